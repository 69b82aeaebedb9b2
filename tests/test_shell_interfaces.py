"""Interfaces between shells: VCCT on the translations of bonded faces, beside solids and theory.

The ply is that of the DCB-UD specimen of NASA/TM-2008-215123. References of SLB and ENF are
27-node solids, four over each arm, elements of 0.25 (the numbers stand in the parameters); what a
plate cannot see (root correction in mode II, modes of unequal arms) is part of what is expected.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from shell_arms import (
    A0,
    E1,
    E3,
    FAST,
    G13,
    HEIGHT,
    UD,
    WIDTH,
    bond,
    dcb,
    enf,
    mean_rates,
    of_one_ply,
    over_beam_theory,
    slb,
    two_arms,
)

import fxcrack as fx
from fxcrack.base import compat
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.mesh import Group
from fxcrack.meshes.sheets import Sheet, sheets

SAME = 3e-3


# -- mode I ----------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("element", "dx", "wanted"),
    [
        (("quadrilateral", 1), 5.0, (1.030, 0.978)),
        (("quadrilateral", 1), 1.0, (1.011, 0.993)),
        (("quadrilateral", 2), 5.0, (1.003, 0.995)),
        (("quadrilateral", 2), 1.0, (0.996, 1.000)),
    ],
)
def test_dcb(
    comm: MPI.Intracomm, element: tuple[str, int], dx: float, wanted: tuple[float, float]
) -> None:
    """Translations tied, rotations free: the root turns as corrected beam theory says."""
    found = over_beam_theory(dcb(comm, element, dx))
    assert found == pytest.approx(wanted, abs=5e-3)


@pytest.mark.parametrize(
    ("element", "wanted"), [(("quadrilateral", 1), 1.014), (("quadrilateral", 2), 1.003)]
)
def test_arms_a_hundredth_of_the_crack_thick(
    comm: MPI.Intracomm, element: tuple[str, int], wanted: float
) -> None:
    """Cells 17 times as long as an arm of 0.3 is high."""
    load, _ = over_beam_theory(dcb(comm, element, 5.0, height=0.3), 0.3)
    assert load == pytest.approx(wanted, abs=3e-3)


def test_a_face_of_several_sections(comm: MPI.Intracomm) -> None:
    """An arm that is thicker on its outside far behind the front: the bonded face is flush."""

    def parts(mesh: fx.Mesh) -> None:
        x = mesh.domain.geometry.x[compat.geometry_dofmap(mesh.domain)].mean(axis=1)
        for name, here in (("near", x[:, 0] < 60.0), ("far", x[:, 0] > 60.0)):
            cells = np.flatnonzero(here & (x[:, 2] > 0.0)).astype(np.int32)
            mesh.groups[name] = Group(2, cells)

    plain = dcb(comm, ("quadrilateral", 1), 2.5)
    load, rate = over_beam_theory(plain)
    parts(plain.mesh)
    near, low = fx.Section(UD, thickness=HEIGHT), fx.Section(UD, thickness=HEIGHT)
    far = fx.Section(UD, thickness=2.0, offset=0.5 * (2.0 - HEIGHT))
    stepped = plain.rebuilt(materials={"near": near, "far": far, "lower": low})
    # 20 thicknesses behind the front
    assert over_beam_theory(stepped) == pytest.approx((load, rate), rel=1e-3)
    with pytest.raises(fx.InputError, match="offsets that put this side at one height"):
        plain.rebuilt(materials={"near": near, "far": fx.Section(UD, thickness=2.0), "lower": low})


@pytest.mark.parametrize("order", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("offset", [0.75, -0.3])
def test_meshes_off_the_middle(comm: MPI.Intracomm, order: int, offset: float) -> None:
    """Load and rate do not depend on where the mesh of an arm lies, from face to face.

    The pins hold the reference surface, which the thickness strain moves beside the middle: half a
    per cent is left for that.
    """
    laminate = fx.Laminate("[45/-45/-45/45]", UD, 0.375)
    x, y = np.linspace(0.0, 64.0, 65), np.linspace(0.0, 4.0, 3)
    found = []
    for s in (0.0, offset):
        parts = [
            Sheet(name, x, y, lambda a, b, z=z: (a, b, z + 0.0 * a))
            for name, z in (("upper", 0.75 - s), ("lower", -0.75 - s))
        ]
        scene = fx.Scene(
            sheets(parts, comm, order=order, name="arms"),
            model=fx.Shell(),
            materials=fx.Section(laminate, offset=s),
            supports=[
                fx.Clamp("upper_a1"),
                fx.Clamp("lower_a1"),
                fx.Displacement("upper_a0", z=0.5),
                fx.Displacement("lower_a0", z=-0.5),
            ],
            debonds=[fx.Debond(bond(16.0), fx.VCCT(GIc=1e3))],
        )
        scene.run(FAST, progress=False)
        rates = mean_rates(scene)
        assert abs(rates[1:]).max() < 1e-9 * rates[0]
        found.append((float(scene.history["R[upper_a0.z]"][-1]), rates[0]))
        scene.close()
    assert found[1] == pytest.approx(found[0], rel=8e-3)


def test_triangles_as_quadrilaterals(comm: MPI.Intracomm) -> None:
    quads, triangles = (
        over_beam_theory(dcb(comm, (cell, 1), 2.5, ny=10)) for cell in ("quadrilateral", "triangle")
    )
    assert triangles == pytest.approx(quads, rel=2e-2)


@pytest.mark.mpi
def test_dcb_grows(comm: MPI.Intracomm) -> None:
    """Onset at G_Ic, crack length against load of beam theory, energy balance."""
    scene = dcb(comm, ("quadrilateral", 1), 2.5)
    history = scene.run(
        fx.Static(until=[fx.CrackLength(scene.debonds[0].interface, 40.0), fx.Time(20.0)]),
        progress=False,
    )
    load, opening = history["R[upper_a0.z]"], history["time"]
    a = history["a[bond]"]
    onset = int(np.argmax(a > A0 + 1e-9)) - 1
    inertia = WIDTH * HEIGHT**3 / 12.0
    reach = A0 + 1.934 * HEIGHT
    critical = np.sqrt(0.17 * WIDTH * E1 * inertia) / reach
    assert load[onset] == pytest.approx(critical, rel=2e-2)
    assert a[-1] >= 40.0 - 1e-9
    assert np.all(np.diff(opening) >= -1e-12)
    assert np.abs(history["balance"]).max() < 1e-8


def test_growth_of_second_order(comm: MPI.Intracomm) -> None:
    """Onsets from 30 to 37.5 in plane strain: load and opening of corrected beam theory."""
    scene = dcb(comm, ("quadrilateral", 2), 2.5)
    planes = [
        fx.Symmetry(f"{arm}_{edge}", "y") for arm in ("upper", "lower") for edge in ("b0", "b1")
    ]
    scene = scene.rebuilt(supports=[*scene.input.supports, *planes])
    until = [fx.CrackLength(scene.debonds[0].interface, 40.0), fx.Time(20.0)]
    onsets = [r for r in scene.run(fx.Static(until=until), progress=False) if r["event"] == "onset"]
    theory = CorrectedBeam(E=E1 / (1.0 - 0.3**2 * E3 / E1), E22=E3, G=G13, h=HEIGHT, b=WIDTH)
    assert [r["a[bond]"] for r in onsets][:4] == pytest.approx([30.0, 32.5, 35.0, 37.5])
    for row in onsets[:4]:
        a = row["a[bond]"]
        load = np.sqrt(0.17 * WIDTH * theory.E * theory.inertia) / (a + theory.chi * HEIGHT)
        assert row["R[upper_a0.z]"] == pytest.approx(load, rel=3e-3)
        assert row["time"] == pytest.approx(theory.dcb_opening(a, load), rel=5e-3)
    scene.close()


# -- mixed modes -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heights", "solids", "rate", "share"),
    [
        ((1.5, 1.5), 0.9140e-3, -0.048, 0.351),
        ((1.0, 2.0), 3.2068e-3, -0.040, 0.406),
        ((2.0, 1.0), 0.3140e-3, -0.061, 0.327),
    ],
    ids=["equal", "thin above", "thick above"],
)
def test_slb(
    comm: MPI.Intracomm, heights: tuple[float, float], solids: float, rate: float, share: float
) -> None:
    """Single leg bending, a = 16, half span 32, strip 1 wide; solids have mode II shares of 0.374,
    0.34 to 0.37 and 0.44 to 0.41."""
    scene = slb(comm, of_one_ply(heights))
    found = mean_rates(scene)
    assert found.sum() / solids - 1.0 == pytest.approx(rate, abs=SAME)
    assert found[1] / found.sum() == pytest.approx(share, abs=SAME)


def test_slb_of_coupled_arms(comm: MPI.Intracomm) -> None:
    """Arms [90/0] and [0/90], 90 degrees on both sides of the crack; G and G_II/G of solids with
    cells for each ply, 3.835e-3 and 0.456, less what plates do not see."""
    plies = (fx.Laminate(lay_up, UD, 0.75) for lay_up in ("[90/0]", "[0/90]"))
    upper, lower = (fx.Section(each) for each in plies)
    scene = slb(comm, (upper, lower))
    found = mean_rates(scene)
    assert found.sum() / 3.835e-3 - 1.0 == pytest.approx(-0.044, abs=SAME)
    assert found[1] / found.sum() == pytest.approx(0.437, abs=SAME)


@pytest.mark.mpi
def test_enf_with_contact(comm: MPI.Intracomm) -> None:
    """Beam theory without a root correction in mode II, which plates do not see: 8.2 % below
    solids (with the correction of 0.42 chi beam theory is 9 % higher)."""
    scene = enf(comm)
    scene.run(FAST, progress=False)
    found = mean_rates(scene)
    beam = 9.0 * 34.0**2 / (16.0 * E1 * 2.25**3)
    assert found[1] / beam == pytest.approx(0.997, abs=SAME)
    assert abs(found[0]) < 1e-3 * found[1]


def test_friction_of_shells(comm: MPI.Intracomm) -> None:
    """Friction of the pressed faces takes a part of G_II and books the energy it takes."""
    plain, rough = enf(comm, 4.0), enf(comm, 4.0, friction=0.5)
    for scene in (plain, rough):
        scene.run(FAST, progress=False)
    assert mean_rates(rough)[1] < 0.999 * mean_rates(plain)[1]
    assert rough.history["friction_energy"][-1] > 0.0
    assert abs(rough.history["balance"][-1]) < 1e-8


# -- what else an interface can do -----------------------------------------------------------------


@pytest.mark.mpi
def test_fatigue(comm: MPI.Intracomm) -> None:
    """Cycles of one opening: onset c1 G^c2, then the integral of da/(c3 G^c4), the static G at both
    ends of the element and 1/(da/dN) log-linear between."""

    def static(a: float) -> float:
        strong = [fx.Debond(bond(a), fx.VCCT(GIc=1e3))]
        scene = dcb(comm, ("quadrilateral", 1), 2.5, debonds=strong)
        scene.run(FAST, progress=False)
        return float(mean_rates(scene).sum())

    rate, end = static(A0), static(A0 + 2.5)
    paris = fx.Paris(c1=50.0, c2=-2.0, c3=0.5, c4=4.0, r1=0.01, r2=0.99)
    debond = fx.Debond(bond(A0), fx.Fatigue(GIc=2.0 * rate, paris=paris))
    scene = dcb(comm, ("quadrilateral", 1), 2.5, debonds=[debond])
    history = scene.run(
        fx.Cycles(maximum=1.0, ratio=0.0, until=fx.CrackLength(debond.interface, 40.0)),
        progress=False,
    )
    grown = [r for r in history if r["event"] == "release"]
    assert grown[0]["a[bond]"] == pytest.approx(A0 + 2.5)
    cycles = 1.0 / (0.5 * rate**4), 1.0 / (0.5 * end**4)  # per length
    mean = (cycles[1] - cycles[0]) / np.log(cycles[1] / cycles[0])
    first = 50.0 * rate**-2.0 + 2.5 * mean
    assert grown[0]["N"] == pytest.approx(first, rel=1e-3)
    assert grown[-1]["a[bond]"] == pytest.approx(40.0)


@pytest.mark.mpi
def test_restart_and_files(comm: MPI.Intracomm, shared_path: Path) -> None:
    """A step that is resumed from its checkpoint ends as the whole one; files show the faces."""
    step = fx.Static(until=fx.Time(4.0))
    whole = dcb(comm, ("quadrilateral", 1), 5.0)
    wanted = whole.run(step, progress=False)
    fx.write_fields(whole, shared_path / "dcb.pvd")
    comm.Barrier()
    files = "".join(f.read_text() for f in sorted((shared_path / "dcb").glob("*.vtu")))
    assert 'Name="bond_traction"' in files
    assert 'Name="director"' in files

    class Stop(Exception):
        pass

    def stop(event: str, row: Any) -> None:
        if row["time"] > 0.5 * wanted["time"][-1]:
            raise Stop

    kept = fx.Checkpoint(shared_path / "state.npz", every=1)
    broken = dcb(comm, ("quadrilateral", 1), 5.0)
    with pytest.raises(Stop):
        broken.run(step, progress=False, checkpoint=kept, observers=[stop])
    again = dcb(comm, ("quadrilateral", 1), 5.0)
    found = again.run(step, progress=False, checkpoint=kept, restart=True)
    for column in ("time", "R[upper_a0.z]", "a[bond]", "GI[bond]"):
        assert np.allclose(found[column], wanted[column], rtol=1e-9, equal_nan=True), column


# -- what is refused -------------------------------------------------------------------------------


def test_faces_that_are_none(comm: MPI.Intracomm) -> None:
    mesh = two_arms(comm, length=4.0, width=1.0, heights=(1.0, 1.0), dx=1.0)

    def made(slave: Any, master: Any) -> fx.Scene:
        interface = fx.Interface(slave=slave, master=master, bonded=lambda x: x[0] > 2.0)
        section = fx.Section(UD, thickness=1.0)
        return fx.Scene(mesh, model=fx.Shell(), materials=section, bonds=[interface])

    with pytest.raises(fx.FxcrackError, match="name a face"):
        made("upper", fx.Face("lower", "top"))
    with pytest.raises(fx.FxcrackError, match="share 10 nodes"):
        made(fx.Face("upper", "bottom"), fx.Face("upper", "top"))
    with pytest.raises(fx.FxcrackError, match="outside the master surface"):
        made(fx.Face("upper", "top"), fx.Face("lower", "bottom"))


def test_bonded_nodes_held_in_part(comm: MPI.Intracomm) -> None:
    """A support of the reference surface alone does not hold a face, which the director moves."""
    supports = [fx.Displacement(f"{arm}_{edge}", y=0.0) for arm in ("upper", "lower")
                for edge in ("b0", "b1")]  # fmt: skip
    scene = dcb(comm, ("quadrilateral", 1), 10.0)
    held = scene.rebuilt(supports=[*scene.input.supports, *supports])
    with pytest.raises(fx.FxcrackError, match="Symmetry"):
        held.run(FAST, progress=False)
    planes = [fx.Symmetry(s.where, "y") for s in supports]
    scene.rebuilt(supports=[*scene.input.supports, *planes]).run(FAST, progress=False)
