"""The linear continuum as its interfaces see it: one factorisation, then dense algebra.

A :class:`LinearSolver` knows which nodes are bonded, open or in contact, gives equilibrium
states for loads, bond forces and openings at the tips, and lets nodes go. It factors again only
when the front leaves the window.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import ComesApart
from fxcrack.equilibrium.cohesive_law import CohesiveBond, CohesiveUnit
from fxcrack.equilibrium.contact import Equilibrium, bond_work, work_between
from fxcrack.equilibrium.friction_state import release_to_contact
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.solvers.base import InterfaceSolver


class LinearSolver(InterfaceSolver):
    """Bodies, interfaces and loads, condensed: nodes let go, energies, fields.

    Arguments as for :class:`~fxcrack.solvers.base.InterfaceSolver`.
    """

    def soften(self, p: int, units: Sequence[CohesiveUnit]) -> None:
        """Let the bond forces of units fall linearly with their opening.

        The forces of all nodes of a unit fall in proportion. Where its faces are pressed together,
        normal forces that press stay: these nodes are in contact from then on.

        Args:
            p: Number of the pair.
            units: What softens by one law each; bonded so far.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
        """
        system, state = self.system, self.state
        bonds, force = [], state.force.copy()
        for nodes, spend, pressed in units:
            row, local = np.nonzero(self.index[p][nodes] >= 0)
            components = self.index[p][nodes[row], local]
            traction = -system.forces(state, components)
            if pressed:
                stays = (local == 0) & (traction < 0.0)
                closed = components[stays]
                system.contact[closed] = system.closed[closed] = True
                row, local, components, traction = (
                    v[~stays] for v in (row, local, components, traction)
                )
            strength = float(np.linalg.norm(traction))
            if not strength > 0.0:
                system.release(components)
                continue
            force[components] = -traction
            bonds.append(
                CohesiveBond(
                    components, traction / strength, strength, 2.0 * spend / strength,
                    (p, nodes[row], local),
                )
            )  # fmt: skip
        every = np.concatenate([unit.nodes for unit in units])
        self.fronts[p].release(every)
        if bonds:
            system.soften(bonds)
            if self.pairs[p].interface.contact:
                normals = self.index[p][every, 0]
                system.touches[normals[normals >= 0]] = True
        self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)

    def open(self, p: int, nodes: Ints) -> None:
        """Make the forces of nodes known instead of their jumps; they keep their values.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
        """
        system, state = self.system, self.state
        if system.friction is not None and self.pairs[p].interface.contact:
            force = release_to_contact(system, p, self.pairs[p], self.index[p], nodes, state)
            self.fronts[p].release(nodes)
            self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)
            return
        components = self.components(p, nodes)
        components = components[~system.free[components]]
        force = state.force.copy()
        force[components] = system.forces(state, components)
        system.release(components)
        self.fronts[p].release(nodes)
        if self.pairs[p].interface.contact:
            self._let_touch(self.pairs[p], self.fronts[p], self.index[p])
        self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)

    def release(self, p: int, nodes: Ints, force: Array) -> tuple[float, float]:
        """Let nodes go at constant load and find the new equilibrium.

        Args:
            p: Number of the pair.
            nodes: Slave nodes.
            force: Given forces afterwards, shape (n_retained,).

        Returns:
            Energy set free by the bond forces on their way, and external work.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
            ComesApart: So it would once bonds that soften have opened; likewise.
        """
        before, saved, spent = self.state, self.remember(), self.friction_energy
        self.open(p, nodes)
        released, work, last = 0.0, 0.0, self.state
        try:
            for _, point in self.system.pieces(last, last.loads, force):
                more, out, _ = self.along(last, point)
                work, released = work + more, released + out
                self.book_friction(last, point)
                last = point
        except (NotPositiveDefinite, ComesApart):
            self.state, self.friction_energy = before, spent
            self.fronts[p].bond(nodes)
            self.recall(saved)
            raise
        self.state = last
        return released, work

    def commit(self) -> None:
        """The present state is good; linear bodies remember nothing else."""

    def remember(self) -> Any:
        """What :meth:`recall` needs to return to the present state, with the same bonds."""
        return self.system.snapshot()

    def recall(self, saved: Any) -> None:
        """Return to an earlier state; ``state`` itself is the caller's to set before."""
        self.system.restore(saved)

    def along(self, here: Equilibrium, point: Equilibrium) -> tuple[float, float, Array]:
        """External work, energy out through bonds, mean jumps of a linear piece."""
        work = work_between(here, point, len(self.loads))
        return work, bond_work(here, point), 0.5 * (here.jump + point.jump)

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies, by name; collective."""
        return {"strain_energy": self.system.strain_energy(state) + self._thermal_part(state)}

    def spent(self) -> dict[str, float]:
        """Energies the bodies have turned into something else, by name; linear ones none."""
        return {}

    def extra_work(self, state: Equilibrium) -> float:
        """Work on the bodies beyond that of supports and force patterns: of a temperature."""
        return self._thermal_part(state)

    def _thermal_part(self, state: Equilibrium) -> float:
        """What a temperature, which counts as a load here, adds to work and stored energy alike.

        -sum_k a_k f_k u + 1/2 sum_kl a_k a_l E_kl
        (:func:`fxcrack.continuum.thermal_strain.held_energies`)
        """
        if not self._n_thermal:
            return 0.0
        if self._held is None:
            from fxcrack.continuum.thermal_strain import held_energies

            self._held = held_energies(self.continuum)
        factors, answers = state.loads[-self._n_thermal :], state.conjugate[-self._n_thermal :]
        return float(0.5 * factors @ self._held @ factors - factors @ answers)

    def book_friction(self, here: Equilibrium, point: Equilibrium) -> None:
        """Account for the energy friction takes along a linear piece."""
        if self.system.friction is not None:
            self.friction_energy += self.system.friction.dissipation(self.system, here, point)

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Displacement vector of a state; collective; the caller destroys it."""
        state = self.state if state is None else state
        assert self._condensation is not None
        last = np.zeros(len(self.system.schur))
        last[: self.system.n_retained] = state.jump
        last[self.system.n_retained : self.system.n_retained + self.n_loads] = state.loads
        return self._condensation.displacement(last)

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces and supports on the bodies, K u - f.

        Collective; the caller destroys the vector.

        Args:
            u: Displacements of the state, from :meth:`displacement`.
            state: The state whose loads act; the present one by default.
        """
        state = self.state if state is None else state
        assert self._stiffness is not None
        out = self._stiffness.createVecLeft()
        self._stiffness.mult(u, out)
        # the first borders are the force patterns with the minus sign; monitors follow
        factors = state.loads[self.n_loads - len(self.loads) :]
        for factor, border in zip(factors, self._borders, strict=False):
            out.axpy(float(factor), border)
        return out
