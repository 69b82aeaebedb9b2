"""Elastic continuum shells of first order as a term, for small and for large rotations."""

from __future__ import annotations

from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.continuum.cell_assembly import add_forces, add_matrices
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.stress import tied_stress
from fxcrack.continuum.term import Term


class TiedElastic(Term):
    """Strain energy of all continuum shells of first order.

    Linear in the displacement, or quadratic strains, exact for any rotation, with the St.
    Venant-Kirchhoff law.

    Args:
        continuum: The bodies, with ``tied_cells``.
        finite: Whether rotations may be large.
    """

    by_cells = True

    def __init__(self, continuum: Continuum, *, finite: bool) -> None:
        self._continuum = continuum
        self._parts = list(continuum.tied_cells.values())
        self.finite = finite
        self.constant = not finite
        self.name = "first-order continuum shells" + (" of large rotation" if finite else "")

    def add_residual(self, forces: Array, u: fem.Function) -> None:
        """Add the forces of the cells."""
        for part in self._parts:
            _, found = part.forces(part.changes(u), finite=self.finite)
            add_forces(forces, part.nodes, found)

    def add_tangent(self, matrix: PETSc.Mat, u: fem.Function, factor: float = 1.0) -> None:
        """Add the tangents of the cells, times a factor."""
        for part in self._parts:
            if self.finite:
                response = part.strain_cells.respond(part.changes(u), finite=True)
                add_matrices(matrix, part.nodes, factor * response.tangent)
            else:
                add_matrices(matrix, part.nodes, factor * part.strain_cells.stiffness())

    def stored(self, u: fem.Function) -> float:
        """Strain energy of the cells that this rank owns."""
        return sum(float(p.forces(p.changes(u), finite=self.finite)[0].sum()) for p in self._parts)

    def stresses(self, u: fem.Function) -> list[tuple[Any, Any]]:
        """Cauchy stress, means of cells, and measure of each part."""
        return [
            (tied_stress(self._continuum, i, u, finite=self.finite), self._continuum.parts[i][2])
            for i in self._continuum.tied_cells
        ]


__all__ = ["TiedElastic"]
