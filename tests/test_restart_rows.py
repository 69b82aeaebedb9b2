"""A restart goes on as the run would have, to 1e-10, where round-off and history count.

Bodies that yield (the tangent depends on what was before), bodies that move far, bodies of very
different stiffness, nearly incompressible ones. Stopped early, in the middle and late.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.restart.scene_state import _check_jumps

SAME = 1e-10  # of the largest value of a kind of column; energies: of the work
STEEL = fx.Isotropic(70e3, 0.3)
YIELDING = fx.Plastic(70e3, 0.3, yield_stress=60.0, hardening=2e3)
SOFT_ON_STIFF = {"upper": fx.Isotropic(70e3, 0.4999), "lower": fx.Isotropic(7e8, 0.3)}
RATES = fx.VCCT(GIc=0.2, GIIc=0.5, mix=fx.BK(2.0), tolerance=0.2)
STRESS = fx.CriticalStress(30.0, 40.0, distance=0.5, tolerance=0.3)
EVENTS: dict[str, Any] = {"maximum": 0.05}
INCREMENTS: dict[str, Any] = {
    "stepping": "increment", "initial": 0.01, "maximum": 0.05, "minimum": 1e-7, "max_cutbacks": 30,
}  # fmt: skip


class Stopped(Exception):
    """Stands for whatever ends a job."""


def arms(
    comm: MPI.Intracomm, materials: Any, debond: dict[str, Any], pull: float = 1.0, **options: Any
) -> fx.Scene:
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 4.0 - 1e-9, name="b", contact=True,
        friction=options.pop("friction", None),
    )  # fmt: skip
    return fx.Scene(
        dcb_2d(comm, length=10.0, dx=1.0, ny=2),
        materials=materials,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("far_upper", x=0.0, y=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0),
            fx.Displacement("pin_top", x=0.0, y=pull),
            fx.Displacement("pin_bottom", x=0.2 * pull, y=-0.6 * pull),
        ],
        debonds=[fx.Debond(interface, **debond)],
        **options,
    )


CASES: dict[str, tuple[Callable[[MPI.Intracomm], fx.Scene], dict[str, Any], int]] = {
    "yielding, critical stress, events": (
        lambda comm: arms(comm, YIELDING, {"criterion": STRESS}), EVENTS, 3,
    ),
    "yielding, critical stress, increments": (
        lambda comm: arms(comm, YIELDING, {"criterion": STRESS}), INCREMENTS, 3,
    ),
    "yielding, progressive": (
        lambda comm: arms(
            comm, YIELDING, {"criterion": RATES, "release": fx.ProgressiveRelease()}
        ), EVENTS, 3,
    ),
    "finite strain": (
        lambda comm: arms(comm, STEEL, {"criterion": RATES}, effects=[fx.FiniteStrain()]),
        EVENTS, 4,
    ),
    "finite strain, progressive": (
        lambda comm: arms(
            comm, STEEL, {"criterion": RATES, "release": fx.ProgressiveRelease()},
            effects=[fx.FiniteStrain()],
        ), EVENTS, 4,
    ),
    "stiff, small sets of jumps": (
        lambda comm: arms(
            comm, SOFT_ON_STIFF, {"criterion": RATES, "release": fx.ProgressiveRelease()},
            options=fx.CondensedOptions(rows=1.0),
        ), {}, 5,
    ),
    "stiff, friction": (
        lambda comm: arms(comm, SOFT_ON_STIFF, {"criterion": RATES}, pull=-1.0, friction=0.3),
        {}, 4,
    ),
    "stiff, nonlinear solver": (
        lambda comm: arms(comm, SOFT_ON_STIFF, {"criterion": RATES}, solver="newton"), {}, 4,
    ),
}  # fmt: skip


def close(one: fx.History, other: fx.History) -> None:
    """Equal events, and columns equal to SAME of the largest value of their kind."""
    assert other["event"].tolist() == one["event"].tolist()
    sizes: dict[str, float] = {}
    for row in one:
        for name, value in row.items():
            if isinstance(value, int | float) and not np.isnan(value):
                kind = name.split("[")[0]
                sizes[kind] = max(sizes.get(kind, 0.0), abs(value))
    for kind in sizes:
        if kind == "balance" or kind.endswith("energy"):
            sizes[kind] = sizes["external_work"]
    sizes["GI"] = sizes["GII"] = max(sizes.get("GI", 0.0), sizes.get("GII", 0.0))
    for a, b in zip(one, other, strict=True):
        for name, value in a.items():
            if isinstance(value, int | float) and not np.isnan(value):
                assert b[name] == pytest.approx(value, rel=0, abs=SAME * sizes[name.split("[")[0]])


@pytest.mark.mpi
@pytest.mark.parametrize("name", CASES)
def test_restart_from_rows(name: str, comm: MPI.Intracomm, shared_path: Path) -> None:
    make, controls, n = CASES[name]
    step = fx.Static(until=[fx.Releases(n), fx.Time(9.0)], **controls)
    scene = make(comm)
    whole = scene.run(step, progress=False)
    scene.close()
    assert whole.rows[-1]["released[b]"] >= 1
    checkpoint = fx.Checkpoint(shared_path / "state.npz", every=1)

    def stop(event: str, _: Any) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise Stopped

    # stopped early, continued, stopped late, continued
    done = 0
    for row in sorted({len(whole) // 3, len(whole) - 2}):
        left, again = row - done, done > 0
        scene = make(comm)
        with pytest.raises(Stopped):
            scene.run(step, checkpoint=checkpoint, restart=again, progress=False, observers=[stop])
        scene.close()
        done = row
    scene = make(comm)
    close(whole, scene.run(step, checkpoint=checkpoint, restart=True, progress=False))
    scene.close()


@pytest.mark.parametrize(("node", "refused"), [(0, False), (1, True)])
def test_soft_motions_are_no_other_bodies(node: int, refused: bool) -> None:
    """Jumps that differ in a motion without force are round-off; others are another scene."""
    system = SimpleNamespace(
        schur=np.diag([1e-3, 1e9]), n_retained=2, free=np.ones(2, bool), closed=np.zeros(2, bool)
    )
    jump = np.array([1e-3, 1.0])
    solver: Any = SimpleNamespace(
        system=system, state=SimpleNamespace(jump=jump), index=[np.array([[0], [1]])]
    )
    linear = SimpleNamespace(solver="linear")
    analysis: Any = SimpleNamespace(plan=linear, solver=solver, condensed=solver)
    saved = jump[:, None].copy()
    _check_jumps(analysis, {"jump[0]": saved})
    saved[node] += 5e-6
    if refused:
        with pytest.raises(fx.InputError, match="the checkpoint does not fit"):
            _check_jumps(analysis, {"jump[0]": saved})
    else:
        _check_jumps(analysis, {"jump[0]": saved})
