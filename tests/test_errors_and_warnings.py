"""Errors, warnings and silent behaviour: every documented condition, in one table.

A row is triggered here, or it names the test that does. Rows about keyword decks and explicit
dynamics are listed with the reason why nothing here can trigger them.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import dcb, fatigue_law, specimen
from test_criteria_in_analysis import plate, run
from test_errors_growth import REFUSED, interface, scene_of

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Attributes:
        condition: The row's first column, shortened.
        reaction: "error", "warning", "stop" (the step ends and keeps what it has), "silent" or
            "none" where the row does not concern this part.
        trigger: What brings it about; returns a reason where the reaction is a stop.
        words: Parts of the message.
        tests: Tests elsewhere that bring it about, as "module.function".
        why_not: Why nothing can trigger it here.
    """

    condition: str
    reaction: str
    trigger: Callable[[], Any] | None = None
    words: tuple[str, ...] = ()
    tests: tuple[str, ...] = ()
    why_not: str = ""


def refused(case: str) -> Row:
    """A row that test_errors_growth.py has a case for."""
    make, words = REFUSED[case]
    return Row(case, "error", make, words)


def strict_set() -> Any:
    return scene_of(fx.Debond(interface(bonded="right", strict=True), fx.VCCT(GIc=0.1)))


def held_faces() -> Any:
    clamped = [fx.Displacement(f"far_{s}", x=0.0, y=0.0) for s in ("upper", "lower")]
    pulled = [fx.Displacement(f"pin_{s}", y=y) for s, y in (("top", 1.0), ("bottom", -1.0))]
    scene = specimen(dcb_2d(MPI.COMM_SELF, dx=2.0, ny=1), supports=[*clamped, *pulled])
    return scene.run(fx.Static(until=fx.Time(0.1)))


def midside_tip() -> Any:
    mesh = dcb_2d(MPI.COMM_SELF, length=20.0, dx=1.0, ny=1, order=2)
    # a bonded midside node whose corners are both open
    lone = fx.Interface("upper_face", "lower_face", lambda x: np.abs(x[0] - 7.5) < 0.1, name="bond")
    return specimen(mesh, interface=lone)


def too_many_cutbacks() -> str:
    scene = plate(fx.CriticalStress(100.0, distance=0.25, tolerance=1e-3))
    step = {"stepping": "increment", "initial": 1e-3, "max_cutbacks": 2}
    return run(scene, fx.Releases(2), **step).reason


def below_the_minimum() -> str:
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1, criterion=fx.VCCT(GIc=0.2, tolerance=1e-5))
    step = {"stepping": "increment", "initial": 0.5, "minimum": 0.4, "max_cutbacks": 99}
    return run(scene, fx.Releases(2), **step).reason


def fatigue_outside_cycles() -> Any:
    return run(dcb(MPI.COMM_SELF, dx=2.0, ny=1, criterion=fatigue_law()), fx.Time(1.0))


def open_ended_cycle() -> Any:
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1, criterion=fatigue_law())
    return scene.run(fx.Cycles(period=(0.5, 1.5)))


def curve_of_openings_ends() -> None:
    f = fx.CrackOpening(([0.0, 2.0], [0.1, 0.3]), distance=1.0).value([0.3, 0.3], [2.0, 50.0])
    assert f.tolist() == [1.0, 1.0]


def curve_of_lengths_ends() -> None:
    curve = fx.CrackLengthVsTime((0.0, 1.0), (0.5, 1.25), reference="upper_face")
    little = fx.Displacement("bottom", x=0.0, y=0.0), fx.Displacement("top", x=0.0, y=1e-3)
    scene = plate(curve, supports=list(little))
    history = run(scene, fx.Releases(100))
    assert history.reason == "the curves of crack length against time have ended"
    assert history["time"][-1] == 1.0


