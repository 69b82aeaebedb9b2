"""An increment from one equilibrium of nonlinear bodies to another, and its work.

Between two accepted states the dense system holds the tangent: it predicts the path (contact and
softening followed exactly on it), SNES corrects the end, and the integrals along the path are those
of the prediction plus the correction e, whose value and rate are zero at the start:

    int_0^1 e ds = e(1)/2 - e'(1)/12      (cubic in s)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import NO_EQUILIBRIUM, EnergyImbalance
from fxcrack.equilibrium.contact import Equilibrium, bond_work
from fxcrack.equilibrium.moving_contact import ImpulseWork

FINE = 1.0 / 512.0
"""Part of an increment, or of a bond force, that is not divided whatever the energies are."""

_SMALLEST_PIECE = 1e-4
"""Part of a bond force whose removal is the least that is tried at once."""


@dataclass(frozen=True)
class IncrementWork:
    """Work along an increment, loads and given forces linear in s from 0 to 1.

    Attributes:
        start: Where it begins.
        end: Where it ends.
        conjugate: Integral of the conjugates over s, shape (n_loads,).
        jump: Integral of the jumps over s, shape (n_retained,), length.
        bonds: Energy released by bonds whose force falls.
        friction: Energy dissipated by friction.
        contact: Energy taken by contact impulses of bodies in motion beyond that, by the
            trapezoidal rule.
        overlap: Work of contact impulses that pushed overlapping faces apart.
    """

    start: Equilibrium
    end: Equilibrium
    conjugate: Array
    jump: Array
    bonds: float
    friction: float
    contact: float = 0.0
    overlap: float = 0.0

    def support_work(self, n_forces: int) -> float:
        """Work of supports, where there are ``n_forces`` force patterns."""
        n, a, b = len(self.start.loads) - n_forces, self.start.loads, self.end.loads
        return float(self.conjugate[:n] @ (b - a)[:n])

    def external_work(self, n_forces: int) -> float:
        """Work of supports and force patterns, of which there are ``n_forces``."""
        n, a, b = len(self.start.loads) - n_forces, self.start.loads, self.end.loads
        by_forces = b[n:] @ self.end.conjugate[n:] - a[n:] @ self.start.conjugate[n:]
        by_forces -= self.conjugate[n:] @ (b - a)[n:]
        return self.support_work(n_forces) + float(by_forces)


@dataclass
class TrialIncrement:
    """An equilibrium that was found, before it is accepted.

    Attributes:
        points: Pieces of the predicted path with the fraction at which each ends.
        end: The equilibrium found.
        rate: Rates of jumps, shape (n_retained,), and conjugates, shape (n_loads,), per s at the
            start, by the tangent there.
        soft: Components that softened at the start, shape (n_soft,).
        iterations: Iterations it took.
        friction: Energy dissipated by friction.
        at: Time of the end.
        u: Displacement of the end, owned dofs.
        values: Forces of the last coordinates and values of the borders there, shape (n_last,).
        drift: What was out of balance where the tangent at hand was made, over the forces.
        noise: What the energies along the path are known to.
        impulses: Work of contact impulses, of bodies in motion that touch.
        energies: Energies stored at the end, by name, ``None`` before they are asked for.
        work: Work along the path, ``None`` before it is confirmed.
    """

    points: list[tuple[float, Equilibrium]]
    end: Equilibrium
    rate: tuple[Array, Array]
    soft: Ints
    iterations: int
    friction: float
    at: float
    u: PETSc.Vec
    values: Array
    drift: float
    noise: float
    impulses: ImpulseWork | None = None
    energies: dict[str, float] | None = None
    work: IncrementWork | None = None

    def integrals(
        self, after: tuple[Array, Array], soft: Ints, *, trapezoidal: bool
    ) -> IncrementWork:
        """Work along the increment.

        Args:
            after: Rates of jumps, shape (n_retained,), and conjugates, shape (n_loads,), per s at
                the end, by the tangent there.
            soft: Components that soften there, shape (n_soft,).
            trapezoidal: Straight from start to end, for bodies whose terms use the trapezoidal
                rule: the energy balance is then exact.
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
        contact = overlap = 0.0
        conjugate += _along(points, "conjugate")
        if self.impulses is not None:
            more = self.impulses.supports
            conjugate[: len(more)] += more
            bonds += self.impulses.bonds
            contact, overlap = self.impulses.beyond, self.impulses.overlap
        return IncrementWork(
            here,
            end,
            conjugate,
            _along(points, "jump") + jump,
            bonds + float(given @ jump),
            self.friction,
            contact,
            overlap,
        )


def in_pieces(go: Callable[[float, bool], None]) -> None:
    """Go from 0 to 1 in as many pieces as the iteration needs.

    Args:
        go: Goes on to a fraction, and is told whether to refuse a piece whose energies do not
            balance to the tolerance. Where it raises, nothing has changed.

    Raises:
        SolverError: The smallest piece fails as well: one of :data:`NO_EQUILIBRIUM`.
    """
    done, size = 0.0, 1.0
    while done < 1.0:
        to = min(done + size, 1.0)
        try:
            go(to, size > FINE)
        except NO_EQUILIBRIUM as error:
            size *= 0.5 if isinstance(error, EnergyImbalance) else 0.25
            if size < _SMALLEST_PIECE:
                raise
        else:
            done = to


def _along(points: list[tuple[float, Equilibrium]], name: str) -> Array:
    """Integral of a quantity over s along linear pieces."""
    return np.sum(
        [
            0.5 * (t - s) * (getattr(a, name) + getattr(b, name))
            for (s, a), (t, b) in pairwise(points)
        ],
        axis=0,
    )
