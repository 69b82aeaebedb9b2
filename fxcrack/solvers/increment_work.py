"""The way from one equilibrium of nonlinear bodies to another, and what was spent on it.

Between two accepted states the dense system holds the tangent: it predicts the way (contact and
softening followed exactly on it), SNES corrects the end, and the integrals along the way are those
of the prediction plus the correction e, whose value and rate are zero at the start:

    int_0^1 e ds = e(1)/2 - e'(1)/12      (cubic in s)
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import ConvergenceError
from fxcrack.equilibrium.contact import Equilibrium, bond_work
from fxcrack.equilibrium.jump_system import Snapshot

FINE = 1.0 / 512.0
"""Part of a way, or of a bond force, that is taken at once whatever the energies are."""


class EnergyImbalance(ConvergenceError):
    """The integrals along a way do not add up to what the bodies have stored: it is too long."""


@dataclass(frozen=True)
class IncrementWork:
    """The way from one equilibrium to another, loads and given forces linear in s from 0 to 1.

    Attributes:
        start: Where it begins.
        end: Where it ends.
        conjugate: Integral of the conjugates over s, shape (n_loads,).
        jump: Integral of the jumps over s, shape (n_retained,).
        bonds: Energy that bonds which are letting go took out on the way.
        friction: Energy that friction took on the way.
    """

    start: Equilibrium
    end: Equilibrium
    conjugate: Array
    jump: Array
    bonds: float
    friction: float

    def external_work(self, n_forces: int) -> float:
        """Work of supports and force patterns, of which there are ``n_forces``."""
        n, a, b = len(self.start.loads) - n_forces, self.start.loads, self.end.loads
        work = self.conjugate[:n] @ (b - a)[:n]
        work += b[n:] @ self.end.conjugate[n:] - a[n:] @ self.start.conjugate[n:]
        work -= self.conjugate[n:] @ (b - a)[n:]
        return float(work)


@dataclass(frozen=True)
class TrialIncrement:
    """What is known of a trial before it is confirmed.

    Attributes:
        saved: The dense system's states before it.
        points: Pieces of the predicted way with the fraction at which each ends.
        end: The equilibrium found.
        rate: Rates of jumps and conjugates at the start, by the tangent there.
        soft: Components that softened at the start.
        iterations: Iterations it took.
        friction: Energy that friction took.
    """

    saved: Snapshot
    points: list[tuple[float, Equilibrium]]
    end: Equilibrium
    rate: tuple[Array, Array]
    soft: Ints
    iterations: int
    friction: float

    def integrals(
        self, after: tuple[Array, Array], soft: Ints, *, trapezoidal: bool
    ) -> IncrementWork:
        """What the way took.

        Args:
            after: Rates of jumps and conjugates at the end, by the tangent there.
            soft: Components that soften there.
            trapezoidal: Straight from start to end, for bodies whose terms count so: with the same
                rule here nothing is lost.
        """
        end, points = self.end, self.points
        here, predicted = points[0][1], points[-1][1]
        if trapezoidal:
            points, predicted, after = [(0.0, here), (1.0, end)], end, self.rate
        given = end.force - here.force
        given[self.soft] = given[soft] = 0.0
        jump, conjugate = (
            (getattr(end, name) - getattr(predicted, name)) / 2.0 - (b - a) / 12.0
            for name, a, b in zip(("jump", "conjugate"), self.rate, after, strict=True)
        )
        states = [*(point for _, point in points), end]
        bonds = sum(bond_work(a, b) for a, b in pairwise(states))
        return IncrementWork(
            here,
            end,
            _along(points, "conjugate") + conjugate,
            _along(points, "jump") + jump,
            bonds + float(given @ jump),
            self.friction,
        )


def _along(points: list[tuple[float, Equilibrium]], name: str) -> Array:
    """Integral of a quantity over s along linear pieces."""
    return np.sum(
        [
            0.5 * (t - s) * (getattr(a, name) + getattr(b, name))
            for (s, a), (t, b) in pairwise(points)
        ],
        axis=0,
    )
