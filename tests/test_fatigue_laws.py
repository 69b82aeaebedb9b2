"""Laws of fatigue growth: driving forces, mode mix, thresholds, laws of the user."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from specimens import (
    GROWS,
    HALF_OPENING,
    PARIS,
    bond,
    fatigue_bilayer,
    fatigue_law,
    fatigue_specimen,
    growth_curve,
    onsets,
    until_length,
)

import fxcrack as fx
from fxcrack.criteria import Regime, element_cycles
from fxcrack.demos import thermal_bilayer
from fxcrack.demos.mmb import ARMS, CRITERION, HALF_SPAN
from fxcrack.meshes.mmb import mmb_2d

Array = npt.NDArray[np.float64]

# a cycle with R = 0.3 at three mode mixes
G_MAX, R = np.array([0.2, 0.3, 0.4]), 0.3
CYCLE = fx.CycleRates((1.0 - R**2) * G_MAX, G_MAX, np.array([0.5, 0.6, 0.8]), [0.0, 0.4, 1.0])
EXACT = {"rtol": 1e-12}  # a few products and powers

BLANCO = fx.Blanco(0.0616, 5.4, 2.99, 4.5, 4.23, 4.94)


def test_the_exponent_of_a_function_does_not_depend_on_the_units() -> None:
    for unit in (1.0, 1e-3, 1e6):
        law = fx.Fatigue(
            GIc=1.0, growth=lambda c, unit=unit: (c.G_max / unit) ** 3 + 0.0
        ).growth_law
        assert law.life_exponent(0.3 * unit) == pytest.approx(3.0)
    # a threshold near the toughness makes growth steep: the largest slope counts
    law = fx.Fatigue(GIc=1.0, growth=lambda c: np.maximum(c.G_max - 0.05, 0.0)).growth_law
    assert 1.7 < law.life_exponent(1.0) < 2.1


def test_what_a_cycle_says_of_itself() -> None:
    np.testing.assert_allclose(CYCLE.R, R, **EXACT)
    np.testing.assert_allclose(CYCLE.G_min, R**2 * G_MAX, **EXACT)
    np.testing.assert_allclose(CYCLE.modes[:, 0], [0.2, 0.18, 0.0], atol=1e-15)
    torn = fx.CycleRates(0.1, np.array([0.4]), 1.0, 0.5, 0.25)
    np.testing.assert_allclose(torn.modes, [[0.2, 0.15, 0.05]], **EXACT)
    assert fx.CycleRates(0.0, np.zeros(1), 1.0).R.tolist() == [0.0]


@pytest.mark.parametrize(
    ("drive", "part"),
    [
        ("dG", 1.0 - R**2),
        ("G_max", 1.0),
        ("dK", (1.0 - R) ** 2),
        (fx.Walker(0.0), 1.0),
        (fx.Walker(0.5), 1.0 - R),
        (fx.Walker(1.0), (1.0 - R) ** 2),
        (fx.Elber(1.0, 0.0), (1.0 - R) ** 2),
        (fx.Elber(0.5, 0.4), (0.62 * (1.0 - R)) ** 2),
        (fx.Elber(0.9, 0.5), (1.0 - R) ** 2),  # the open part is at most 1
    ],
)
def test_driving_forces(drive: Any, part: float) -> None:
    law = fx.Paris(2.0, -1.5, 0.01, 3.0, drive=drive)
    np.testing.assert_allclose(law.growth(CYCLE), 0.01 * (part * G_MAX) ** 3, **EXACT)
    np.testing.assert_allclose(law.onset(CYCLE), 2.0 * (part * G_MAX) ** -1.5, **EXACT)
    normalised = fx.Paris(2.0, -1.5, 0.01, 3.0, drive=drive, normalised=True)
    expected = 0.01 * (part * G_MAX / CYCLE.G_c) ** 3
    np.testing.assert_allclose(normalised.growth(CYCLE), expected, **EXACT)


def test_stress_intensity_factors() -> None:
    E, nu = 70e3, 0.3
    # dK = (1 - R) K_max, K^2 = E' G
    for state, modulus in (("plane strain", E / (1.0 - nu**2)), ("plane stress", E)):
        law = fx.ParisK(1e-9, 3.2, E, nu, state=state)  # type: ignore[arg-type]
        dK = (1.0 - R) * np.sqrt(modulus * G_MAX)
        np.testing.assert_allclose(law.growth(CYCLE), 1e-9 * dK**3.2, **EXACT)
    assert law.life_exponent(1.0) == 1.6
    # a threshold of dK between the first and the second node
    held = fx.ParisK(1e-9, 3.2, E, state="plane stress", dK_th=0.5 * float(dK[0] + dK[1]))
    assert held.regimes(CYCLE).tolist() == [Regime.NONE, Regime.PARIS, Regime.PARIS]


def test_constants_by_the_mode_mix() -> None:
    ratio = CYCLE.dG / CYCLE.G_c
    found = BLANCO.growth(CYCLE)
    # at phi = 0.4 by hand; the pure modes have their own constants
    m = 5.4 + 4.94 * 0.4 + (4.5 - 5.4 - 4.94) * 0.16
    c = 0.0616 * 4.23**0.4 * (2.99 / (4.23 * 0.0616)) ** 0.16
    hand = [0.0616 * ratio[0] ** 5.4, c * ratio[1] ** m, 2.99 * ratio[2] ** 4.5]
    np.testing.assert_allclose(found, hand, **EXACT)
    law = fx.KenaneBenzeggagh(0.01, 6.0, 1.0, 4.0, 2.0, 3.0)
    m = 6.0 - 2.0 * 0.4**3
    c = 0.01**0.36  # log C_II = 0, (1 - phi)^2 = 0.36
    hand = [0.01 * CYCLE.dG[0] ** 6, c * CYCLE.dG[1] ** m, CYCLE.dG[2] ** 4]
    np.testing.assert_allclose(law.growth(CYCLE), hand, **EXACT)
    assert law.life_exponent(1.0) == 6.0 and BLANCO.life_exponent(1.0) >= 5.4


def test_threshold_and_upper_limit_by_the_mode_mix() -> None:
    # G_max/G_c is 0.4, 0.5, 0.5 at shares 0, 0.4, 1
    table = fx.Paris(0.0, -1.0, 1.0, 3.0, ([0.0, 1.0], [0.45, 0.1]), ([0.0, 1.0], [0.9, 0.45]))
    assert table.regimes(CYCLE).tolist() == [Regime.NONE, Regime.PARIS, Regime.UNSTABLE]
    curve = fx.Paris(0.0, -1.0, 1.0, 3.0, lambda b: 0.45 * (1.0 - b), lambda b: 0.9 - 0.45 * b)
    assert curve.regimes(CYCLE).tolist() == [Regime.NONE, Regime.PARIS, Regime.UNSTABLE]


def test_an_element_ends_where_the_law_changes() -> None:
    # a user's law without growth up to dG = 0.2: on the way from 0.4 to 0.1 the crack arrests
    def law(cycle: fx.CycleRates) -> Array:
        return np.where(cycle.dG > 0.2, 1e-3 * cycle.dG**2, 0.0)

    growth = fx.Fatigue(GIc=1.0, growth=law).growth_law
    high, middle, low = (fx.CycleRates(g, np.array([g]), 1.0) for g in (0.4, 0.3, 0.1))
    assert element_cycles(growth, high, low, 0.5) == [np.inf]
    # log-linear: the mean of 1/(1e-3 g^2) from 0.4 to 0.3
    mean = (0.3**-2 - 0.4**-2) / (1e-3 * 2.0 * np.log(0.4 / 0.3))
    np.testing.assert_allclose(element_cycles(growth, high, middle, 0.5), 0.5 * mean, **EXACT)
    # beyond the upper limit no cycles pass: from 0.8 to 0.2 with the limit at 0.4, half-way
    paris = fx.Paris(0.0, -1.0, 1e-3, 2.0, 0.01, 0.4)
    ends = (fx.CycleRates(g, np.array([g]), 1.0) for g in (0.8, 0.2))
    mean = (0.2**-2 - 0.4**-2) / (1e-3 * 2.0 * np.log(2.0))
    np.testing.assert_allclose(element_cycles(paris, *ends, 1.0), 0.5 * mean, rtol=1e-10)


def test_a_law_of_the_user_grows_as_the_law_it_repeats() -> None:
    def law(cycle: fx.CycleRates) -> Array:
        return 0.5 * cycle.dG**4

    same = fx.Paris(c1=0.0, c2=-1.0, c3=0.5, c4=4.0, r1=0.0, r2=1.0)
    curves = []
    for given in ({"growth": law}, {"paris": same}, {"growth": same}):
        scene = fatigue_specimen(criterion=fx.Fatigue(GIc=0.4, **given))
        step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 33.0))
        curves.append(growth_curve(scene.run(step))[1])
        scene.close()
    np.testing.assert_allclose(curves[0], curves[1], rtol=1e-12)
    np.testing.assert_allclose(curves[2], curves[1], rtol=1e-12)


def test_load_ratio_changes_growth_by_the_driving_force() -> None:
    # the same largest load: N at R over N at 0 is the ratio of growth rates, at every length
    life = {}
    for ratio in (0.0, 0.5):
        law = fx.Paris(0.0, -1.0, 0.5, 4.0, 0.2, 0.9, drive=fx.Walker(0.3))
        scene = fatigue_specimen(criterion=fatigue_law(paris=law))
        step = fx.Cycles(maximum=HALF_OPENING, ratio=ratio, until=until_length(scene, 33.0))
        life[ratio] = growth_curve(scene.run(step))[1][1:]
        scene.close()
    # (0.5^0.6)^4; the dense equilibria of both runs differ by round-off
    np.testing.assert_allclose(life[0.5] / life[0.0], 0.5 ** (-0.6 * 4.0), rtol=1e-8)


def mmb(criterion: Any, lever: float) -> tuple[fx.Scene, fx.Interface]:
    """A coarse mixed-mode bending specimen."""
    interface = bond(25.0, contact=True)
    scene = fx.Scene(
        mmb_2d(half_span=HALF_SPAN, height=1.5, dx=1.0, ny=2),
        materials=ARMS,
        model=fx.PlaneStress(thickness=25.0),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
        ],
        loads=[
            fx.PointForce("lever_end", (0.0, lever / HALF_SPAN)),
            fx.PointForce("load", (0.0, -(lever + HALF_SPAN) / HALF_SPAN)),
        ],
        debonds=[fx.Debond(interface, criterion)],
    )
    return scene, interface


@pytest.mark.verification
@pytest.mark.parametrize("lever", [30.0, 80.0])
def test_mixed_mode_bending_by_blanco_is_its_own_integral(lever: float) -> None:
    """N(a) beside the law integrated over static rates, the law written out anew here."""
    scene, interface = mmb(CRITERION, lever)
    static = scene.run(fx.Static(until=fx.CrackLength(interface, 34.0), stepping="path"))
    scene.close()
    rows = onsets(static)
    load = 0.5 * min(r["F[load]"] for r in rows)
    a = [r["a[bond]"] for r in rows]
    one, two = (
        CubicSpline(a, [r[k] * (load / r["F[load]"]) ** 2 for r in rows])
        for k in ("GI[bond]", "GII[bond]")
    )

    def slow(x: float) -> float:
        g1, g2 = float(one(x)), float(two(x))
        phi = g2 / (g1 + g2)
        critical = 0.1703 + (0.494 - 0.1703) * phi**1.62
        factor = 0.0616 * 4.23**phi * (2.99 / (4.23 * 0.0616)) ** phi**2
        power = 5.4 + 4.94 * phi + (4.5 - 5.4 - 4.94) * phi**2
        return 1.0 / (factor * ((1.0 - 0.1**2) * (g1 + g2) / critical) ** power)

    criterion = fx.Fatigue(GIc=0.1703, GIIc=0.494, mix=fx.BK(eta=1.62), growth=BLANCO)
    scene, interface = mmb(criterion, lever)
    step = fx.Cycles(maximum=load, ratio=0.1, until=fx.CrackLength(interface, 33.0))
    history = scene.run(step)
    scene.close()
    lengths, N = growth_curve(history)
    expected = [quad(slow, 25.0, x, epsrel=1e-8)[0] for x in lengths[1:]]
    assert history.rows[1]["GII[bond]"] > 0.0 and history.rows[1]["GI[bond]"] > 0.0
    # G is taken as log-linear within elements: k da^2/(12 a^2) = 1.5e-3 for growth with a^-12
    np.testing.assert_allclose(N[1:], expected, rtol=3e-3)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: fx.Fatigue(GIc=1.0), "a law of growth is missing"),
        (lambda: fx.Fatigue(GIc=1.0, paris=PARIS, growth=BLANCO), "give one law of growth"),
        (lambda: fx.Fatigue(GIc=1.0, growth=3.0), "growth = 3.0 is no law of fatigue growth"),
        (lambda: fx.Fatigue(GIc=1.0, growth=fx.Paris), "it is a class; make one"),
        (lambda: fx.Fatigue(GIc=1.0, growth=lambda: 1.0), "must be a function of one cycle"),
        (lambda: fx.Paris(0.0, -1.0, 1.0, 1.0, drive="dJ"), "drive = 'dJ' is no driving force"),
        (lambda: fx.Walker(1.5), "gamma = 1.5 must lie between 0 and 1"),
        (lambda: fx.ParisK(1.0, 2.0, 70e3), "plane strain needs Poisson's ratio"),
        (lambda: fx.Blanco(1.0, 2.0, 1.0, 2.0, 1.0, -9.0), "the exponent falls to -0.25"),
        (
            lambda: fx.Paris(0.0, -1.0, 1.0, 1.0, lambda b: b, 0.5),
            "r1 = 0.5 must be below the upper limit r2 = 0.5 at a share of shear of 0.5",
        ),
        (
            lambda: fx.Paris(0.0, -1.0, 1.0, 1.0, ([0.0, 2.0], [0.1, 0.1])),
            "shares of r1 reach from 0 to 2",
        ),
        (lambda: fx.Paris(0.0, -1.0, 1.0, 1.0, lambda b: b[1:]), r"returned shape \(100,\)"),
    ],
)
def test_bad_laws_are_named(make: Any, says: str) -> None:
    with pytest.raises(fx.InputError, match=says):
        make()


@pytest.mark.parametrize(
    ("law", "says"),
    [
        (lambda cycle: cycle.nothing, "fails: AttributeError"),
        (lambda cycle: cycle.dG[:2], r"returned shape \(2,\)"),
        (lambda cycle: -cycle.dG, "returned da/dN = -0.182"),
        (lambda cycle: cycle.dG * np.nan, "must be finite and not negative"),
        (lambda cycle: ["fast"] * 3, "not numbers"),
    ],
)
def test_laws_of_the_user_are_checked(law: Any, says: str) -> None:
    with pytest.raises(fx.InputError, match=says):
        fx.Fatigue(GIc=1.0, growth=law).growth_law.growth(CYCLE)


@pytest.mark.verification
def test_temperature_cycles_grow_a_bilayer() -> None:
    """Cooling by 200 and by 50 in turn: G goes with the square, steady state in closed form."""
    scene = fatigue_bilayer(fx.Temperature(-1.0))
    history = scene.run(fx.Cycles(maximum=200.0, minimum=50.0, until=until_length(scene, 7.0)))
    rows = [r for r in history if r["event"] in GROWS]
    top, dG = (np.array([r[k] for r in rows]) for k in ("G_max[bond]", "dG[bond]"))
    np.testing.assert_allclose(dG, (1.0 - 0.25**2) * top, rtol=1e-9)
    # the energy of whole elements, far from both ends, on two elements per layer
    np.testing.assert_allclose(top, thermal_bilayer.steady_rate(200.0), rtol=0.03)
    scene.close()
