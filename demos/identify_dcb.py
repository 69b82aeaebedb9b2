# # Toughness from a test
#
# What a test measures is load against opening. The toughness is found by least squares on the
# whole curve: the scene is solved once, and because its bodies are linear all loads and openings
# at growth scale with sqrt(Gc), so that every further prediction costs next to nothing.
#
# Three sets of data: a double cantilever beam of known toughness with 1 % of noise, the same with a
# resistance that rises (fibre bridging),
#
#     R = G0 + G1 (1 - exp(-(a - a0)/length)),
#
# and the onsets of the specimen DCB-UD of NASA/TM-2008-215123 (digitised). Beside them stands the
# data reduction of ASTM D5528, which needs the crack length at each point; the fit does not.
"""Toughness and a resistance curve from load and opening, beside the methods of the standard."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack import identify
from fxcrack.demos import dcb
from fxcrack.demos.show import arguments, table

G_IC = 0.25
RISING = {"G0": 0.15, "G1": 0.15, "length": 5.0}
NOISE = 0.01
WIDTH, THICKNESS = 25.0, 3.0

# Onsets at mid-width: crack length, half the opening, load (mm, mm, N). Their toughness is 0.1703.
DCB_UD = np.array(
    [
        (30.0, 0.750, 60.7),
        (31.0, 0.794, 58.8),
        (32.0, 0.842, 57.3),
        (33.0, 0.890, 55.6),
        (34.0, 0.942, 54.2),
        (35.0, 1.001, 52.5),
        (40.0, 1.274, 46.7),
    ]
)


def constant(GIc: float) -> fx.VCCT:
    """One toughness."""
    return fx.VCCT(GIc=GIc)


def rising(G0: float, G1: float, length: float) -> fx.VCCT:
    """A toughness that rises as the crack grows from 30 mm."""
    return fx.VCCT(GIc=lambda x: G0 + G1 * (1.0 - np.exp(-(x[0] - 30.0) / length)))


def synthetic(
    response: identify.LinearResponse, criterion: fx.VCCT, name: str, seed: int
) -> identify.Record:
    """Onsets of a criterion with noise in the load, and an elastic part before them."""
    grown = response.a <= 50.0
    s = response.factors(criterion)
    opening, load = (s * response.opening)[grown], (s * response.load)[grown]
    part = np.linspace(0.2, 0.9, 8)
    u = np.concatenate((part * opening[0], opening))
    p = np.concatenate((part * load[0], load))
    a = np.concatenate((np.full(len(part), response.a[0]), response.a[grown]))
    p = p + np.random.default_rng(seed).normal(0.0, NOISE * load.max(), len(p))
    return identify.Record(u, p, a, name).loading()


def run(dx: float = 0.5, ny: int = 8) -> dict[str, identify.Fit]:
    """Solve the scene once and fit the three sets of data."""
    scene, bond = dcb.make_scene(dx, ny)
    axes = identify.Axes("u[pin_top.y]", "R[pin_top.y]", opening_factor=2.0)
    response = identify.linear_response(scene, fx.CrackLength(bond, 55.0), axes)
    scene.close()
    known = synthetic(response, constant(G_IC), "synthetic", 1)
    bridged = synthetic(response, rising(**RISING), "resistance", 2)
    a, half, load = DCB_UD.T
    published = identify.Record(2.0 * half, load, a, "DCB-UD")
    return {
        known.name: identify.fit(identify.Test(known, response), constant, {"GIc": 0.1}),
        bridged.name: identify.fit(
            identify.Test(bridged, response), rising, {"G0": 0.2, "G1": 0.1, "length": 10.0}
        ),
        published.name: identify.fit(identify.Test(published, response), constant, {"GIc": 0.1}),
    }


def reduce(record: identify.Record) -> dict[str, identify.reduction.Reduced]:
    """The methods of the standard on the points at which the crack grows."""
    opening, load = record.points
    a = record.lengths()
    grows = np.append(a[1:] > a[0], True)
    growing = identify.Record(opening[grows], load[grows], a[grows], record.name)
    return identify.reduction.dcb(growing, width=WIDTH, thickness=THICKNESS)


def main(out: Path, fine: bool = False) -> None:
    """Fit, print beside what was put in and beside the standard, draw the pictures."""
    found = run(*((0.25, 8) if fine else (0.5, 8)))
    true = {"synthetic": {"GIc": G_IC}, "resistance": RISING, "DCB-UD": {"GIc": 0.1703}}
    rows = [
        [test, name, value, fit.half_widths[name], true[test][name]]
        for test, fit in found.items()
        for name, value in fit.values.items()
    ]
    table("Least squares on whole curves", ["data", "", "found", "+- (95 %)", "put in"], rows)
    reduced = [
        [test, method.method, method.mean, float(method.G.std(ddof=1))]
        for test in ("synthetic", "DCB-UD")
        for method in reduce(found[test].tests[0].record).values()
    ]
    table("Data reduction of ASTM D5528", ["data", "method", "G_Ic", "deviation"], reduced)
    for name, fit in found.items():
        fit.plot(out / f"{name}.png", xlabel="opening / mm", ylabel="load / N")
    if MPI.COMM_WORLD.rank == 0:
        print(f"pictures in {out}")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/identify_dcb"))
