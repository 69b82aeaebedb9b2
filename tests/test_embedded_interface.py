"""Interfaces that end inside a body: as one that goes on, bonded, to the edge of the body."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import on_root
from fxcrack.mesh.read import gmsh_model, prepare
from fxcrack.meshes.blocks import Blocks

LINE = np.linspace(-4.0, 4.0, 17)
BORDER, A = 2.5, 1.0


def plate(comm: MPI.Comm, half: float, order: int, z: tuple[np.ndarray, ...] = ()) -> fx.Mesh:
    """A square plate split along y = 0 where abs(x) < half."""

    def make() -> Blocks:
        model = Blocks()
        cell = "hexahedron" if z else "quadrilateral"
        block = model.add("body", (LINE, LINE, *z), cell, order)
        shape, rows = block.part(y=0.0)
        x = block.points()[rows].mean(axis=1)
        model.group("cut", (shape, rows[abs(x[:, 0]) < half]))
        model.group("top", block.part(y=4.0))
        model.group("bottom", block.part(y=-4.0))
        return model

    def work() -> object:
        with gmsh_model("plate") as gmsh:
            make().write(gmsh.model)
            up = (0.0, 1.0, 0.0)[: 3 if z else 2]
            return prepare(gmsh.model, "plate", split=[fx.Split("cut", "up", "low", up)])

    return distribute(on_root(comm, work), comm, "plate")


def history(mesh: fx.Mesh, *, contact: bool = False, **options: object) -> fx.History:
    """Pulled and sheared until three nodes have gone, and one or two stand before the border."""
    bond = fx.Interface(
        "up", "low", bonded=lambda x: abs(x[0]) > A - 1e-9, name="bond", contact=contact
    )
    solid = mesh.gdim == 3
    still = {"z": 0.0} if solid else {}
    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(1e3, 0.3),
        model=fx.Solid() if solid else fx.PlaneStress(),
        supports=[
            fx.Displacement("bottom", x=0.0, y=0.0, **still),
            fx.Displacement("top", x=0.3, y=1.0, **still),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1.0, GIIc=1.0, GIIIc=1.0, mix=fx.BK(1.0)))],
        **options,
    )
    found = scene.run(fx.Static(until=fx.Releases(3)))
    scene.close()
    return found


@pytest.mark.quick("1-True-options0")
@pytest.mark.mpi
@pytest.mark.parametrize(
    ("order", "contact", "options"),
    [(1, True, {}), (2, False, {}), (1, False, {"solver": "newton"})],
)
def test_border_inside_a_body(
    comm: MPI.Comm, order: int, contact: bool, options: dict[str, object]
) -> None:
    inside = history(plate(comm, BORDER, order), contact=contact, **options)
    whole = history(plate(comm, 9.0, order), contact=contact, **options)
    assert inside.rows[-1]["released[bond]"] == whole.rows[-1]["released[bond]"] >= 2
    for column in ("time", "f[bond]", "GI[bond]", "GII[bond]", "R[top.y]", "strain_energy"):
        np.testing.assert_allclose(inside[column], whole[column], rtol=1e-9, atol=1e-9)


def test_no_crack_passes_the_border(comm: MPI.Comm) -> None:
    bond = fx.Interface("up", "low", bonded=lambda x: abs(x[0]) > A - 1e-9, name="bond")
    scene = fx.Scene(
        plate(comm, BORDER, 1),
        materials=fx.Isotropic(1e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("bottom", x=0.0, y=0.0), fx.Displacement("top", y=1.0)],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1.0))],
    )
    end = scene.run(fx.Static(until=fx.Time(50.0))).rows[-1]
    # 3 nodes on each side between the first tip and the border
    assert end["released[bond]"] == 6 and end["time"] == 50.0
    assert abs(end["balance"]) < 1e-12 * end["external_work"]


@pytest.mark.mpi
def test_border_of_a_patch_in_a_solid(comm: MPI.Comm) -> None:
    z = (np.linspace(0.0, 1.0, 3),)
    inside, whole = (history(plate(comm, half, 1, z)) for half in (BORDER, 9.0))
    for column in ("time", "f[bond]", "R[top.y]"):
        np.testing.assert_allclose(inside[column], whole[column], rtol=1e-8)
