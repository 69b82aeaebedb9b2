# # A criterion and a mode-mix law of one's own
#
# A criterion is a class derived from `fx.Criterion`, usually a frozen dataclass, that makes its
# evaluator; everything else has a default. Here growth starts when the stress intensity reaches
# K_c, with K^2 = E' G (Irwin 1957) and G from bond forces F and the openings w behind the tips:
#
#     f = K/K_c,    K = sqrt(E' F.w/(2 A))    (even mesh)
#
# With K_c = sqrt(E' G_c) this must give the loads of VCCT. A mode-mix law is a function of the
# rates and the toughness, here an ellipse. Lifting one arm of a beam whose far end is clamped gives
# G_II/G_I = 3/4 (Williams 1988), so that the ellipse is met at
#
#     G_T = 7 G_Ic/sqrt(16 + 9 (G_Ic/G_IIc)^2)
"""A user's own criterion and mode-mix law, against VCCT and beam theory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

E, GIC, GIIC = 70e3, 0.2, 0.6


@dataclass(frozen=True)
class StressIntensity(fx.Criterion):
    K_c: float

    def evaluator(self, probe, temperature, *, softens=False):
        return fx.TipEvaluator(probe, self.f)

    def f(self, tips, force, opening):
        rate = (force * opening).sum(axis=(1, 2)) / (2.0 * tips.area)
        return np.sqrt(E * np.maximum(rate, 0.0)) / self.K_c, {"G": rate}


def ellipse(g1, g2, g3, g1c, g2c, g3c):
    return np.sqrt((g1 / g1c) ** 2 + (g2 / g2c) ** 2 + (g3 / g3c) ** 2)


def run(criterion, dx=0.5, length=100.0, solver=None, release=fx.StepRelease(), count=6):  # noqa: B008
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 30.0 - 1e-6, name="bond")
    clamps = [fx.Displacement(f"far_{side}", x=0.0, y=0.0) for side in ("upper", "lower")]
    scene = fx.Scene(
        dcb_2d(dx=dx, length=length),
        materials=fx.Isotropic(E, 0.0),
        model=fx.PlaneStress(),
        supports=[*clamps, fx.Displacement("pin_top", y=1.0)],
        debonds=[fx.Debond(bond, criterion, release)],
        solver=solver,
    )
    history = scene.run(fx.Static(until=fx.Releases(count)), progress=False)
    return history, history.rows_of("onset", "unstable")


def main(out: Path, fine: bool = False) -> None:
    criteria = StressIntensity(np.sqrt(E * GIC)), fx.VCCT(GIC), fx.VCCT(GIC, GIIC, mix=ellipse)
    (own, _), (vcct, _), (_, mixed) = (run(c, 0.25 if fine else 0.5) for c in criteria)
    own.to_csv(out / "own_criterion.csv")
    rows = zip(own["R[pin_top.y]"], vcct["R[pin_top.y]"], strict=True)
    table("load / N", ["own criterion", "VCCT"], list(rows))
    total, theory = (
        mixed[0]["GI[bond]"] + mixed[0]["GII[bond]"],
        7.0 / np.hypot(4.0, 3 * GIC / GIIC),
    )
    table("G_T/G_Ic", ["FE", "theory"], [(total / GIC, theory)])


if __name__ == "__main__":
    main(*arguments(__doc__, "out/own_criterion"))
