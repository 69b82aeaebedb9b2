"""Surfaces that continue each other: one interface, on which a crack goes from one to the next."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import PINS, STEEL, column, onsets

import fxcrack as fx
from fxcrack.base.errors import InterfaceError, MeshError
from fxcrack.meshes.blocks import Blocks, build

HEIGHT, LENGTH, TURN = 1.5, 40.0, 12.0
TOUGH, TOUGHER = 0.2, 0.4


def halves(comm: MPI.Intracomm) -> fx.Mesh:
    """A double cantilever beam whose faces have a group on either side of x = 12."""

    def make() -> Blocks:
        model = Blocks()
        x = np.linspace(0.0, LENGTH, 81)
        for name, end in (("up", HEIGHT), ("low", -HEIGHT)):
            y = np.sort(np.linspace(0.0, end, 3))
            arm = model.add(f"{name} arm", [x, y], "quadrilateral", 1)
            shape, rows = arm.part(y=0.0)
            middle = arm.points()[rows - arm.first, 0].mean(axis=1)
            model.group(f"{name} west", (shape, rows[middle < TURN]))
            model.group(f"{name} east", (shape, rows[middle > TURN]))
            model.group(f"{name} whole", (shape, rows))
            model.group("pin_top" if end > 0 else "pin_bottom", arm.part(x=0.0, y=end))
        return model

    return build(comm, "halves", make)


def toughness(x: Any) -> Any:
    """Twice as much in the east."""
    return np.where(x[0] < TURN - 1e-9, TOUGH, TOUGHER)


def grown(mesh: fx.Mesh, *faces: str) -> fx.History:
    """The crack from x = 10 into the eastern half."""
    face = fx.Interface(*faces, bonded=lambda x: x[0] >= 10.0 - 1e-9, name="bond")
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=PINS,
        debonds=[fx.Debond(face, fx.VCCT(GIc=toughness))],
    )
    return scene.run(fx.Static(until=fx.CrackLength(face, 14.0)), progress=False)


@pytest.mark.mpi
@pytest.mark.three
def test_a_crack_passes_from_one_surface_to_the_next(comm: MPI.Intracomm) -> None:
    mesh = halves(comm)
    whole = grown(mesh, "up whole", "low whole")
    joined = mesh.joined("up", ["up west", "up east"]).joined("low", ["low east", "low west"])
    assert "up" not in mesh.groups and len(mesh.groups) == len(joined.groups) - 2
    passed = grown(joined, "up", "low")
    a = column(onsets(passed), "a[bond]")
    assert a[0] == pytest.approx(10.0) and a[-1] == pytest.approx(13.5)
    wanted = np.where(a < TURN - 1e-9, TOUGH, TOUGHER)
    assert column(onsets(passed), "GI[bond]") == pytest.approx(wanted, rel=1e-9)
    # the same nodes and facets as a surface that was one from the start
    for name in ("a[bond]", "GI[bond]", "R[pin_top.y]", "strain_energy"):
        assert column(passed.rows, name) == pytest.approx(column(whole.rows, name), rel=1e-9)


def test_two_interfaces_with_a_node_in_common_are_told_how() -> None:
    mesh = halves(MPI.COMM_SELF)
    west, east = (fx.Interface(f"up {s}", f"low {s}", name=s, bonded=lambda x: x[0] >= 10.0 - 1e-9)
                  for s in ("west", "east"))  # fmt: skip
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=PINS,
        debonds=[fx.Debond(i, fx.VCCT(GIc=TOUGH)) for i in (west, east)],
    )
    with pytest.raises(InterfaceError, match=r"one interface: mesh\.joined\('whole', "):
        scene.run(fx.Static(until=fx.Releases(1)), progress=False)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ([], "give a list of names"),
        ("up west", "give a list of names"),
        (["up west", "up eats"], "did you mean 'up east'"),
        (["up west", "up arm"], "different dimensions"),
    ],
)
def test_groups_that_cannot_be_joined(parts: Any, words: str) -> None:
    mesh = halves(MPI.COMM_SELF)
    with pytest.raises(MeshError, match=words):
        mesh.joined("up", parts)
    with pytest.raises(MeshError, match="has a group 'up east' already"):
        mesh.joined("up east", ["up west"])
    with pytest.raises(MeshError, match="name = 5 must be a text"):
        mesh.joined(5, ["up west"])  # type: ignore[arg-type]
