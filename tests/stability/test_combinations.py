"""Random scenes that combine effects, by seed (tests/stability/combinations.py).

FXCRACK_SEEDS=first:last runs those seeds in place of the slow ones; ``make random SEEDS=0:500``
runs all 500 and writes docs/combinations.md.
"""

from __future__ import annotations

import os

import pytest
from mpi4py import MPI

from stability.combinations import Combination, reference_of
from stability.invariants import faults, run_scene
from stability.random_scenes import check, seeds_of
from stability.relations import broken, difference, relations_of

pytestmark = pytest.mark.stability

GIVEN = os.environ.get("FXCRACK_SEEDS")
QUICK = (7, 24, 36, 40)
SLOW = [s for s in (seeds_of(GIVEN) if GIVEN else range(24)) if s not in QUICK]

FOUND = {
    34: "faces in motion overlapped by 3e-3 of the largest jump after a new pairing",
    44: "bodies that yield, contact that opens: balance off by 2 %",
    253: "path stepping with friction turned back and forth for ever",
}
"""Seeds of scenes that failed once, and of what."""

OPEN = {
    72: "friction on a path, moduli 1 to 1000: the energy balance is off by 8e-8 of the work",
    174: "other numbers of nodes change the energy by 3e-5: an increment is divided where its "
    "energies are off by more than a bound, and after each faces are paired anew",
    264: "other numbers of nodes change f of another tip than the growing one by 6e-4 on a path",
    339: "contact in motion at finite strain: round-off of other units grows to 1e-3 of the energy",
}
"""Seeds of scenes that fail, and of what."""


def fails(seed: int) -> list[str]:
    return check(Combination.of(seed), seed)[1]


@pytest.mark.parametrize("seed", QUICK)
def test_a_few_scenes(seed: int) -> None:
    assert not fails(seed), Combination.of(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SLOW)
def test_scenes(seed: int) -> None:
    assert not fails(seed), Combination.of(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [s for s in FOUND if s not in SLOW])
def test_scenes_that_failed_once(seed: int) -> None:
    c = Combination.of(seed)
    assert not faults(c, run_scene(c)), (c, FOUND[seed])


@pytest.mark.slow
@pytest.mark.parametrize("seed", OPEN)
def test_scenes_that_fail(seed: int) -> None:
    if bad := fails(seed):
        pytest.xfail(f"{bad}: {OPEN[seed]}")


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
@pytest.mark.quick("7", "24")
@pytest.mark.parametrize("seed", [7, 24, 36, 0, 13, 40])
def test_any_number_of_ranks(comm: MPI.Intracomm, seed: int) -> None:
    """One rank and several: the same events, energies and f to 1e-6 of the largest."""
    c = Combination.of(seed)
    reference_of(c)  # on one rank each
    alone, together = run_scene(c), run_scene(c, comm=comm)
    assert alone.history is not None and together.history is not None
    words = difference(alone.history, together.history, 1.0, 1.0)
    assert float(words.split()[0]) < 1e-6, words
