"""Energy release rates by domain integrals, and their modes, beside closed forms.

Closed forms: centre crack (plate of 40 a, Feddersen's finite width factor), two half-planes with a
crack between them (Rice 1988), penny-shaped crack (Sneddon 1946), bilayer that cools (Suo and
Hutchinson 1990). The meshes are coarse, 4 elements along half a crack of second order, so that the
whole file takes seconds; the tolerances are twice what was measured on them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import FORCES, HELD_FAR, bond, dcb, specimen

import fxcrack as fx
from fxcrack.demos import penny, thermal_bilayer
from fxcrack.meshes.center_crack import center_crack
from fxcrack.meshes.dcb import dcb_2d, dcb_3d

E, NU = 200e3, 0.3
STIFF, SOFT = fx.Isotropic(E, NU), fx.Isotropic(10e3, 0.2)
WIDE = 1.0 / np.cos(np.pi / 40.0)
PULLED = [fx.Traction("top", (0.0, 1.0)), fx.Traction("bottom", (0.0, -1.0))]
SHEARED = [
    *(fx.Traction("top", (1.0, 0.0)), fx.Traction("bottom", (-1.0, 0.0))),
    *(fx.Traction("left", (0.0, -1.0)), fx.Traction("right", (0.0, 1.0))),
]


def on_crack(x: np.ndarray) -> np.ndarray:
    return np.where(np.abs(x[0]) < 1.0 - 1e-9, 1.0, 0.0)


INFLATED = [fx.Pressure("upper_face", on_crack), fx.Pressure("lower_face", on_crack)]


def plate(
    loads: Sequence[Any],
    criterion: Any,
    *,
    materials: Any = STIFF,
    watch: Sequence[Any] = (),
    order: int = 2,
    n: int = 4,
    cell: str = "quadrilateral",
) -> fx.history.Row:
    """The state at time 1 of a plate with a crack of half length 1, long before it grows."""
    mesh = center_crack(
        a=1.0, width=40.0, height=40.0, n_crack=n, fine=0.75, growth=1.5, order=order, cell=cell
    )
    interface = fx.Interface(
        "upper_face", "lower_face", lambda x: np.abs(x[0]) >= 1.0 - 1e-9, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=materials,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("bottom_left", x=0.0, y=0.0),
            fx.Displacement("bottom_right", y=0.0),
        ],
        loads=loads,
        debonds=[fx.Debond(interface, criterion, watch=watch)],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
    scene.close()
    return row


def domain(**options: Any) -> fx.VCCT:
    return fx.VCCT(GIc=1.0, method="domain", **options)


@pytest.mark.parametrize(("loads", "mode", "width"), [(INFLATED, "I", WIDE), (SHEARED, "II", 1.0)])
def test_centre_crack(loads: Sequence[Any], mode: str, width: float) -> None:
    # measured: G within 0.1 % (VCCT -1.9 % pulled, -3.0 % sheared)
    row = plate(loads, domain())
    exact = np.pi * (1.0 - NU**2) / E * width
    assert float(row[f"G{mode}[bond]"]) == pytest.approx(exact, rel=0.005)
    k = np.sqrt(np.pi * width)
    assert abs(float(row[f"K{mode}[bond]"])) == pytest.approx(k, rel=0.005)
    other = "II" if mode == "I" else "I"
    assert abs(float(row[f"K{other}[bond]"])) < 1e-6 * k


def test_pressure_on_the_faces_is_remote_tension() -> None:
    # superposition of a uniform stress, which is exact on every mesh
    a, b = (plate(loads, domain(), order=1) for loads in (PULLED, INFLATED))
    for name in ("GI[bond]", "KI[bond]"):
        assert float(a[name]) == pytest.approx(float(b[name]), rel=1e-6)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_first_order_intensity_factor(cell: str) -> None:
    # 8 elements along half the crack, where VCCT is 3 and 6 % short of G: measured 0.1 %
    row = plate(PULLED, domain(), order=1, n=8, cell=cell)
    assert float(row["KI[bond]"]) == pytest.approx(np.sqrt(np.pi * WIDE), rel=0.005)


def oscillation(a: fx.Isotropic, b: fx.Isotropic) -> float:
    """Oscillation index of two isotropic materials in plane strain (Dundurs' beta)."""
    (m1, k1), (m2, k2) = ((m.E / 2.0 / (1.0 + m.nu), 3.0 - 4.0 * m.nu) for m in (a, b))
    beta = (m1 * (k2 - 1.0) - m2 * (k1 - 1.0)) / (m1 * (k2 + 1.0) + m2 * (k1 + 1.0))
    return float(np.log((1.0 - beta) / (1.0 + beta)) / (2.0 * np.pi))


@pytest.mark.parametrize("length", [0.1, pytest.param(1.0, marks=pytest.mark.slow)])
def test_crack_between_two_materials(length: float) -> None:
    # K = p sqrt(pi a) (1 + 2 i eps) (2 a)^{-i eps}; measured: phase 0.02 degrees, size 0.03 %
    both = {"upper": STIFF, "lower": SOFT}
    row = plate(INFLATED, domain(reference_length=length), materials=both)
    eps = oscillation(STIFF, SOFT)
    exact = (1.0 + 2j * eps) * (0.5 * length) ** (1j * eps) * np.sqrt(np.pi * WIDE)
    k = complex(float(row["KI[bond]"]), float(row["KII[bond]"]))
    assert np.angle(k, deg=True) == pytest.approx(np.angle(exact, deg=True), abs=0.3)
    assert abs(k) == pytest.approx(abs(exact), rel=0.005)


@pytest.mark.slow
def test_modes_of_two_materials_do_not_depend_on_the_mesh() -> None:
    # the share of mode II by VCCT goes from 6 to 11 % between these meshes
    both, shares = {"upper": STIFF, "lower": SOFT}, []
    for n in (4, 8):
        row = plate(INFLATED, domain(reference_length=0.2), materials=both, order=1, n=n)
        shares.append(float(row["GII[bond]"]) / float(row["GI[bond]"]))
    assert shares[0] == pytest.approx(shares[1], abs=0.003)


def test_reference_length_is_asked_for(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("WARNING", logger="fxcrack"):
        plate(INFLATED, domain(), materials={"upper": STIFF, "lower": SOFT}, order=1)
    assert "reference_length" in caplog.text


@pytest.mark.slow
def test_a_front_with_a_step_is_followed_and_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    """A strip between grips: G is the same everywhere but for what the step of the front does.

    The front passes the step along an edge of the elements that is nearly parallel to the growth.
    Where such edges were left out of it G was 4 times the mean there.
    """
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= 3.0 - 1e-9 + 0.2 * (abs(x[2] - 0.5) < 0.3),
        name="bond",
    )
    mesh = dcb_3d(length=6.0, height=1.0, width=1.0, z_spacing=np.linspace(0, 1, 9), dx=0.2, ny=5)
    held = [fx.Displacement(name, z=0.0) for name in ("side_0", "side_w")]
    grips = [
        fx.Displacement("top", x=0.0, z=0.0, y=0.01),
        fx.Displacement("bottom", x=0.0, z=0.0, y=-0.01),
    ]
    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.Solid(),
        supports=[*grips, *held],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e5), watch=[domain()])],
    )
    with caplog.at_level("WARNING", logger="fxcrack"):
        scene.run(fx.Static(until=fx.Time(1.0)))
    assert "turns by 58 degrees" in caplog.text
    (line,) = fx.front_lines(scene, bond)
    whole = 70e3 * 0.7 / (1.3 * 0.4) * 0.01**2
    ratio = line.values["GI_domain"] / whole
    assert 0.3 < ratio.min() and ratio.max() < 1.8
    assert ratio[4] < ratio[0]  # the part that is ahead has less


