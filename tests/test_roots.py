"""Searches for f = 1: bounded numbers of trials, whatever the function is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fxcrack.base.roots import Bracket, bracketed_root

HARD: dict[str, Callable[[float], float]] = {
    "linear": lambda x: x - 0.3,
    "flat, then steep": lambda x: x**60 - 0.5**60,
    "steep, then flat": lambda x: np.sqrt(x) - np.sqrt(1e-7),
    "jump": lambda x: -1.0 if x < 0.7371 else 1.0,
    "jump from almost nothing": lambda x: -1e-9 if x < 0.123 else 1e9,
    "triple": lambda x: (x - 0.4) ** 3,
}


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_root_of_hard_functions(name: str, sign: float) -> None:
    """The root to round-off of the function, on the far side where there is none."""
    function, trials = HARD[name], 0

    def counted(x: float) -> float:
        nonlocal trials
        trials += 1
        return sign * function(x)

    ends = sign * function(0.0), sign * function(1.0)
    x = bracketed_root(counted, 0.0, 1.0, *ends, close=4e-15)
    assert sign * function(x) * ends[1] >= 0.0 or abs(function(x)) < 4e-15
    before = x * (1.0 - 1e-14) - 1e-16
    assert function(x) == pytest.approx(0.0, abs=4e-15) or function(before) * function(x) < 0.0
    assert trials <= 130, trials
    assert trials <= 3 or name != "linear"


@given(
    root=st.floats(1e-9, 1.0 - 1e-9), side=st.sampled_from(["low", "high", "ends"]),
    seed=st.integers(0, 100),
)  # fmt: skip
def test_bracket_is_halved_whatever_is_guessed(root: float, side: str, seed: int) -> None:
    """Guesses that always lie at the far end of the bracket: three trials more than halving."""
    rng = np.random.default_rng(seed)
    low, high = 0.0, 1.0
    bracket = Bracket(low, high)
    for trial in range(1, 44):
        end = {"low": 0.0, "high": 1.0}.get(side, float(rng.integers(2)))
        x = bracket.admit(low + end * (high - low), high, low)
        assert low <= x <= high
        low, high = (x, high) if x < root else (low, x)
        assert high - low <= 2.0 ** (3 - trial) * (1.0 + 1e-9)
    assert bracket.trials == 43


def test_good_guesses_are_left_alone() -> None:
    """A guess that narrows the bracket enough is taken as it is."""
    bracket = Bracket(2.0, 1.0)
    for guess in (1.9, 1.01, 1.5):
        assert bracket.admit(guess, 2.0, 1.0) == guess
    assert bracket.admit(1.999, 2.0, 1.0) == pytest.approx(1.5)
