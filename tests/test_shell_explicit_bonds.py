"""Explicit dynamics of bonded shells: growth, spent energy, supports and contact at interfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.sheets import Sheet, sheets

E, RHO, HEIGHT, WIDTH, GC = 70e3, 2.7e-9, 1.5, 2.0, 0.3
FREE = 4.0
"""Length of the ends of both arms, which belong to no interface."""


def arms(
    comm: MPI.Intracomm, length: float, dx: float, lower: float | None = None, *,
    height: float = 0.5,
) -> fx.Mesh:  # fmt: skip
    """Two strips on each other, their ends u0 and l0 apart from the rest, u and l.

    Meshes lie at a part of the height of the arms from the bonded faces.
    """

    def at(z: float) -> Any:
        return lambda a, b: (a, b, z + 0.0 * a)

    def cells(step: float) -> Any:
        return np.linspace(FREE, length, round((length - FREE) / step) + 1)

    ends = np.linspace(0.0, FREE, round(FREE / dx) + 1)
    across, z = [0.0, WIDTH], height * HEIGHT
    return sheets(
        [
            Sheet("u0", ends, across, at(z)),
            Sheet("u", cells(dx), across, at(z)),
            Sheet("l0", ends, across, at(-z)),
            Sheet("l", cells(lower or dx), across, at(-z)),
        ],
        comm,
        joined=True,
    )


def dcb(
    comm: MPI.Intracomm, length: float, dx: float, speed: float, *, lower: float | None = None,
    crack: float = 12.0, dynamic: bool = True, height: float = 0.5, **given: Any,
) -> tuple[fx.Scene, fx.Interface]:  # fmt: skip
    """Arms opened at their ends, to a speed or in a unit of time."""
    bond = fx.Interface(
        slave=fx.Face("l", "top"), master=fx.Face("u", "bottom"),
        bonded=lambda x: x[0] >= crack - 1e-9, name="bond", **given,
    )  # fmt: skip
    supports: list[Any] = [
        fx.Symmetry(f"{arm}_{side}", "y") for arm in ("u", "l", "u0", "l0") for side in ("b0", "b1")
    ]
    for end, sign in (("u0_a0", 1.0), ("l0_a0", -1.0)):
        if dynamic:
            smooth = fx.SmoothStep((0.0, 0.2 / speed), (0.0, 1.0))
            supports.append(
                fx.Displacement.by_velocity(end, x=0.0, z=sign * speed, amplitude=smooth)
            )
        else:
            supports.append(fx.Displacement(end, x=0.0, z=sign))
    alloy = fx.Isotropic(E, 0.0, density=RHO)
    up, down = (
        fx.Section(alloy, thickness=HEIGHT, offset=s * (0.5 - height) * HEIGHT) for s in (1.0, -1.0)
    )
    scene = fx.Scene(
        arms(comm, length, dx, lower, height=height),
        model=fx.Shell(),
        materials={"u0": up, "u": up, "l0": down, "l": down},
        supports=supports,
        debonds=[fx.Debond(bond, fx.VCCT(GIc=GC))],
        effects=[fx.Inertia()] if dynamic else [],
        monitors=[fx.Monitor("u0_a0", (0, 0, 1), name="opening")],
    )
    return scene, bond


def off_balance(history: fx.History) -> float:
    """Largest error of the energies over the largest work."""
    work = np.abs(history["external_work"].astype(float)).max()
    return float(np.abs(history["balance"].astype(float)).max() / work)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(("lower", "height"), [(None, 0.2), (1.0, 0.5)])
def test_growth_spends_the_toughness(
    comm: MPI.Intracomm, lower: float | None, height: float
) -> None:
    """Arms torn apart at 20 m/s: G_c per area is spent and the energies balance to round-off.

    With arms of unlike cells, softening nodes share masters and are found in sweeps: 1e-4.
    """
    scene, bond = dcb(comm, 20.0, 2.0, 2e4, lower=lower, height=height)
    step = fx.Explicit(until=[fx.CrackLength(bond, 12.0), fx.Time(1e-4)], rows=40)
    history = scene.run(step, progress=False)
    assert history["a[bond]"][-1] >= 12.0 - 1e-9
    exact = 1e-12 if lower is None else 1e-4
    assert history["spent[bond]"][-1] == pytest.approx(GC, rel=exact)
    assert off_balance(history) < 1e-9
    # the increment is that of membrane waves of the smallest cells
    cell = min(2.0, lower or 2.0)
    wave = np.sqrt(E / RHO)
    assert history.details["stable_increment"] * wave / cell == pytest.approx(1.0, abs=0.02)
    alone, bond = dcb(MPI.COMM_SELF, 20.0, 2.0, 2e4, lower=lower, height=height)
    step = fx.Explicit(until=[fx.CrackLength(bond, 12.0), fx.Time(1e-4)], rows=40)
    reference = alone.run(step, progress=False)
    assert len(reference) == len(history)
    for column in ("time", "opening", "kinetic_energy", "a[bond]", "released_energy"):
        name = "m[opening]" if column == "opening" else column
        mine, theirs = (h[name].astype(float) for h in (history, reference))
        np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-8 * np.abs(theirs).max())


@pytest.mark.slow
def test_slow_opening_is_quasi_static(comm: MPI.Intracomm) -> None:
    """At 0.5 m/s the crack is at each length at the opening of statics, within 3 %."""
    scene, bond = dcb(comm, 50.0, 1.0, 500.0, crack=24.0)
    step = fx.Explicit(until=[fx.CrackLength(bond, 28.0), fx.Time(1e-2)], rows=2000)
    history = scene.run(step, progress=False)
    still, bond = dcb(comm, 50.0, 1.0, 1.0, crack=24.0, dynamic=False)
    static = still.run(fx.Static(until=fx.CrackLength(bond, 28.0)), progress=False)
    a, opening = (history[c].astype(float) for c in ("a[bond]", "m[opening]"))
    rest, held = (static[c].astype(float) for c in ("a[bond]", "m[opening]"))
    lengths = np.arange(21.0, 28.0)
    # the row after the release of a node, of either, shows the next length
    found = [opening[int(np.argmax(a > n + 0.5))] for n in lengths]
    expected = [held[int(np.flatnonzero(rest < n + 0.5)[-1])] for n in lengths]
    np.testing.assert_allclose(found, expected, rtol=0.03)
    assert history["spent[bond]"][-1] == pytest.approx(GC, rel=1e-12)
    assert off_balance(history) < 1e-9


@pytest.mark.mpi
def test_reactions_of_bonded_ends(comm: MPI.Intracomm) -> None:
    """Bonded strips clamped at an end of the interface carry what presses on them, at rest."""
    bond = fx.Interface(slave=fx.Face("l", "top"), master=fx.Face("u", "bottom"), name="bond")
    length = 12.0
    first = 3.516 / length**2 * np.sqrt(E * (2.0 * HEIGHT) ** 2 / (12.0 * RHO))
    scene = fx.Scene(
        arms(comm, length, 2.0),
        model=fx.Shell(),
        materials=fx.Section(fx.Isotropic(E, 0.0, density=RHO), thickness=HEIGHT),
        supports=[fx.Clamp("u_a1", name="upper"), fx.Clamp("l_a1", name="lower")],
        loads=[
            fx.Pressure(
                fx.Face("u", "top"), 2.0, amplitude=fx.SmoothStep((0.0, 6.0 / first), (0.0, 1.0))
            )
        ],
        bonds=[bond],
        effects=[fx.Inertia(rayleigh=(2.0 * first, 0.0))],
        monitors=[fx.Monitor("u0_a0", (0, 0, 1), name="end")],
    )
    history = scene.run(fx.Explicit(until=fx.Time(20.0 / first), rows=20), progress=False)
    force = 2.0 * WIDTH * (length - FREE)
    total = history["R[upper.z]"][-1] + history["R[lower.z]"][-1]
    assert total == pytest.approx(force, rel=1e-3)
    # bending of the whole and shear: a beam of both heights, loaded over the part that is bonded
    inertia, part = WIDTH * (2.0 * HEIGHT) ** 3 / 12.0, length - FREE
    q = 2.0 * WIDTH
    beam = q * part**4 / (8.0 * E * inertia) + FREE * q * part**3 / (6.0 * E * inertia)
    beam += q * part**2 / 2.0 / (5.0 / 6.0 * 0.5 * E * 2.0 * HEIGHT * WIDTH)
    assert -history["m[end]"][-1] == pytest.approx(beam, rel=0.05)
    assert off_balance(history) < 1e-9


def test_faces_do_not_pass_through_each_other(comm: MPI.Intracomm) -> None:
    """Contact of faces of shells: arms that close again do not overlap, and gain no energy."""
    scene, bond = dcb(comm, 20.0, 1.0, 2e4, contact=True)
    step = fx.Explicit(until=[fx.CrackLength(bond, 14.0), fx.Time(1e-4)], rows=30)
    history = scene.run(step, progress=False)
    lost = history["contact_energy"].astype(float)
    assert lost.max() > 0.0 and lost.min() > -1e-9 * lost.max()
    assert off_balance(history) < 1e-9


def test_refusals(comm: MPI.Intracomm) -> None:
    """What stands against points of faces as unknowns is named."""

    def run(scene: fx.Scene, **given: Any) -> None:
        scene.run(fx.Explicit(until=fx.Time(1e-6), **given), progress=False)

    with pytest.raises(fx.InputError, match="bonds with a stiffness"):
        run(dcb(comm, 8.0, 2.0, 1e4, crack=6.0, stiffness=(1e5, 1e5, 1e5))[0])
    with pytest.raises(fx.InputError, match="mass_scale='dt' is not available beside interfaces"):
        run(dcb(comm, 8.0, 2.0, 1e4, crack=6.0)[0], dt=1e-7, mass_scale="dt")
    bond = fx.Interface(slave=fx.Face("l", "top"), master=fx.Face("u", "bottom"), name="bond")
    given: dict[str, Any] = {
        "model": fx.Shell(),
        "materials": fx.Section(fx.Isotropic(E, 0.0, density=RHO), thickness=HEIGHT),
        "bonds": [bond],
    }
    inertia = fx.Inertia()
    scene = fx.Scene(
        arms(comm, 8.0, 2.0), supports=[fx.Clamp("u0_a0")],
        effects=[inertia, fx.FiniteStrain()], **given,
    )  # fmt: skip
    with pytest.raises(fx.InputError, match="is for small rotations"):
        run(scene)
    scene = fx.Scene(
        arms(comm, 8.0, 2.0), supports=[fx.Clamp("u0_a0"), fx.Displacement("u_a1", z=0.0)],
        effects=[inertia], **given,
    )  # fmt: skip
    with pytest.raises(fx.InputError, match="holds displacement or director alone, in z"):
        run(scene)
    layers = sheets(
        [
            Sheet(name, [0.0, 2.0, 4.0], [0.0, 2.0], lambda a, b, z=z: (a, b, z + 0.0 * a))
            for name, z in (("a", 0.0), ("b", HEIGHT), ("c", 2.0 * HEIGHT))
        ],
        comm,
    )
    given["bonds"] = [
        fx.Interface(slave=fx.Face("a", "top"), master=fx.Face("b", "bottom"), name="first"),
        fx.Interface(slave=fx.Face("c", "bottom"), master=fx.Face("b", "top"), name="second"),
    ]
    scene = fx.Scene(layers, supports=[fx.Clamp("b_a0")], effects=[inertia], **given)
    with pytest.raises(fx.InputError, match="on its top and on its bottom at one node"):
        run(scene)
