"""The bodies of a condensed solver, as integrals over them see them."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.thermal_strain import ThermalLoad
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.interface.crack_fluid import CrackFluid
from fxcrack.solvers.base import Solver
from fxcrack.solvers.cell_source import CellSource


class CondensedBodies:
    """The :class:`fxcrack.criteria.probe.Bodies` of a condensed solver; shapes are given there.

    Args:
        solver: The solver.
    """

    def __init__(self, solver: Solver) -> None:
        self._solver = solver
        self.continuum: Continuum = solver.continuum
        self.loads: list[Any] = [x for x in solver.loads if not isinstance(x, ThermalLoad)]
        self._n_thermal = len(solver.loads) - len(self.loads)
        self._forms: WeakForm | None = getattr(solver, "bodies", None)
        self.finite = self._forms is not None and self._forms.finite

    @property
    def uncovered(self) -> str:
        """What an integral for elastic bodies in equilibrium does not cover, in words."""
        continuum, forms = self.continuum, self._forms
        if isinstance(continuum, ShellBodies) or continuum.shell_cells:
            return "shells"
        if continuum.layout.shared:
            return "generalised plane strain"
        if continuum.founded:
            return "stabilise"
        if any(p.interface.stiffness is not None for p in self._solver.pairs):
            return "bonds with a stiffness"
        if forms is None:
            return ""
        if forms.dynamic:
            return "inertia"
        if forms.path_dependent:
            return "plasticity"
        if any(isinstance(term, FollowerPressure | CrackFluid) for term in forms.terms):
            return "pressures that follow the bodies"
        return ""

    def cells_around(self, groups: list[str | None]) -> CellSource:
        """The cells, with marks of those of some groups; collective."""
        return CellSource(self.continuum, groups)

    def displacements(self, nodes: Ints, state: Equilibrium) -> Array:
        """Displacements of global nodes, the same on all ranks; collective."""
        return self._of_nodes(nodes, self._solver.displacement(state))

    def changes(self, nodes: Ints, before: Equilibrium, after: Equilibrium) -> Array:
        """Change of displacements between states of the same loads; collective."""
        change = self._solver.displacement_of_jumps(after.jump - before.jump)
        return self._of_nodes(nodes, change)

    def held(self, nodes: Ints) -> Bools:
        """Which components supports prescribe at global nodes, (n, gdim); collective."""
        prescribed = (self._solver.supports.which >= 0).astype(float)
        return self._gathered(nodes, prescribed) > 0.0

    def _of_nodes(self, nodes: Ints, u: PETSc.Vec) -> Array:
        """Values of a vector at global nodes, on all ranks, shape (n, gdim); destroys it."""
        out = self._gathered(nodes, u.array_r)
        u.destroy()
        return out

    def _gathered(self, nodes: Ints, values: Array) -> Array:
        """Values of the owned dofs at global nodes, on all ranks, shape (n, gdim); collective."""
        layout = self.continuum.layout
        here = layout.is_owned(nodes)
        mine = np.zeros((len(nodes), self.continuum.gdim))
        mine[here] = layout.displacements(values)[layout.to_local(nodes[here])]
        out = np.zeros_like(mine)
        self.continuum.comm.Allreduce(mine, out, op=MPI.SUM)
        return out

    def load_factors(self, state: Equilibrium) -> Array:
        """Factors of the force patterns, shape (n_loads,)."""
        solver = self._solver
        first = solver.n_loads - len(solver.loads)
        return np.asarray(state.loads[first : first + len(self.loads)])

    def temperature_factors(self, state: Equilibrium) -> Array:
        """Factors of the temperature patterns, shape (n_patterns,)."""
        field = self.continuum.temperature
        if field is None:
            return np.zeros(0)
        if self._n_thermal:
            return np.asarray(state.loads[len(state.loads) - self._n_thermal :])
        return field.factors.copy()
