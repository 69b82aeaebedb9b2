"""What criteria ask of one interface, answered by a condensed solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.crack_pressure import CrackPressure
from fxcrack.interface.front import Front
from fxcrack.interface.pair import Pair
from fxcrack.solvers.base import Solver
from fxcrack.solvers.condensed_bodies import CondensedBodies

_OF_PRODUCTS = 1e-11
"""Round-off of a bond force as a part of the products it is the sum of, where no more is known."""

_MOST_ROUND_OFF = 1e-9
"""Largest round-off of an entry that counts here, as a part of the entry on the diagonal. Scenes
with more have been warned of, and the bound exceeds forces that still hold two digits there."""

_UNBOUNDED = 1e100
"""Jump per force of nodes that hold a body alone."""


class CondensedFrontProbe:
    """A :class:`fxcrack.criteria.probe.FrontProbe`, where all shapes and signs are given.

    Args:
        solver: The solver.
        p: Number of the pair.
    """

    def __init__(self, solver: Solver, p: int) -> None:
        self._solver = solver
        self._p = p
        self.front: Front = solver.fronts[p]
        self.gdim: int = solver.continuum.gdim
        self.bodies = CondensedBodies(solver)
        self._roots: tuple[Array, float | Array, Array] | None = None  # of S and its round-off

    @property
    def pair(self) -> Pair:
        """The interface, paired anew where its faces slide."""
        return self._solver.pairs[self._p]

    @property
    def _opening_factor(self) -> float:
        """Opening of the whole crack over the jump of a node, 2 on a plane of symmetry."""
        return self.pair.interface.opening_factor

    def bond_forces(self, nodes: Ints, state: Equilibrium) -> Array:
        """Bond forces, tension positive, global vectors of shape (..., 3) [force]."""
        solver = self._solver
        index = solver.index[self._p][nodes]
        rows = np.unique(index[index >= 0])
        values = np.zeros(solver.system.n_retained)
        values[rows] = -solver.system.forces(state, rows)
        return solver.vectors(self._p, nodes, values) - self._under_bonds(nodes, state)

    def _under_bonds(self, nodes: Ints, state: Equilibrium) -> Array | float:
        """What pressures that follow the crack add to the forces of bonds, shape (..., 3)."""
        solver = self._solver
        total: Array | float = 0.0
        first = solver.n_loads - len(solver.loads)
        for k, load in enumerate(solver.loads):
            if isinstance(load, CrackPressure) and load.p == self._p and state.loads[first + k]:
                each = np.zeros((self.front.surface.n_nodes, 3))
                each[:, : self.gdim] = load.under_bonds(self.front.bonded)
                total = total + float(state.loads[first + k]) * each[nodes]
        return total + self._turned(nodes, self.front.bonded)

    def _turned(self, nodes: Ints, bonded: Bools | None = None) -> Array | float:
        """What finite strain has changed of the loads of such pressures on faces, (..., 3)."""
        total: Array | float = 0.0
        for fluid in self._solver.fluids:
            if fluid.pressure.p == self._p:
                more = fluid.more_on_faces(bonded)
                total = total + np.pad(more, ((0, 0), (0, 3 - self.gdim)))[nodes]
        return total

    def round_off(self, nodes: Ints, state: Equilibrium) -> Array:
        """How large bond forces may be by round-off alone, shape (...) [force]."""
        system = self._solver.system
        index = self._solver.index[self._p][nodes]
        n = len(state.jump)
        roots = self._roots_of_round_off(system)
        size = roots[:n] @ np.abs(state.jump)
        size += roots[n : n + len(state.loads)] @ np.abs(state.loads)
        if (roots.any() and size > 0.0) or not system.n_retained:
            return np.asarray((size * roots[index]).max(axis=-1))
        each = np.zeros(len(roots))
        rows = np.unique(index[index >= 0])
        x = np.abs(np.concatenate([state.jump, state.loads]))
        each[rows] = _OF_PRODUCTS * (np.abs(system.schur[rows, : len(x)]) @ x)
        return np.asarray(each[index].max(axis=-1))

    def _roots_of_round_off(self, system: ContactSystem) -> Array:
        """Square roots of the round-off of entries of S, and a zero for what has no number.

        An entry S_ij is off by what those on the diagonal of the bodies' matrix allow. They stay
        while S does, so that they are kept for it.
        """
        schur, given = system.schur, system.cholesky.round_off
        if self._roots is None or self._roots[0] is not schur or self._roots[1] is not given:
            most = _MOST_ROUND_OFF * np.abs(np.diagonal(schur))
            self._roots = schur, given, np.append(np.sqrt(np.minimum(given, most)), 0.0)
        return self._roots[2]

    def jumps(self, nodes: Ints, state: Equilibrium) -> Array:
        """Jumps, global vectors of shape (..., 3) [length]."""
        jump = self._opening_factor * self._solver.vectors(self._p, nodes, state.jump)
        if not self.pair.interface.mode_i_only:
            return jump
        normal = np.zeros_like(jump)
        normal[..., : self.gdim] = self._solver.frames[self._p][nodes][..., 0]
        return np.asarray(np.einsum("...c,...c->...", normal, jump)[..., None] * normal)

    @property
    def has_face_loads(self) -> bool:
        """Whether loads act on the faces of any interface."""
        return bool(np.any(self._solver.face_loads))

    def face_loads(self, nodes: Ints, state: Equilibrium) -> Array:
        """Loads on the faces, global vectors of shape (..., 3) [force]."""
        solver = self._solver
        factors = state.loads[solver.n_loads - len(solver.loads) :]
        every = solver.vectors(self._p, nodes, solver.face_loads @ factors)
        return every + self._turned(nodes) - self._under_bonds(nodes, state)

    def released_jumps(self, nodes: Ints, force: Array, normal: Array | None = None) -> Array:
        """Jumps that releasing some nodes would open, global vectors of shape (k, 3) [length]."""
        index, frames = self._solver.index[self._p][nodes], self._solver.frames[self._p][nodes]
        local = np.einsum("kci,kc->ki", frames, force[:, : self.gdim])
        return self._opening_factor * self._released(index, index >= 0, local, frames, normal)

    def _released(
        self, index: Ints, free: Bools, force: Array, frames: Array, normal: Array | None
    ) -> Array:
        """Jumps of nodes without some of their bonds, global vectors of shape (k, 3).

        Args:
            index: Retained components, shape (k, gdim).
            free: Those released, likewise.
            force: Their bond forces in local frames, likewise.
            frames: These, shape (k, gdim, gdim).
            normal: Direction, shape (3,), in which nothing moves, be it none of the local frames'
                (they do not turn with the bodies); ``None`` for none.
        """
        jump = np.zeros(index.shape)
        system = self._solver.system
        star = system.reduced(index[free])
        try:
            factor = system.cholesky.factorise(star, index[free])
        except NotPositiveDefinite:
            if normal is not None:
                tangential = free & (np.arange(index.shape[1]) > 0)
                return self._released(index, tangential, force, frames, None)
            factor = np.eye(len(star)) / np.sqrt(_UNBOUNDED)
        jump[free] = cho_solve((factor, True), force[free])
        if normal is not None:
            k = len(index)
            across = np.zeros((*index.shape, k))
            across[range(k), :, range(k)] = np.einsum("kci,c->ki", frames, normal[: self.gdim])
            held = across[free]
            given = cho_solve((factor, True), held)
            jump[free] -= (
                given @ np.linalg.lstsq(held.T @ given, held.T @ jump[free], rcond=None)[0]
            )
        world = np.zeros((len(index), 3))
        world[:, : self.gdim] = np.einsum("kci,ki->kc", frames, jump)
        return world

    def opened(self, nodes: Ints, closed: Bools, force: Array, state: Equilibrium) -> Equilibrium:
        """The state that releasing bonded nodes would lead to, everything else as it is."""
        index, frames = self._solver.index[self._p][nodes], self._solver.frames[self._p][nodes]
        moves = index >= 0
        moves[:, 0] &= ~closed
        new = index[moves]
        system = self._solver.system
        local = np.einsum("kci,kc->ki", frames, force[:, : self.gdim])[moves]
        try:
            factor = system.cholesky.factorise(system.reduced(new), new)
        except NotPositiveDefinite:
            return state
        opening = cho_solve((factor, True), local)
        jump, free = state.jump.copy(), system.cholesky.free
        jump[new] += opening
        if len(free):
            jump[free] -= system.cholesky.solve(system.schur[np.ix_(free, new)] @ opening)
        return replace(state, jump=jump)

    def mean_position(self, group: str) -> Array:
        """Mean reference position of the nodes of a group, shape (3,) [length]; collective.

        Raises:
            InputError: The mesh has no such group, or it holds no node.
        """
        return self._solver.continuum.mean_position(group)

    def follow(self, where: str | int) -> int:
        """Follow the mean displacement of a group or of a slave node; its row in :meth:`motion`."""
        continuum = self._solver.continuum
        if isinstance(where, str):
            return self._solver.follow(continuum.owned_nodes(where))
        layout = continuum.layout
        node = self.pair.surface.dofs[where]
        here = np.array([node])[: int(layout.is_owned(node))]
        return self._solver.follow(layout.to_local(here))

    def motion(self, state: Equilibrium) -> Array:
        """Displacements that are followed, shape (n_followed, gdim) [length]."""
        return self._solver.motion(state)
