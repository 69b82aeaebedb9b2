"""Bonds that soften with their opening, condensed to themselves.

    F(w) = F0 (1 - w/w_f)            w the opening along F0, while it grows
    F(w) = F(w_max) w/w_max          when it goes back (secant), w_max never heals

With the free jumps condensed out, the softening ones obey a small system

    (S* - B) delta = c - g*,    S* = S_RR - Y^t Y,   Y = L^-1 S_FR,

B the (negative) stiffness of the bonds. Where S* - B is not positive definite the state is
unstable; the energy is then lowered with the bond forces lagged,  S* delta_new = c(w_old) - g*,
which decreases it monotonically because the softening energy is concave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.errors import ConvergenceError
from fxcrack.solve.cholesky import GrowingCholesky

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_STIFFEST = 1e-7
"""The secant of a bond that unloads at once is that of this fraction of its final opening."""
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
            return self.strength * (1.0 - opening / self.final)
        return self.secant * opening

    def taken(self, opening: float) -> float:
        """Energy the bond has taken up to an opening, the part it would give back included."""
        if self.largest is None:
            return self.strength * opening * (1.0 - 0.5 * opening / self.final)
        dissipated = 0.5 * self.strength * self.largest
        return dissipated + 0.5 * self.secant * opening**2

    @property
    def secant(self) -> float:
        """Stiffness of the secant branch, force/length."""
        w = max(self.largest or 0.0, _STIFFEST * self.final)
        return self.strength * (1.0 - w / self.final) / w


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
        limit = max(bond.largest, _STIFFEST * bond.final)
        if b > limit + small:
            return max(limit - a, 0.0) / (b - a)
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

    def snap(self, right: Array, jump: Array) -> list[SoftBond]:
        """Run downhill from an unstable state at constant load.

        Args:
            right: -g* at the present loads, shape (r,).
            jump: Present soft jumps, shape (r,).

        Returns:
            Bonds that opened all the way; the branches of the others are set for the new state.

        Raises:
            ConvergenceError: No end was found.
        """
        self.snaps += 1
        edges = np.cumsum([0] + [len(b.components) for b in self.bonds])
        inverse = np.linalg.inv(self.star)
        strength = np.array([b.strength for b in self.bonds])
        final = np.array([b.final for b in self.bonds])
        directions = np.zeros((len(self.bonds), edges[-1]))
        for i, bond in enumerate(self.bonds):
            directions[i, edges[i] : edges[i + 1]] = bond.direction
        free_opening = directions @ inverse @ right
        compliance = directions @ inverse @ directions.T
        w = directions @ jump
        largest = np.array([w_ if b.largest is None else b.largest
                            for b, w_ in zip(self.bonds, w, strict=True)])  # fmt: skip
        w, largest, steps = downhill(free_opening, compliance, strength, final, w, largest)
        self.snap_steps += steps
        gone = []
        for bond, now, most in zip(self.bonds, w, largest, strict=True):
            if most >= bond.final * (1.0 - 10.0 * _EVENT):
                gone.append(bond)
            else:
                bond.largest = None if now >= most - 1e-9 * bond.final else float(most)
        return gone


def downhill(
    free_opening: Array,
    compliance: Array,
    strength: Array,
    final: Array,
    w: Array,
    largest: Array,
) -> tuple[Array, Array, int]:
    """Openings after running downhill from an unstable equilibrium; w_max never heals.

    The energy 1/2 (w - w_0)^t C^-1 (w - w_0) + sum of what the bonds take is piecewise quadratic.
    Each step follows Newton's direction, or that of negative curvature, to the next change of a
    branch: a bond opens all the way, one that held its force opens again.

    Args:
        free_opening: w_0, openings without any bond force, shape (n,), length.
        compliance: C, openings per force, shape (n, n).
        strength: F0, shape (n,).
        final: w_f, shape (n,).
        w: Present openings, shape (n,).
        largest: w_max, shape (n,).

    Returns:
        Openings, largest openings, number of steps.

    Raises:
        ConvergenceError: No end was found.
    """
    stiffness = np.linalg.inv(compliance)
    slope = strength / final
    # openings are small differences of what loads and bonds do alone: round-off of those counts
    close = np.maximum(1e-11 * final, 1e-13 * np.abs(free_opening).max())
    level = 1e-7 * float(np.linalg.norm(strength))
    most = 50 * len(w) + 100
    for step in range(1, most):
        largest = np.maximum(largest, w)
        gone = largest >= final - close
        force = np.where(gone, 0.0, strength * (1.0 - largest / final))
        gradient = stiffness @ (w - free_opening) + force
        direction, whole = _direction(
            stiffness, slope, gradient, level, ~gone & (w >= largest - close)
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
            return w, np.maximum(largest, w), step
    raise ConvergenceError(
        f"softening bonds: no equilibrium after {step} steps downhill with {len(w)} bonds; "
        "the load may exceed what the interface can carry at all"
    )


def _direction(
    stiffness: Array, slope: Array, gradient: Array, level: float, opens: npt.NDArray[np.bool_]
) -> tuple[Array, bool]:
    """Where to go: Newton's step (True: it ends there), or a direction of negative curvature.

    A slope below ``level`` counts as none. Bonds that would close on the way hold their force
    and leave the softening set.
    """
    opens = opens.copy()
    while True:
        curvature = stiffness - np.diag(np.where(opens, slope, 0.0))
        values, vectors = np.linalg.eigh(curvature)
        stable = values[0] > 1e-12 * values[-1]
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
            return direction, bool(stable)
        opens &= ~back
