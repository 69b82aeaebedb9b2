"""A few random scenes that combine effects, each relation once, and any number of ranks.

By seed (tests/stability/combinations.py); more of them are in :mod:`stability.test_seeds`.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from mpi4py import MPI

from stability.combinations import Combination, reference_of
from stability.invariants import run_scene
from stability.random_scenes import check
from stability.relations import broken, difference, relations_of

pytestmark = pytest.mark.stability

QUICK = (7, 24, 36, 40)
BY_DEFAULT = (86, 331, 344)
ON_RANKS = (3, 4, 7, 0, 2, 5, 9, 10, 13, 17, 18, 36, 174, 264)


def fails(seed: int) -> list[str]:
    return check(Combination.of(seed), seed)[1]


@pytest.mark.parametrize("seed", QUICK)
def test_a_few_scenes(seed: int) -> None:
    assert not fails(seed), Combination.of(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", BY_DEFAULT)
def test_scenes_in_3d_without_a_named_release(seed: int) -> None:
    c = Combination.of(seed)
    assert c.solid and c.release == "step"
    assert not check(replace(c, release="default"), seed)[1]


@pytest.mark.slow
def test_every_relation_of_one_scene() -> None:
    """Each is tried on a scene in which bonds go, and tells another load apart."""
    c = Combination(criterion="power", load=(0.6, 1.0, 0.0))
    base = run_scene(c)
    assert base.history is not None and base.history[-1]["released[bond0]"] > 0
    for relation in relations_of(c):
        assert not broken(c, base, relation)
    other = run_scene(Combination(criterion="power", load=(0.6, 1.001, 0.0)))
    assert other.history is not None
    assert float(difference(base.history, other.history, 1.0, 1.0).split()[0]) > 1e-5


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.quick("3", "4", "7")
@pytest.mark.parametrize("seed", ON_RANKS)
def test_any_number_of_ranks(comm: MPI.Intracomm, seed: int) -> None:
    """One rank and several: the same events, energies and f to 1e-8 of the largest.

    Another order of sums leaves 1e-12; more means that round-off has decided something.
    """
    c = Combination.of(seed)
    reference_of(c)  # on one rank each
    alone, together = run_scene(c), run_scene(c, comm=comm)
    assert alone.history is not None and together.history is not None
    words = difference(alone.history, together.history, 1.0, 1.0)
    assert float(words.split()[0]) < 1e-8, (c, words)
