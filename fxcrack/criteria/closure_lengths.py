"""Virtual crack closure on uneven spacing: force and opening taken at one and the same length.

A bond force F at a tip with elements of d_behind and d_ahead is the one that even spacing l would
have there. In the singular field the force of even spacing goes with sqrt(l), so with phi the ratio
of F w/(2 G b d_behind) of the discrete crack-tip field to its value for even spacing,

    l = d_behind phi(d_ahead/d_behind)^2

(phi: finite elements around a crack tip in the asymptotic field, plane strain, all of them
d_behind long behind the tip and d_ahead long ahead; :data:`_CALIBRATION`). The opening at l behind
the tip comes from the profile of the openings there, two Williams terms (Williams 1957) through two
of its points:

    w(r) = sqrt(r) (A + B r)

The first is that of the singular field, the second what beams and plates add, whose elements may
be as long as they are thick. Then, as on even spacing l,

    G = F w(l)/(2 b l)      second order: G = (F_corner w(l) + F_midside w(l/2))/(2 b l)
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Bools

_CALIBRATION = {1: (0.316, 0.028, -0.0105), 2: (0.434, 0.014, -0.0108)}
"""log phi = c1 x + c2 x^2 + c3 x^3, x = log(d_ahead/d_behind), per order of the elements."""

LARGEST_RATIO = 4.0
"""Ratio of the lengths behind and ahead up to which the calibration serves, either way."""

_EVEN = 1e-9
"""Lengths whose ratio differs from 1 by less are equal."""


def length_of_force(ahead: Array, behind: Array, order: int) -> Array:
    """Even spacing that would give the bond force of a tip.

    Args:
        ahead: Length of the element ahead, shape (n,) [length]; positive.
        behind: Length of the element behind, shape (n,) [length].
        order: Order of the elements, 1 or 2.

    Returns:
        Shape (n,) [length]. Beyond :data:`LARGEST_RATIO` the ratio counts as that.
    """
    ratio = np.divide(ahead, behind, out=np.ones_like(behind), where=behind > 0.0)
    x = np.log(np.clip(ratio, 1.0 / LARGEST_RATIO, LARGEST_RATIO))
    a, b, c = _CALIBRATION[order]
    return np.asarray(behind * np.exp(2.0 * x * (a + x * (b + x * c))))


def uneven(ahead: Array, behind: Array) -> Bools:
    """Tips whose elements ahead and behind differ in length, shape (n,).

    Arguments as for :func:`length_of_force`; the last node of a surface counts as even.
    """
    return np.asarray((ahead > 0.0) & (np.abs(ahead - behind) > _EVEN * behind))


def opening_shares(ahead: Array, behind: Array, further: Array, order: int) -> Array:
    """How much each measured opening counts in the openings that force nodes are multiplied with.

    Args:
        ahead: Length of the element ahead, shape (n,) [length].
        behind: Length of the element behind, shape (n,) [length].
        further: Distance of the second corner node behind the tip, shape (n,) [length]; 0 where
            there is none: the singular field alone is then taken beyond the first one.
        order: Order of the elements, 1 or 2.

    Returns:
        Shape (n, order, order + 1): rows the front node and, for second order, the midside node
        ahead; columns the wake node, for second order the wake midside, and the second corner.
    """
    n = len(behind)
    out = np.zeros((n, order, order + 1))
    spread = uneven(ahead, behind)
    out[:, range(order), range(order)] = 1.0
    if not spread.any():
        return out
    length = length_of_force(ahead, behind, order)
    far = np.where(further > behind, further, np.inf)
    middle = 0.5 * behind
    for row in range(order):
        at = length / (row + 1)
        if order == 1:
            near, beyond, columns = behind, far, (0, 1)
            shares = _profile(at, near, beyond)
            _place(out, row, spread, shares, columns)
            continue
        inside = at <= behind
        # within the element behind its midside and corner hold the profile, further the corners
        _place(out, row, spread & inside, _profile(at, middle, behind), (1, 0))
        known = np.isfinite(far)
        _place(out, row, spread & ~inside & known, _profile(at, behind, far), (0, 2))
        _place(out, row, spread & ~inside & ~known, _profile(at, middle, behind), (1, 0))
    return out


def _profile(at: Array, near: Array, far: Array) -> tuple[Array, Array]:
    """Shares of the openings at two distances in that at a third one: w/sqrt(r) is linear in r.

    An infinite distance has no share.
    """
    known = np.isfinite(far)
    second = np.where(known, far, 2.0 * near)
    part = np.where(known, (at - near) / (second - near), 0.0)
    return np.sqrt(at / near) * (1.0 - part), np.sqrt(at / second) * part


def _place(
    out: Array, row: int, where: Bools, shares: tuple[Array, Array], columns: tuple[int, int]
) -> None:
    out[where, row] = 0.0
    for share, column in zip(shares, columns, strict=True):
        out[where, row, column] = share[where]
