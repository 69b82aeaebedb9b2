"""Mode mix from pure I to pure II, through G_T = 0, and products of the wrong sign.

Hard: at G_T = 0 the mix is 0/0, roots of it have infinite slope, crossings of f = 1 are looked for
on the way through it; on arms of different heights the product of force and opening is negative in
one mode. Must hold: f is finite and continuous, zero where G is, never negative; growth starts
where the law says; negative rates are reported as they are and count for nothing.
"""

from __future__ import annotations

import numpy as np
import pytest
from specimens import specimen

import fxcrack as fx
from stability.beams import FAR, arms, watched

pytestmark = pytest.mark.stability

A0 = 20.0
LAWS = {
    "BK": fx.BK(eta=0.5),  # steeper than the usual: infinite slope at pure mode I
    "Reeder": fx.Reeder(eta=2.2),
    "power": fx.Power(am=1.0, an=0.7),
}


def beam(
    angle: float, law: str, amplitude: fx.Amplitude | None = None, **options: object
) -> fx.Scene:
    """Ends moved apart along ``angle`` from the normal: 0 opens, 90 degrees shears."""
    across, along = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    across, along = (0.0 if abs(v) < 1e-12 else float(v) for v in (across, along))
    return specimen(
        arms(),
        a0=A0,
        supports=[
            fx.Displacement("end_upper", x=along, y=across),
            fx.Displacement("end_lower", x=-along, y=-across),
            *FAR,
        ],
        criterion=fx.VCCT(GIc=0.2, GIIc=0.6, GIIIc=0.6, mix=LAWS[law]),
    )


def onset_time(angle: float, law: str) -> float:
    history = watched(beam(angle, law), until=fx.Releases(1))
    return float(next(r for r in history if r["event"] == "onset")["time"])


@pytest.mark.quick("0.0-*", "45.0-*", "90.0-*", "135.0-*")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [0.0, 1e-6, 45.0, 89.0, 90.0 - 1e-6, 90.0, 135.0])
def test_onset_at_any_mix(law: str, angle: float) -> None:
    """f = 1 by the law at the rates reported; pure modes go at their own toughness."""
    history = watched(beam(angle, law), until=fx.Releases(3))
    assert history.reason == "3 nodes released"
    for row in history:
        if row["event"] != "onset":
            continue
        rates = np.array([[float(row[f"{m}[bond]"]) for m in ("GI", "GII", "GIII")]])
        by_law = float(LAWS[law].ratio(rates, np.array([0.2, 0.6, 0.6]))[0])
        assert by_law == pytest.approx(float(row["f[bond]"]), rel=1e-12)
        assert row["f[bond]"] >= 1.0 - 1e-9
    first = next(r for r in history if r["event"] == "onset")
    if angle == 0.0:
        assert first["GI[bond]"] == pytest.approx(0.2, rel=1e-6)
    if angle == 90.0:
        assert first["GII[bond]"] == pytest.approx(0.6, rel=1e-6)


@pytest.mark.quick("*-event")
@pytest.mark.parametrize("stepping", ["event", "increment"])
@pytest.mark.parametrize("law", LAWS)
def test_through_no_load_at_all(law: str, stepping: str) -> None:
    """Opened, let go to nothing, sheared: at rest f is 0, not 0/0; then it grows in mode II.

    Both parts stay below the onset at first, so that the crack is the same before and after.
    """
    # openings of both ends at which f = 1, found by running there
    top = {angle: onset_time(angle, law) for angle in (0.0, 90.0)}
    opening = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 0.9 * top[0.0], 0.0))
    shearing = fx.Amplitude((2.0, 4.0), (0.0, 2.0 * top[90.0]))
    supports = [*FAR]
    for name, sign in (("end_upper", 1.0), ("end_lower", -1.0)):
        supports += [
            fx.Displacement(name, y=sign, amplitude=opening, name=f"{name} y"),
            fx.Displacement(name, x=sign, amplitude=shearing, name=f"{name} x"),
        ]
    scene = specimen(
        arms(),
        a0=A0,
        supports=supports,
        criterion=fx.VCCT(GIc=0.2, GIIc=0.6, GIIIc=0.6, mix=LAWS[law]),
    )
    for time in (1.0, 2.0):
        history = watched(scene, until=fx.Time(time), stepping=stepping, initial=0.05, maximum=0.05)
        f = float(history.rows[-1]["f[bond]"])
        # G goes with the square of the load; at rest round-off only
        assert f == pytest.approx(0.81 if time == 1.0 else 0.0, abs=1e-9)
        assert history.rows[-1]["released[bond]"] == 0
    history = watched(
        scene, until=fx.Releases(1), stepping=stepping, initial=0.05, maximum=0.05, max_cutbacks=40
    )
    onset = next(r for r in history if r["time"] > 2.0 and r["f[bond]"] >= 1.0 - 1e-9)
    assert onset["GI[bond]"] <= 1e-9 * onset["GII[bond]"]
    # 2 + time at which the shear alone would bring it to f = 1
    at_one = 2.0 + 1.0
    assert at_one - 1e-6 <= onset["time"] <= 2.0 + np.sqrt(1.2) + 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("heights", [(0.3, 3.0), (3.0, 0.3)])
@pytest.mark.parametrize("law", LAWS)
def test_products_of_the_wrong_sign(law: str, heights: tuple[float, float]) -> None:
    """The thin arm of two is pushed along and lifted so that one product is negative somewhere.

    Angles all round are tried: at each, f is the law's value of the positive rates alone.
    """
    negative = 0
    for angle in np.arange(0.0, 360.0, 15.0):
        across, along = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        scene = specimen(
            arms(heights=heights),
            a0=A0,
            supports=[
                fx.Displacement("pin_top", x=float(along), y=float(across)),
                fx.Displacement("pin_bottom", x=0.0, y=0.0),
                *FAR,
            ],
            criterion=fx.VCCT(GIc=0.2, GIIc=0.6, GIIIc=0.6, mix=LAWS[law]),
        )
        history = scene.run(fx.Static(until=fx.Time(1e-2)), progress=False)
        (growth,) = scene.cracks
        values = growth.evaluate(growth.tips(), scene.solver.state, 1e-2)
        rates = np.stack([values.report[m] for m in ("GI", "GII", "GIII")], axis=1)
        negative += int((rates < 0.0).any())
        expected = LAWS[law].ratio(np.maximum(rates, 0.0), np.array([0.2, 0.6, 0.6]))
        assert np.all(values.f >= 0.0) and np.isfinite(values.f).all()
        assert values.f == pytest.approx(expected, rel=1e-12)
        assert history.rows[-1]["f[bond]"] == pytest.approx(float(values.f.max()), rel=1e-12)
        scene.close()
    assert negative > 0  # or nothing was tested
