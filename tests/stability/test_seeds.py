"""Random scenes by seed: some of them, and those that failed once.

FXCRACK_SEEDS=first:last runs those seeds in place of the first ones; ``make random SEEDS=0:500``
runs all 500 and writes docs/combinations.md.
"""

from __future__ import annotations

import os

import pytest

from stability.combinations import Combination
from stability.invariants import faults, run_scene
from stability.random_scenes import check, seeds_of

pytestmark = [pytest.mark.stability, pytest.mark.slow]

GIVEN = os.environ.get("FXCRACK_SEEDS")
SEEDS = seeds_of(GIVEN) if GIVEN else range(24)

FOUND = {
    34: "faces in motion overlapped by 3e-3 of the largest jump after a new pairing",
    44: "bodies that yield, contact that opens: balance off by 2 %",
    67: "exact closure: f jumped over 1 where bodies began to yield, and was looked for for ever",
    72: "friction in 3-D: work of contact that changed within an increment, 8e-8 of the energy",
    174: "above a node of the other face round-off chose whether faces were paired anew",
    194: "bonds softened in mixed mode in motion: faces overlapped by 3e-3 of the largest jump",
    253: "path stepping with friction turned back and forth for ever",
    264: "likewise, on a path: f of another tip than the growing one differed by 6e-4",
    339: "likewise, in motion: other units changed the energies by 1e-3",
    392: "a new pairing beside a bond that is neutral at onset went past its softening: contact "
    "did not settle, and the step stopped",
    407: "faces were paired anew where f had just come to 1 and went above it: event stepping "
    "released there, path stepping went back, and the onset loads differed by 4e-5",
    441: "a resumed step went on with the tangent of another state, 2e-7 of the work",
    480: "a new pairing after a release moved the faces far: 2e-4 of the energy was missing",
}
"""Seeds of scenes that failed once, and of what."""

WITH_RELATION = (174, 264, 339, 407, 441)
"""Those in which another description, or a restart, gave another history."""


def fails(seed: int) -> list[str]:
    return check(Combination.of(seed), seed)[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_scenes(seed: int) -> None:
    assert not fails(seed), Combination.of(seed)


@pytest.mark.parametrize("seed", [s for s in FOUND if s not in SEEDS])
def test_scenes_that_failed_once(seed: int) -> None:
    c = Combination.of(seed)
    bad = fails(seed) if seed in WITH_RELATION else faults(c, run_scene(c))
    assert not bad, (c, FOUND[seed])
