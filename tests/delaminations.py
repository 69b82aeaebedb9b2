"""Strips of two bonded arms in 3-D for tests of continuum shells: SLB and ENF of any lay-up."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base import compat
from fxcrack.mesh import Group
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies

PLY = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
UPWARDS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
"""Frame of laminates of solid cells whose plies are stacked along y."""


def name_layers(mesh: fx.Mesh, names: list[str], y: Any) -> None:
    """Name the cells between consecutive values of y."""
    centres = mesh.domain.geometry.x[compat.geometry_dofmap(mesh.domain)].mean(axis=1)[:, 1]
    for name, low, high in zip(names, y, y[1:], strict=False):
        cells = np.flatnonzero((centres > low) & (centres < high)).astype(np.int32)
        mesh.groups[name] = Group(3, cells)


def strip(
    upper: fx.Laminate,
    lower: fx.Laminate,
    *,
    dx: float,
    a: float,
    half_span: float,
    per_ply: int = 0,
    enf: bool = False,
    lever: float | None = None,
    order: int = 2,
    layers: int = 1,
    criterion: fx.VCCT | None = None,
) -> fx.Scene:
    """A strip 1 wide, x along, y upwards, cracked for x < a; unit load down at mid-span.

    SLB: the upper arm alone rests on the left support. ENF: the lower one does, faces in contact.
    MMB: that with a ``lever`` c, which lifts the cracked end by c/L and presses by (c + L)/L.
    ``per_ply``: solid cells for each ply; 0: ``layers`` continuum shells per arm.
    """
    x = np.arange(round(2 * half_span / dx) + 1) * dx
    plies = [lam.interfaces(sign * 0.5 * lam.thickness) for lam, sign in ((upper, 1), (lower, -1))]
    plies[0][0] = plies[1][-1] = 0.0
    lines = [
        np.linspace(z[0], z[-1], layers + 1)
        if not per_ply
        else np.interp(np.arange((len(z) - 1) * per_ply + 1) / per_ply, np.arange(len(z)), z)
        for z in plies
    ]

    def make() -> Blocks:
        model, above, below = two_bodies(
            (x, x), (lines[0], lines[1]), (np.array([0.0, 1.0]),), cell="hexahedron", order=order
        )
        model.group("load", above.part(x=half_span, y=float(lines[0][-1])))
        model.group("lifted", above.part(x=0.0, y=float(lines[0][-1])))
        rest, level = (below, float(lines[1][0])) if enf else (above, 0.0)
        model.group("left", rest.part(x=0.0, y=level))
        model.group("right", rest.part(x=2 * half_span, y=level))
        model.group("side", *(arm.part(z=0.0) for arm in ((below,) if enf else (above,))))
        return model

    mesh = build(MPI.COMM_SELF, "strip", make)
    materials: dict[str, Any]
    if per_ply:
        materials = {}
        for name, lam, z in (("upper", upper, plies[0]), ("lower", lower, plies[1])):
            stack = fx.Laminate(lam.plies, frame=UPWARDS).layers(name)
            name_layers(mesh, list(stack), z)
            materials |= stack
    else:
        materials = {
            "upper": fx.ContinuumShell(upper, "upper_face", "top", axis=(1, 0, 0)),
            "lower": fx.ContinuumShell(lower, "bottom", "lower_face", axis=(1, 0, 0)),
        }
    loads = [fx.PointForce("load", (0.0, -1.0, 0.0))]
    if lever is not None:
        loads = [
            fx.PointForce("lifted", (0.0, lever / half_span, 0.0)),
            fx.PointForce("load", (0.0, -(lever + half_span) / half_span, 0.0)),
        ]
    slave, master = ("upper_face", "lower_face") if enf else ("lower_face", "upper_face")
    bond = fx.Interface(
        slave=slave, master=master, bonded=lambda x: x[0] >= a - 1e-9, contact=enf, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=materials,
        model=fx.Solid(),
        supports=[
            fx.Displacement("left", y=0.0),
            fx.Displacement("right", x=0.0, y=0.0),
            fx.Displacement("side", z=0.0),
        ],
        loads=loads,
        debonds=[fx.Debond(bond, criterion or fx.VCCT(GIc=1e9))],
    )
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    return scene


def rates(scene: fx.Scene) -> tuple[float, float]:
    """G and G_II/G, means over the width."""
    crack = scene.cracks[0]
    values = crack.evaluate(crack.tips(), scene.solver.state, scene.time)
    width = values.tips.width
    one, two, three = (values.report[m] @ width / width.sum() for m in ("GI", "GII", "GIII"))
    return float(one + two + three), float(two / (one + two + three))


__all__ = ["PLY", "rates", "strip"]