@pytest.mark.slow
def test_rings_do_not_matter() -> None:
    # beyond the first, which the error of the tip itself reaches, measured: 5e-6
    found = []
    for rings in (2, 3, 4):
        row = plate(PULLED, domain(rings=rings))
        found.append((float(row["GI[bond]"]), float(row["KI[bond]"])))
    assert np.allclose(found, found[0], rtol=2e-3)


@pytest.mark.slow
def test_ring_reaches_beyond_a_thin_arm() -> None:
    """Beams of second order: the load of closed forms, with rings that pass the free faces.

    Forces are given, so that no compliance comes in between load and G.
    """
    loads = []
    for rings in (1, 3, 6):
        scene = dcb(
            MPI.COMM_WORLD, dx=1.0, ny=2, order=2, loads=FORCES,
            supports=HELD_FAR, criterion=fx.VCCT(GIc=0.2, method="domain", rings=rings),
        )  # fmt: skip
        scene.run(fx.Static(until=fx.Releases(1)), progress=False)
        loads.append(next(r for r in scene.history if r["event"] == "onset")["time"])
        scene.close()
    # corrected beam theory 2.122; measured 2.12
    assert np.allclose(loads[1:], 2.122, rtol=5e-3)
    assert loads[0] == pytest.approx(2.122, rel=0.03)


