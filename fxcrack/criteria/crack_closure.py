"""Exact crack closure: the energy that releasing a unit of the front frees on this mesh, by mode.

A unit is what is released together: one front node, or for second order a corner node and the
midside node ahead of it. With S* the stiffness of its jumps (what else is free, is free) and p its
bond forces, the jumps after release are delta = (S*)^-1 p and the energy freed is

    G dA = 1/2 p . delta = 1/2 sum (p_n delta_n + p_s delta_s + p_t delta_t)

the two-step crack closure integral of Irwin (1957), without an assumption on mesh, load or order.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.checks import one_of
from fxcrack.base.errors import InputError
from fxcrack.criteria.closure_lengths import length_of_force, opening_shares


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


def closure_rates(
    force: npt.ArrayLike, jump: npt.ArrayLike, area: npt.ArrayLike, *, signed: int | None = None
) -> Array:
    """Split the closure energy of units by mode.

    A unit pressed together (:func:`opens` is False) stays closed when released: its G_I is zero.
    The sum of its forces decides, not each node: in some second-order faces the corner force of a
    uniform tension is zero or negative. For such units compute ``jump`` with the normal held, so
    that shear alone is released.

    Args:
        force: Bond forces in the local frame (normal, growth direction, front tangent), tension
            positive, shape (n, k, 3) [force]; k nodes per unit.
        jump: Jumps of displacement after release, same frame, shape (n, k, 3) [length].
        area: Area that releasing the unit sets free, shape (n,) or one number [length^2].
        signed: How many nodes of a unit, the first ones, have forces with the sign of the
            traction; all of them by default, and the corner alone where jumps are hierarchical
            (:mod:`fxcrack.interface.hierarchy`).

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
    rates[~opens(p[:, :signed, 0], delta[:, :signed, 0]), 0] = 0.0
    return np.asarray(rates)


_OWNER = "VCCT"


def energy_release_rates(
    force: npt.ArrayLike,
    opening: npt.ArrayLike,
    d_ahead: npt.ArrayLike,
    d_behind: npt.ArrayLike,
    width: npt.ArrayLike,
    *,
    normalisation: Normalisation = "equal_length",
    further: npt.ArrayLike | None = None,
    d_further: npt.ArrayLike = 0.0,
) -> Array:
    r"""Energy release rates by mode at front nodes, with their sign.

    What turns F w/2 into a rate on an uneven mesh, "equal_length": the force is that of even
    spacing l, and the opening is taken at l behind the front, see
    :mod:`fxcrack.criteria.closure_lengths`.

    "tributary" leaves the opening where it is, at d_behind, and divides by a mean length: near the
    front the
    traction varies as K/sqrt(r) and the opening as K sqrt(r). A nodal force that collects the
    traction of a length l is therefore proportional to K sqrt(l), an opening at distance l to K
    sqrt(l), and

        F w = 2 G b sqrt(l_F l_w)

    with the factor fixed by even spacing, where F w = 2 G b d. First order: the force at the front
    node collects from both elements at it, l_F = (d_ahead + d_behind)/2; l_w = d_behind. Second
    order: the same for the corner force with the opening of the wake corner. The midside force
    collects from the element ahead alone, so l_F is proportional to d_ahead; the wake midside lies
    at d_behind/2, so l_w is proportional to d_behind:

        G = F_corner w_corner/(2 b sqrt((d_ahead + d_behind)/2 d_behind))
          + F_midside w_midside/(2 b sqrt(d_ahead d_behind))

    On even spacing this is (F_corner w_corner + F_midside w_midside)/(2 b d) (Krueger 2002). The
    others divide the sum of the products by 2 b times "ahead" d_ahead, "behind" d_behind,
    "ahead_sqrt" sqrt(d_ahead d_behind), which is "ahead" corrected by sqrt(d_ahead/d_behind)
    (Krueger 2002).

    In 3-D with areas that are no product of a width and a length (fans, unstructured faces), give
    the areas swept by the node ahead and behind as ``d_ahead`` and ``d_behind``, and ``width`` 1.
    In axisymmetry the width is 2 pi r and forces are those of the full ring.

    Args:
        force: Bond forces, tension positive, shape (n, k, 3) [force]: k = 1 the front node; k = 2
            (second order) the corner node, then the midside node ahead of it.
        opening: Jumps of displacement behind, slave minus master, shape (n, k, 3) [length]: k = 1
            the wake node; k = 2 the wake corner, then the wake midside.
        d_ahead: Length of the element ahead, shape (n,) or one number [length]; may be 0, where the
            surface ends, for "tributary" and "behind".
        d_behind: Length of the element behind, shape (n,) or one number [length].
        width: Width of the front that belongs to the node, shape (n,) or one number [length].
        normalisation: "equal_length", "tributary", "ahead", "ahead_sqrt" or "behind".
        further: Jumps at the second corner node behind, shape (n, 3) [length], for "equal_length";
            None where it is not known: the singular field alone is then taken.
        d_further: Distance of that node, shape (n,) or one number [length]; 0 where there is none.

    Returns:
        G_I, G_II, G_III, shape (n, 3) [force/length]. Closed wake nodes (w_n <= 0) do not count
        for mode I. A negative rate (compression, strongly asymmetric arms) is kept: see
        ``mixed_mode.clip``.

    Raises:
        InputError: Shapes disagree, a length or width is not positive, or ``normalisation`` is
            unknown.
    """
    f = np.asarray(force, dtype=np.float64)
    w = np.asarray(opening, dtype=np.float64)
    if f.shape != w.shape or f.ndim != 3 or f.shape[1] not in (1, 2) or f.shape[2] != 3:
        raise InputError(
            f"{_OWNER}: forces have shape {f.shape} and openings {w.shape}; "
            "both must be (n, 1, 3) or, for second order, (n, 2, 3)"
        )
    ahead, behind, b = (
        np.broadcast_to(np.asarray(v, dtype=np.float64), f.shape[:1])
        for v in (d_ahead, d_behind, width)
    )
    weights = closure_weights(ahead, behind, b, f.shape[1], normalisation)
    if normalisation == "equal_length":
        none = further is None
        far = np.zeros((len(f), 3)) if none else np.asarray(further, dtype=np.float64)
        distance = np.zeros(len(f)) if none else np.broadcast_to(d_further, f.shape[:1])
        shares = opening_shares(ahead, behind, np.asarray(distance, float), f.shape[1])
        w = np.einsum("nkj,njc->nkc", shares, np.concatenate([w, far[:, None]], axis=1))
    return weighted_rates(f, w, weights)


