"""The jump over the cycles to the next release, by the rates at the beginning of elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.errors import InputError
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.fatigue_law import FatigueLaw, Regime


@dataclass(frozen=True, eq=False)
class CycleJump:
    """What happens at the end of a stabilised cycle.

    Attributes:
        cycles: Cycles N so far, after the jump.
        event: "growth" in the Paris regime; "unstable", at least one node beyond the upper limit;
            "arrest", no node will ever be released; "limit", the allowed cycles are over.
        release: Front nodes to release, shape (n,); none at "arrest" and "limit".
        regime: Regime of each front node, shape (n,).
        initiated: Front nodes at which onset is over, shape (n,).
        credit: Growth of each front node within its element, shape (n,) [length]; 0 for those
            released, None when no growth is kept.
    """

    cycles: float
    event: Literal["growth", "unstable", "arrest", "limit"]
    release: Bools
    regime: npt.NDArray[np.int64]
    initiated: Bools
    credit: Array | None


def cycle_jump(
    law: FatigueLaw,
    cycle: CycleRates,
    da: npt.ArrayLike,
    *,
    cycles: float = 0.0,
    initiated: npt.ArrayLike = False,
    credit: npt.ArrayLike | None = None,
    tolerance: float = 0.2,
    limit: float = np.inf,
    short: bool = False,
) -> CycleJump:
    """Jump over the cycles to the next release.

    With N0 counted once, until onset, a node in the Paris regime is released after

        dN = max(N0 - N, 0) + (da - credit)/(da/dN)

    The jump is the smallest dN; nodes within ``tolerance`` of it are released together. While a
    node is beyond the upper limit the jump is one cycle: those nodes are released, and others that
    finish within it.

    Args:
        law: Law of onset and growth.
        cycle: The stabilised cycle at n front nodes.
        da: Length by which releasing the node moves the front, shape (n,) or one number [length].
        cycles: Cycles N so far.
        initiated: Front nodes at which onset is over, shape (n,) or one truth value. Nodes that
            come to the front by growth are.
        credit: Growth so far within the element of each node, shape (n,) [length]; None when growth
            of nodes that are not released is not kept.
        tolerance: f_tol; nodes with dN <= (1 + f_tol) of the smallest are released together.
        limit: Cycles at which the analysis ends.
        short: Whether the limit is known to come before the next release.

    Returns:
        The jump.

    Raises:
        InputError: There is no front node, a rate is not finite or a length not positive.
    """
    da = _checked(cycle, da)
    n = len(da)
    onset_over = np.array(np.broadcast_to(np.asarray(initiated, dtype=np.bool_), (n,)))
    grown = np.zeros(n) if credit is None else np.array(credit, dtype=np.float64)
    regime = law.regimes(cycle)
    rate = np.where(regime == Regime.PARIS, law.growth(cycle), 0.0)
    wait = np.where(onset_over, 0.0, np.maximum(law.onset(cycle) - cycles, 0.0))
    left = np.maximum(da - grown, 0.0)
    dN = wait + np.divide(left, rate, out=np.full(n, np.inf), where=rate > 0.0)

    beyond = regime == Regime.UNSTABLE
    event: Literal["growth", "unstable", "arrest", "limit"] = "growth"
    if beyond.any():
        event, jump = "unstable", 1.0
        release = beyond | (dN <= jump)
    else:
        jump = float(dN.min())
        release = np.isfinite(dN) & (dN <= (1.0 + tolerance) * jump)
        if not release.any():
            event, jump = "arrest", 0.0
    if cycles + jump > limit or short:
        event, jump, release = "limit", max(limit - cycles, 0.0), np.zeros(n, dtype=np.bool_)

    if credit is not None:
        moving = regime == Regime.PARIS
        grown[moving] += rate[moving] * np.maximum(jump - wait[moving], 0.0)
        grown[release] = 0.0
    onset_over |= release | ((regime == Regime.PARIS) & (wait <= jump))
    return CycleJump(
        cycles=cycles + jump,
        event=event,
        release=release,
        regime=regime,
        initiated=onset_over,
        credit=None if credit is None else grown,
    )


def _checked(cycle: CycleRates, da: npt.ArrayLike) -> Array:
    """Lengths of the elements, shape (n,), once they and the cycle are found to make sense."""
    shape = cycle.dG.shape
    if len(shape) != 1 or not shape[0]:
        raise InputError(
            f"fatigue: the front has shape {shape}; give one value per front node, at least one"
        )
    lengths = np.array(np.broadcast_to(np.asarray(da, dtype=np.float64), shape))
    given = {"dG": cycle.dG, "G_max": cycle.G_max, "G_c": cycle.G_c, "da": lengths}
    for name, values in given.items():
        good = np.isfinite(values) & (values > 0.0 if name in ("G_c", "da") else values >= 0.0)
        if not good.all():
            row = int(np.flatnonzero(~good)[0])
            raise InputError(
                f"fatigue: {name} = {values[row]} at front node {row}; it must be finite and "
                f"{'positive' if name in ('G_c', 'da') else 'not negative'}"
            )
    return lengths
