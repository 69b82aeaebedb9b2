"""Force of a softening bond over an increment of explicit dynamics, by a discrete gradient.

A bond that softens with its opening w has the potential

    Phi(w) = F0 (w - w^2/(2 w_f))                       while w grows, up to w_f
    Phi(w) = Phi(top) - k_s (top^2 - w^2)/2             on the secant below the largest opening top
    Phi(w) = Phi(0)                                     where it is shut, w < 0,

k_s = F0 (1 - top/w_f)/top. Openings are taken in the middle of increments: w_- before the force F
acts, w_+ after it. F is the number for which its work is the change of the potential,

    F (w_+ - w_-) = Phi(w_+) - Phi(w_-),    w_+ = w_- + b - c F,

with b the change of the opening without the force and c what a unit force takes from it. So a
bond dissipates exactly the area F0 w_f/2 below its law, whatever the increment is, and its
stiffness does not limit the increment (discrete gradients: Gonzalez, J. Nonlinear Sci. 6, 1996). On
the secant F is the mean of the forces at both ends; on the envelope, and in the increment in which
the bond breaks, it is the smaller root of a quadratic.

For few bonds calls of numpy cost ten times the arithmetic, so the same law is written twice: for
arrays, and for one bond in plain numbers.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.equilibrium.cohesive_law import STIFFEST


def softening_force(
    strength: Array, final: Array, low: Array, top: Array, change: Array, compliance: Array
) -> Array:
    """Forces of bonds over one increment, tension positive.

    All arguments have shape (n,), as has the result [force].

    Args:
        strength: F0, the force at which softening began, positive [force].
        final: w_f, the opening at which nothing is left, positive [length].
        low: w_-, the opening in the middle of the last increment [length].
        top: Largest opening so far, between 0 and w_f [length].
        change: b, change of the opening in this increment without the force [length].
        compliance: c, what a unit force takes from that change, positive [length/force].
    """
    slope, tiny = strength / final, STIFFEST * final
    at_top = strength * (1.0 - top / final)
    secant = at_top / np.maximum(top, tiny)
    free = low + change
    force = secant * (low + 0.5 * change) / (1.0 + 0.5 * secant * compliance)
    shut = (low < 0.0) | (free - compliance * force < 0.0)
    if shut.any():
        force = np.where(shut, _through_zero(secant, low, free, change, compliance), force)
    grows = free - compliance * _force_to_top(at_top, low, top, tiny) > top
    if not grows.any():
        return np.asarray(force)
    # energy of the secant branch down to w_-, on top of what the envelope has at the top
    known = 0.5 * secant * (top**2 - np.maximum(low, 0.0) ** 2)
    known -= strength * top - 0.5 * slope * top**2
    square = compliance - 0.5 * slope * compliance**2
    linear = change + strength * compliance - slope * compliance * free
    constant = strength * free - 0.5 * slope * free**2 + known
    envelope = _smaller_root(square, linear, constant)
    whole = 0.5 * strength * final + known
    last = _smaller_root(compliance, change, whole)
    # a bond that softens faster than masses can follow in an increment breaks in it, if the masses
    # have the energy for that
    able = (change > 0.0) & (change**2 >= 4.0 * compliance * whole)
    able &= free - compliance * last > final
    breaks = (free - compliance * envelope > final) | ((square <= 0.0) & able)
    return np.asarray(np.where(grows, np.maximum(np.where(breaks, last, envelope), 0.0), force))


def force_of_one(
    strength: float, final: float, low: float, top: float, change: float, compliance: float
) -> float:
    """Force of one bond over one increment: :func:`softening_force` in plain numbers."""
    tiny = STIFFEST * final
    slope = strength / final
    at_top = strength * (1.0 - top / final)
    secant = at_top / max(top, tiny)
    free = low + change
    force = secant * (low + 0.5 * change) / (1.0 + 0.5 * secant * compliance)
    if low < 0.0 or free - compliance * force < 0.0:
        force = _one_through_zero(secant, low, free, change, compliance)
    if low < -tiny:
        to_top = 0.5 * at_top * top / max(top - min(low, 0.0), max(top, tiny))
    else:
        to_top = 0.5 * at_top * (1.0 + (max(low, 0.0) / top if top > tiny else 1.0))
    if free - compliance * to_top <= top:
        return force
    known = 0.5 * secant * (top * top - max(low, 0.0) ** 2)
    known -= strength * top - 0.5 * slope * top * top
    square = compliance - 0.5 * slope * compliance * compliance
    linear = change + strength * compliance - slope * compliance * free
    envelope = _one_root(square, linear, strength * free - 0.5 * slope * free * free + known)
    whole = 0.5 * strength * final + known
    breaks = free - compliance * envelope > final
    if not breaks and square <= 0.0:
        able = change > 0.0 and change * change >= 4.0 * compliance * whole
        breaks = able and free - compliance * _one_root(compliance, change, whole) > final
    return max(_one_root(compliance, change, whole) if breaks else envelope, 0.0)


def _one_through_zero(
    secant: float, low: float, free: float, change: float, compliance: float
) -> float:
    if low > 0.0:
        energy = 0.5 * secant * low * low
        bottom = sqrt(change * change + 4.0 * compliance * energy) - change
        return 2.0 * energy / (bottom if bottom > 0.0 else inf)
    if free > 0.0:
        square = compliance + 0.5 * secant * compliance * compliance
        linear = change + secant * compliance * free
        return _one_root(square, linear, 0.5 * secant * free * free)
    return 0.0


def _one_root(a: float, b: float, c: float) -> float:
    bottom = b + sqrt(max(b * b - 4.0 * a * c, 0.0))
    return 2.0 * c / (bottom if bottom > 0.0 else inf)


def _force_to_top(at_top: Array, low: Array, top: Array, tiny: Array) -> Array:
    """Force for which an increment ends at the largest opening so far, shape (n,)."""
    opens = np.maximum(top, tiny)
    share = np.where(top > tiny, np.maximum(low, 0.0) / opens, 1.0)
    through = top / np.maximum(top - np.minimum(low, 0.0), opens)
    return 0.5 * at_top * np.where(low < -tiny, through, 1.0 + share)


def _through_zero(
    secant: Array, low: Array, free: Array, change: Array, compliance: Array
) -> Array:
    """Force on the secant where the opening is negative before or after the increment."""
    opens = _smaller_root(
        compliance + 0.5 * secant * compliance**2,
        change + secant * compliance * free,
        0.5 * secant * free**2,
    )
    # the positive root of c F^2 - b F - k_s low^2/2 = 0, b < 0
    energy = 0.5 * secant * low**2
    bottom = np.sqrt(change**2 + 4.0 * compliance * energy) - change
    closes = 2.0 * energy / np.where(bottom > 0.0, bottom, np.inf)
    before_open, after_open = low > 0.0, free > 0.0
    return np.where(before_open, closes, np.where(after_open, opens, 0.0))


def _smaller_root(a: Array, b: Array, c: Array) -> Array:
    """Smaller root x of a x^2 - b x + c = 0 with b > 0, without cancellation."""
    root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    bottom = b + root
    return np.asarray(2.0 * c / np.where(bottom > 0.0, bottom, np.inf))


def softening_potential(strength: Array, final: Array, opening: Array, top: Array) -> Array:
    """Phi at an opening, energy that the bond has taken since softening began, shape (n,).

    Args:
        strength: F0 [force].
        final: w_f [length].
        opening: w, at most ``top`` [length].
        top: Largest opening so far [length].
    """
    reached = np.clip(top, 0.0, final)
    envelope = strength * (reached - 0.5 * reached**2 / final)
    secant = strength * (1.0 - reached / final) / np.maximum(reached, STIFFEST * final)
    return np.asarray(envelope - 0.5 * secant * (reached**2 - np.clip(opening, 0.0, reached) ** 2))
