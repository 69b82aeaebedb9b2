"""Which jumps take part in the condensation, and how far the retained set reaches."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from specimens import STEEL, bond

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.condensation.retained import CostModel, choose_roles
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.front import Front
from fxcrack.interface.jump_coordinates import FIXED, FREE, RETAINED
from fxcrack.interface.pair import Pair
from fxcrack.interface.pairing import make_pair
from fxcrack.meshes.dcb import dcb_2d

Roles = npt.NDArray[np.int8]


@pytest.fixture(scope="module")
def continuum() -> Continuum:
    mesh = dcb_2d(MPI.COMM_SELF, length=40.0, dx=1.0, ny=1)
    return Continuum(mesh, STEEL, fx.PlaneStrain())


def roles(
    continuum: Continuum,
    *,
    reach: float = np.inf,
    active: bool = True,
    cost: CostModel | None = None,
    cap_mb: float = 100.0,
    order: float = 20.0,
    **options: object,
) -> tuple[Pair, Roles]:
    """Roles of the jumps of a crack up to x = 20, sorted along x."""
    pair = make_pair(continuum, bond(order, **options))
    front = Front(pair.surface, pair.bonded, "bond")
    (found,) = choose_roles(
        [pair], [front], [active], [reach],
        CostModel(plain=1.0, per_entry=1e-9) if cost is None else cost,
        cap_mb=cap_mb, gdim=2,
    )  # fmt: skip
    return pair, found[np.argsort(pair.surface.x[:, 0])]


def test_cheap_entries_take_the_whole_path(continuum: Continuum) -> None:
    _, found = roles(continuum)
    # two open nodes behind the tip, everything bonded ahead; the rest of the wake is free
    assert np.all(found[18:] == RETAINED) and np.all(found[:18] == FREE)


def test_inactive_interfaces_stay_tied(continuum: Continuum) -> None:
    _, found = roles(continuum, active=False)
    assert np.all(found[20:] == FIXED) and np.all(found[:20] == FREE)


def test_no_farther_than_the_step_asks(continuum: Continuum) -> None:
    _, found = roles(continuum, reach=5.0)
    assert np.all(found[18:26] == RETAINED) and np.all(found[26:] == FIXED)
    # two rows ahead in any case
    _, found = roles(continuum, reach=0.0)
    assert np.all(found[18:23] == RETAINED) and np.all(found[23:] == FIXED)


def test_contact_watches_all_open_normals(continuum: Continuum) -> None:
    _, found = roles(continuum, reach=0.0, contact=True)
    assert np.all(found[:23, 0] == RETAINED)
    assert np.all(found[:18, 1] == FREE) and np.all(found[18:23, 1] == RETAINED)


def test_bonds_in_the_normal_direction_leave_slips_free(continuum: Continuum) -> None:
    _, found = roles(continuum, reach=3.0, normal_only=True)
    assert np.all(found[20:24, 0] == RETAINED) and np.all(found[24:, 0] == FIXED)
    assert np.all(found[20:, 1] == FREE)


def test_expensive_entries_take_a_part(continuum: Continuum) -> None:
    """The part with the least cost in all; fewer the dearer an entry of S is."""
    sizes = []
    for per_entry in (1e-9, 6e-4, 1e-1):
        _, found = roles(continuum, cost=CostModel(plain=0.1, per_entry=per_entry))
        sizes.append(int((found == RETAINED).sum()))
        # without holes
        ahead = np.flatnonzero((found == RETAINED).all(axis=1))
        assert np.array_equal(ahead, np.arange(18, 18 + len(ahead)))
    assert sizes[0] == 46 > sizes[1] > sizes[2] >= 10


def test_memory_cap(continuum: Continuum) -> None:
    """Twice S in 8-byte numbers: 1.6 kB hold 10 components, which the smallest set needs."""
    _, found = roles(continuum, cap_mb=16 * 20**2 / 1e6)
    assert (found == RETAINED).sum() == 20
    _, found = roles(continuum, cap_mb=16 * 10**2 / 1e6)
    assert (found == RETAINED).sum() == 10
    with pytest.raises(InputError, match="at least 10 jump components must be retained"):
        roles(continuum, cap_mb=16 * 9.5**2 / 1e6)


@given(
    st.floats(1e-3, 1e3),
    st.floats(1e-9, 1e-3),
    st.lists(st.integers(1, 6), min_size=1, max_size=40),
)
def test_reach_is_the_cheapest(plain: float, entry: float, steps: list[int]) -> None:
    model = CostModel(plain, entry)
    counts = 10 + np.cumsum(steps)
    n = model.reach(counts)
    assert 1 <= n <= len(counts)
    # as many factorisations as parts of this size are needed
    total = [
        np.ceil(len(counts) / (i + 1)) * (plain + entry * float(c) ** 2)
        for i, c in enumerate(counts)
    ]
    assert total[n - 1] == pytest.approx(min(total))
    assert model.reach(counts[:0]) == 0


@given(st.integers(0, 5000), st.floats(1e-3, 1e3))
def test_observed_times_are_met(n: int, seconds: float) -> None:
    model = CostModel.guess(100_000, 3)
    ratio = model.per_entry / model.plain
    model.observe(n, seconds)
    assert model.plain + model.per_entry * n**2 == pytest.approx(seconds)
    assert model.per_entry / model.plain == pytest.approx(ratio)