@pytest.mark.parametrize("order", [1, 2])
def test_penny_shaped_crack(order: int) -> None:
    # measured, 8 elements along the radius: G +0.9 and -0.3 %
    scene, found = penny.run(0.25, order, "domain")
    row = next(r for r in scene.history if r["event"] == "onset")
    k = float(row["KI[crack]"]) / float(row["time"])
    scene.close()
    exact = 2.0 * penny.PRESSURE * np.sqrt(penny.RADIUS / np.pi)
    assert k == pytest.approx(exact, rel=0.01 if order == 1 else 0.003)
    assert found["G / exact"] == pytest.approx(1.0, rel=0.02 if order == 1 else 0.006)


@pytest.mark.parametrize("solver", [None, "newton"])
def test_bilayer_that_cools(solver: str | None) -> None:
    # steady state, crack three thicknesses long: measured 1e-4 on elements of half a thickness
    t = thermal_bilayer
    interface = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 3.0 - 1e-9, name="bond")
    criterion = fx.VCCT(GIc=0.1, method="domain", reference_length=1.0)
    scene = fx.Scene(
        t.layers(0.5),
        materials={"upper": t.UPPER, "lower": t.LOWER},
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("middle_upper", x=0.0),
            fx.Displacement("middle_lower", x=0.0),
            fx.Displacement("foot", y=0.0),
        ],
        debonds=[fx.Debond(interface, criterion)],
        effects=[fx.Temperature(t.HOT - 1.0, reference=t.HOT)],
        solver=solver,
    )
    scene.run(fx.Static(until=fx.Releases(1)), progress=False)
    row = next(r for r in scene.history if r["event"] == "onset")
    assert 0.1 == pytest.approx(t.steady_rate(float(row["time"])), rel=5e-3)
    scene.close()


def test_modes_beside_loads_on_outer_faces() -> None:
    """A ring that reaches the loaded face of a thin arm gives the factors of one that does not.

    The integrals do not depend on the ring: measured 2e-4 of the larger factor.
    """
    found = []
    for rings in (2, 6):
        scene = specimen(
            dcb_2d(length=20.0, dx=0.25, ny=6, order=2),
            a0=10.0,
            criterion=domain(rings=rings),
            supports=HELD_FAR,
            loads=[fx.Traction("top", (0.3, 1.0))],
        )
        row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
        found.append([float(row[f"{k}[bond]"]) for k in ("KI", "KII")])
        scene.close()
    assert np.allclose(found[1], found[0], rtol=1e-3)


@pytest.mark.parametrize("lengths", [(1.0, 0.5), (0.25, 1.0)])
def test_tip_on_a_jump_of_the_element_size(lengths: tuple[float, float]) -> None:
    """A load on the ends of a DCB, corrected beam theory: measured within 0.1 % at 1:4 to 4:1.

    VCCT is up to 1.1 % off there.
    """
    behind, ahead = lengths
    x = np.concatenate([np.arange(0.0, 30.0, behind), np.arange(30.0, 60.1, ahead)])
    scene = specimen(
        dcb_2d(length=60.0, x_spacing=x, ny=3, order=2),
        loads=FORCES,
        supports=HELD_FAR,
        criterion=fx.VCCT(GIc=0.2, method="domain"),
    )
    scene.run(fx.Static(until=fx.Releases(1)), progress=False)
    onset = next(r for r in scene.history if r["event"] == "onset")
    scene.close()
    assert float(onset["time"]) == pytest.approx(2.122, rel=5e-3)


THIN: dict[str, Any] = {"length": 20.0, "height": 0.5, "dx": 0.5, "ny": 1, "order": 2}


