"""Load cycles on nonlinear bodies: finite strain, contact that changes, cycles of temperature."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import (
    GROWS,
    HALF_OPENING,
    HELD_FAR,
    PARIS,
    column,
    fatigue_bilayer,
    fatigue_enf,
    fatigue_law,
    fatigue_specimen,
    growth_curve,
    largest_imbalance,
    specimen,
    until_length,
)
from test_fatigue_scenes import stacked

import fxcrack as fx
from fxcrack.demos import thermal_bilayer
from fxcrack.meshes.dcb import dcb_2d

THIN: dict[str, Any] = {"length": 20.0, "height": 0.5, "dx": 0.5, "ny": 1, "order": 2}


def test_linear_bodies_on_the_nonlinear_solver_need_the_same_cycles() -> None:
    found = []
    for options in ({}, {"solver": "newton"}):
        scene = fatigue_specimen(**options)
        step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 32.0))
        history = scene.run(step, progress=False)
        found.append(growth_curve(history))
        assert largest_imbalance(history) < 1e-8
        scene.close()
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-12)
    np.testing.assert_allclose(found[1][1], found[0][1], rtol=1e-7)


def test_finite_strain_at_small_loads_is_linear() -> None:
    """Openings of 1e-3 of those of the specimen; rates over toughness are the same.

    Differences of the order of the rotation, 1e-4, times the exponent of growth.
    """
    law = fx.Paris(50.0, -2.0, 0.5, 4.0, 0.2, 0.9, normalised=True)
    found = []
    for effects in ([], [fx.FiniteStrain()]):
        criterion = fx.Fatigue(GIc=0.4e-6, paris=law)
        scene = fatigue_specimen(criterion=criterion, effects=effects)
        until = until_length(scene, 32.0)
        history = scene.run(fx.Cycles(maximum=1e-3, minimum=3e-4, until=until), progress=False)
        found.append(growth_curve(history)[1])
        scene.close()
    np.testing.assert_allclose(found[1], found[0], rtol=1e-3)


@pytest.mark.slow
def test_extremes_at_finite_strain_are_those_of_static_loads() -> None:
    """Arms that turn by 25 degrees; cycles by hand from the ranges, energies balance."""
    arms = [fx.Displacement("pin_top", y=3.0), fx.Displacement("pin_bottom", y=-3.0), *HELD_FAR]
    options: dict[str, Any] = {"a0": 10.0, "effects": [fx.FiniteStrain()], "supports": arms}
    static, rates = specimen(dcb_2d(**THIN), criterion=fx.VCCT(GIc=1e9), **options), []
    for time in (0.3, 1.0):
        row = static.run(fx.Static(until=fx.Time(time), maximum=0.35), progress=False)[-1]
        rates.append(float(row["GI[bond]"]) + float(row["GII[bond]"]))
    static.close()
    law = fx.Paris(50.0, -2.0, 1e-8, 2.0, 0.0, 0.9)
    scene = specimen(dcb_2d(**THIN), criterion=fx.Fatigue(GIc=1e4, paris=law), **options)
    step = fx.Cycles(maximum=1.0, minimum=0.3, until=until_length(scene, 11.0))
    history = scene.run(step, progress=False)
    rows = [r for r in history if r["event"] in GROWS]
    dG, top, N = (column(rows, k) for k in ("dG[bond]", "G_max[bond]", "N"))
    assert top[0] == pytest.approx(rates[1], rel=1e-6)
    assert dG[0] == pytest.approx(rates[1] - rates[0], rel=1e-6)
    # small strain would have 0.91 of the maximum
    assert abs(dG[0] / top[0] - 0.91) > 1e-3
    slow = 0.5 / law.growth_rate(dG)
    each = np.diff(slow) / np.diff(np.log(slow))
    np.testing.assert_allclose(N[1:], law.onset_cycles(dG[0]) + np.cumsum(each), rtol=1e-9)
    assert largest_imbalance(history) < 1e-4
    scene.close()


@pytest.mark.parametrize(
    ("effects", "friction"),
    [
        pytest.param([], None, id="small"),
        pytest.param([fx.FiniteStrain()], None, id="finite"),
        pytest.param([], 0.5, id="small, friction"),
        pytest.param([fx.FiniteStrain()], 0.5, id="finite, friction", marks=pytest.mark.slow),
    ],
)
def test_contact_that_changes_sides_within_the_cycle(
    effects: list[Any], friction: float | None
) -> None:
    """End-notched flexure to and fro: G falls to zero in between, known to 5e-3 of G_max.

    With friction the faces stick where the load turns. Linear bodies, whose pieces without a
    change are exact, say what the sampled cycle of nonlinear ones must be.
    """
    found = []
    for options in ({}, {"solver": "newton", "effects": effects}):
        scene = fatigue_enf(a0=36.0, dx=2.0, friction=friction, **options)
        # 0.1 of the deflection of 1.5: small beside the height, so that both are nearly linear
        row = scene.run(fx.Cycles(maximum=0.1, ratio=-1.0, n_max=1e-6), progress=False)[-1]
        found.append([float(row[f"{k}[bond]"]) for k in ("G_max", "dG")])
        scene.close()
    assert found[0][1] == pytest.approx(found[0][0], rel=5e-3)
    np.testing.assert_allclose(found[1], found[0], rtol=6e-3)


def test_temperature_cycles_of_a_bilayer() -> None:
    """Cooling by 200 and by 50 in turn, G of the steady state in closed form (Suo, Hutchinson)."""
    rows = []
    for cycle in ({"maximum": 200.0, "minimum": 50.0}, {"period": (50.0, 350.0)}):
        # down to 200 degrees and back, or as a turn through an amplitude
        amplitude = fx.Amplitude((0.0, 50.0, 200.0, 350.0), (0.0, 50.0, 200.0, 50.0))
        scene = fatigue_bilayer(fx.Temperature(-1.0, amplitude=amplitude), solver="newton")
        history = scene.run(fx.Cycles(**cycle, until=until_length(scene, 5.0)), progress=False)
        rows.append([r for r in history if r["event"] in GROWS])
        scene.close()
    one, other = ([column(r, f"{k}[bond]") for k in ("G_max", "dG")] for r in rows)
    np.testing.assert_allclose(other, one, rtol=1e-6)
    np.testing.assert_allclose(one[1], (1.0 - 0.25**2) * one[0], rtol=1e-6)
    # the energy of whole elements, far from both ends, on two elements per layer
    np.testing.assert_allclose(one[0], thermal_bilayer.steady_rate(200.0), rtol=0.03)


@pytest.mark.mpi
@pytest.mark.three
def test_growth_with_friction_on_any_number_of_ranks(comm: MPI.Intracomm) -> None:
    """Loads to and fro: the cycles that linear bodies need, and energies that balance.

    Extremes of G are known to 5e-3, which the exponent of 4 makes 0.02 of the cycles; measured
    0.005.
    """
    found = []
    for options in ({}, {"solver": "newton"}):
        scene = fatigue_enf(comm, a0=36.0, dx=2.0, GIc=0.008, friction=0.5, **options)
        step = fx.Cycles(maximum=0.1, ratio=-0.5, until=until_length(scene, 38.0))
        history = scene.run(step, progress=False)
        a, N = growth_curve(history)
        assert a[-1] == 38.0 and history[-1]["friction_energy"] > 0.0
        assert largest_imbalance(history) < 1e-8
        found.append(N[-1])
        scene.close()
    assert found[1] == pytest.approx(found[0], rel=0.02)


@pytest.mark.mpi
def test_releases_that_are_undone_and_ranks(comm: MPI.Intracomm) -> None:
    """Two interfaces whose tips are not tried in their order: cycles of linear ones."""
    other = fx.Paris(c1=0.0, c2=-1.0, c3=2.0, c4=5.0, r1=0.1, r2=0.9)
    pairs = [
        (30.0, fatigue_law(tolerance=0.0, credit=True)),
        (28.0, fatigue_law(tolerance=0.0, credit=True, GIc=0.3, paris=other)),
    ]
    found = []
    for options in ({}, {"solver": "newton"}):
        scene, (first, _) = stacked(comm, pairs, **options)
        step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=fx.CrackLength(first, 32.0))
        history = scene.run(step, progress=False)
        found.append([growth_curve(history, f"bond{i}") for i in range(2)])
        scene.close()
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_static_steps_and_cycles_in_turn_at_finite_strain() -> None:
    """Loaded statically, cycled, loaded further, cycled: N as without the static step between."""
    curves = []
    for between in (False, True):
        scene = fatigue_specimen(criterion=fatigue_law(credit=True), effects=[fx.FiniteStrain()])
        scene.run(fx.Static(until=fx.Time(0.5)), grow=[], progress=False)
        scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, n_max=1800.0), progress=False)
        if between:
            scene.run(fx.Static(until=fx.Time(1.2)), grow=[], progress=False)
            scene.run(fx.Static(until=fx.Time(1.2)), grow=[], progress=False)
        step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 32.0))
        history = scene.run(step, progress=False)
        rows = [r for r in history if r["event"] in GROWS and "dG[bond]" in r]
        curves.append((column(rows, "a[bond]"), column(rows, "N")))
        assert largest_imbalance(history) < 1e-4
        scene.close()
    (a, N), (b, M) = curves
    np.testing.assert_allclose(b, a)
    np.testing.assert_allclose(M, N, rtol=1e-6)
    assert PARIS.onset_cycles(0.256) < N[-1]


def refused(effects: list[Any], step: fx.Cycles, **options: Any) -> str:
    scene = fatigue_specimen(effects=effects, **options)
    with pytest.raises(fx.InputError) as error:
        scene.run(step, progress=False)
    scene.close()
    return str(error.value)


def test_refusals() -> None:
    finite = [fx.FiniteStrain()]
    step = fx.Cycles(maximum=1.0, ratio=0.1, n_max=10.0)
    assert "partial" in refused(finite, step, criterion=fatigue_law(partial=True))
    yields = fx.Plastic(70e3, 0.3, yield_stress=1e3)
    assert "plasticity" in refused([], step, materials=yields)
    warm = [*finite, fx.Temperature(1.0)]
    expands = fx.Isotropic(70e3, 0.3, expansion=1e-5)
    assert "minimum=" in refused(warm, step, materials=expands)
    smooth = [*finite, fx.Temperature(1.0, amplitude=fx.SmoothStep((0.0, 1.0), (0.0, 1.0)))]
    down = fx.Cycles(maximum=1.0, minimum=0.1, n_max=10.0)
    assert "period=" in refused(smooth, down, materials=expands)


@pytest.mark.mpi
@pytest.mark.three
def test_a_cycle_without_equilibrium_ends_at_its_maximum(comm: MPI.Intracomm) -> None:
    """Arms pressed against each other at a node by a sixth of their height: it buckles."""
    mesh = dcb_2d(comm, length=24.0, height=1.5, dx=1.0, ny=2)
    scene = specimen(
        mesh, a0=10.0, contact=True, effects=[fx.FiniteStrain()], criterion=fatigue_law(GIc=4.0)
    )
    step = fx.Cycles(maximum=0.5, ratio=-0.5, until=until_length(scene, 12.0))
    last = scene.run(step, progress=False)[-1]
    assert last["u[pin_top.y]"] == 0.5
    assert abs(last["balance"]) < 1e-4 * last["strain_energy"]
    assert scene.analysis.fatigue.N == 0.0
    scene.close()
