"""Delamination specimens in bending as solids, continuum shells and shells: four studies in one.

Each is a strip of unit width in plane strain, cracked to 30 mm, under a unit load: DCB, ENF with
contact, single-leg bending and mixed-mode bending with a lever of 42 mm. Solids have as many cells
over an arm as make them as high as long, one at least; an arm of shells is one of them. Shells on
surface meshes have exact bonds, or bonds with the compliance of the arms. Errors are counted from
the solids: shells of any kind tend to values of their own
(:data:`fxcrack.accuracy.study.Study.refers_to`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from mpi4py import MPI

from fxcrack.accuracy.study import Case, Measured, Setting, Study
from fxcrack.base.arrays import Array
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.face import Face
from fxcrack.continuum.kinematics import Shell, Solid
from fxcrack.continuum.loads import Displacement, PointForce
from fxcrack.continuum.materials import Orthotropic
from fxcrack.continuum.node_supports import Clamp, Symmetry
from fxcrack.continuum.section import Section
from fxcrack.criteria import VCCT
from fxcrack.history import History
from fxcrack.interface.definition import Interface
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.sheets import Sheet, sheets
from fxcrack.scene import Scene
from fxcrack.steps.debond import Debond
from fxcrack.steps.end_conditions import CrackLength, Time
from fxcrack.steps.static import Static

A, HALF_SPAN, HEIGHT, LEVER = 30.0, 50.0, 1.5, 42.0
PLY = Orthotropic(E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3))
"""Carbon fibre of NASA/TM-2008-215123, stacked along z in shells."""
UPRIGHT = Orthotropic(PLY.E, PLY.nu, PLY.G, frame=((1, 0, 0), (0, 0, 1)))
"""The same stacked along y, in solid cells."""
_COMPLIANT = "shell with compliant bonds"
_SHELLS = ("shell", _COMPLIANT)


@dataclass(frozen=True)
class Specimen:
    """How a strip is held and loaded, at the start, the middle or the end of an arm.

    Attributes:
        title: What it is.
        held: Arm, place and components that are held, y upwards; all of one arm, the master.
        forces: Arm, place and force upwards.
        contact: Whether the faces of the crack touch.
    """

    title: str
    held: tuple[tuple[str, str, str], ...]
    forces: tuple[tuple[str, str, float], ...]
    contact: bool = False


def mixed_mode_bending(lever: float) -> Specimen:
    """Mixed-mode bending by a unit load at the end of a lever, from mid-span (length)."""
    return Specimen(
        f"MMB, lever {lever:g} mm",
        (("lower", "start", "y"), ("lower", "end", "xy")),
        (
            ("upper", "start", lever / HALF_SPAN),
            ("upper", "middle", -(lever + HALF_SPAN) / HALF_SPAN),
        ),
        contact=True,
    )


SPECIMENS = {
    "strip_dcb": Specimen(
        "DCB",
        (("upper", "end", "clamp"),),
        (("upper", "start", 1.0), ("lower", "start", -1.0)),
    ),
    "strip_enf": Specimen(
        "ENF with contact",
        (("lower", "start", "y"), ("lower", "end", "xy")),
        (("upper", "middle", -1.0),),
        contact=True,
    ),
    "strip_slb": Specimen(
        "single-leg bending",
        (("upper", "start", "y"), ("upper", "end", "xy")),
        (("upper", "middle", -1.0),),
    ),
    "strip_mmb": mixed_mode_bending(LEVER),
}


def _stations(size: float) -> Array:
    """Coordinates along the strip, with a node at the crack tip and at mid-span."""
    ends = (0.0, A, HALF_SPAN, 2.0 * HALF_SPAN)
    parts = [
        np.linspace(a, b, max(1, int(np.ceil((b - a) / size - 1e-9))) + 1)
        for a, b in pairwise(ends)
    ]
    return np.unique(np.concatenate(parts))


def _hexahedra(setting: Setting, per_arm: int) -> Mesh:
    """Both arms as hexahedra, y upwards, z across."""
    x = _stations(setting.size)
    up = np.linspace(0.0, HEIGHT, per_arm + 1)

    def make() -> Blocks:
        model, above, below = two_bodies(
            (x, x), (up, -up[::-1]), (np.array([0.0, 1.0]),), cell="hexahedron",
            order=setting.order,
        )  # fmt: skip
        for name, arm, outside in (("upper", above, HEIGHT), ("lower", below, -HEIGHT)):
            model.group(f"{name}_start", arm.part(x=0.0, y=outside))
            model.group(f"{name}_middle", arm.part(x=HALF_SPAN, y=outside))
            model.group(f"{name}_end", arm.part(x=2.0 * HALF_SPAN, y=outside))
            model.group(f"{name}_whole_end", arm.part(x=2.0 * HALF_SPAN))
        arms = (above, below)
        model.group("sides", *(arm.part(z=side) for arm in arms for side in (0.0, 1.0)))
        return model

    mesh: Mesh = build(MPI.COMM_WORLD, "strip", make)
    return mesh


def _bonded(x: Array) -> Array:
    return np.asarray(x[0] >= A * (1.0 - 1e-9))


def _solid(specimen: Specimen, setting: Setting) -> dict[str, Any]:
    """Arguments of the scene as solids or continuum shells."""
    shells = setting.cell == "continuum shell"
    mesh = _hexahedra(setting, 1 if shells else max(1, round(HEIGHT / setting.size)))
    materials: Any = UPRIGHT
    if shells:
        materials = {
            "upper": ContinuumShell(PLY, "upper_face", "top", axis=(1.0, 0.0, 0.0)),
            "lower": ContinuumShell(PLY, "bottom", "lower_face", axis=(1.0, 0.0, 0.0)),
        }
    supports = [Displacement("sides", z=0.0)]
    for arm, place, how in specimen.held:
        if how == "clamp":
            supports.append(Displacement(f"{arm}_whole_{place}", x=0.0, y=0.0))
        else:
            along = 0.0 if "x" in how else None
            supports.append(Displacement(f"{arm}_{place}", x=along, y=0.0))
    loads = [
        PointForce(f"{arm}_{place}", (0.0, force, 0.0)) for arm, place, force in specimen.forces
    ]
    return {
        "mesh": mesh, "model": Solid(), "materials": materials, "supports": supports,
        "loads": loads, "faces": {"upper": "upper_face", "lower": "lower_face"},
    }  # fmt: skip


def _shell(specimen: Specimen, setting: Setting) -> dict[str, Any]:
    """Arguments of the scene as shells, z upwards, y across."""
    x = _stations(setting.size)
    middle = {"upper": 0.5 * HEIGHT, "lower": -0.5 * HEIGHT}
    parts = [
        Sheet(
            arm, x, [0.0, 1.0], lambda a, b, z=z: (a, b, z + 0.0 * a),
            points={f"{arm}_middle_{i}": (HALF_SPAN, float(i)) for i in (0, 1)},
        )
        for arm, z in middle.items()
    ]  # fmt: skip
    edge = {"start": "a0", "end": "a1"}
    supports: list[Any] = [
        Symmetry(f"{arm}_{side}", "y") for arm in middle for side in ("b0", "b1")
    ]
    for arm, place, how in specimen.held:
        where = f"{arm}_{edge[place]}"
        if how == "clamp":
            supports.append(Clamp(where))
        else:
            along = 0.0 if "x" in how else None
            supports.append(Displacement(where, x=along, z=0.0))
    loads = []
    for arm, place, force in specimen.forces:
        if place == "middle":
            loads += [PointForce(f"{arm}_middle_{i}", (0.0, 0.0, 0.5 * force)) for i in (0, 1)]
        else:
            loads.append(PointForce(f"{arm}_{edge[place]}", (0.0, 0.0, force)))
    return {
        "mesh": sheets(parts, order=setting.order, name="strip"), "model": Shell(),
        "materials": Section(PLY, thickness=HEIGHT), "supports": supports, "loads": loads,
        "faces": {"upper": Face("upper", "bottom"), "lower": Face("lower", "top")},
    }  # fmt: skip


def strip(specimen: Specimen, setting: Setting) -> Case:
    """G and the share of mode II at a unit load; nothing grows."""
    given = (_shell if setting.cell in _SHELLS else _solid)(specimen, setting)
    faces, held = given.pop("faces"), specimen.held[0][0]
    bond = Interface(
        slave=faces["lower" if held == "upper" else "upper"], master=faces[held],
        bonded=_bonded, contact=specimen.contact, name="bond",
        stiffness="arms" if setting.cell == _COMPLIANT else None,
    )  # fmt: skip
    scene = Scene(
        given.pop("mesh"),
        debonds=[Debond(bond, VCCT(GIc=1e9, **setting.rate_options()))],
        options=setting.options(),
        **given,
    )

    def measure(history: History) -> Measured:
        crack = scene.cracks[0]
        values = crack.evaluate(crack.tips(), scene.solver.state, scene.time)
        width = values.tips.width
        one, two = (float(values.report[m] @ width / width.sum()) for m in ("GI", "GII"))
        return Measured(G=one + two, others={"G_II/G": two / (one + two)})

    # the length says how little of the bond is retained
    return Case(scene, Static(until=(Time(1.0), CrackLength(bond, A + 0.1))), measure)


def _worth_trying(setting: Setting) -> bool:
    """Whether a setting says more: shells are near their own limits with much longer cells."""
    if setting.cell == "hexahedron":
        return setting.order == 2 or setting.size > 0.5
    if setting.cell == _COMPLIANT:  # for cells of 0.5 to 1.3 times the height of an arm
        return setting.order == 1 and setting.size > 0.5
    return setting.size > 1.0


def _study(name: str) -> Study:
    specimen = SPECIMENS[name]

    def make(setting: Setting) -> Case:
        return strip(specimen, setting)

    make.__name__ = name
    return Study(
        make,
        sizes=(5.0, 2.5, 1.25, 0.625, 0.3125),
        cells=("hexahedron", "continuum shell", "shell", _COMPLIANT),
        methods=("vcct",),
        admits=_worth_trying,
        refers_to=("hexahedron",),
        title=f"{specimen.title} of carbon fibre, a strip as solids, continuum shells and shells",
        unit="mm",
    )


STRIPS = {name: _study(name) for name in SPECIMENS}
strip_dcb, strip_enf, strip_slb, strip_mmb = STRIPS.values()

__all__ = [
    *("SPECIMENS", "STRIPS", "mixed_mode_bending", "strip"),
    *("strip_dcb", "strip_enf", "strip_mmb", "strip_slb"),
]
