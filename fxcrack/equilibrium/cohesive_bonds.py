"""Bonds that soften with their opening, condensed to themselves.

With the free jumps condensed out, the softening ones obey a small system

    (S* - B) delta = c - g*,    S* = S_RR - Y^t Y,   Y = L^-1 S_FR,

B the (negative) stiffness of the bonds. Where S* - B is not positive definite the state is
unstable, or neutral; the bonds then open unstably, to the next minimum of the energy along their
branches. Components whose faces are in contact keep their jump: the system is that of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.equilibrium.cohesive_law import NEUTRAL, STIFFEST, CohesiveBond
from fxcrack.equilibrium.growing_cholesky import GrowingCholesky
from fxcrack.equilibrium.snap_through import snap_through

_LOOSE = 1e-12
"""Stiffness below this fraction of that of the bodies at the nodes is round-off."""
_EVENT = 1e-10
"""Openings within this fraction of the final one count as equal."""
_ALONG = 1e-12
"""Bonds of whose direction no more than this part (of its square) is left to move are held."""


@dataclass
class CohesiveCounts:
    """Effort spent on softening bonds.

    Attributes:
        snaps: Number of unstable states passed.
        snap_steps: Iterations spent on them.
        solves: Number of equilibria solved for while bonds softened.
    """

    snaps: int = 0
    snap_steps: int = 0
    solves: int = 0


class CohesiveBonds:
    """All softening bonds of a jump system.

    Args:
        schur: S, shape (n_last, n_last), force/length between jumps.

    Attributes:
        bonds: The bonds.
        finished: Energy dissipated by bonds that have opened all the way.
        counts: Effort so far, that before the last factorisation included.
    """

    def __init__(self, schur: Array) -> None:
        self._schur = schur
        self.bonds: list[CohesiveBond] = []
        self.finished = 0.0
        self.counts = CohesiveCounts()
        self._forward = np.zeros((0, 0))
        self._star: Array | None = None

    def taken(self, jump: Array) -> float:
        """Energy all softening bonds have taken so far, finished ones included.

        Args:
            jump: Retained jumps, shape (n_retained,), length.
        """
        return self.finished + sum(b.taken(b.opening(jump)) for b in self.bonds)

    @property
    def components(self) -> Ints:
        """Components of all bonds, shape (r,)."""
        if not self.bonds:
            return np.zeros(0, dtype=np.int64)
        return np.concatenate([b.components for b in self.bonds])

    def refresh(self, cholesky: GrowingCholesky) -> None:
        """Condense anew after the free set shrank or bonds were added or removed."""
        mine = self.components
        self._forward = cholesky.forward(self._schur[np.ix_(cholesky.free, mine)])
        self._star = None

    def renew(self, schur: Array, bonds: list[CohesiveBond], cholesky: GrowingCholesky) -> None:
        """Take another S with the same numbering, and the bonds.

        Args:
            schur: S, shape (n_last, n_last), force/length between jumps.
            bonds: The bonds.
            cholesky: Factor of the new S over the free components.
        """
        self._schur, self.bonds = schur, bonds
        self.refresh(cholesky)

    def extend(self, new: Ints, left: Array, tile: Array) -> None:
        """Follow the free set as it grows.

        Args:
            new: Components just freed, shape (k,).
            left: Their rows of the factor, shape (k, n_before).
            tile: Their diagonal block of it, shape (k, k).
        """
        right = self._schur[np.ix_(new, self.components)] - left @ self._forward
        self._forward = np.vstack([self._forward, np.linalg.solve(tile, right)])
        self._star = None

    @property
    def star(self) -> Array:
        """S*, shape (r, r), force/length."""
        if self._star is None:
            mine = self.components
            star = self._schur[np.ix_(mine, mine)] - self._forward.T @ self._forward
            self._star = star
        return self._star

    @property
    def coupling(self) -> Array:
        """Y, shape (n_free, r)."""
        return self._forward

    def laws(self, faster: float = 0.0) -> tuple[Array, Array]:
        """Forces at zero opening c, shape (r,), force, and stiffness B, shape (r, r), force/length.

        Args:
            faster: Fraction by which bonds soften faster than they do.
        """
        r = len(self.components)
        constant, stiffness = np.zeros(r), np.zeros((r, r))
        i = 0
        for bond in self.bonds:
            j = i + len(bond.components)
            dyad = np.outer(bond.direction, bond.direction)
            if bond.largest is None:
                constant[i:j] = -bond.strength * bond.direction
                stiffness[i:j, i:j] = (1.0 + faster) * bond.strength / bond.final * dyad
            else:
                constant[i:j] = -bond.force(0.0) * bond.direction
                stiffness[i:j, i:j] = -bond.secant * dyad
            i = j
        return constant, stiffness

    def solve(self, right: Array, jump: Array, held: Bools) -> tuple[Array, Array]:
        """Jumps and forces of the bonds, branches as they are.

        Args:
            right: -g*, with what the jumps of held components contribute, shape (r,), force.
            jump: Jumps of the held components, shape (r,), length; others are not read.
            held: Components that contact holds, shape (r,).

        Returns:
            Jumps (length) and forces of the bonds alone on the slave side, both of shape (r,).
        """
        self.counts.solves += 1
        constant, stiffness = self.laws()
        if not held.any():
            found = np.linalg.solve(self.star - stiffness, constant + right)
            return np.asarray(found), constant + stiffness @ found
        found, moves = np.where(held, jump, 0.0), ~held
        right = (constant + right + stiffness @ found)[moves]
        found[moves] = np.linalg.solve((self.star - stiffness)[np.ix_(moves, moves)], right)
        return found, constant + stiffness @ found

    def rates(self, right: Array, held: Bools) -> Array:
        """Rates of the jumps for given rates of -g*, branches as they are.

        Args:
            right: Rates of -g*, shape (r,).
            held: Components that contact holds, shape (r,).

        Returns:
            Shape (r,), zero where contact holds.
        """
        _, stiffness = self.laws()
        out, moves = np.zeros(len(right)), ~held
        matrix = (self.star - stiffness)[np.ix_(moves, moves)]
        out[moves] = np.linalg.solve(matrix, right[moves])
        return out

    def stable(self, held: Bools) -> bool:
        """Whether S* - B is positive definite, and not just so.

        Args:
            held: Components that contact holds, shape (r,).
        """
        _, stiffness = self.laws(NEUTRAL)
        try:
            np.linalg.cholesky((self.star - stiffness)[np.ix_(~held, ~held)])
        except np.linalg.LinAlgError:
            return False
        return True

    # -- events on a linear piece ------------------------------------------------------------

    def first_event(self, before: Array, after: Array) -> tuple[float, list[CohesiveBond]]:
        """First fraction of a piece at which a bond leaves its branch, and which ones do.

        Args:
            before: Jumps at the beginning, shape (n_retained,), length.
            after: Jumps at the end, shape (n_retained,), length.

        Returns:
            inf and nothing if none does.
        """
        best, found = np.inf, []
        for bond in self.bonds:
            x = self._leaves(bond, bond.opening(before), bond.opening(after))
            if x < best - 1e-12:
                best, found = x, [bond]
            elif x <= best + 1e-12 and np.isfinite(x):
                found.append(bond)
        return best, found

    def _leaves(self, bond: CohesiveBond, a: float, b: float) -> float:
        small = _EVENT * bond.final
        if bond.fixed:
            return np.inf
        if bond.largest is None:
            if b > bond.final - small:
                return max(bond.final - a, 0.0) / (b - a) if b > a else 0.0
            return 0.0 if b < a - small else np.inf
        # a stiff branch followed too far would exceed the law
        small = min(small, 1e-6 * max(bond.largest, STIFFEST * bond.final))
        if b > bond.largest + small:
            return max(bond.largest - a, 0.0) / (b - a) if b > a else 0.0
        return np.inf

    def switch(self, bond: CohesiveBond, jump: Array) -> bool:
        """Move a bond to its next branch at a state.

        Args:
            bond: The bond.
            jump: Retained jumps, shape (n_retained,), length.

        Returns:
            Whether it has opened all the way (its force is zero and stays so).
        """
        w = bond.opening(jump)
        if bond.largest is not None:
            bond.largest = None
            return False
        if w >= bond.final * (1.0 - 10.0 * _EVENT):
            return True
        bond.largest = max(w, 0.0)
        return False

    # -- passing an unstable state -------------------------------------------------------------

    def snap(self, jump: Array, held: Bools, round_off: float | Array = 0.0) -> list[CohesiveBond]:
        """Descend in energy from an unstable equilibrium to a stable one at constant load.

        Args:
            jump: Softening jumps of the equilibrium, shape (r,), length.
            held: Components that contact holds, shape (r,).
            round_off: That of the entries of S, a number or one per unknown, shape (n_last,),
                force/length.

        Returns:
            Bonds that opened all the way; the branches of the others are set for the new state.

        Raises:
            ComesApart: There is no minimum: nothing holds a body once bonds have opened.
        """
        self.counts.snaps += 1
        bonds, directions, across = self._axes(held)
        stiffness = directions @ self.star @ directions.T
        if len(across):
            # no force acts across the directions; what has no stiffness there restrains nothing
            coupling = across @ self.star @ directions.T
            inner = np.linalg.pinv(across @ self.star @ across.T, rcond=_LOOSE, hermitian=True)
            stiffness -= coupling.T @ inner @ coupling
        mine = self.components
        noise = np.broadcast_to(round_off, len(self._schur))[mine]
        least = float(np.maximum(_LOOSE * self._schur[mine, mine], noise).max())
        strength = np.array([b.strength for b in bonds])
        final = np.array([b.final for b in bonds])
        every = np.zeros(len(self._schur))
        every[mine] = jump
        w = np.array([b.opening(every) for b in bonds])
        largest = np.array([w_ if b.largest is None else b.largest
                            for b, w_ in zip(bonds, w, strict=True)])  # fmt: skip
        force = np.array([b.force(w_) for b, w_ in zip(bonds, w, strict=True)])
        opens, largest, steps = snap_through(force, stiffness, least, strength, final, w, largest)
        self.counts.snap_steps += steps
        gone = []
        for bond, on, most in zip(bonds, opens, largest, strict=True):
            if most >= bond.final * (1.0 - 10.0 * _EVENT):
                gone.append(bond)
            else:
                bond.largest = None if on else float(most)
        return gone

    def _axes(self, held: Bools) -> tuple[list[CohesiveBond], Array, Array]:
        """How bonds may open.

        Args:
            held: Components that contact holds, shape (r,).

        Returns:
            The n bonds whose opening may change; the least motions that open them by one, shape
            (n, r); an orthonormal basis of the motions that open none, shape (m, r).
        """
        bonds, along, across = [], [], []
        i, r = 0, len(self.components)
        for bond in self.bonds:
            k = len(bond.components)
            moves = np.flatnonzero(~held[i : i + k])
            direction = bond.direction[moves]
            square = float(direction @ direction)
            whole = np.zeros((len(moves), r))
            if square > _ALONG:
                basis = np.column_stack([direction, np.eye(len(moves))])
                whole[:, i + moves] = np.linalg.qr(basis)[0].T
                whole[0, i + moves] = direction / square
                bonds.append(bond)
                along.append(whole[:1])
                across.append(whole[1:])
            else:
                whole[:, i + moves] = np.eye(len(moves))
                across.append(whole)
            i += k
        none = np.zeros((0, r))
        return bonds, np.concatenate([none, *along]), np.concatenate([none, *across])
