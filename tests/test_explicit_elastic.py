"""Bonds with a stiffness of their own in explicit dynamics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from test_explicit import (
    ALUMINIUM,
    G_IC,
    HALF,
    MODULUS,
    SHEAR_SPEED,
    coarse,
    imbalance,
    opening_at,
    pins,
    until,
)

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d


def beam(comm: MPI.Intracomm, stiffness: Any, *, nx_lower: int | None = None) -> fx.Scene:
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 30.0 - 1e-9, name="bond",
        contact=True, stiffness=stiffness,
    )  # fmt: skip
    return fx.Scene(
        coarse(comm, nx_lower=nx_lower),
        materials=ALUMINIUM,
        model=fx.PlaneStrain(thickness=20.0),
        supports=pins(8e3),
        debonds=[fx.Debond(interface, fx.VCCT(GIc=G_IC))],
        effects=[fx.Inertia()],
    )


@pytest.mark.mpi
@pytest.mark.parametrize("nx_lower", [None, 44], ids=["matching", "not matching"])
def test_elastic_bonds_spend_the_toughness(comm: MPI.Intracomm, nx_lower: int | None) -> None:
    scene = beam(comm, "auto", nx_lower=nx_lower)
    history = scene.run(until(scene, 33.0, 3e-4, rows=50))
    scene.close()
    assert history["a[bond]"][-1] >= 33.0
    assert imbalance(history) <= 1e-10
    # what was stored in the bond and what softening took, together; shared masters in sweeps
    assert history["spent[bond]"][-1] == pytest.approx(G_IC, rel=2e-6)
    assert history["bond_energy"].max() > 0.0
    # springs of the stiffness of the cells cost a fifth of the increment (0.79 for square cells)
    scene = beam(comm, None, nx_lower=nx_lower)
    exact = scene.run(until(scene, 30.0, 1e-6, rows=1))
    scene.close()
    ratio = history.details["stable_increment"] / exact.details["stable_increment"]
    assert ratio == pytest.approx(0.79, abs=0.03)


@pytest.mark.slow
def test_stiff_bonds_are_the_exact_ones() -> None:
    exact = beam(MPI.COMM_SELF, None)
    lengths = (31.0, 32.0)
    known = opening_at(exact.run(until(exact, 32.0, 3e-4, rows=300)), 8e3, lengths)
    exact.close()
    stiff = beam(MPI.COMM_SELF, (10.0 * MODULUS / 0.75,) * 3)
    found = opening_at(stiff.run(until(stiff, 32.0, 3e-4, rows=300)), 8e3, lengths)
    stiff.close()
    # rows are 0.1 % of the opening apart; waves of another increment move a release by one per cent
    assert found == pytest.approx(known, rel=0.02)


@pytest.mark.slow
def test_soft_bonds_lower_g_by_their_compliance() -> None:
    """A strip pulled slowly: bonds are in series with both halves, G/G_0 = 1/(1 + M/(2 h K))."""
    per_half = 6
    end = 60.0 * HALF / SHEAR_SPEED
    u0 = np.sqrt(0.4 * G_IC * HALF / MODULUS)
    slow = fx.SmoothStep((0.0, 0.7 * end), (0.0, 1.0))
    g = {}
    for over in (None, 0.1, 1.0, 10.0):
        stiffness = None if over is None else (over * MODULUS * per_half / HALF,) * 3
        interface = fx.Interface(
            "upper_face", "lower_face", bonded=lambda x: x[0] >= 4.0 * HALF - 1e-9, name="bond",
            stiffness=stiffness,
        )  # fmt: skip
        scene = fx.Scene(
            dcb_2d(MPI.COMM_SELF, length=8.0 * HALF, height=HALF, dx=HALF / per_half, ny=per_half),
            materials=ALUMINIUM,
            model=fx.PlaneStrain(),
            supports=[
                fx.Displacement("top", x=0.0, y=u0, amplitude=slow),
                fx.Displacement("bottom", x=0.0, y=-u0, amplitude=slow),
            ],
            debonds=[fx.Debond(interface, fx.VCCT(GIc=G_IC))],
            effects=[fx.Inertia(rayleigh=(6e5, 0.0))],
        )
        history = scene.run(fx.Explicit(until=fx.Time(end), rows=60))
        scene.close()
        g[over] = float(history["GI[bond]"].astype(float)[-15:].mean())
    assert g[None] == pytest.approx(0.4 * G_IC, rel=0.02)
    # VCCT on 6 elements over the half height is within a per cent or two
    overs = np.array([0.1, 1.0, 10.0])
    ratios = [g[over] / g[None] for over in overs]
    assert ratios == pytest.approx(1.0 / (1.0 + 0.5 / (per_half * overs)), abs=0.015)
    assert ratios[0] < ratios[1] < ratios[2] < 1.0


@pytest.mark.slow
def test_restart_with_elastic_bonds(tmp_path: Path) -> None:
    first = beam(MPI.COMM_SELF, "auto")
    step = until(first, 34.0, 3e-4, rows=60)
    seen = []

    class Enough(Exception):
        """Ends the run from inside."""

    def stop(event: str, row: dict[str, Any]) -> None:
        seen.append(event)
        if len(seen) == 25:
            raise Enough

    kept = fx.Checkpoint(tmp_path / "run.npz", every=1)
    with pytest.raises(Enough):
        first.run(step, checkpoint=kept, observers=[stop])
    first.close()
    second = beam(MPI.COMM_SELF, "auto")
    again = second.run(until(second, 34.0, 3e-4, rows=60), checkpoint=kept, restart=True)
    second.close()
    assert again["a[bond]"][-1] >= 34.0
    assert imbalance(again) <= 1e-10
    assert again["spent[bond]"][-1] == pytest.approx(G_IC, rel=1e-9)


def test_what_is_refused() -> None:
    for wrong in ("soft", (1.0, 2.0), (1.0, -1.0, 1.0), 3.0):
        with pytest.raises(fx.InputError, match="stiffness"):
            fx.Interface("a", "b", stiffness=wrong)  # type: ignore[arg-type]
    scene = beam(MPI.COMM_SELF, "auto")
    with pytest.raises(fx.InputError, match="that of exact bonds"):
        scene.run(fx.Explicit(until=fx.Time(1e-6), start="equilibrium"))
    with pytest.raises(fx.InputError, match="stiffness of their own"):
        scene.run(fx.Dynamic(until=fx.Time(1e-6), dt=1e-7))
    scene.close()
