"""Slips of the pen are told from each other, and none is taken for something else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d

BOND = fx.Interface("upper_face", "lower_face", bonded=lambda x: x[0] >= 2.0, name="bond")
PARTS: dict[str, Any] = {
    "materials": fx.Isotropic(E=70e3, nu=0.3),
    "model": fx.PlaneStrain(),
    "supports": [
        fx.Displacement("pin_top", x=0.0, y=1.0),
        fx.Displacement("pin_bottom", x=0.0, y=-1.0),
    ],
    "debonds": [fx.Debond(BOND, fx.VCCT(GIc=0.2))],
}


@pytest.fixture(scope="module")
def mesh() -> fx.Mesh:
    return dcb_2d(length=6.0, height=1.0, dx=1.0, ny=1)


def run(mesh: fx.Mesh, step: Any = None, **parts: Any) -> fx.History:
    return fx.Scene(mesh, **(PARTS | parts)).run(step or fx.Static(until=fx.Releases(1)))


def push(**words: Any) -> list[fx.Displacement]:
    return [fx.Displacement("pin_top", x=0.0, y=1.0, **words), PARTS["supports"][1]]


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"model": fx.PlaneStrain}, "PlaneStrain is a class"),
        ({"materials": {"upper": fx.Isotropic, "lower": PARTS["materials"]}}, "not a material"),
        ({"supports": PARTS["supports"][0]}, r"write supports=\[...\]"),
        ({"effects": fx.FiniteStrain()}, r"write effects=\[...\]"),
        ({"debonds": [BOND]}, r"debonds\[0\] is Interface"),
        ({"supports": push(amplitude=2.0)}, "give Amplitude"),
        ({"loads": [fx.PointForce("pin_top", 1.0)]}, "no list of components"),  # type: ignore[arg-type]
        ({"step": fx.Time(1.0)}, "step is Time"),
        ({"newton": {"reuse": False}}, "newton is dict"),
        ({"supports": [fx.Displacement("pin_tap", y=1.0)]}, "did you mean 'pin_top'"),
    ],
)
def test_parts_of_the_wrong_kind(mesh: fx.Mesh, parts: dict[str, Any], words: str) -> None:
    with pytest.raises(fx.InputError, match=words):
        run(mesh, **parts)


@pytest.mark.parametrize(
    "make",
    [
        lambda: fx.Static(until=1.0),  # type: ignore[arg-type]
        lambda: fx.Cycles(maximum=1.0, ratio=0.1, until=40.0),  # type: ignore[arg-type]
        lambda: fx.mesh_from_gmsh(None, split=fx.Split("glue", "s", "m", (0.0, 1.0))),  # type: ignore[arg-type]
        lambda: fx.VCCT(GIc="0.2"),  # type: ignore[arg-type]
        lambda: fx.Isotropic("70e3", 0.3),  # type: ignore[arg-type]
        lambda: fx.PlaneStrain(thickness="25"),  # type: ignore[arg-type]
        lambda: fx.Inertia(density=1.0, velocity=1.0),  # type: ignore[arg-type]
        lambda: fx.Debond(BOND, fx.VCCT(GIc=0.2), "step"),  # type: ignore[arg-type]
        lambda: fx.Debond(BOND, fx.VCCT(GIc=0.2), fx.StepRelease),  # type: ignore[arg-type]
    ],
)
def test_values_of_the_wrong_kind(make: Callable[[], Any]) -> None:
    words = (
        "until|not a number|write split=|thickness = '25'|one entry per component|must lie between"
        "|allow at least one|no release law"
    )
    with pytest.raises(fx.InputError, match=words):
        make()


def test_a_list_of_end_conditions_ends_at_the_first(mesh: fx.Mesh) -> None:
    ends = [fx.Time(1e-3), fx.CrackLength(BOND, 4.0)]
    history = run(mesh, fx.Static(until=ends), debonds=[fx.Debond(BOND, fx.VCCT(GIc=1e6))])
    assert history.reason == "time 0.001 reached"
    assert history[-1]["a[bond]"] < 4.0


def test_temperature_that_strains_nothing_is_told(
    mesh: fx.Mesh, caplog: pytest.LogCaptureFixture
) -> None:
    fx.Scene(mesh, **PARTS, effects=[fx.Temperature(10.0)])
    if mesh.comm.rank == 0:
        assert "no material expands" in caplog.text
    caplog.clear()
    warm = {"materials": fx.Isotropic(70e3, 0.3, expansion=1e-5)}
    fx.Scene(mesh, **(PARTS | warm), effects=[fx.Temperature(10.0)])
    assert not caplog.text


def test_a_mesh_says_its_groups_not_its_entities(mesh: fx.Mesh) -> None:
    assert "upper (dim 2)" in repr(mesh) and "array" not in repr(mesh)


def test_a_dynamic_step_needs_inertia(mesh: fx.Mesh) -> None:
    with pytest.raises(fx.InputError, match=r"effects=\[Inertia\(\)\]"):
        run(mesh, fx.Dynamic(until=fx.Time(1.0), dt=0.1))


def test_a_scene_without_load_says_so(mesh: fx.Mesh) -> None:
    still = [fx.Displacement("pin_top", x=0.0, y=0.0), fx.Displacement("pin_bottom", x=0.0, y=0.0)]
    assert "no load acts" in run(mesh, supports=still).reason


@pytest.mark.parametrize("method", ["vcct", "closure"])
def test_arms_that_are_pressed_together_never_separate(mesh: fx.Mesh, method: str) -> None:
    """Without contact G_I is negative and counts as zero; what is left is round-off of G_II."""
    press = [fx.Displacement("pin_top", x=0.0, y=-1.0), fx.Displacement("pin_bottom", x=0.0, y=1.0)]
    debonds = [fx.Debond(BOND, fx.VCCT(GIc=0.2, method=method))]
    history = run(mesh, supports=press, debonds=debonds)
    assert "not reached" in history.reason
    assert not any(row["event"] == "release" for row in history)
