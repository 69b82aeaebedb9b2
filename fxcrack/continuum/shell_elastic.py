"""Elastic shells as a term of the nonlinear solver, for small and for large rotations."""

from __future__ import annotations

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.continuum.cell_assembly import add_forces, add_matrices
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.shell_bodies import ShellBodies, ShellPart
from fxcrack.continuum.shell_temperature import ShellTemperature, ShellThermalWork
from fxcrack.continuum.strain_cells import Response
from fxcrack.continuum.term import Term


class ShellElastic(Term):
    """Strain energy of all sections of a shell.

    The strains are those of :mod:`fxcrack.continuum.shell_strains`: linear, or quadratic in the
    unknowns, exact for any rotation, with the St. Venant-Kirchhoff law.

    Args:
        shell: The shells.
        finite: Whether rotations may be large.
    """

    by_cells = True

    def __init__(self, shell: ShellBodies, *, finite: bool) -> None:
        self._shell = shell
        self.finite = finite
        self.constant = not finite
        self.name = "shells of large rotation" if finite else "shells"
        self._temperature: ShellTemperature | None = None
        self._thermal: ShellThermalWork | None = None
        if shell.temperature is not None:
            self._temperature = ShellTemperature(shell)
            self._thermal = ShellThermalWork(shell, self._temperature, self.stored)

    def _changes(self, part: ShellPart, u: fem.Function) -> Array:
        """Changes of positions and directors of a part's cells, (n_cells, n_vectors, 3)."""
        vectors = np.asarray(u.x.array).reshape(-1, 2, 3)[part.nodes]
        return np.asarray(vectors.reshape(len(part.nodes), 2 * part.nodes.shape[1], 3))

    def _respond(self, i: int, u: fem.Function, *, tangent: bool) -> Response:
        """Energy of the cells of a part and its derivatives."""
        part = self._shell.shell_parts[i]
        stress = None if self._temperature is None else self._temperature.stress(i)
        return part.strain_cells.respond(
            self._changes(part, u), stress=stress, finite=self.finite, tangent=tangent
        )

    def add_residual(self, forces: Array, u: fem.Function) -> None:
        """Add the forces of the cells."""
        for i, part in enumerate(self._shell.shell_parts):
            add_forces(forces, part.nodes, self._respond(i, u, tangent=False).residual)

    def add_tangent(self, matrix: PETSc.Mat, u: fem.Function) -> None:
        """Add the tangents of the cells."""
        for i, part in enumerate(self._shell.shell_parts):
            add_matrices(matrix, part.nodes, self._respond(i, u, tangent=True).tangent)

    def stored(self, u: fem.Function) -> float:
        """Strain energy of the cells that this rank owns."""
        total = 0.0
        for i in range(len(self._shell.shell_parts)):
            total += float(self._respond(i, u, tangent=False).energy.sum())
            if self._temperature is not None:
                total += self._temperature.square(i)
        return total

    def begin(self, time: float, dt: float) -> None:
        """Set the temperature at the end of the increment."""
        if self._thermal is not None:
            self._thermal.begin(time)

    def begin_at(self, u: fem.Function) -> None:
        """Add the work of the temperature that shells have at rest before they move."""
        self.commit(u)

    def commit(self, u: fem.Function) -> None:
        """Add the work of the temperature."""
        if self._thermal is not None:
            self._thermal.commit(u)

    def path_work(self, u: fem.Function) -> float:
        """Work of the temperature since the last commit."""
        return 0.0 if self._thermal is None else self._thermal.path_work(u)

    def work(self) -> float:
        """Work of the temperature up to the last commit."""
        return 0.0 if self._thermal is None else self._thermal.work

    def state(self) -> dict[str, Array]:
        """State of the work of the temperature, shapes as in :meth:`ShellThermalWork.state`."""
        return {} if self._thermal is None else self._thermal.state()

    def places(self) -> dict[str, Place]:
        """Where that state is defined."""
        return {} if self._thermal is None else self._thermal.places()

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        if self._thermal is not None:
            self._thermal.restore(state)


__all__ = ["ShellElastic"]
