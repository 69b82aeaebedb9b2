"""Bonds that soften with their opening, condensed to themselves.

With the free jumps condensed out, the softening ones obey a small system

    (S* - B) delta = c - g*,    S* = S_RR - Y^t Y,   Y = L^-1 S_FR,

B the (negative) stiffness of the bonds. Where S* - B is not positive definite the state is
unstable, or neutral; the bonds then open unstably, to the next minimum of the energy along their
branches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.equilibrium.cohesive_law import NEUTRAL, STIFFEST, CohesiveBond
from fxcrack.equilibrium.growing_cholesky import GrowingCholesky
from fxcrack.equilibrium.snap_through import snap_through

_LOOSE = 1e-12
"""Stiffness below this fraction of that of the bodies at the nodes is round-off."""
_EVENT = 1e-10
"""Openings within this fraction of the final one count as equal."""


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

    def _laws(self, faster: float = 0.0) -> tuple[Array, Array]:
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

    def solve(self, right: Array) -> Array:
        """Jumps (length) for given -g* (force), branches as they are, both of shape (r,)."""
        self.counts.solves += 1
        constant, stiffness = self._laws()
        return np.asarray(np.linalg.solve(self.star - stiffness, constant + right))

    def rates(self, right: Array) -> Array:
        """Rates of the jumps for given rates of -g*, branches as they are, both of shape (r,)."""
        _, stiffness = self._laws()
        return np.asarray(np.linalg.solve(self.star - stiffness, right))

    def stable(self) -> bool:
        """Whether S* - B is positive definite, and not just so."""
        _, stiffness = self._laws(NEUTRAL)
        try:
            np.linalg.cholesky(self.star - stiffness)
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

    def snap(self, jump: Array, round_off: float | Array = 0.0) -> list[CohesiveBond]:
        """Descend in energy from an unstable equilibrium to a stable one at constant load.

        Args:
            jump: Softening jumps of the equilibrium, shape (r,), length.
            round_off: That of the entries of S, a number or one per unknown, shape (n_last,),
                force/length.

        Returns:
            Bonds that opened all the way; the branches of the others are set for the new state.

        Raises:
            ComesApart: There is no minimum: nothing holds a body once bonds have opened.
        """
        self.counts.snaps += 1
        directions, across = self._axes()
        stiffness = directions @ self.star @ directions.T
        if len(across):
            # no force acts across the directions; what has no stiffness there restrains nothing
            coupling = across @ self.star @ directions.T
            inner = np.linalg.pinv(across @ self.star @ across.T, rcond=_LOOSE, hermitian=True)
            stiffness -= coupling.T @ inner @ coupling
        mine = self.components
        noise = np.broadcast_to(round_off, len(self._schur))[mine]
        least = float(np.maximum(_LOOSE * self._schur[mine, mine], noise).max())
        strength = np.array([b.strength for b in self.bonds])
        final = np.array([b.final for b in self.bonds])
        w = directions @ jump
        largest = np.array([w_ if b.largest is None else b.largest
                            for b, w_ in zip(self.bonds, w, strict=True)])  # fmt: skip
        held = np.array([b.force(w_) for b, w_ in zip(self.bonds, w, strict=True)])
        opens, largest, steps = snap_through(held, stiffness, least, strength, final, w, largest)
        self.counts.snap_steps += steps
        gone = []
        for bond, on, most in zip(self.bonds, opens, largest, strict=True):
            if most >= bond.final * (1.0 - 10.0 * _EVENT):
                gone.append(bond)
            else:
                bond.largest = None if on else float(most)
        return gone

    def _axes(self) -> tuple[Array, Array]:
        """Unit vectors along the openings, shape (n, r), and across them, shape (r - n, r)."""
        along, across = [], []
        i, r = 0, len(self.components)
        for bond in self.bonds:
            k = len(bond.components)
            whole = np.zeros((k, r))
            whole[:, i : i + k] = np.linalg.qr(np.column_stack([bond.direction, np.eye(k)]))[0].T
            whole[0, i : i + k] = bond.direction
            along.append(whole[:1])
            across.append(whole[1:])
            i += k
        return np.concatenate(along), np.concatenate(across)
