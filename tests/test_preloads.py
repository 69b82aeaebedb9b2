"""Constant loads beside a proportional one: residual curvature, pretension, weight, contact.

An arm whose temperature is linear over its height curves by kappa without stress once it is free,
so that with bending stiffness D its energy release rate is G = (P a + D kappa)^2/(b D): quadratic
in the load, not a power of it, and P(a) falls linearly with the residual moment.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import FORCES, HELD_FAR, bond, column, largest_imbalance, onsets

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.effects import FiniteStrain
from fxcrack.meshes.dcb import dcb_2d

GIC, HEIGHT = 0.2, 1.5
ARM = fx.Isotropic(70e3, 0.3, expansion=1e-5)
D = ARM.E / (1.0 - ARM.nu**2) * HEIGHT**3 / 12.0
MOMENT = np.sqrt(GIC * D)  # of f = 1
PINS = ("pin_top", "pin_bottom")
MOUTH: dict[str, Any] = {"stepping": "opening", "opening": PINS}
PATH: dict[str, Any] = {"stepping": "path"}


def curl(part: float, amplitude: Any = None) -> fx.Temperature:
    """A temperature whose residual moment is a part of that of f = 1; negative ones open."""
    slope = part * MOMENT / (D * (1.0 + ARM.nu) * 1e-5)
    return fx.Temperature(lambda x: slope * np.abs(x[1]), amplitude=amplitude or fx.constant())


def arms(
    comm: MPI.Intracomm,
    *effects: Any,
    pins: bool = False,
    release: Any = None,
    loads: Any = (),
    contact: bool = False,
    a0: float = 10.0,
    pull: Any = None,
    **scene: Any,
) -> fx.Scene:
    """A double cantilever beam under proportional forces, or displacements of its pins."""
    supports = list(HELD_FAR)
    if pins:
        supports += [fx.Displacement(p, y=s) for p, s in zip(PINS, (1.0, -1.0), strict=True)]
    forces = [fx.PointForce(f.where, f.value, amplitude=pull or fx.Ramp()) for f in FORCES]
    criterion = scene.pop("criterion", fx.VCCT(GIc=GIC))
    return fx.Scene(
        dcb_2d(comm, length=26.0, dx=0.5, ny=2, order=2),
        materials=ARM,
        model=fx.PlaneStrain(),
        supports=supports,
        loads=[*loads, *([] if pins else forces)],
        monitors=[fx.Monitor(p, (0.0, 1.0), name=p) for p in PINS],
        debonds=[fx.Debond(bond(a0, contact=contact), criterion, release or fx.StepRelease())],
        effects=effects,
        **scene,
    )


def grow(scene: fx.Scene, **step: Any) -> list[dict[str, Any]]:
    """Onsets of a few releases; f = 1 at each, and energies balance to round-off."""
    history = scene.run(fx.Static(until=fx.Releases(4), **(step or PATH)), progress=False)
    found = onsets(history)
    assert len(found) == 2  # of a corner and a midside node each
    assert column(found, "f[bond]") == pytest.approx(1.0, rel=1e-8)
    # finite strain: work of the temperature by the trapezoidal rule
    assert largest_imbalance(history) < (1e-2 if FiniteStrain() in scene.analysis.effects else 1e-9)
    return found


def pulls(found: list[dict[str, Any]]) -> Any:
    """Forces on the upper pin, whether given or a reaction."""
    name = "F[pin_top]" if "F[pin_top]" in found[0] else "R[pin_top.y]"
    return column(found, name)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("solver", [None, pytest.param("newton", marks=pytest.mark.slow)])
def test_residual_curvature_shifts_the_load(comm: MPI.Intracomm, solver: str | None) -> None:
    plain = pulls(grow(arms(comm, solver=solver)))
    for part in (-0.5, 0.3, -1.5):
        step = PATH if part != 0.3 else MOUTH
        found = grow(arms(comm, curl(part), solver=solver), **step)
        # beams: P/P_0 = 1 + part; elements of a third of the height are off by 3e-4
        assert pulls(found) == pytest.approx(plain * (1.0 + part), rel=1e-3)


@pytest.mark.slow
def test_mixed_mode_is_that_of_a_body_made_anew() -> None:
    # linear bodies do not remember how the crack grew: the first onset of a scene that begins with
    # the longer crack, found by event stepping, is another way to the same equilibrium
    weight = fx.BodyForce((0.0, -0.05), amplitude=fx.constant())
    criterion = fx.VCCT(GIc=GIC, GIIc=3 * GIC, mix=fx.BK(1.8))
    preload: dict[str, Any] = {"loads": [weight], "criterion": criterion, "contact": True}
    for part, step in ((-0.4, PATH), (-1.4, PATH), (0.4, MOUTH)):
        found = grow(arms(MPI.COMM_SELF, curl(part), **preload), **step)
        assert column(found, "GII[bond]").min() > 1e-5 * GIC
        for a, load in zip(column(found, "a[bond]"), pulls(found), strict=True):
            if load > 0.0:
                again = arms(MPI.COMM_SELF, curl(part), a0=a, **preload)
                first = onsets(again.run(fx.Static(until=fx.Releases(1)), progress=False))
                assert first[0]["F[pin_top]"] == pytest.approx(load, rel=1e-8)
            else:  # the load holds the crack closed: f = 1 under it from the first moment
                given = arms(MPI.COMM_SELF, curl(part), a0=a, pull=fx.constant(load), **preload)
                rows = given.run(fx.Static(until=fx.Releases(1)), progress=False).rows
                assert rows[0]["f[bond]"] == pytest.approx(1.0, rel=1e-8)


def test_an_amplitude_that_has_ended_is_a_constant_load() -> None:
    ramp = fx.Amplitude((0.0, 1.0), (0.0, 1.0))
    scene = arms(MPI.COMM_SELF, curl(-0.5, ramp))
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    grown = scene.run(fx.Static(until=fx.Releases(4), stepping="path"), progress=False)
    assert pulls(onsets(grown)) == pytest.approx(
        pulls(grow(arms(MPI.COMM_SELF, curl(-0.5)))), rel=1e-9
    )
    # at -1.5 the load falls below what it was when the amplitude ended, and the temperature stays
    scene = arms(MPI.COMM_SELF, curl(-1.5, ramp))
    scene.run(fx.Static(until=fx.Time(1.0)), grow=[], progress=False)
    scene.run(fx.Static(until=fx.Releases(2), stepping="path"), progress=False)
    history = scene.run(fx.Static(until=fx.Releases(6)), progress=False)
    assert history["time"][-1] < 0.0
    assert column(history.rows[1:], "F[temperature]") == pytest.approx(1.0, rel=1e-15)


def test_preload_that_drives_the_crack_at_any_load() -> None:
    pull = fx.PointForce("pin_top", (1500.0, 0.0), amplitude=fx.constant(), name="tension")
    history = arms(MPI.COMM_SELF, loads=[pull]).run(
        fx.Static(until=fx.Releases(2), **PATH), progress=False
    )
    assert "the constant loads alone drive the crack" in history.reason
    assert history.rows[-1]["released[bond]"] == 0 and history.rows[-1]["F[pin_top]"] == 0.0


def test_loads_that_cannot_stand_beside_a_proportional_one() -> None:
    step = fx.Static(until=fx.Releases(1), **PATH)
    later = curl(-0.5, fx.Amplitude((0.0, 3.0), (0.0, 1.0)))
    with pytest.raises(InputError, match="one proportional load beside constant ones"):
        arms(MPI.COMM_SELF, later).run(step)
    alone = arms(MPI.COMM_SELF, curl(-0.5), pins=True)
    held = fx.Scene(
        alone.mesh,
        materials=ARM,
        model=fx.PlaneStrain(),
        supports=HELD_FAR,
        debonds=alone.debonds,
        effects=[curl(-0.5)],
    )
    with pytest.raises(InputError, match="needs a load that is proportional to time"):
        held.run(step)
    scene = arms(MPI.COMM_SELF, curl(-0.5, fx.Amplitude((0.0, 0.5), (0.0, 1.0))), solver="newton")
    scene.run(fx.Static(until=fx.Time(0.5)), progress=False)
    with pytest.raises(InputError, match="would change back with the load of nonlinear bodies"):
        scene.run(step)


class Stopped(Exception):
    """The run is cut short."""


@pytest.mark.mpi
def test_restart_below_zero_load(comm: MPI.Intracomm, shared_path: Path) -> None:
    step = fx.Static(until=fx.Releases(6), **PATH)
    whole = arms(comm, curl(-1.5)).run(step, progress=False)
    checkpoint = fx.Checkpoint(shared_path / "path.npz", every=1)

    def stop(event: str, row: dict[str, Any]) -> None:
        if row["released[bond]"] == 4:
            raise Stopped

    with pytest.raises(Stopped):
        arms(comm, curl(-1.5)).run(step, checkpoint=checkpoint, progress=False, observers=[stop])
    again = arms(comm, curl(-1.5)).run(step, checkpoint=checkpoint, restart=True, progress=False)
    assert again["event"].tolist() == whole["event"].tolist()
    assert column(again, "F[pin_top]") == pytest.approx(column(whole, "F[pin_top]"), rel=1e-9)
    assert whole["time"][-1] < 0.0


@pytest.mark.slow
@pytest.mark.parametrize("stepping", [PATH, MOUTH], ids=["path", "opening"])
def test_finite_strain_and_softening(stepping: dict[str, Any]) -> None:
    # arms of 10 lengths per height: small rotations, so that finite strain changes loads by 0.3 %
    linear = pulls(grow(arms(MPI.COMM_SELF, curl(-0.5)), **stepping))
    finite = grow(arms(MPI.COMM_SELF, curl(-0.5), FiniteStrain()), **stepping)
    assert pulls(finite) == pytest.approx(linear, rel=5e-3)
    if stepping is PATH:
        release = {"release": fx.ProgressiveRelease()}
        traced = grow(arms(MPI.COMM_SELF, curl(-0.5), **release))
        by_pins = grow(arms(MPI.COMM_SELF, curl(-0.5), pins=True, **release), stepping="event")
        assert pulls(traced) == pytest.approx(pulls(by_pins), rel=1e-9)
