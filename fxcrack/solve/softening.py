"""Bonds that soften with their opening, condensed to themselves.

    F(w) = F0 (1 - w/w_f)            w the opening along F0, while it grows
    F(w) = F(w_max) w/w_max          when it goes back (secant), w_max never heals

With the free jumps condensed out, the softening ones obey a small system

    (S* - B) delta = c - g*,    S* = S_RR - Y^t Y,   Y = L^-1 S_FR,

B the (negative) stiffness of the bonds. Where S* - B is not positive definite the state is
unstable; the energy is then lowered to the next minimum along the branches of the bonds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.errors import ComesApart
from fxcrack.solve.cholesky import GrowingCholesky

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_STIFFEST = 1e-7
"""The secant of a bond that unloads at once is that of this fraction of its final opening."""
_LOOSE = 1e-12
"""Stiffness below this fraction of that of the bodies at the nodes is round-off."""
_EVENT = 1e-10
"""Openings within this fraction of the final one count as equal."""


@dataclass
class SoftBond:
    """One bond that softens.

    Attributes:
        components: Its window components, shape (k,).
        direction: Unit vector of the opening w in them, shape (k,).
        strength: F0, force.
        final: w_f, length.
        where: Pair, slave node and its jump components, to find the bond again after a rebase.
        largest: w_max on the secant branch, ``None`` while the opening grows, length.
    """

    components: Ints
    direction: Array
    strength: float
    final: float
    where: tuple[int, int, Ints]
    largest: float | None = None

    def opening(self, jump: Array) -> float:
        """W of a state."""
        return float(self.direction @ jump[self.components])

    def force(self, opening: float) -> float:
        """Tensile force at an opening on the present branch."""
        if self.largest is None:
            return self._envelope(opening)
        return self._envelope(self.largest) + self.secant * (opening - self.largest)

    def _envelope(self, opening: float) -> float:
        return self.strength * (1.0 - opening / self.final)

    def taken(self, opening: float) -> float:
        """Energy the bond has taken up to an opening, the part it would give back included."""
        most = opening if self.largest is None else self.largest
        back = most - opening
        given_back = back * (self._envelope(most) - 0.5 * self.secant * back)
        return self.strength * most * (1.0 - 0.5 * most / self.final) - given_back

    @property
    def secant(self) -> float:
        """Stiffness of the secant branch, force/length."""
        w = max(self.largest or 0.0, _STIFFEST * self.final)
        return self._envelope(w) / w


class SoftSet:
    """All softening bonds of a jump system.

    Args:
        schur: S.

    Attributes:
        bonds: The bonds.
        finished: Energy dissipated by bonds that have opened all the way.
        snaps: Number of unstable states passed.
        snap_steps: Iterations spent on them.
        solves: Number of equilibria solved for while bonds softened.
    """

    def __init__(self, schur: Array) -> None:
        self._schur = schur
        self.bonds: list[SoftBond] = []
        self.finished = 0.0
        self.snaps = 0
        self.snap_steps = 0
        self.solves = 0
        self._forward = np.zeros((0, 0))
        self._star: Array | None = None

    def taken(self, jump: Array) -> float:
        """Energy all softening bonds have taken so far, finished ones included."""
        return self.finished + sum(b.taken(b.opening(jump)) for b in self.bonds)

    @property
    def components(self) -> Ints:
        """Window components of all bonds, shape (r,)."""
        if not self.bonds:
            return np.zeros(0, dtype=np.int64)
        return np.concatenate([b.components for b in self.bonds])

    def refresh(self, cholesky: GrowingCholesky) -> None:
        """Condense anew after the free set shrank or bonds were added or removed."""
        mine = self.components
        self._forward = cholesky.forward(self._schur[np.ix_(cholesky.free, mine)])
        self._star = None

    def renew(self, schur: Array, bonds: list[SoftBond], cholesky: GrowingCholesky) -> None:
        """Take another S with the same numbering, and the bonds."""
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
        """S*, shape (r, r)."""
        if self._star is None:
            mine = self.components
            star = self._schur[np.ix_(mine, mine)] - self._forward.T @ self._forward
            self._star = star
        return self._star

    @property
    def coupling(self) -> Array:
        """Y, shape (n_free, r)."""
        return self._forward

    def _laws(self) -> tuple[Array, Array]:
        """Forces at zero opening c, shape (r,), and bond stiffness B, shape (r, r)."""
        r = len(self.components)
        constant, stiffness = np.zeros(r), np.zeros((r, r))
        i = 0
        for bond in self.bonds:
            j = i + len(bond.components)
            dyad = np.outer(bond.direction, bond.direction)
            if bond.largest is None:
                constant[i:j] = -bond.strength * bond.direction
                stiffness[i:j, i:j] = bond.strength / bond.final * dyad
            else:
                constant[i:j] = -bond.force(0.0) * bond.direction
                stiffness[i:j, i:j] = -bond.secant * dyad
            i = j
        return constant, stiffness

    def solve(self, right: Array) -> Array:
        """Jumps for given -g*, branches as they are, shape (r,)."""
        self.solves += 1
        constant, stiffness = self._laws()
        return np.asarray(np.linalg.solve(self.star - stiffness, constant + right))

    def rates(self, right: Array) -> Array:
        """Rates of the jumps for given rates of -g*, branches as they are, shape (r,)."""
        _, stiffness = self._laws()
        return np.asarray(np.linalg.solve(self.star - stiffness, right))

    def forces(self, jump: Array) -> Array:
        """Forces on the slave side at given soft jumps, shape (r,)."""
        constant, stiffness = self._laws()
        return np.asarray(constant + stiffness @ jump)

    def stable(self) -> bool:
        """Whether S* - B is positive definite."""
        _, stiffness = self._laws()
        try:
            np.linalg.cholesky(self.star - stiffness)
        except np.linalg.LinAlgError:
            return False
        return True

    # -- events on a linear piece ------------------------------------------------------------

    def first_event(self, before: Array, after: Array) -> tuple[float, list[SoftBond]]:
        """First fraction of a piece at which a bond leaves its branch, and which ones do.

        Args:
            before: Jumps at the beginning, shape (n_window,).
            after: Jumps at the end.

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

    def _leaves(self, bond: SoftBond, a: float, b: float) -> float:
        small = _EVENT * bond.final
        if bond.largest is None:
            if b > bond.final - small:
                return max(bond.final - a, 0.0) / (b - a) if b > a else 0.0
            return 0.0 if b < a - small else np.inf
        # a stiff branch followed too far would exceed the law
        small = min(small, 1e-6 * max(bond.largest, _STIFFEST * bond.final))
        if b > bond.largest + small:
            return max(bond.largest - a, 0.0) / (b - a) if b > a else 0.0
        return np.inf

    def switch(self, bond: SoftBond, jump: Array) -> bool:
        """Move a bond to its next branch at a state.

        Returns:
            Whether it is gone for good (its force is zero and stays so).
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

    def snap(self, jump: Array, round_off: float | Array = 0.0) -> list[SoftBond]:
        """Run downhill from an unstable equilibrium at constant load.

        Args:
            jump: Soft jumps of the equilibrium, shape (r,).
            round_off: That of the entries of S, a number or one per unknown.

        Returns:
            Bonds that opened all the way; the branches of the others are set for the new state.

        Raises:
            ComesApart: There is no end: nothing holds a body once bonds have opened.
        """
        self.snaps += 1
        directions, across = self._axes()
        stiffness = directions @ self.star @ directions.T
        if len(across):
            # no force acts across the directions; what is loose there holds nothing
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
        opens, largest, steps = downhill(held, stiffness, least, strength, final, w, largest)
        self.snap_steps += steps
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


def downhill(
    held: Array,
    stiffness: Array,
    least: float,
    strength: Array,
    final: Array,
    w: Array,
    largest: Array,
) -> tuple[Bools, Array, int]:
    """Run downhill from an unstable equilibrium to a stable one; w_max never heals.

    The energy 1/2 (w - w_1)^t K (w - w_1) - F_1^t (w - w_1) + sum of what the bonds take, with
    the openings w_1 and forces F_1 of the equilibrium it starts from, is piecewise quadratic.
    Each step follows Newton's direction, or that of negative curvature, to the next change of a
    branch: a bond opens all the way, one that went back opens again. The force is continuous where
    a bond turns back, so no energy comes from nowhere.

    Args:
        held: F_1, shape (n,).
        stiffness: K, forces per opening, shape (n, n).
        least: Stiffness below which nothing is held.
        strength: F0, shape (n,).
        final: w_f, shape (n,).
        w: w_1, shape (n,).
        largest: w_max, shape (n,).

    Returns:
        Bonds that soften at the end (the others are gone, or hold on the secant branch), largest
        openings, number of steps.

    Raises:
        ComesApart: The energy falls for ever: nothing holds a body once bonds have opened.
    """
    slope = strength / final
    start = w
    close = np.maximum(1e-11 * final, 1e-13 * np.abs(w).max())  # round-off of openings
    level = 1e-7 * float(np.linalg.norm(strength))
    most = 50 * len(w) + 100
    for step in range(1, most):
        largest = np.maximum(largest, w)
        gone = largest >= final - close
        top = np.clip(largest, _STIFFEST * final, final)
        secant = np.where(gone, 0.0, strength * (1.0 - top / final) / top)
        turned = strength * (1.0 - largest / final) + secant * np.minimum(w - largest, 0.0)
        gradient = stiffness @ (w - start) + np.where(gone, 0.0, turned) - held
        direction, whole, opens = _direction(
            stiffness, least, slope, secant, gradient, level, ~gone & (w >= largest - close)
        )
        x = 1.0 if whole else np.inf
        for limit in (
            np.where(gone, np.inf, final),
            np.where(w < largest - close, largest, np.inf),
        ):
            with np.errstate(divide="ignore", invalid="ignore"):
                way = np.where(direction > 0.0, (limit - w) / direction, np.inf)
            x = min(x, float(np.nanmin(way)))
        if not np.isfinite(x):
            break
        w = w + x * direction
        if whole and x == 1.0:
            return opens, np.maximum(largest, w), step
    raise ComesApart(
        f"softening bonds: no equilibrium after {step} steps downhill with {len(w)} bonds; "
        "the load exceeds what the interface can carry"
    )


def _direction(
    stiffness: Array,
    least: float,
    slope: Array,
    secant: Array,
    gradient: Array,
    level: float,
    opens: Bools,
) -> tuple[Array, bool, Bools]:
    """Where to go, whether it is Newton's step and ends there, and which bonds soften on the way.

    Otherwise it is a direction of negative curvature. A slope below ``level`` counts as none. Bonds
    that would close on the way go back on their secant.
    """
    opens = opens.copy()
    while True:
        curvature = stiffness + np.diag(np.where(opens, -slope, secant))
        values, vectors = np.linalg.eigh(curvature)
        stable = values[0] > max(least, 1e-15 * values[-1])
        if stable:
            direction = -np.linalg.solve(curvature, gradient)
        else:
            # downhill, and where that is level towards opening
            direction = vectors[:, 0]
            tilt = float(gradient @ direction)
            if tilt > level:
                direction = -direction
            elif abs(tilt) <= level and direction[opens].sum() < 0.0:
                direction = -direction
        back = opens & (direction < 0.0)
        if not back.any():
            return direction, bool(stable), opens
        opens &= ~back