def test_finite_strain_at_small_loads_is_small_strain() -> None:
    """Unequal forces, so that both modes act: differences of the order of the strain, 1e-4."""
    found = []
    loads = [fx.PointForce("pin_top", (0.0, 1e-3)), fx.PointForce("pin_bottom", (0.0, -5e-4))]
    for effects in ([], [fx.FiniteStrain()]):
        scene = specimen(
            dcb_2d(**THIN), a0=10.0, criterion=domain(), effects=effects, loads=loads,
            supports=HELD_FAR,
        )  # fmt: skip
        row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
        found.append([float(row[f"{k}[bond]"]) for k in ("GI", "GII", "KI", "KII")])
        scene.close()
    assert np.allclose(found[1], found[0], rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("material", [STIFF, fx.NeoHookean(E, NU)])
def test_finite_strain_releases_the_energy(material: Any) -> None:
    """Arms that turn by 25 degrees: G is the derivative of the energy at held displacements.

    The energies are those of cracks 0.06 elements shorter: their G is 1.2 % larger at a = 10, where
    it goes with the fourth power; measured 0.8 %.
    """
    energies, total = [], 0.0
    for a in (9.5, 10.0, 10.5):
        scene = specimen(
            dcb_2d(**THIN),
            a0=a,
            materials=material,
            criterion=fx.VCCT(GIc=1e9, method="domain"),
            effects=[fx.FiniteStrain()],
            supports=[
                fx.Displacement("pin_top", y=3.0),
                fx.Displacement("pin_bottom", y=-3.0),
                *HELD_FAR,
            ],
        )
        step = fx.Static(until=fx.Time(1.0), initial=0.25, maximum=0.25)
        row = scene.run(step, progress=False)[-1]
        energies.append(float(row["strain_energy"]))
        if a == 10.0:
            total = sum(float(row[f"G{mode}[bond]"]) for mode in ("I", "II"))
        scene.close()
    assert total == pytest.approx(energies[0] - energies[2], rel=0.015)


def test_onsets_of_a_growing_crack() -> None:
    """Every onset lies at f = 1 exactly, and energy balances: loads come from the same states."""
    scene = dcb(MPI.COMM_WORLD, dx=1.0, ny=2, criterion=fx.VCCT(GIc=0.2, method="domain"))
    history = scene.run(fx.Static(until=fx.Releases(3)), progress=False)
    onsets = [float(r["f[bond]"]) for r in history if r["event"] in ("onset", "unstable")]
    assert np.allclose(onsets, 1.0, atol=1e-9)
    scene.close()


def test_watched_beside_another_method() -> None:
    row = plate(PULLED, fx.VCCT(GIc=1.0), watch=[domain(), fx.VCCT(GIc=1.0, method="closure")])
    decides, watched = float(row["GI[bond]"]), float(row["GI_domain[bond]"])
    assert watched != decides
    # VCCT is 1.9 % below the closed form on this mesh, the integral at it
    assert watched == pytest.approx(decides * 1.02, rel=0.005)
    assert float(row["GI_closure[bond]"]) == pytest.approx(decides * 1.12, rel=0.05)


@pytest.mark.slow
def test_front_in_space_releases_the_energy() -> None:
    """The sum along a straight front is the derivative of the energy at held displacements.

    Central difference over a +- 1 of an energy that goes with a^-3: 0.3 % off at a = 25.
    """
    mesh = dcb_3d(length=40.0, width=5.0, dx=1.0, dy=2.5, ny=1, order=2)
    energies, total = [], 0.0
    for a in (24.0, 25.0, 26.0):
        scene = specimen(mesh, a0=a, criterion=fx.VCCT(GIc=2e3, method="domain"))
        history = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
        energies.append(float(history[-1]["strain_energy"]))
        if a == 25.0:
            crack = scene.cracks[0]
            values = crack.evaluate(crack.tips(), scene.solver.state, scene.time)
            rates = sum(values.report[f"G{mode}"] for mode in ("I", "II", "III"))
            # corner nodes have linear functions along the front, midside nodes the mean of both
            z = scene.pairs[0].surface.x[values.tips.node, 2]
            share = {0.0: 1.25, 2.5: 2.5, 5.0: 1.25}
            width = np.array([share.get(float(np.round(v, 6)), 0.0) for v in z])
            total = float(np.sum(rates * width))
        scene.close()
    assert total == pytest.approx(0.5 * (energies[0] - energies[2]), rel=0.02)


def refused(build: Callable[[], Any]) -> str:
    with pytest.raises(fx.InputError, match="domain") as error:
        build()
    return str(error.value)


def test_refusals() -> None:
    mesh = dcb_2d(dx=5.0, ny=1)
    interface = bond(30.0)
    law = fx.VCCT(GIc=0.2, method="domain")
    assert "StepRelease" in refused(lambda: fx.Debond(interface, law, fx.ProgressiveRelease()))
    step = fx.Static(until=fx.Releases(1))
    plastic = specimen(mesh, criterion=law, materials=fx.Plastic(70e3, 0.3, yield_stress=1e3))
    assert "plasticity" in refused(lambda: plastic.run(step))


@pytest.mark.mpi
def test_same_on_any_number_of_ranks(comm: MPI.Intracomm) -> None:
    """The same number on one rank and on all: rounding of the sums apart."""
    found = []
    for chosen in (MPI.COMM_SELF, comm):
        scene = dcb(chosen, dx=2.0, ny=2, order=2, criterion=fx.VCCT(GIc=0.2, method="domain"))
        scene.run(fx.Static(until=fx.Releases(2)), progress=False)
        found.append([float(x) for x in scene.history["time"]])
        scene.close()
    assert np.allclose(found[0], found[1], rtol=1e-9)
