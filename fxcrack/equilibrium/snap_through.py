"""From an unstable equilibrium of softening bonds down to a stable one, at constant load.

The energy is piecewise quadratic: between changes of branch Newton's step ends in its minimum, and
a direction of negative curvature leads to the next change.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.errors import ComesApart
from fxcrack.equilibrium.cohesive_law import NEUTRAL, STIFFEST


def snap_through(
    held: Array,
    stiffness: Array,
    least: float,
    strength: Array,
    final: Array,
    w: Array,
    largest: Array,
) -> tuple[Bools, Array, int]:
    """Descend in energy from an unstable equilibrium to a stable one; w_max never decreases.

    The energy 1/2 (w - w_1)^t K (w - w_1) - F_1^t (w - w_1) + sum of what the bonds take, with
    the openings w_1 and forces F_1 of the equilibrium it starts from, is piecewise quadratic.
    Each step follows Newton's direction, or that of negative curvature, to the next change of a
    branch: a bond opens all the way, one that went back opens again. The force is continuous where
    a bond turns back, so no energy is created there.

    Args:
        held: F_1, shape (n,), force.
        stiffness: K, forces per opening, shape (n, n), force/length.
        least: Stiffness below which nothing is held, force/length.
        strength: F0, shape (n,), force.
        final: w_f, shape (n,), length.
        w: w_1, shape (n,), length.
        largest: w_max, shape (n,), length.

    Returns:
        Bonds that soften at the end (the others have opened all the way, or are on the secant
        branch), shape (n,); largest openings, shape (n,), length; number of steps.

    Raises:
        ComesApart: The energy has no minimum: nothing holds a body once bonds have opened.
    """
    slope = strength / final
    start = w
    close = np.maximum(1e-11 * final, 1e-13 * np.abs(w).max())  # round-off of openings
    level = 1e-7 * float(np.linalg.norm(strength))
    most = 50 * len(w) + 100
    for step in range(1, most):
        largest = np.maximum(largest, w)
        gone = largest >= final - close
        top = np.clip(largest, STIFFEST * final, final)
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
        f"softening bonds: no equilibrium after {step} steps of descent with {len(w)} bonds; "
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
        values, vectors = np.linalg.eigh(curvature - np.diag(np.where(opens, NEUTRAL * slope, 0.0)))
        stable = values[0] > max(least, 1e-15 * values[-1])
        if stable:
            direction = -np.linalg.solve(curvature, gradient)
        else:
            # down the energy, and where it is level towards opening
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
