"""The growing Cholesky factor against scipy, through any sequence of appends and removals."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from fxcrack.equilibrium import growing_cholesky
from fxcrack.equilibrium.growing_cholesky import GrowingCholesky, NotPositiveDefinite

Array = npt.NDArray[np.float64]

N = 150  # more than two tiles of the blocked substitution
ROUND_OFF = 1e-10  # condition numbers below 1e4, a hundred operations


def spd(n: int, seed: int) -> Array:
    """Symmetric, eigenvalues from 0.01 to 1."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    return (q * np.geomspace(0.01, 1.0, n)) @ q.T


def assert_right(factor: GrowingCholesky, matrix: Array, rng: np.random.Generator) -> None:
    free = factor.free
    assert len(factor) == len(np.unique(free)) == len(free)
    block = matrix[np.ix_(free, free)]
    for shape in ((len(free),), (len(free), 3)):
        right = rng.standard_normal(shape)
        expected = scipy.linalg.solve(block, right, assume_a="pos") if len(free) else right
        assert factor.solve(right) == pytest.approx(expected, abs=ROUND_OFF * 100)
        assert factor.backward(factor.forward(right)) == pytest.approx(
            expected, abs=ROUND_OFF * 100
        )
    if len(free):
        lower = scipy.linalg.cholesky(block, lower=True)
        right = rng.standard_normal(len(free))
        expected = scipy.linalg.solve_triangular(lower, right, lower=True)
        assert factor.forward(right) == pytest.approx(expected, abs=ROUND_OFF * 10)
        k = len(free) // 2
        unit = np.eye(len(free))[k]
        assert factor.backward(factor.forward(unit, start=k)) == pytest.approx(
            scipy.linalg.solve(block, unit, assume_a="pos"), abs=ROUND_OFF * 100
        )
    rest = np.setdiff1d(np.arange(len(matrix)), free)[:4]
    _, star = factor.reduced(rest)
    coupling = matrix[np.ix_(free, rest)]
    inner = scipy.linalg.solve(block, coupling) if len(free) else coupling
    expected = matrix[np.ix_(rest, rest)] - coupling.T @ inner
    assert star == pytest.approx(expected, abs=ROUND_OFF)


operations = st.lists(
    st.tuples(st.booleans(), st.integers(1, 70), st.integers(0, 10**6)), min_size=1, max_size=8
)


@settings(max_examples=40)
@given(operations, st.integers(0, 3))
def test_any_sequence(steps: list[tuple[bool, int, int]], seed: int) -> None:
    matrix = spd(N, seed)
    factor = GrowingCholesky(matrix)
    rng = np.random.default_rng(seed)
    for grow, count, pick in steps:
        pool = np.setdiff1d(np.arange(N), factor.free) if grow else factor.free
        chosen = np.random.default_rng(pick).permutation(pool)[:count]
        before = factor.free.copy()
        if grow:
            factor.append(chosen)
            assert np.array_equal(factor.free, np.concatenate([before, chosen]))
        else:
            first = factor.remove(chosen)
            assert np.array_equal(factor.free, before[~np.isin(before, chosen)])
            assert np.array_equal(factor.free[:first], before[:first])
    assert_right(factor, matrix, rng)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 130), st.integers(1, 5), st.integers(0, 10**6))
def test_unrestrained_unknown_changes_nothing(n_free: int, n_extra: int, pick: int) -> None:
    """S is singular once all are free: appending the last ones fails, whatever comes with them."""
    n = n_free + n_extra
    mode = np.random.default_rng(pick).uniform(0.5, 1.0, n)  # every unknown takes part in it
    project = np.eye(n) - np.outer(mode, mode) / (mode @ mode)
    matrix = project @ spd(n, pick % 7) @ project
    order = np.random.default_rng(pick).permutation(n)
    factor = GrowingCholesky(matrix)
    factor.append(order[:n_free])
    with pytest.raises(NotPositiveDefinite) as found:
        factor.append(order[n_free:])
    assert found.value.index in order[n_free:]
    assert np.array_equal(factor.free, order[:n_free])
    assert_right(factor, matrix, np.random.default_rng(0))
    # the others are restrained as long as one of them is held
    factor.append(order[n_free:-1])
    assert_right(factor, matrix, np.random.default_rng(1))


@pytest.mark.parametrize("seed", range(4))
def test_large_sets_are_factored_anew_in_pieces(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Beyond AT_ONCE unknowns removal takes the rest from S again, some at a time."""
    monkeypatch.setattr(growing_cholesky, "AT_ONCE", 13)
    matrix, rng = spd(N, seed), np.random.default_rng(seed)
    factor = GrowingCholesky(matrix)
    factor.append(rng.permutation(N)[:120])
    anew = []
    whole = GrowingCholesky._factor_anew
    monkeypatch.setattr(
        GrowingCholesky, "_factor_anew", lambda *given: (anew.append(1), whole(*given))
    )
    for count in (1, 30, 5):
        before = factor.free.copy()
        gone = before[rng.permutation(len(before) // 3)[:count]]
        first = factor.remove(gone)
        assert np.array_equal(factor.free, before[~np.isin(before, gone)])
        assert np.array_equal(factor.free[:first], before[:first])
        assert_right(factor, matrix, rng)
        factor.append(gone)
        assert_right(factor, matrix, rng)
    assert anew


@pytest.mark.parametrize("stiffness", [0.0, 1e-6])
def test_round_off_at_a_long_lever_holds_nothing(stiffness: float) -> None:
    """A body that turns about a far support: the last unknown moves little, the others much.

    An error of the entry that moves most comes back in the last pivot times the square of its
    lever, far beyond the round-off of the last diagonal entry; a real stiffness is larger still.
    """
    lever = np.array([30.0, 20.0, 10.0, 5.0, 1.0])
    project = np.eye(5) - np.outer(lever, lever) / (lever @ lever)
    matrix = project @ spd(5, 1) @ project
    matrix[0, 0] += 1e-11 + stiffness
    factor = GrowingCholesky(matrix)
    factor.round_off = np.full(5, 1e-10)
    factor.append(np.arange(4))
    pivot = float(factor.reduced(np.array([4]))[1][0, 0])
    assert pivot == pytest.approx(lever[0] ** 2 * (1e-11 + stiffness), rel=1e-2)
    if stiffness:
        factor.append(np.array([4]))
        assert len(factor) == 5
    else:
        with pytest.raises(NotPositiveDefinite):
            factor.append(np.array([4]))


def test_nothing_free() -> None:
    factor = GrowingCholesky(spd(5, 0))
    assert factor.solve(np.zeros(0)).shape == (0,)
    assert factor.remove(np.array([2])) == 0
    y, star = factor.reduced(np.array([1, 3]))
    assert y.shape == (0, 2) and np.array_equal(star, spd(5, 0)[np.ix_([1, 3], [1, 3])])
