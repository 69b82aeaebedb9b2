"""Continuum shells, one per arm, beside fine solids: mode mix, coupled lay-ups, large rotation.

Plates and continuum shells have no root correction in mode II, so that G of bending specimens is 1
to 3 % low; the mode mix of unequal arms depends on the length of the cells in solids as well.
"""

from __future__ import annotations

import numpy as np
import pytest
from delaminations import PLY, rates, strip
from mpi4py import MPI
from scipy.optimize import brentq

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.meshes.dcb import dcb_3d

pytestmark = pytest.mark.verification


def plain(thickness: float) -> fx.Laminate:
    return fx.Laminate([0], PLY, thickness)


COUPLED = fx.Laminate("[90/0]", PLY, 0.75), fx.Laminate("[0/90]", PLY, 0.75)
"""Arms that bend when they are stretched; the plies at the interface are both at 90 degrees."""
CASES = {
    "equal": ((plain(1.5), plain(1.5)), {"a": 16.0, "half_span": 32.0}),
    "thin above": ((plain(1.0), plain(2.0)), {"a": 16.0, "half_span": 32.0}),
    "thick above": ((plain(2.0), plain(1.0)), {"a": 16.0, "half_span": 32.0}),
    "coupled": (COUPLED, {"a": 16.0, "half_span": 32.0}),
    "notched": ((plain(2.25), plain(2.25)), {"a": 34.0, "half_span": 88.0, "enf": True}),
}
SOLIDS = {
    "equal": (9.142e-4, 0.374),
    "thin above": (3.208e-3, 0.368),
    "thick above": (3.141e-4, 0.405),
    "coupled": (3.835e-3, 0.456),
    "notched": (4.453e-4, 0.997),
}
"""G at unit load and G_II/G of second-order solids, 4 cells over an arm (2 a ply in the coupled
ones), 0.25 long (0.5 in the notched beam)."""
SHELLS = {
    # dx, what G lacks, G_II/G
    "equal": (2.0, -0.023, 0.367),
    "thin above": (2.0, -0.020, 0.337),
    "thick above": (2.0, -0.026, 0.422),
    "coupled": (1.0, -0.008, 0.453),
    "notched": (2.0, -0.033, 1.000),
}


@pytest.mark.quick("equal")
@pytest.mark.parametrize("case", ["equal", "thin above", "coupled", "notched"])
def test_one_cell_per_arm(case: str) -> None:
    (upper, lower), options = CASES[case]
    dx, lack, share = SHELLS[case]
    scene = strip(upper, lower, dx=dx, **options)
    total, second = rates(scene)
    # a tenth of a per cent: the digits of the reference
    assert total / SOLIDS[case][0] - 1.0 == pytest.approx(lack, abs=1.5e-3)
    assert second == pytest.approx(share, abs=1.5e-3)
    scene.close()


@pytest.mark.parametrize(
    ("case", "lack", "share"),
    [
        ("equal", -0.048, 0.351), ("thin above", -0.040, 0.406), ("thick above", -0.061, 0.327),
        ("coupled", -0.044, 0.437), ("notched", -0.082, 1.0),
    ],
)  # fmt: skip
def test_first_order(case: str, lack: float, share: float) -> None:
    """One cell of first order per arm, 1 long: what plates lack, no root correction in mode II."""
    (upper, lower), options = CASES[case]
    scene = strip(upper, lower, dx=1.0, order=1, **options)
    total, second = rates(scene)
    assert total / SOLIDS[case][0] - 1.0 == pytest.approx(lack, abs=3e-3)
    assert second == pytest.approx(share, abs=5e-3)
    scene.close()


@pytest.mark.parametrize(
    ("case", "order", "lack", "share"),
    [
        ("equal", 1, -0.045, 0.366),
        ("thin above", 1, -0.037, 0.377),
        ("thick above", 1, -0.052, 0.383),
        ("notched", 1, -0.051, 1.0),
        ("equal", 2, -0.011, 0.375),
        pytest.param("thin above", 2, -0.010, 0.324, marks=pytest.mark.slow),
        pytest.param("thick above", 2, -0.012, 0.449, marks=pytest.mark.slow),
        pytest.param("notched", 2, -0.010, 1.0, marks=pytest.mark.slow),
    ],
)
def test_two_cells_per_arm(case: str, order: int, lack: float, share: float) -> None:
    """Without shear factors: of first order no better in G, of second order within 1.2 %."""
    (upper, lower), options = CASES[case]
    dx = 1.0 if order == 1 and case != "notched" else 2.0
    scene = strip(upper, lower, dx=dx, order=order, layers=2, **options)
    total, second = rates(scene)
    assert total / SOLIDS[case][0] - 1.0 == pytest.approx(lack, abs=2e-3)
    assert second == pytest.approx(share, abs=3e-3)
    scene.close()


