"""Exact crack closure: the energy that releasing a unit of the front frees on this mesh, by mode.

A unit is what is released together: one front node, or for second order a corner node and the
midside node ahead of it. With S* the stiffness of its jumps (what else is free, is free) and p its
bond forces, the jumps after release are delta = (S*)^-1 p and the energy freed is

    G dA = 1/2 p . delta = 1/2 sum (p_n delta_n + p_s delta_s + p_t delta_t)

the two-step crack closure integral of Irwin (1957), without an assumption on mesh, load or order.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array
from fxcrack.errors import InputError


def opens(force: npt.ArrayLike, jump: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Which units open when they are released.

    Those that are in tension do; also those in which the nodes ahead are pressed together harder
    than the first is pulled (arms thinner than an element is long), if they set free energy by
    opening.

    Args:
        force: Normal bond forces, tension positive, shape (n, k) [force].
        jump: Normal jumps after release of all components, shape (n, k) [length].

    Returns:
        Shape (n,).
    """
    p, delta = np.asarray(force, dtype=np.float64), np.asarray(jump, dtype=np.float64)
    pulled = p.sum(axis=1) > 0.0
    return np.asarray(pulled | ((delta.sum(axis=1) > 0.0) & ((p * delta).sum(axis=1) > 0.0)))


def closure_rates(force: npt.ArrayLike, jump: npt.ArrayLike, area: npt.ArrayLike) -> Array:
    """Split the closure energy of units by mode.

    A unit pressed together (:func:`opens` says no) stays closed when released: its G_I is zero.
    The sum of its forces decides, not each node: in some second-order faces the corner force of a
    uniform tension is zero or negative. For such units compute ``jump`` with the normal held, so
    that shear alone is released.

    Args:
        force: Bond forces in the local frame (normal, growth direction, front tangent), tension
            positive, shape (n, k, 3) [force]; k nodes per unit.
        jump: Jumps of displacement after release, same frame, shape (n, k, 3) [length].
        area: Area that releasing the unit sets free, shape (n,) or one number [length^2].

    Returns:
        G_I, G_II, G_III, shape (n, 3) [force/length]. They add up to the energy freed per area,
        save for the normal part of closed units; single modes may be negative where modes are
        coupled.

    Raises:
        InputError: Shapes disagree, or an area is not positive.
    """
    p = np.asarray(force, dtype=np.float64)
    delta = np.asarray(jump, dtype=np.float64)
    if p.shape != delta.shape or p.ndim != 3 or p.shape[2] != 3:
        raise InputError(
            f"crack closure: forces have shape {p.shape} and jumps {delta.shape}; both must be "
            "(n, k, 3)"
        )
    a = np.broadcast_to(np.asarray(area, dtype=np.float64), p.shape[:1])
    bad = np.flatnonzero(~((a > 0.0) & (a < np.inf)))
    if bad.size:
        raise InputError(
            f"crack closure: the area of unit {bad[0]} is {a[bad[0]]}; it must be positive and "
            "finite: look at the mesh near this front node"
        )
    rates = 0.5 * (p * delta).sum(axis=1) / a[:, None]
    rates[~opens(p[..., 0], delta[..., 0]), 0] = 0.0
    return np.asarray(rates)