def closure_weights(
    ahead: Array,
    behind: Array,
    width: Array,
    n_products: int,
    normalisation: Normalisation,
    straight: Bools | None = None,
) -> Array:
    """What :func:`energy_release_rates` multiplies the products F w with.

    Args:
        ahead: Length of the element ahead, shape (n,) [length].
        behind: Length of the element behind, shape (n,) [length].
        width: Width of the front that belongs to the node, shape (n,) [length].
        n_products: Products F w per node: 1, or 2 for second order.
        normalisation: As for :func:`energy_release_rates`.
        straight: Whether both lengths lie on one line, shape (n,); where they do not,
            "equal_length" is "tributary".

    Returns:
        Shape (n, n_products) [1/length^2].

    Raises:
        InputError: As there.
    """
    one_of(_OWNER, "normalisation", normalisation, NORMALISATIONS)
    end_allowed = normalisation in ("equal_length", "tributary", "behind")
    _check_lengths(_OWNER, "d_ahead", ahead, zero=end_allowed)
    _check_lengths(_OWNER, "d_behind", behind, zero=False)
    _check_lengths(_OWNER, "width", width, zero=False)
    if normalisation in ("equal_length", "tributary"):
        corner = np.sqrt((ahead + behind) / 2.0 * behind)
        midside = np.sqrt(ahead * behind)
        if normalisation == "equal_length":
            length = length_of_force(ahead, behind, n_products)
            line = ahead > 0.0 if straight is None else straight & (ahead > 0.0)
            corner, midside = np.where(line, length, corner), np.where(line, length, midside)
    else:
        corner = midside = {
            "ahead": ahead,
            "ahead_sqrt": np.sqrt(ahead * behind),
            "behind": behind,
        }[normalisation]
    lengths = np.stack([corner, midside], axis=-1)[:, :n_products]
    # Where the surface ends there is no midside node ahead and its length is 0.
    weight = np.divide(1.0, lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    return np.asarray(weight / (2.0 * width[:, None]))


def weighted_rates(force: Array, opening: Array, weights: Array) -> Array:
    """:func:`energy_release_rates` with given weights.

    Args:
        force: Bond forces, tension positive, shape (n, k, 3) [force].
        opening: Jumps of displacement behind, shape (n, k, 3) [length].
        weights: From :func:`closure_weights`, shape (n, k) [1/length^2].

    Returns:
        G_I, G_II, G_III, shape (n, 3) [force/length].
    """
    products = force * opening
    # closed wake nodes do not count for mode I
    products[..., 0] = np.where(opening[..., 0] > 0.0, products[..., 0], 0.0)
    return np.asarray((products * weights[..., None]).sum(axis=1))


def _check_lengths(owner: str, name: str, values: Array, *, zero: bool) -> None:
    good = (values >= 0.0 if zero else values > 0.0) & (values < np.inf)
    if not good.all():
        row = int(np.flatnonzero(~good)[0])
        raise InputError(
            f"{owner}: {name} = {values[row]} at row {row} of the front nodes; it must be "
            f"{'zero or ' if zero else ''}positive and finite: look at the mesh near this node"
        )


Normalisation = Literal["equal_length", "tributary", "ahead", "ahead_sqrt", "behind"]
NORMALISATIONS = ("equal_length", "tributary", "ahead", "ahead_sqrt", "behind")