@pytest.mark.quick("42.0-0.02")
@pytest.mark.parametrize(("lever", "total_lack"), [(30.0, 0.028), (42.0, 0.020), (80.0, 0.012)])
def test_mixed_mode_bending(lever: float, total_lack: float) -> None:
    """Against ASTM D6671 with cells 2.5 long: G within 3 %, G_I within 0.6 %.

    G_II lacks 3.6 %; solids, 4 cells over an arm and 1 long, lack 1.5 % of it.
    """
    beam = CorrectedBeam(E=139.4e3, E22=10.16e3, G=4.6e3, h=1.5, b=1.0)
    scene = strip(plain(1.5), plain(1.5), dx=2.5, a=35.0, half_span=50.0, enf=True, lever=lever)
    total, second = rates(scene)
    one, two = beam.mmb_rates(35.0, 1.0, lever, 50.0)
    assert total / (one + two) == pytest.approx(1.0 - total_lack, abs=2e-3)
    assert total * (1.0 - second) == pytest.approx(one, rel=6e-3)
    assert total * second / two == pytest.approx(0.9635, abs=2e-3)
    scene.close()


@pytest.mark.slow
@pytest.mark.parametrize("case", ["equal", "thick above", "coupled"])
def test_the_solid_references(case: str) -> None:
    """Half as fine: G 0.1 % lower, the mode mix of unequal arms not converged."""
    (upper, lower), options = CASES[case]
    per_ply = 2 if case == "coupled" else 4
    scene = strip(upper, lower, dx=0.5, per_ply=per_ply, **options)
    total, second = rates(scene)
    assert total == pytest.approx(SOLIDS[case][0], rel=2e-3)
    drift = 0.02 if case == "thick above" else 2e-3
    assert second == pytest.approx(SOLIDS[case][1], abs=drift)
    scene.close()


# -- large rotation --------------------------------------------------------------------------------


def elastica(length: float, deflection: float, bending: float) -> tuple[float, float]:
    """Load and slope at the tip of an inextensible cantilever whose tip is moved sideways."""
    v, w = np.polynomial.legendre.leggauss(60)
    v, w = (v + 1) / 2, w / 2

    def integrals(slope: float) -> tuple[float, float]:
        theta = slope * (1 - v**2)
        f = 2 * slope * v * w / np.sqrt(np.sin(slope) - np.sin(theta))
        return float(f.sum()), float((np.sin(theta) * f).sum())

    def off(slope: float) -> float:
        along, across = integrals(slope)
        return across / along - deflection / length

    slope = float(brentq(off, 1e-3, 1.5))
    return bending / 2 * (integrals(slope)[0] / length) ** 2, slope


@pytest.mark.slow
def test_arms_that_roll_up() -> None:
    """DCB arms of 60 x 0.5 opened until their tips slope by 64 degrees.

    G against J = 2 P sin(slope)/b of the elastica, by VCCT in the turned frame of the tip.
    """
    a, b, h, e, opening = 60.0, 5.0, 0.5, 70e3, 80.0
    mesh = dcb_3d(MPI.COMM_SELF, length=80.0, height=h, width=b, dx=2.0, dy=5.0, ny=1, order=2)
    section = fx.Isotropic(e, 0.0)
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= a - 1e-9, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials={
            "upper": fx.ContinuumShell(section, "upper_face", "top"),
            "lower": fx.ContinuumShell(section, "bottom", "lower_face"),
        },
        model=fx.Solid(),
        supports=[
            fx.Displacement("pin_top", y=opening / 2),
            fx.Displacement("pin_bottom", y=-opening / 2),
            fx.Displacement("far_lower", x=0.0, y=0.0, z=0.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e9))],
        effects=[fx.FiniteStrain()],
    )
    scene.run(fx.Static(until=fx.Time(1.0), initial=0.1, maximum=0.1), progress=False)
    load, slope = elastica(a, opening / 2, e * b * h**3 / 12)
    assert np.degrees(slope) > 60.0
    assert scene.history.rows[-1]["R[pin_top.y]"] == pytest.approx(load, rel=0.01)
    at_load = 2 * scene.history.rows[-1]["R[pin_top.y]"] * np.sin(slope) / b
    total, second = rates(scene)
    assert total == pytest.approx(at_load, rel=0.01)
    assert second < 1e-3
    scene.close()
