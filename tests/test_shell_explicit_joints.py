"""Explicit dynamics of shells with kinks and T joints, and of meshes off their middle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from test_shell_explicit import LENGTH, RHO, SUDDEN, WIDTH, E, balanced, bending_mode, strip

import fxcrack as fx
from fxcrack.meshes.sheets import Sheet, sheets

ANGLES = (0.3 * np.pi, -0.3 * np.pi)


def frame(
    comm: MPI.Intracomm, n: int, *, angles: tuple[float, ...] = (0.5 * np.pi,), offset: float = 0.0,
    nu: float = 0.0, ramp: Any = SUDDEN, supports: tuple[Any, ...] = (), dynamic: bool = True,
) -> fx.Scene:  # fmt: skip
    """A clamped strip and others that leave its free end at angles; the last one is pulled."""
    x = np.linspace(0.0, LENGTH, n + 1)
    parts = [Sheet("foot", x, [0.0, WIDTH])]
    for k, angle in enumerate(angles):
        c, s = np.cos(angle), np.sin(angle)
        parts.append(
            Sheet(
                f"arm{k}", x, [0.0, WIDTH],
                lambda a, b, c=c, s=s: (LENGTH + c * a, b, s * a),
            )
        )  # fmt: skip
    last = f"arm{len(angles) - 1}"
    return fx.Scene(
        sheets(parts, comm, joined=True),
        model=fx.Shell(),
        materials=fx.Section(
            fx.Isotropic(E, nu, density=RHO), thickness=0.5, axis=(0, 1, 0), offset=offset
        ),
        supports=[fx.Clamp("foot_a0", name="root"), *supports],
        loads=[fx.Traction(f"{last}_a1", (1.0, 0.3, 0.0), amplitude=ramp)],
        monitors=[
            fx.Monitor(f"{last}_a1", (1, 0, 0), name="end"),
            fx.Monitor("foot_a1", (0, 0, 1), name="below"),
            fx.Monitor("arm0_a0", (0, 0, 1), name="above"),
        ],
        effects=[fx.Inertia()] if dynamic else [],
    )


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(
    "supports",
    [(), (fx.Displacement("arm0_a0", z=0.0, name="pin"),), (fx.Clamp("arm0_a0", name="pin"),)],
    ids=["free", "pinned joint", "clamped joint"],
)
def test_joints_at_rest(comm: MPI.Intracomm, supports: tuple[Any, ...]) -> None:
    """Three strips at a joint, off their middles, stay in their static state with its reactions."""
    given: dict[str, Any] = {"angles": ANGLES, "offset": 0.1, "nu": 0.3, "supports": supports}
    history = frame(comm, 3, **given).run(
        fx.Explicit(until=fx.Time(1e-5), rows=2, start="equilibrium"), progress=False
    )
    still = frame(comm, 3, dynamic=False, **given).run(
        fx.Static(until=fx.Time(1.0)), progress=False
    )
    assert history["m[end]"].astype(float) == pytest.approx(still["m[end]"][-1], rel=1e-8)
    reactions = [c for c in still.columns if c.startswith("R[")]
    size = max(abs(still[c][-1]) for c in reactions)
    for column in reactions:
        assert history[column][-1] == pytest.approx(still[column][-1], abs=1e-7 * size), column
    assert history["kinetic_energy"][-1] < 1e-12 * history["strain_energy"][-1]


@pytest.mark.mpi
def test_joints_that_move(comm: MPI.Intracomm) -> None:
    """Parts stay together, forces of joints do no work, on any number of ranks."""
    scene = frame(comm, 4, angles=ANGLES, offset=-0.1)
    history = scene.run(fx.Explicit(until=fx.Time(1e-4), rows=5), progress=False)
    assert balanced(history)
    below, above = (history[f"m[{c}]"].astype(float) for c in ("below", "above"))
    assert np.abs(below).max() > 1e-4
    np.testing.assert_allclose(below, above, atol=1e-12 * np.abs(below).max())
    alone = frame(MPI.COMM_SELF, 4, angles=ANGLES, offset=-0.1)
    reference = alone.run(fx.Explicit(until=fx.Time(1e-4), rows=5), progress=False)
    for column in ("m[end]", "m[below]", "kinetic_energy", "external_work"):
        mine, theirs = (h[column].astype(float) for h in (history, reference))
        np.testing.assert_allclose(mine, theirs, rtol=1e-8, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.slow
def test_a_frame_moves_as_in_implicit_dynamics(comm: MPI.Intracomm) -> None:
    """An L frame pulled over a third of a period of its first mode: 1.5 % of the largest motion.

    The inertia of directors is enlarged in the one and not in the other: 2 % with cells twice as
    long.
    """
    ramp = fx.SmoothStep((0.0, 3e-4), (0.0, 1.0))
    found = frame(comm, 12, ramp=ramp).run(fx.Explicit(until=fx.Time(9e-4), rows=9), progress=False)
    twin = frame(comm, 12, ramp=ramp).run(fx.Dynamic(until=fx.Time(9e-4), dt=1e-5), progress=False)
    times = found["time"].astype(float)
    wanted = np.interp(times, twin["time"].astype(float), twin["m[end]"].astype(float))
    np.testing.assert_allclose(found["m[end]"].astype(float), wanted, atol=0.015 * wanted.max())


@pytest.mark.mpi
@pytest.mark.parametrize("finite", [False, True])
def test_meshes_off_the_middle(comm: MPI.Intracomm, finite: bool) -> None:
    """A strip moves alike wherever its mesh lies; increment, inertia of directors as well.

    The pressure moves the mesh beside the middle by what it compresses of the thickness between.
    """
    size = 2e4 if finite else 1.0
    found = []
    for offset in (0.0, 0.15):
        scene = strip(
            comm, 0.3, 6, section={"offset": offset},
            loads=[fx.Pressure(fx.Face("strip", "top"), 0.1, amplitude=SUDDEN)],
            inertia={"velocity": (0.0, 0.0, lambda x: size * bending_mode(x)),
                     "rayleigh": (1e3, 0.0)},
            effects=(fx.FiniteStrain(),) if finite else (),
        )  # fmt: skip
        history = scene.run(fx.Explicit(until=fx.Time(2e-5), rows=4), progress=False)
        assert balanced(history, 1e-4 if finite else 1e-9)
        details = [history.details[name] for name in ("stable_increment", "director_inertia")]
        found.append([*details, *history["m[w]"].astype(float)[1:]])
    compressed = 0.1 / E * 0.15
    # large rotations see thickness strains that are quadratic in the rotation
    np.testing.assert_allclose(found[1][:2], found[0][:2], rtol=1e-3 if finite else 1e-9)
    np.testing.assert_allclose(
        found[1][2:], found[0][2:], rtol=1e-3 if finite else 1e-9, atol=2.0 * compressed
    )


@pytest.mark.mpi
def test_pins_off_the_middle(comm: MPI.Intracomm) -> None:
    """Pins that hold the mesh below a strip, and a prescribed turn there, at rest as in statics."""
    given: dict[str, Any] = {
        "section": {"offset": 0.15},
        "supports": [
            fx.Displacement("strip_a0", x=0.0, y=0.0, z=0.0, name="left"),
            fx.Rotation("strip_a1", y=0.01, amplitude=SUDDEN, name="turn"),
            fx.Displacement("strip_a1", x=0.0, name="right"),
        ],
        "loads": [fx.Pressure(fx.Face("strip", "top"), 0.1, amplitude=SUDDEN)],
    }
    scene = strip(comm, 0.3, 6, **given)
    still = scene.rebuilt(effects=[]).run(fx.Static(until=fx.Time(1.0)), progress=False)
    history = scene.run(
        fx.Explicit(until=fx.Time(1e-5), rows=2, start="equilibrium"), progress=False
    )
    assert history["m[w]"].astype(float) == pytest.approx(still["m[w]"][-1], rel=1e-8)
    reactions = [c for c in still.columns if c.startswith("R[")]
    size = max(abs(still[c][-1]) for c in reactions)
    for column in reactions:
        assert history[column][-1] == pytest.approx(still[column][-1], abs=1e-7 * size), column


def test_an_interface_at_a_joint_is_refused(comm: MPI.Intracomm) -> None:
    """The web of a stringer on a foot that is bonded."""
    x = np.linspace(0.0, 4.0, 3)
    parts = [
        Sheet("skin", x, [0.0, 2.0], lambda a, b: (a, b, -0.5 + 0.0 * a)),
        Sheet("foot", x, [0.0, 2.0]),
        Sheet("web", x, [0.0, 2.0], lambda a, b: (a, 0.0 * b, b)),
    ]
    scene = fx.Scene(
        sheets(parts, comm, joined=True), model=fx.Shell(), supports=[fx.Clamp("skin_a0")],
        materials=fx.Section(fx.Isotropic(E, 0.0, density=RHO), thickness=0.5),
        bonds=[fx.Interface(slave=fx.Face("foot", "bottom"), master=fx.Face("skin", "top"))],
        effects=[fx.Inertia()],
    )  # fmt: skip
    with pytest.raises(fx.InputError, match="3 nodes at kinks or T joints"):
        scene.run(fx.Explicit(until=fx.Time(1e-6)), progress=False)
