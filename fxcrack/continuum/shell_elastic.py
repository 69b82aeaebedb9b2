"""Elastic shells as a term of the nonlinear solver, for small and for large rotations."""

from __future__ import annotations

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.continuum.cell_assembly import add_forces, add_matrices
from fxcrack.continuum.shell_bodies import ShellBodies, ShellPart
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

    def _changes(self, part: ShellPart, u: fem.Function) -> Array:
        """Changes of positions and directors of a part's cells, (n_cells, n_vectors, 3)."""
        vectors = np.asarray(u.x.array).reshape(-1, 2, 3)[part.nodes]
        return np.asarray(vectors.reshape(len(part.nodes), 2 * part.nodes.shape[1], 3))

    def add_residual(self, forces: Array, u: fem.Function) -> None:
        """Add the forces of the cells."""
        for part in self._shell.shell_parts:
            response = part.strain_cells.respond(
                self._changes(part, u), finite=self.finite, tangent=False
            )
            add_forces(forces, part.nodes, response.residual)

    def add_tangent(self, matrix: PETSc.Mat, u: fem.Function) -> None:
        """Add the tangents of the cells."""
        for part in self._shell.shell_parts:
            response = part.strain_cells.respond(self._changes(part, u), finite=self.finite)
            add_matrices(matrix, part.nodes, response.tangent)

    def stored(self, u: fem.Function) -> float:
        """Strain energy of the cells that this rank owns."""
        return sum(
            float(
                p.strain_cells.respond(
                    self._changes(p, u), finite=self.finite, tangent=False
                ).energy.sum()
            )
            for p in self._shell.shell_parts
        )


__all__ = ["ShellElastic"]
