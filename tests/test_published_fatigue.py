"""Fatigue of published specimens beside closed forms: modes I, II and mixed, both controls, 3-D.

HTA/6376C, arms 1.55 high and 20 wide cracked to 35 mm: constants of the Paris law in the mode mix
by Turon, Costa, Camanho and Davila (Composites A 38 (2007) 2270) for the tests of Asp, Sjoegren and
Greenhalgh (J. Compos. Technol. Res. 23 (2001) 55), whose thresholds are 23, 15 and 10 % of the
toughness in mode I, half and half, and mode II. N(a) is integrated here from beam theory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from specimens import FORCES, HELD_FAR, PINS, bond, growth_curve, largest_imbalance

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.mmb import mmb_2d

Array = npt.NDArray[np.float64]
Rates = Callable[[float], tuple[float, float]]

BEAM = CorrectedBeam(E=120e3, E22=10.5e3, G=5.25e3, h=1.55, b=20.0)
STIFFNESS = BEAM.E * BEAM.inertia
ARMS = fx.Orthotropic(E=(120e3, 10.5e3, 10.5e3), nu=(0.30, 0.30, 0.51), G=(5.25e3, 5.25e3, 3.48e3))
GIC, GIIC, ETA = 0.260, 1.002, 1.988  # 0.447 half and half
THRESHOLD = ([0.0, 0.5, 1.0], [0.23, 0.15, 0.10])
LAW = fx.Blanco(0.0616, 5.4, 2.99, 4.5, 458087.0, 4.94, r1=THRESHOLD, r2=0.9)
FATIGUE = fx.Fatigue(GIc=GIC, GIIc=GIIC, mix=fx.BK(eta=ETA), growth=LAW)
HALF_SPAN, A0, R = 50.0, 36.0, 0.1


def critical(phi: float) -> float:
    """Toughness at a share of mode II."""
    return GIC + (GIIC - GIC) * phi**ETA


def speed(rates: tuple[float, float], ratio: float = R) -> float:
    """da/dN at the largest G_I and G_II, the law written out anew."""
    whole = sum(rates)
    phi = rates[1] / whole
    factor = 0.0616 * 458087.0**phi * (2.99 / (458087.0 * 0.0616)) ** phi**2
    power = 5.4 + 4.94 * phi + (4.5 - 5.4 - 4.94) * phi**2
    return float(factor * ((1.0 - ratio**2) * whole / critical(phi)) ** power)


def lives(rates: Rates, a: Array, ratio: float = R) -> Array:
    """N at crack lengths."""
    return np.array(
        [quad(lambda x: 1.0 / speed(rates(x), ratio), a[0], x, epsrel=1e-8)[0] for x in a]
    )


def test_the_law_in_the_mode_mix_is_that_of_the_tests_half_and_half() -> None:
    """C = 4.23 and m = 6.41 were measured there; the interpolation has three and four digits."""
    one, two = (
        float(LAW.growth(fx.CycleRates(np.array([g]), np.array([g]), 1.0, 0.5))[0])
        for g in (0.1, 0.2)
    )
    power = np.log(two / one) / np.log(2.0)
    assert power == pytest.approx(6.41, abs=5e-3)
    assert one * 10.0**power == pytest.approx(4.23, abs=5e-3)


@pytest.mark.parametrize(("phi", "ratio"), [(0.0, 0.1), (0.5, 0.1), (1.0, 0.5)])
def test_moments_on_both_arms_grow_by_the_law_on_elements_of_2_mm(phi: float, ratio: float) -> None:
    """G does not depend on a: M_I^2/(b E I) and 3/4 M_II^2/(b E I) (Williams 1988).

    Beams of second order bend exactly, and so does the bonded part: what is left is the end of the
    beam, six heights away.
    """
    whole = 0.4 * critical(phi)
    one = np.sqrt((1.0 - phi) * whole * BEAM.b * STIFFNESS)
    two = np.sqrt(phi * whole * BEAM.b * STIFFNESS / 0.75)

    def bending(moment: float) -> Callable[[Array], Array]:
        scale = 12.0 * moment / (BEAM.b * BEAM.h**3)
        return lambda x: scale * (np.abs(x[1]) - 0.5 * BEAM.h)

    interface = bond(A0)
    scene = fx.Scene(
        dcb_2d(length=60.0, height=BEAM.h, dx=2.0, ny=1, order=2),
        materials=ARMS,
        model=fx.PlaneStress(thickness=BEAM.b),
        supports=HELD_FAR,
        loads=[
            fx.Traction("end_upper", (bending(two + one), 0.0)),
            fx.Traction("end_lower", (bending(one - two), 0.0)),
        ],
        debonds=[fx.Debond(interface, FATIGUE)],
    )
    step = fx.Cycles(maximum=1.0, ratio=ratio, until=fx.CrackLength(interface, 44.0))
    history = scene.run(step, progress=False)
    a, N = growth_curve(history)
    assert len(a) == 5 and largest_imbalance(history) < 1e-9
    expected = (a - A0) / speed(((1.0 - phi) * whole, phi * whole), ratio)
    np.testing.assert_allclose(N[1:], expected[1:], rtol=2e-3)
    # at 0.12 of the toughness mode II alone is above its threshold
    step = fx.Cycles(maximum=np.sqrt(0.3), ratio=ratio, n_max=1e-3)
    assert scene.run(step, progress=False).reason.startswith("arrest") == (phi < 1.0)
    scene.close()


def specimen(mesh: fx.Mesh, supports: Any, loads: Any, **options: Any) -> fx.Scene:
    """A specimen in plane stress."""
    return fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.PlaneStress(thickness=BEAM.b),
        supports=supports,
        loads=loads,
        debonds=[fx.Debond(bond(A0, **options), FATIGUE)],
    )


def beam_dcb(dx: float, control: str) -> tuple[fx.Scene, float, Rates]:
    """A double cantilever beam, the largest load or half opening of the cycle, and its rates."""
    mesh = dcb_2d(length=80.0, height=BEAM.h, dx=dx, ny=2, order=2)
    load = BEAM.dcb_load(A0, (0.4 if control == "force" else 0.7) * GIC)
    shift = BEAM.chi * BEAM.h
    if control == "force":
        scale = load**2 / (BEAM.b * STIFFNESS)
        return specimen(mesh, HELD_FAR, FORCES), load, lambda a: (scale * (a + shift) ** 2, 0.0)
    half = 0.5 * BEAM.dcb_opening(A0, load)
    scale = 9.0 * STIFFNESS * half**2 / BEAM.b
    return specimen(mesh, PINS, ()), half, lambda a: (scale / (a + shift) ** 4, 0.0)


def beam_enf(dx: float, control: str) -> tuple[fx.Scene, float, Rates]:
    """End-notched flexure with contact, likewise."""
    mesh = enf_2d(half_span=HALF_SPAN, height=BEAM.h, dx=dx, ny=2, order=2)
    held = [
        fx.Displacement("support_left", y=0.0),
        fx.Displacement("support_right", x=0.0, y=0.0),
    ]
    load = BEAM.enf_load(A0, 0.3 * GIIC)
    if control == "force":
        scene = specimen(mesh, held, [fx.PointForce("load", (0.0, -1.0))], contact=True)
        return scene, load, lambda a: (0.0, BEAM.enf_rate(a, load))
    down = BEAM.enf_deflection(A0, load, HALF_SPAN)
    scene = specimen(mesh, [*held, fx.Displacement("load", y=-1.0)], (), contact=True)
    return (
        scene,
        down,
        lambda a: (0.0, BEAM.enf_rate(a, down / BEAM.enf_deflection(a, 1.0, HALF_SPAN))),
    )


def beam_mmb(dx: float, _: str) -> tuple[fx.Scene, float, Rates]:
    """Mixed-mode bending with half of each mode, likewise."""
    lever = 42.0
    mesh = mmb_2d(half_span=HALF_SPAN, height=BEAM.h, dx=dx, ny=2, order=2)
    held = [
        fx.Displacement("support_left", y=0.0),
        fx.Displacement("support_right", x=0.0, y=0.0),
    ]
    forces = [
        fx.PointForce("lever_end", (0.0, lever / HALF_SPAN)),
        fx.PointForce("load", (0.0, -(lever + HALF_SPAN) / HALF_SPAN)),
    ]
    one, two = BEAM.mmb_rates(A0, 1.0, lever, HALF_SPAN)
    load = float(np.sqrt(0.4 * critical(two / (one + two)) / (one + two)))
    scene = specimen(mesh, held, forces, contact=True)
    return scene, load, lambda a: BEAM.mmb_rates(a, load, lever, HALF_SPAN)


@pytest.mark.slow
@pytest.mark.verification
@pytest.mark.parametrize(
    ("make", "control", "power"),
    [
        (beam_dcb, "force", 5.4),
        (beam_dcb, "displacement", 5.4),
        (beam_enf, "force", 4.5),
        (beam_enf, "displacement", 4.5),
        (beam_mmb, "force", 6.4),
    ],
)
def test_specimens_live_as_long_as_beam_theory_says(
    make: Callable[[float, str], tuple[fx.Scene, float, Rates]], control: str, power: float
) -> None:
    """N(a) to the power 1/m within 2.5 % of beam theory on elements of 2 and 1 mm.

    G of corrected beam theory is known to 1 or 2 %: in the limit of fine meshes it is 1.2 % above
    that of plane elasticity in end-notched flexure under a force, and 0.5 % in mixed-mode bending.
    Growth under displacement control ends where G falls to the threshold, if it does.
    """
    found = []
    for dx in (2.0, 1.0):
        scene, top, rates = make(dx, control)
        interface = scene.debonds[0].interface
        step = fx.Cycles(maximum=top, ratio=R, until=fx.CrackLength(interface, 44.0))
        history = scene.run(step, progress=False)
        a, N = growth_curve(history)
        ratio = (N[1:] / lives(rates, a)[1:]) ** (1.0 / power)
        np.testing.assert_allclose(ratio, 1.0, atol=0.025)
        found.append(np.interp([40.0, 42.0], a[1:], np.log(N[1:])))
        if make is beam_dcb and control == "displacement":
            step = fx.Cycles(maximum=top, ratio=R)
            history = scene.run(step, progress=False)
            assert history.reason.startswith("arrest")
            last = history.rows[-1]["a[bond]"]
            # the element in which G comes to the threshold is not passed
            held = 0.23 * GIC
            assert sum(rates(last)) > 0.985 * held and sum(rates(last + dx)) < 1.015 * held
        scene.close()
    # both meshes: 1 % in G at most
    np.testing.assert_allclose(found[0], found[1], atol=0.01 * power)


@pytest.mark.slow
@pytest.mark.verification
def test_a_front_in_3d_lives_as_the_derivative_of_its_stiffness_says() -> None:
    """Half of a beam 10 wide: cycles per millimetre once the front has bowed out, exponent 5.4.

    The mean of G along the front is the derivative of the energy, which straight fronts on the same
    mesh give; away from the free edge G is the same all along the bowed front.
    """
    law = fx.Paris(0.0, -1.0, 0.0616, 5.4, 0.1, 0.95, normalised=True)
    width, top = 5.0, 0.5

    def scene(a0: float, criterion: Any) -> fx.Scene:
        mesh = dcb_3d(
            length=50.0, height=BEAM.h, width=width, dx=1.0, dy=1.0, ny=2, fine=(24.0, 31.0),
            coarse_dx=4.0,
        )  # fmt: skip
        return fx.Scene(
            mesh,
            materials=ARMS,
            model=fx.Solid(),
            supports=[fx.Symmetry("side_0", "z"), *PINS],
            debonds=[fx.Debond(bond(a0), criterion)],
        )

    lengths, stiffness = np.array([24.0, 26.0, 28.0, 30.0]), []
    for a0 in lengths:
        still = scene(float(a0), fx.VCCT(GIc=1e5))
        row = still.run(fx.Static(until=fx.Time(1.0)), grow=[], progress=False)[-1]
        stiffness.append(row["R[pin_top.y]"] / row["u[pin_top.y]"])
        still.close()
    curve = CubicSpline(lengths, np.log(stiffness))

    def slow(a: float) -> float:
        rate = -(top**2) * np.exp(curve(a)) * curve(a, 1) / width
        return float(1.0 / (0.0616 * ((1.0 - R**2) * rate / GIC) ** 5.4))

    tired = scene(25.0, fx.Fatigue(GIc=GIC, paris=law, partial=True))
    interface = tired.debonds[0].interface
    step = fx.Cycles(maximum=top, ratio=R, until=fx.CrackLength(interface, 29.5))
    history = tired.run(step, progress=False)
    a, N = growth_curve(history)
    tired.close()
    at = np.exp(np.interp([27.0, 28.0, 29.0], a[1:], np.log(N[1:])))
    expected = [quad(slow, x, x + 1.0, epsrel=1e-8)[0] for x in (27.0, 28.0)]
    np.testing.assert_allclose(np.diff(at), expected, rtol=0.05)
