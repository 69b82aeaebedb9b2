"""Laws of release: what remains of the bond force, and the energy it spends on its way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fxcrack.base.errors import InputError
from fxcrack.criteria import (
    AmplitudeRelease,
    ProgressiveRelease,
    RampRelease,
    StepRelease,
)
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.steps.force_ramps import ViscousRamp

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12  # a few roundings of well-scaled numbers


def bond(strength: float = 1.0, final: float = 1.0, largest: float | None = None) -> CohesiveBond:
    """A bond that softens along its only component."""
    return CohesiveBond(
        np.array([0]), np.array([1.0]), strength, final, (0, np.array([0]), np.array([0])), largest
    )


def test_step_holds_in_its_increment_and_goes_in_the_next() -> None:
    assert StepRelease().remaining([0, 1, 2]).tolist() == [1.0, 0.0, 0.0]
    assert StepRelease().driver == "once"


def test_ramp_over_increments_or_opening() -> None:
    assert RampRelease(4).remaining([0, 1, 2, 4, 5]).tolist() == [1.0, 0.75, 0.5, 0.0, 0.0]
    assert RampRelease(4).driver == "increments" and RampRelease().driver == "opening"
    assert RampRelease().remaining([0.0, 0.25, 1.0, 2.0]).tolist() == [1.0, 0.75, 0.0, 0.0]


def test_progressive_starts_whole_and_ends_at_the_final_opening() -> None:
    assert ProgressiveRelease().remaining([-0.5, 0.0, 0.25, 1.0, 2.0]).tolist() == [
        1,
        1,
        0.75,
        0,
        0,
    ]
    assert ProgressiveRelease().driver == "opening"


@given(st.floats(0.1, 100.0), st.floats(0.01, 10.0), st.floats(0.1, 1.0))
def test_softening_bond_follows_the_law_and_spends_its_area(
    force: float, final: float, part: float
) -> None:
    soft, w = bond(force, final), np.linspace(0.0, part * final, 11)
    along = np.array([soft.force(float(x)) for x in w])
    np.testing.assert_allclose(
        along, force * ProgressiveRelease().remaining(w / final), atol=1e-12 * force
    )
    # exact for a straight line; all of 1/2 F0 w_f at the end
    assert np.trapezoid(along, w) == pytest.approx(soft.taken(w[-1]), rel=ROUND_OFF)
    assert soft.taken(final) == pytest.approx(0.5 * force * final, rel=ROUND_OFF)


@given(st.floats(0.05, 0.95), st.floats(0.0, 1.0), st.floats(0.1, 100.0))
def test_secant_unloading_gives_back_the_triangle_below_it(
    top: float, part: float, force: float
) -> None:
    up, down = bond(force), bond(force, largest=top)
    assert down.force(top) == pytest.approx(up.force(top), rel=ROUND_OFF)
    # the secant is followed down from its top: round-off is that of the force there
    expected = pytest.approx(part * up.force(top), rel=ROUND_OFF, abs=ROUND_OFF * up.force(top))
    assert down.force(part * top) == expected
    assert down.taken(top) == pytest.approx(up.taken(top), rel=ROUND_OFF)
    # what was dissipated on the way to the top, the triangle 1/2 F0 w_max, stays lost
    assert down.taken(0.0) == pytest.approx(0.5 * force * top, rel=ROUND_OFF)


# --- amplitude ------------------------------------------------------------------------------------


def test_amplitude_release() -> None:
    law = AmplitudeRelease([0.0, 0.5, 1.0], [1.0, 0.75, 0.0])
    assert law.remaining([-1.0, 0.0, 0.25, 0.75, 1.0, 9.0]) == pytest.approx(
        [1.0, 1.0, 0.875, 0.375, 0.0, 0.0]
    )
    assert law.driver == "time"
    assert law.suggested_increment == 1.0
    assert AmplitudeRelease([0.0, 1.0], [1.0, 0.0], 0.1).suggested_increment == 0.1


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: AmplitudeRelease([0, 1], [0.9, 0]), "begins with fraction 0.9 at time 0; it must"),
        (lambda: AmplitudeRelease([0.1, 1], [1, 0]), "begins with fraction 1 at time 0.1; it must"),
        (lambda: AmplitudeRelease([0, 1], [1, 0.1]), "ends with fraction 0.1 at time 1; it must"),
        (lambda: AmplitudeRelease([0], [1]), "ends with fraction 1 at time 0"),
        (lambda: AmplitudeRelease([0, 1, 1], [1, 0.5, 0]), "times must increase"),
        (lambda: AmplitudeRelease([0, 1], [1, math.nan]), r"fractions\[1\] = nan"),
        (lambda: AmplitudeRelease([0, 1], [1, 0], 0.0), "first_increment = 0.0 must be positive"),
        (lambda: RampRelease(0), "RampRelease: increments = 0 must be a whole number, at least 1"),
        (lambda: RampRelease(2.5), "RampRelease: increments = 2.5 must be a whole number"),  # type: ignore[arg-type]
    ],
)
def test_bad_laws_are_refused_when_written(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


# --- viscosity ------------------------------------------------------------------------------------


def viscous(viscosity: float, remaining: float = 1.0) -> ViscousRamp:
    nodes = np.array([0])
    return ViscousRamp(0, nodes, np.array([[1.0, 0.0]]), viscosity, 0.0, remaining)


def test_viscous_release_lags_and_catches_up() -> None:
    # Against the force exp(-t/mu): implicit Euler is of first order.
    errors = []
    for n in (50, 100, 200):
        release = viscous(0.5)
        for k in range(n):
            release.accept(2.0 / n * (k + 1), None)  # type: ignore[arg-type]
        errors.append(abs(release.remaining - np.exp(-4.0)))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([1.0, 1.0], abs=0.1)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1e6), st.floats(1e-6, 1e6))
def test_viscous_release_never_rises(remaining: float, dt: float, mu: float) -> None:
    release = viscous(mu, remaining)
    assert 0.0 <= release.fraction(dt) <= remaining * (1.0 + ROUND_OFF)
    assert release.fraction(0.0) == pytest.approx(remaining, rel=ROUND_OFF, abs=1e-300)
