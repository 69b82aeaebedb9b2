"""Rigid surfaces in explicit dynamics: half models beside whole ones, impact on a wall."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import assert_same

import fxcrack as fx
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d, half_dcb

E, RHO = 70e3, 2.7e-9
PLANE = fx.RigidPlane((0.0, 0.0), (0.0, 1.0))
HALVED = ("strain_energy", "kinetic_energy", "external_work", "released_energy")
RATES = ("f[bond]", "GI[bond]", "GII[bond]", "spent[bond]")
ALIKE = ("time", "a[bond]", "area[bond]", *RATES, "R[pin_top.y]")


def torn(comm: MPI.Intracomm, *, half: bool, speed: float = 1e4, **options: Any) -> fx.Scene:
    """A DCB whose pins are torn apart, whole or its upper half on the plane of symmetry."""
    size: dict[str, Any] = {"length": 40.0, "height": 1.5, "dx": 1.0, "ny": 2}
    supports = [fx.Displacement.by_velocity("pin_top", y=speed)]
    if not half:
        supports.append(fx.Displacement.by_velocity("pin_bottom", y=-speed))
    bond = fx.Interface(
        "upper_face", PLANE if half else "lower_face", lambda x: x[0] >= 10.0 - 1e-9,
        contact=True, symmetry=half, name="bond",
    )  # fmt: skip
    given = {"release": options.pop("release")} if "release" in options else {}
    return fx.Scene(
        (half_dcb if half else dcb_2d)(comm, **size),
        materials=fx.Isotropic(E, 0.3, density=RHO),
        model=fx.PlaneStrain(thickness=20.0),
        supports=supports,
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2), **given)],
        effects=[fx.Inertia(), *options.pop("effects", [])],
        **options,
    )


def history(scene: fx.Scene, time: float, **options: Any) -> fx.History:
    found = scene.run(fx.Explicit(until=fx.Time(time), rows=40, **options), progress=False)
    scene.close()
    return found


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("release", [None, fx.StepRelease()], ids=["progressive", "step"])
def test_half_of_a_dcb_is_the_whole(comm: MPI.Intracomm, release: Any) -> None:
    given = {} if release is None else {"release": release}
    half, whole = (history(torn(comm, half=h, **given), 4e-5) for h in (True, False))
    assert whole["a[bond]"][-1] >= 13.0  # it runs
    assert list(half["event"]) == list(whole["event"])
    for name in (*ALIKE, *HALVED):
        a, b = (np.asarray(h[name], dtype=float) for h in (half, whole))
        a = (2.0 if name in HALVED else 1.0) * a
        # the same but for round-off, measured at 1e-13 of the largest value
        assert np.abs(a - b).max() <= 1e-9 * max(np.abs(b).max(), 0.1), name
    assert np.abs(half["balance"]).max() <= 1e-11 * half["external_work"].max()


def bar(comm: MPI.Intracomm, **options: Any) -> fx.Scene:
    """A bar of 10 that moves onto a wall, lateral strain free of stress."""
    face = fx.Interface(
        "upper_face", options.pop("master", PLANE), lambda x: np.zeros(x.shape[1], bool),
        contact=True, name="face", **options.pop("interface", {}),
    )  # fmt: skip
    return fx.Scene(
        half_dcb(comm, length=0.5, height=10.0, dx=0.5, ny=40),
        materials=fx.Isotropic(E, 0.0, density=RHO),
        model=fx.PlaneStress(),
        bonds=[face],
        monitors=[fx.Monitor("top", (0.0, 1.0), "top")],
        **options,
    )


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("finite", [False, True])
def test_a_bar_meets_a_wall(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture, finite: bool
) -> None:
    """Saint-Venant: pressure rho c v for 2 L/c, then the bar leaves with the velocity reversed."""
    length, speed, c = 10.0, 1e3, np.sqrt(E / RHO)
    effects: list[Any] = [fx.Inertia(velocity=(0.0, -speed))]
    scene = bar(comm, effects=effects + ([fx.FiniteStrain()] if finite else []))
    rows = history(scene, 4.0 * length / c)
    assert "stay tied" not in caplog.text  # its bonded set marks no node
    t, u = rows["time"].astype(float) * c / length, rows["m[top]"].astype(float)
    late = t > 3.0
    away = float(np.polyfit(t[late] * length / c, u[late], 1)[0]) / speed
    # the wall takes the kinetic energy of the row of nodes that meets it, half an element
    assert rows["contact_energy"][-1] / rows["initial_energy"][0] == pytest.approx(1 / 80, rel=0.1)
    assert away == pytest.approx(1.0, abs=0.05)
    # the free end turns back at L/c, the bar is as long as it was, and leaves, at 2 L/c
    deepest = float(t[np.argmin(u)])
    assert deepest == pytest.approx(1.0, abs=0.06)
    assert u.min() == pytest.approx(-speed * length / c, rel=0.03)
    scale = rows["initial_energy"][0]
    assert np.abs(rows["balance"]).max() <= (1e-4 if finite else 1e-11) * scale


@pytest.mark.mpi
@pytest.mark.three
def test_bonds_on_a_wall_are_a_support(comm: MPI.Intracomm) -> None:
    """A bar bonded to a wall moves as one whose face is held; without criterion, all directions."""
    found = []
    for bonded in (True, False):
        face = fx.Interface("upper_face", PLANE, None if bonded else (lambda x: x[0] < -1.0))
        scene = fx.Scene(
            half_dcb(comm, length=1.0, height=2.0, dx=0.5, ny=3),
            materials=fx.Isotropic(E, 0.3, density=RHO),
            model=fx.PlaneStrain(),
            bonds=[face],
            supports=[] if bonded else [fx.Displacement("upper_face", x=0.0, y=0.0)],
            loads=[fx.Traction("top", (1.0, 2.0), amplitude=fx.constant())],
            monitors=[fx.Monitor("top", (0.3, 0.7), "top")],
            effects=[fx.Inertia()],
        )
        found.append(history(scene, 4e-6))
    held, supported = found
    assert np.abs(held["m[top]"]).max() > 0.0
    for name in ("m[top]", "strain_energy", "kinetic_energy"):
        assert held[name] == pytest.approx(supported[name], rel=1e-9, abs=1e-12)


@pytest.mark.mpi
@pytest.mark.slow
def test_a_block_runs_around_in_a_bore(comm: MPI.Intracomm) -> None:
    """Finite strain: normals and gaps are those below the nodes where they are now."""
    radius = 3.0
    bore = fx.RigidCylinder((0.25, 2.98), (0.0, 0.0, 1.0), radius, inside=True)
    rows = history(block_in(comm, bore), 1.6e-4)
    corners = rows["m[left x]"], rows["m[left y]"], rows["m[right x]"] + 0.5, rows["m[right y]"]
    left, right = (
        np.hypot(corners[k].astype(float) - 0.25, corners[k + 1].astype(float) - 2.98)
        for k in (0, 2)
    )
    turned = np.arctan2(corners[0].astype(float) - 0.25, 2.98 - corners[1].astype(float))
    assert turned.max() > 0.6
    # a node moves along the tangent for one increment, which leaves s^2/(2 R): 1e-7 of R
    assert max(left.max(), right.max()) <= radius * (1.0 + 1e-5)
    # a perfectly plastic impact with every turn of the normal loses little
    assert rows["kinetic_energy"][-1] > 0.95 * rows["initial_energy"][0]
    assert np.abs(rows["balance"]).max() <= 1e-3 * rows["initial_energy"][0]


def block_in(comm: MPI.Intracomm, bore: Any) -> fx.Scene:
    """A small block at the lowest point of a bore, moving to the right."""
    face = fx.Interface(
        "upper_face", bore, lambda x: np.zeros(x.shape[1], bool), contact=True, gap="keep",
        tolerance=0.2, name="face",
    )  # fmt: skip

    def make() -> Blocks:
        model, axis = Blocks(), np.linspace(0.0, 0.5, 2)
        block = model.add("body", (axis, axis), "quadrilateral", 1)
        model.group("upper_face", block.part(y=0.0))
        model.group("tip_left", block.part(x=0.0, y=0.0))
        model.group("tip_right", block.part(x=0.5, y=0.0))
        return model

    return fx.Scene(
        build(comm, "body", make),
        materials=fx.Isotropic(1e3, 0.3, density=1e-9),
        model=fx.PlaneStrain(),
        bonds=[face],
        monitors=[
            fx.Monitor(group, direction, f"{name} {axis}")
            for group, name in (("tip_left", "left"), ("tip_right", "right"))
            for axis, direction in (("x", (1.0, 0.0)), ("y", (0.0, 1.0)))
        ],
        effects=[fx.Inertia(velocity=(1.2e4, 0.0)), fx.FiniteStrain()],
    )


def test_restart_of_a_half_model(tmp_path: Path) -> None:
    kept = fx.Checkpoint(tmp_path / "half.npz", every=10)

    class Stopped(Exception):
        """Ends the run."""

    def stop(event: str, row: Any) -> None:
        if row["time"] > 1.2e-5:
            raise Stopped

    step = fx.Explicit(until=fx.Time(2e-5), rows=40)
    whole = torn(MPI.COMM_SELF, half=True).run(step, progress=False)
    with pytest.raises(Stopped):
        torn(MPI.COMM_SELF, half=True).run(step, checkpoint=kept, observers=[stop], progress=False)
    scene = torn(MPI.COMM_SELF, half=True)
    again = scene.run(step, checkpoint=kept, restart=True, progress=False)
    assert_same(whole, again, 1e-9)


def test_bonds_along_the_normal_need_a_rigid_surface() -> None:
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 10.0, normal_only=True)
    scene = fx.Scene(
        dcb_2d(MPI.COMM_SELF, length=20.0, height=1.0, dx=2.0, ny=1),
        materials=fx.Isotropic(E, 0.3, density=RHO),
        model=fx.PlaneStrain(),
        bonds=[bond],
        effects=[fx.Inertia()],
    )
    with pytest.raises(fx.InputError, match="leave normal_only out"):
        scene.run(fx.Explicit(until=fx.Time(1e-6)))
    scene.close()
