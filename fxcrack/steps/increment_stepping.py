"""Stepping by increments of time: accept 1 <= f <= 1 + tolerance, cut back above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base.errors import ComesApart, ConvergenceError, EnergyImbalance
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.steps.analysis import Analysis, largest
from fxcrack.steps.crack import Crack
from fxcrack.steps.driver import BEYOND, LARGE, StepDriver
from fxcrack.steps.increment_control import IncrementControl
from fxcrack.steps.release import release_critical
from fxcrack.steps.static import Static

_SAME_TIME = 1e-9
"""Times closer together than this part of an increment are the same."""
_AT_TOP, _NEAR_TOP = 1e-6, 1e-2
"""How far f may differ from the upper end of its release range by what one node has of the next,
and the fraction of the range in which it is so near that end that cutting back gains nothing."""


def step_by_increments(driver: StepDriver) -> str:
    """Take increments of time until an end condition holds; collective.

    Args:
        driver: The driver of the step, in equilibrium.

    Returns:
        Why the step ended.

    Raises:
        TooManyCutbacks: No increment is small enough.
        NotPositiveDefinite: A body would come free; the state is the last equilibrium before.
        ComesApart: Likewise, while loading.
    """
    analysis, step = driver.analysis, driver.step
    control, done = IncrementControl(step), 0
    if driver.resume is not None:
        control.size, control.cutbacks = driver.resume["size"], driver.resume["cutbacks"]
        done = driver.resume["done"]
    neutral = False  # growth at constant f: the smallest increment, whatever f is at its end
    while True:
        driver.checkpoint_point(size=control.size, cutbacks=control.cutbacks, done=done)
        reason = driver.ended()
        if reason:
            return reason
        done += 1
        if done > step.max_increments:
            return (
                f"stopped: {step.max_increments} increments done without reaching the "
                "end condition; raise max_increments or maximum, or end the step at a Time"
            )
        if analysis.time > BEYOND and driver.end_time >= LARGE:
            return "the criterion is not reached however large the load becomes"
        if not control.cutbacks:  # a load that is not proportional may have been overshot
            control.size = max(control.size, min(_scaled(analysis, step), step.maximum))
        met = _met_at_start(analysis)
        smallest = neutral or any(met)
        size = step.minimum if smallest else control.size
        target, limit = analysis.time + size, min([driver.end_time, *driver.breaks_ahead()])
        if target > limit - _SAME_TIME * size:
            target = limit  # no increment of round-off is left before it
        saved = analysis.snapshot()
        analysis.balance.increment += 1
        try:
            driver.path.over_increment(target)
        except (NotPositiveDefinite, ComesApart):
            analysis.rollback(saved)  # contact and bonds have changed half of the way
            raise
        except (ConvergenceError, EnergyImbalance) as error:
            analysis.rollback(saved)
            control.rejected(target - analysis.time, str(error))
            continue
        values = analysis.evaluate(analysis.solver.state, analysis.time)
        if _excess(analysis.active, values, met) > (_AT_TOP if neutral else 1e-12):
            analysis.rollback(saved)
            used = target - analysis.time
            neutral = not neutral and _is_neutral(analysis, values, used, control)
            if not neutral:
                control.rejected(used, f"f = {largest(values):.4g}")
            continue
        analysis.tip_values = values
        analysis.condensed.commit()
        for ramp in analysis.ramps:
            ramp.accept(analysis.time, analysis.condensed)
        driver.record("increment")
        if not smallest:
            control.accepted()
        neutral = False
        _release_ready(driver, control)


def _release_ready(driver: StepDriver, control: IncrementControl) -> None:
    """Release what is in its release range, again as long as more may be released at this load."""
    analysis = driver.analysis
    while _any_ready(analysis) and not driver.ended():
        release_critical(analysis, all_ready=True)
        driver.record("release")
        control.suggest(_first_increment(analysis))
        if not _may_run_on(analysis):
            return


def _first_increment(analysis: Analysis) -> float:
    """Increment suggested after a release has just begun, infinite without a suggestion."""
    begun = [r for r in analysis.ramps if r.by_time and r.start == analysis.time]
    return min((r.suggested_increment for r in begun), default=np.inf)


def _scaled(analysis: Analysis, step: Static) -> float:
    """Increment that brings a proportional load near the first release, else 0."""
    beta, time = step.linear_scaling, analysis.time
    if beta is None or time <= 0.0 or any(g.n_released for g in analysis.active):
        return 0.0
    reach = [
        float(v.f.max()) ** (-1.0 / g.degree)
        for g, v in analysis.at_tips()
        if v.f.max(initial=0.0) > 0.0
    ]
    return max(time * (beta * min(reach) - 1.0), 0.0) if reach else 0.0


def _any_ready(analysis: Analysis) -> bool:
    """Whether some f has reached the lower end of its release range."""
    return any(v.f.max(initial=0.0) >= g.criterion.release_range[0] for g, v in analysis.at_tips())


def _upper(g: Crack) -> float:
    """Largest f at which nodes of a crack may be released."""
    upper, unstable = g.criterion.release_range[1], g.criterion.unstable_tolerance
    if unstable is not None and g.n_released:
        upper = max(upper, 1.0 + unstable)
    return upper


def _excess(cracks: Sequence[Crack], values: Sequence[TipValues], met: Sequence[bool]) -> float:
    """By how much the worst f is above its release range; cracks that were met do not count."""
    excess = [
        v.f.max(initial=0.0) - _upper(g)
        for g, v, no_matter in zip(cracks, values, met, strict=True)
        if not no_matter
    ]
    return float(max(excess, default=-1.0))


def _met_at_start(analysis: Analysis) -> list[bool]:
    """Per crack, whether f is in its release range already at the start of an increment.

    That applies to criteria other than energy release rates, right after nodes were released. The
    smallest increment is used then, and the nodes are released at its end whatever their f is:
    cutting back could not make it smaller.
    """
    return [
        g.criterion.smallest_increment_when_met
        and bool(v.f.max(initial=0.0) >= g.criterion.release_range[0])
        for g, v in analysis.at_tips()
    ]


def _is_neutral(
    analysis: Analysis, after: Sequence[TipValues], used: float, control: IncrementControl
) -> bool:
    """Whether the cutbacks left cannot keep f in its release range, and the smallest increment can.

    So it is where growth is neutral: f stays what it was when a node is released, at the upper
    end of its range at last. The next node is then released at the same load.

    Args:
        analysis: The analysis at the start of an increment.
        after: Values of the criteria at its end, before it was undone.
        used: Its size, time.
        control: Size of the increments.
    """
    step = control.step
    left = step.cutback ** (step.max_cutbacks - control.cutbacks)
    left = max(left, step.minimum / used)
    for (g, v), w in zip(analysis.at_tips(), after, strict=True):
        upper, f, later = _upper(g), v.f.max(initial=0.0), w.f.max(initial=0.0)
        if later <= upper:
            continue
        low = g.criterion.release_range[0]
        near = f >= upper - _NEAR_TOP * (upper - low) or left * (later - f) > upper - f
        if not (low <= f <= upper + _AT_TOP and near):
            return False
    return True


def _may_run_on(analysis: Analysis) -> bool:
    """Whether more nodes may be released at this load: within the unstable growth tolerance."""
    over = [
        (float(v.f.max(initial=0.0)), g.criterion.unstable_tolerance)
        for g, v in analysis.at_tips()
        if v.f.max(initial=0.0) >= g.criterion.release_range[0]
    ]
    return all(t is not None and f <= 1.0 + t for f, t in over)