DECK, EXPLICIT = "a matter of keyword decks", "a matter of explicit dynamics"
ROWS = [
    Row("node set missing: whole pair bonded, no tip", "warning",
        tests=("test_errors_growth.test_no_set_bonds_everything",)),
    Row("node of the set not on the slave surface", "warning",
        tests=("test_errors_growth.test_set_with_nodes_off_the_surface",)),
    Row("node of the set not on the slave surface, strict", "error", strict_set,
        ("interface 'bond'", "nodes of bonded set 'right' are not slave nodes", "one of them at (",
         "take them out of the set", "strict=True")),
    refused("self-contact"),
    Row("surfaces that share nodes", "error",
        tests=("test_interface_pairing.test_shared_nodes",)),
    Row("finite-sliding surface-to-surface contact", "none",
        why_not="the pairing is that of small sliding; there is no such formulation to choose"),
    refused("normal only with VCCT"),
    refused("normal only with enhanced VCCT"),
    Row("normal only with fatigue", "error",
        lambda: fx.Debond(interface(normal_only=True), fatigue_law()),
        ("interface 'bond'", "not possible with Fatigue", "bond in all directions")),
    refused("symmetry without normal only"),
    Row("more than one criterion on a pair", "error",
        tests=("test_errors_growth.test_two_criteria_on_a_pair",)),
    refused("no criterion"),
    Row("COD distance outside the pair", "error",
        tests=("test_errors_growth.test_opening_beyond_the_end_of_the_pair",)),
    Row("stress distance outside the bonded part", "error",
        tests=("test_errors_growth.test_stress_beyond_the_bonded_part",)),
    Row("first tabulated length beyond the first bonded node", "warning",
        tests=("test_errors_growth.test_first_tabulated_length_beyond_the_first_bonded_node",
               "test_errors_growth.test_one_tip_that_never_propagates")),
    Row("end of the table of lengths: no extrapolation", "silent", curve_of_lengths_ends),
    Row("end of the table of openings: no extrapolation", "silent", curve_of_openings_ends),
    Row("stress, COD, length criterion in 3-D", "silent",
        tests=("test_coverage.test_every_cell_on_any_number_of_ranks",)),
    Row("stress, COD, length, enhanced or fatigue criterion in explicit", "none", why_not=EXPLICIT),
    Row("fatigue outside a fatigue procedure", "error", fatigue_outside_cycles,
        ("interface 'bond' has a Fatigue criterion, which needs cycles", "fx.Cycles")),
    Row("another criterion inside a fatigue procedure", "error",
        tests=("test_fatigue.test_criterion_and_step_must_go_together",)),
    Row("amplitude that is not cyclic in a fatigue step", "error",
        tests=("test_fatigue.test_amplitudes_must_be_cyclic_and_change",)),
    Row("toughness missing at a slave node", "error",
        tests=("test_toughness_in_analysis.test_every_slave_node_needs_a_value",)),
    Row("toughness per slave node with enhanced VCCT", "error",
        lambda: fx.EnhancedVCCT(GIc=np.full(5, 0.2), GIc_p=0.1),
        ("EnhancedVCCT: GIc is given per slave node", "only VCCT and fatigue allow")),
    Row("SEARCH NSET with SEARCH ABOVE or BELOW", "none", why_not=DECK),
    Row("explicit surface does not extend past the set", "none", why_not=EXPLICIT),
    Row("explicit bonded set without interaction", "none", why_not=EXPLICIT),
    Row("boundary condition on crack-surface nodes, both faces alike", "information", held_faces,
        ("interface 'bond': supports hold both faces at 1 of its bonded nodes", "(100, 0, 0)",
         "cannot open and show no force")),
    Row("boundary condition on crack-surface nodes, one face", "error",
        tests=("test_interface_pairing.test_support_on_slave_but_not_on_master",)),
    Row("quadratic tip at a midside node", "error", midside_tip,
        ("interface 'bond': the tip at (7.5, 0, 0) is a midside node", "whole element faces",
         "begin at a corner node")),
    Row("less than two rows behind the front", "none",
        why_not="a rule of the surface-to-surface formulation; pairs are node to surface"),
    refused("amplitude that does not begin with 1"),
    refused("amplitude that begins late"),
    refused("amplitude that does not end with 0"),
    Row("f above its range after all cutbacks", "stop", too_many_cutbacks,
        ("stopped: f = ", "after 2 cutbacks", "max_cutbacks")),
    Row("increment below the minimum", "stop", below_the_minimum,
        ("stopped: f = ", "below the minimum 0.4")),
]  # fmt: skip


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.condition)
def test_row(row: Row, caplog: pytest.LogCaptureFixture) -> None:
    for name in row.tests:
        module, function = name.split(".")
        assert callable(getattr(importlib.import_module(module), function)), name
    if row.trigger is None:
        assert row.tests or (row.reaction == "none" and row.why_not)
        return
    if row.reaction == "error":
        with pytest.raises(fx.InputError) as error:
            row.trigger()
        message = str(error.value)
    else:
        caplog.set_level(logging.INFO if row.reaction == "information" else logging.WARNING)
        found = row.trigger()
        message = caplog.text
        if row.reaction == "stop":
            assert found in message  # warned of, too
        if row.reaction == "silent":
            assert not message
    assert row.words or row.reaction == "silent"
    for word in row.words:
        assert word in message
