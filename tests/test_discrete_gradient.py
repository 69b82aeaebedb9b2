"""The force of a softening bond over an increment does exactly the work of its law."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fxcrack.equilibrium.discrete_gradient import (
    force_of_one,
    softening_force,
    softening_potential,
)

number = st.floats(0.0, 1.0)


def one(*values: float) -> list[np.ndarray]:
    return [np.array([v]) for v in values]


@given(
    low=st.floats(-1.0, 1.0), top=number, change=st.floats(-2.0, 2.0), log_c=st.floats(-6.0, 3.0)
)
def test_work_is_the_change_of_the_potential(
    low: float, top: float, change: float, log_c: float
) -> None:
    # openings in units of w_f, forces in units of F0; low is on the secant, at its end, or shut
    top = max(top, 1e-3)
    low, c = min(low, top), 10.0**log_c
    (force,) = softening_force(*one(1.0, 1.0, low, top, change, c))
    high = low + change - c * force
    before = softening_potential(*one(1.0, 1.0, low, top))[0]
    after = softening_potential(*one(1.0, 1.0, high, max(top, high)))[0]
    assert force >= 0.0
    assert abs(force * (high - low) - (after - before)) <= 1e-10 * (1.0 + abs(change))


@given(
    speed=st.floats(0.02, 3.0),
    c=st.floats(1e-4, 10.0),
    wobble=st.floats(0.0, 0.9),
    period=st.integers(2, 40),
)
def test_a_bond_that_is_torn_spends_the_area_below_its_law(
    speed: float, c: float, wobble: float, period: int
) -> None:
    low = top = spent = 0.0
    for i in range(2000):
        pull = speed * (1.0 - 2.0 * wobble * (i % period == 0)) + c * max(1.0 - top, 0.0)
        (force,) = softening_force(*one(1.0, 1.0, low, top, pull, c))
        high = low + pull - c * force
        spent += force * (high - low)
        low, top = high, max(top, high)
        if top >= 1.0:
            break
    if top >= 1.0:
        # a bond that is held where it began has the stiffness of F0 over 1e-7 w_f
        assert abs(spent - 0.5) <= 1.0001e-7


def test_secant_force_is_the_mean_of_both_ends() -> None:
    # at rest on the secant: no change, no work, the force of the law itself
    (force,) = softening_force(*one(2.0, 0.1, 0.02, 0.05, 0.0, 0.0))
    assert abs(force - 2.0 * 0.5 * 0.4) <= 1e-15


def test_a_long_increment_breaks_the_bond_at_once_with_the_whole_energy() -> None:
    (force,) = softening_force(*one(2.0, 0.1, 0.0, 0.0, 5.0, 1e-3))
    assert abs(force * (5.0 - 1e-3 * force) - 0.1) <= 1e-14


@given(
    low=st.floats(-1.0, 1.0), top=number, change=st.floats(-2.0, 2.0), log_c=st.floats(-6.0, 3.0)
)
def test_one_bond_has_the_force_of_an_array(
    low: float, top: float, change: float, log_c: float
) -> None:
    low, c = min(low, top), 10.0**log_c
    (known,) = softening_force(*one(1.0, 1.0, low, top, change, c))
    # where both roots of the quadratic coincide, round-off in it appears with its square root, 2e-8
    assert force_of_one(1.0, 1.0, low, top, change, c) == pytest.approx(known, rel=2e-7, abs=1e-12)


@given(
    low=st.floats(-1.0, 1.0), top=number, change=st.floats(-2.0, 2.0), log_c=st.floats(-6.0, 3.0)
)
def test_work_of_one_bond_is_the_change_of_the_potential(
    low: float, top: float, change: float, log_c: float
) -> None:
    top = max(top, 1e-3)
    low, c = min(low, top), 10.0**log_c
    force = force_of_one(1.0, 1.0, low, top, change, c)
    high = low + change - c * force
    before = softening_potential(*one(1.0, 1.0, low, top))[0]
    after = softening_potential(*one(1.0, 1.0, high, max(top, high)))[0]
    assert force >= 0.0
    assert abs(force * (high - low) - (after - before)) <= 1e-10 * (1.0 + abs(change))
