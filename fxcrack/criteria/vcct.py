"""Virtual crack closure: energy release rates from bond forces and the openings behind them.

Even spacing d, width b (Rybicki and Kanninen 1977; in 3-D Shivakumar, Tan and Newman 1988):

    G_I = F_n w_n/(2 b d)    G_II = F_s w_s/(2 b d)    G_III = F_t w_t/(2 b d)

F is the bond force at the front node, w the opening at the wake node behind it, both as (normal,
growth direction, front tangent). Growth when f of the mode-mix law reaches 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array, not_negative, number, one_of
from fxcrack.criteria.rate_criterion import NORMALISATIONS, Normalisation, RateCriterion
from fxcrack.errors import InputError

_OWNER = "VCCT"


def energy_release_rates(
    force: npt.ArrayLike,
    opening: npt.ArrayLike,
    d_ahead: npt.ArrayLike,
    d_behind: npt.ArrayLike,
    width: npt.ArrayLike,
    *,
    normalisation: Normalisation = "tributary",
) -> Array:
    r"""Energy release rates by mode at front nodes, with their sign.

    The length that turns F w/2 into a rate on an uneven mesh, "tributary": near the front the
    traction goes as K/sqrt(r) and the opening as K sqrt(r). A nodal force that collects the
    traction of a length l is therefore proportional to K sqrt(l), an opening at distance l to K
    sqrt(l), and

        F w = 2 G b sqrt(l_F l_w)

    with the factor fixed by even spacing, where F w = 2 G b d. First order: the force at the front
    node collects from both elements at it, l_F = (d_ahead + d_behind)/2; l_w = d_behind. Second
    order: the same for the corner force with the opening of the wake corner. The midside force
    collects from the element ahead alone, so l_F goes as d_ahead; the wake midside lies at
    d_behind/2, so l_w goes as d_behind:

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
        normalisation: "tributary", "ahead", "ahead_sqrt" or "behind".

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
    return weighted_rates(f, w, closure_weights(ahead, behind, b, f.shape[1], normalisation))


def closure_weights(
    ahead: Array, behind: Array, width: Array, n_products: int, normalisation: Normalisation
) -> Array:
    """What :func:`energy_release_rates` multiplies the products F w with.

    Returns:
        Shape (n, n_products) [1/length^2].

    Raises:
        InputError: As there.
    """
    one_of(_OWNER, "normalisation", normalisation, NORMALISATIONS)
    end_allowed = normalisation in ("tributary", "behind")
    _check_lengths(_OWNER, "d_ahead", ahead, zero=end_allowed)
    _check_lengths(_OWNER, "d_behind", behind, zero=False)
    _check_lengths(_OWNER, "width", width, zero=False)
    if normalisation == "tributary":
        corner = np.sqrt((ahead + behind) / 2.0 * behind)
        midside = np.sqrt(ahead * behind)
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
    """:func:`energy_release_rates` with weights at hand."""
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


@dataclass(frozen=True, eq=False)
class VCCT(RateCriterion):
    """Growth when the energy release rate of the virtual crack closure technique reaches toughness.

    Attributes:
        GIc: Mode I toughness [force/length]: a number, one value per slave node, a function of
            position (n, gdim) -> (n,), or a :class:`~fxcrack.criteria.toughness.Tabulated`.
        GIIc: Mode II toughness, likewise; GIc when not given.
        GIIIc: Mode III toughness, likewise; GIIc when not given.
        mix: :class:`~fxcrack.BK`, :class:`~fxcrack.Power` or :class:`~fxcrack.Reeder`. Needed as
            soon as GIIc or GIIIc is given. Without them f = G_T/GIc.
        tolerance: f_tol; growth is accepted while 1 <= f <= 1 + f_tol.
        method: "vcct", or "closure": the exact energy of releasing the node.
        normalisation: Length VCCT divides by, see :func:`energy_release_rates`.
        unstable_tolerance: f_tol of unstable growth: several nodes may go at one load while
            1 + tolerance <= f <= 1 + unstable_tolerance. None: off; math.inf: unlimited.
        viscosity: Viscous regularisation mu of released nodes, also of those that soften [time];
            0: none.
    """

    unstable_tolerance: float | None = field(default=None, kw_only=True)
    viscosity: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        super().__post_init__()
        not_negative(self._owner, viscosity=self.viscosity)
        unstable = self.unstable_tolerance
        if unstable is None:
            return
        if number(self._owner, "unstable_tolerance", unstable) < self.tolerance:
            raise InputError(
                f"{self._owner}: unstable_tolerance = {unstable} is below tolerance = "
                f"{self.tolerance}; give a larger one, math.inf for no limit, or None to switch "
                "unstable growth off"
            )
