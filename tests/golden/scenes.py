"""One small analysis per capability, written with public names only.

Every scene is without symmetry (the lower arm is softer, loads differ from side to side), so that
no decision between two equal nodes hangs on round-off.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fxcrack as fx  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
from mpi4py import MPI

from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.center_crack import center_crack
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.mmb import mmb_2d
from fxcrack.meshes.penny import penny

Make = Callable[[MPI.Intracomm], fx.Scene]

STIFF, SOFT = fx.Isotropic(70e3, 0.3), fx.Isotropic(60e3, 0.25)
ARMS = {"upper": STIFF, "lower": SOFT}
CARBON = fx.Orthotropic(E=(140e3, 10e3, 10e3), nu=(0.3, 0.3, 0.43), G=(4.6e3, 4.6e3, 3.5e3))
PINS = (
    fx.Displacement("pin_top", x=0.0, y=0.25),
    fx.Displacement("pin_bottom", x=0.0, y=-0.24),
)
HELD_FAR = (
    fx.Displacement("far_upper", x=0.0, y=0.0),
    fx.Displacement("far_lower", x=0.0, y=0.0),
)
FORCES = (fx.PointForce("pin_top", (0.0, 1.0)), fx.PointForce("pin_bottom", (0.0, -0.9)))
MONITORS = (
    fx.Monitor("pin_top", (0.0, 1.0), name="top"),
    fx.Monitor("pin_bottom", (0.0, 1.0), name="bottom"),
)
MIXED = fx.VCCT(GIc=0.2, GIIc=0.6, mix=fx.BK(eta=1.6))
INCREMENTS: dict[str, Any] = {"stepping": "increment", "max_cutbacks": 30}


@dataclass(frozen=True)
class Golden:
    """An analysis whose history is kept.

    Attributes:
        covers: The capability, in words.
        make: Makes the scene on a communicator.
        steps: Steps that are run one after the other.
        stop: Row of the history at which the run is stopped and then continued from its checkpoint
            in a new scene; ``None`` runs without checkpoint.
        long: Whether it takes more than two seconds on several ranks of few cores, as most scenes
            with nonlinear bodies do.
    """

    covers: str
    make: Make
    steps: Sequence[fx.Static | fx.Cycles]
    stop: int | None = None
    long: bool = False


def bond(a0: float, **options: Any) -> fx.Interface:
    """The faces between the arms, open up to x = a0."""
    return fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= a0 - 1e-9,
        name="bond",
        **options,
    )


def beam(
    comm: MPI.Intracomm,
    criterion: Any = MIXED,
    release: Any = None,
    *,
    faces: dict[str, Any] | None = None,
    mesh: dict[str, Any] | None = None,
    **scene: Any,
) -> fx.Scene:
    """Two arms of length 20, cracked to 6, pulled apart at their ends unless told otherwise."""
    laws = () if release is None else (release,)
    return fx.Scene(
        dcb_2d(comm, **({"length": 20.0, "dx": 1.0, "ny": 1} | (mesh or {}))),
        debonds=[fx.Debond(bond(6.0, **(faces or {})), criterion, *laws)],
        **({"materials": ARMS, "model": fx.PlaneStrain(), "supports": PINS} | scene),
    )


def pins(*opening: float, times: Sequence[float] | None = None) -> list[fx.Displacement]:
    """Pins that follow an opening in time, free to move along the arms."""
    clock = times or [float(i) for i in range(len(opening))]
    way = fx.Amplitude(tuple(clock), opening)
    return [
        fx.Displacement("pin_top", y=1.0, amplitude=way),
        fx.Displacement("pin_bottom", y=-0.96, amplitude=way),
    ]


def bent(comm: MPI.Intracomm, criterion: Any = None, **options: Any) -> fx.Scene:
    """Arms that turn far: opened, pressed together, opened further."""
    supports = [*HELD_FAR, *pins(0.0, 1.6, -0.02, 3.2, times=(0.0, 1.0, 2.0, 4.0))]
    return beam(
        comm,
        criterion or fx.VCCT(GIc=1.5, tolerance=0.3),
        **(
            {
                "materials": {"upper": fx.Isotropic(7e3, 0.3), "lower": fx.Isotropic(6e3, 0.25)},
                "supports": supports,
                "effects": [fx.FiniteStrain()],
                "faces": {"contact": True},
                "mesh": {"length": 14.0},
            }
            | options
        ),
    )


def flexure(comm: MPI.Intracomm, effects: Sequence[Any] = (), **faces: Any) -> fx.Scene:
    """End-notched flexure, loaded, unloaded and loaded again: the faces press on each other."""
    way = fx.Amplitude((0.0, 1.0, 2.0, 3.0), (0.0, 1.0, 0.3, 1.5))
    return fx.Scene(
        enf_2d(comm, half_span=20.0, height=1.5, dx=1.0, ny=1),
        materials=ARMS,
        model=fx.PlaneStress(thickness=2.0),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
            fx.Displacement("load", y=-1.0, amplitude=way),
        ],
        debonds=[fx.Debond(bond(14.0, contact=True, **faces), MIXED)],
        effects=effects,
    )


def pulled_block(comm: MPI.Intracomm) -> fx.Scene:
    """A block under pressure, pulled to and fro across its base by one end face."""
    pull = fx.Amplitude((1.0, 2.0, 3.0), (0.0, 0.03, -0.01))
    interface = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: np.zeros(x.shape[1], dtype=bool),
        contact=True,
        friction=lambda x: 0.3 + 0.02 * x[0],
        name="base",
    )
    return fx.Scene(
        dcb_3d(comm, length=3.0, height=1.0, width=2.0, dx=1.0, dy=1.0, ny=1),
        materials=fx.Isotropic(1000.0, 0.3),
        model=fx.Solid(),
        supports=[
            fx.Displacement("bottom", x=0.0, y=0.0, z=0.0),
            fx.Displacement("far_upper", x=1.0, z=0.2, amplitude=pull, name="pull"),
        ],
        loads=[fx.Pressure("top", 5.0, amplitude=fx.Amplitude((0.0, 1.0), (0.0, 1.0)))],
        bonds=[interface],
    )


def mixed_mode_bending(comm: MPI.Intracomm) -> fx.Scene:
    """A lever of 0.8 half spans on orthotropic arms."""
    return fx.Scene(
        mmb_2d(comm, half_span=20.0, height=1.5, dx=1.0, ny=1),
        materials=CARBON,
        model=fx.PlaneStress(thickness=25.0),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
        ],
        loads=[
            fx.PointForce("lever_end", (0.0, 0.8)),
            fx.PointForce("load", (0.0, -1.8)),
        ],
        debonds=[fx.Debond(bond(12.0, contact=True), MIXED)],
    )


def front(comm: MPI.Intracomm, order: int = 1, **debond: Any) -> fx.Scene:
    """A beam in 3-D, opened more on one side than on the other."""
    ends = [
        fx.Displacement("end_upper", y=lambda x: 0.2 + 0.02 * x[2]),
        fx.Displacement("end_lower", y=lambda x: -0.2 - 0.017 * x[2]),
    ]
    held = [fx.Displacement(f"far_{s}", x=0.0, y=0.0, z=0.0) for s in ("upper", "lower")]
    return fx.Scene(
        dcb_3d(comm, length=16.0, width=3.0, dx=1.0, dy=1.0, ny=1, order=order),
        materials=ARMS,
        model=fx.Solid(),
        supports=[*held, *ends],
        debonds=[fx.Debond(bond(10.0, contact=True), **debond)],
    )


def plate(
    comm: MPI.Intracomm,
    criterion: Any,
    release: Any = None,
    watch: Sequence[Any] = (),
    **scene: Any,
) -> fx.Scene:
    """A plate with a crack from -1 to 1, stretched more on its right side."""
    interface = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: np.abs(x[0]) >= 1.0 - 1e-9,
        normal_only=scene.pop("normal_only", False),
        name="bond",
    )
    laws = {} if release is None else {"release": release}
    return fx.Scene(
        center_crack(comm, a=1.0, width=6.0, height=4.0, n_crack=5, fine=1.0, growth=1.3),
        materials=STIFF,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("bottom", x=0.0, y=0.0),
            fx.Displacement("top", x=0.1, y=lambda x: 1.0 + 0.03 * x[0]),
        ],
        debonds=[fx.Debond(interface, criterion, watch=watch, **laws)],
        **scene,
    )


def pressed(comm: MPI.Intracomm) -> fx.Scene:
    """Arms pulled apart at the end and pressed together in the middle, not at the same time."""
    times = (0.0, 1.0, 2.0, 3.0, 4.0)
    pull = fx.Amplitude(times, (0.0, 1.0, 1.0, 0.2, 0.0))
    press = fx.Amplitude(times, (0.0, 0.0, 1.0, 1.0, 0.0))
    return beam(
        comm,
        fx.Fatigue(GIc=0.4, paris=fx.Paris(c1=0.5, c2=-1.0, c3=0.5, c4=3.0, r1=0.01, r2=0.9)),
        supports=HELD_FAR,
        loads=[
            fx.PointForce("pin_top", (0.0, 8.0), pull),
            fx.PointForce("pin_bottom", (0.0, -6.5), pull),
            fx.Pressure("top", lambda x: np.where(x[0] < 5.0, 1.2, 0.0), press),
            fx.Pressure("bottom", lambda x: np.where(x[0] < 5.0, 0.4, 0.0), press),
        ],
        faces={"contact": True},
    )


def cooled(comm: MPI.Intracomm) -> fx.Scene:
    """Opened, then cooled: the arms shrink differently and the bond becomes brittle."""
    held = fx.Amplitude((0.0, 1.0), (0.0, 1.0))
    return beam(
        comm,
        fx.VCCT(GIc=fx.Tabulated([20.0, 120.0], [0.05, 0.2])),
        materials={
            "upper": fx.Isotropic(70e3, 0.3, expansion=2e-5),
            "lower": fx.Isotropic(60e3, 0.25, expansion=1e-5),
        },
        supports=[
            fx.Displacement("pin_top", x=0.0, y=0.05, amplitude=held),
            fx.Displacement("pin_bottom", x=0.0, y=-0.05, amplitude=held),
        ],
        effects=[
            fx.Temperature([(1.0, 120.0), (2.0, lambda x: 20.0 + x[0])], reference=120.0),
        ],
    )


def warmed(comm: MPI.Intracomm) -> fx.Scene:
    """Moduli that fall as the temperature rises, on the nonlinear path."""
    hot = fx.Isotropic(50e3, 0.3, expansion=2e-5)
    return beam(
        comm,
        materials={
            "upper": fx.ByTemperature({0.0: STIFF, 100.0: hot}),
            "lower": SOFT,
        },
        effects=[fx.Temperature([(0.0, 0.0), (1.0, 100.0)])],
    )


def laminate(comm: MPI.Intracomm) -> fx.Scene:
    """Three layers with an interface and a criterion each; the second crack lies inside."""

    def make() -> Blocks:
        model, x = Blocks(), np.linspace(0.0, 30.0, 31)
        layers = {"upper": (0.0, 1.6), "middle": (-0.3, 0.0), "lower": (-1.7, -0.3)}
        for name, (low, high) in layers.items():
            block = model.add(name, (x, np.linspace(low, high, 2)), "quadrilateral", 1)
            model.group(f"{name}_top", block.part(y=high))
            model.group(f"{name}_bottom", block.part(y=low))
            model.group(f"pin_{name}", block.part(x=0.0, y=high if name == "upper" else low))
        return model

    first = fx.Interface(
        "upper_bottom", "middle_top", lambda x: x[0] >= 6.0 - 1e-9, contact=True, name="first"
    )
    second = fx.Interface(
        "middle_bottom",
        "lower_top",
        lambda x: (x[0] <= 10.0 + 1e-9) | (x[0] >= 16.0 - 1e-9),
        contact=True,
        name="second",
    )
    return fx.Scene(
        build(comm, "laminate", make),
        materials=CARBON,
        model=fx.PlaneStress(thickness=20.0),
        supports=[
            fx.Displacement("pin_upper", x=0.0, y=1.0),
            fx.Displacement("pin_lower", x=0.0, y=-1.0),
        ],
        debonds=[
            fx.Debond(first, fx.VCCT(GIc=0.33, GIIc=0.8, mix=fx.BK(eta=2.0))),
            fx.Debond(second, fx.VCCT(GIc=0.2, GIIc=0.6, mix=fx.Power(am=1.0, an=1.3))),
        ],
    )


def disc(comm: MPI.Intracomm) -> fx.Scene:
    """A penny-shaped crack under a pressure on its faces."""

    def pressure(x: np.ndarray) -> np.ndarray:
        return np.where(x[0] < 2.0, 1.0, 0.0)

    return fx.Scene(
        penny(comm, a=2.0, radius=8.0, half_height=8.0, dr=0.2, fine=0.6, growth=1.4),
        materials=ARMS,
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("axis_bottom", y=0.0),
        ],
        loads=[fx.Pressure("upper_face", pressure), fx.Pressure("lower_face", pressure)],
        debonds=[fx.Debond(bond(2.0), fx.VCCT(GIc=1e-3))],
        monitors=[fx.Monitor("centre_upper", (0.0, 1.0), name="centre")],
    )


def moved(comm: MPI.Intracomm, *effects: Any) -> fx.Scene:
    """Arms with mass whose ends are moved fast."""
    opening = fx.Amplitude((0.0, 1e-4), (0.0, 0.5))
    return beam(
        comm,
        materials={
            "upper": fx.Isotropic(70e3, 0.3, density=2.7e-9),
            "lower": fx.Isotropic(60e3, 0.25, density=2.0e-9),
        },
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=opening),
            fx.Displacement("pin_bottom", x=0.0, y=-0.9, amplitude=opening),
        ],
        effects=effects,
    )


def follower(comm: MPI.Intracomm) -> fx.Scene:
    """A pressure between the arms that turns with them, and a temperature."""
    pressure = [
        fx.Pressure(
            f"{side}_face", lambda x: np.where(x[0] < 6.0, 30.0, 0.0), follows=True, name=side
        )
        for side in ("upper", "lower")
    ]
    return bent(
        comm,
        fx.VCCT(GIc=2.0, unstable_tolerance=np.inf),
        supports=HELD_FAR,
        loads=pressure,
        monitors=MONITORS,
        faces={},
    )


def until(releases: int, **controls: Any) -> list[fx.Static]:
    """One static step that ends after some releases."""
    return [fx.Static(until=fx.Releases(releases), **controls)]


SCENES: dict[str, Golden] = {
    "event": Golden(
        "VCCT, event stepping, step release, mixed mode by BK, load that falls and rises again",
        lambda comm: beam(
            comm,
            supports=[*HELD_FAR, *pins(0.0, 0.15, 0.05, 0.6)],
            monitors=MONITORS,
            mesh={"ny": 2, "cell": "triangle"},
        ),
        [fx.Static(until=fx.Time(3.0))],
    ),
    "increment": Golden(
        "increment stepping with cutbacks, unstable growth within its tolerance",
        lambda comm: beam(
            comm,
            fx.VCCT(GIc=0.2, tolerance=0.05, unstable_tolerance=np.inf),
            faces={"contact": True},
        ),
        until(7, initial=0.3, linear_scaling=0.9, **INCREMENTS),
    ),
    "mixed_mode": Golden(
        "mixed-mode bending: orthotropic arms, point forces, contact, path following",
        mixed_mode_bending,
        until(7, stepping="path"),
    ),
    "opening": Golden(
        "opening control of force-loaded arms",
        lambda comm: beam(
            comm, supports=HELD_FAR, loads=FORCES, monitors=MONITORS, faces={"contact": True}
        ),
        until(6, stepping="opening", opening=("top", "bottom")),
    ),
    "friction": Golden(
        "Coulomb friction in 2-D from event to event, forth and back",
        lambda comm: flexure(comm, friction=0.4),
        [fx.Static(until=fx.Time(3.0))],
    ),
    "friction_increment": Golden(
        "Coulomb friction in 2-D in increments",
        lambda comm: flexure(comm, friction=0.4),
        [fx.Static(until=fx.Time(3.0), initial=0.2, maximum=0.2, **INCREMENTS)],
    ),
    "friction_3d": Golden(
        "Coulomb friction in 3-D, coefficient by position, no bond",
        pulled_block,
        [fx.Static(until=fx.Time(3.0))],
    ),
    "front_step": Golden(
        "3-D front, exact closure, step release, contact",
        lambda comm: front(
            comm, criterion=fx.VCCT(GIc=0.2, method="closure"), release=fx.StepRelease()
        ),
        until(10),
    ),
    "front_default": Golden(
        "3-D front, default release, mixed mode by BK, contact",
        lambda comm: front(comm, criterion=MIXED),
        until(6),
    ),
    "front_progressive": Golden(
        "3-D front, progressive release, three toughnesses",
        lambda comm: front(
            comm,
            criterion=fx.VCCT(GIc=0.2, GIIc=0.5, GIIIc=0.6, mix=fx.Reeder(eta=2.0)),
            release=fx.ProgressiveRelease(),
        ),
        until(6),
    ),
    "front_second_order": Golden(
        "3-D front with second-order faces, progressive release, viscosity",
        lambda comm: front(
            comm,
            2,
            criterion=fx.VCCT(GIc=0.2, viscosity=1e-2),
            release=fx.ProgressiveRelease(),
        ),
        until(4, initial=0.05, maximum=0.1, **INCREMENTS),
    ),
    "progressive": Golden(
        "progressive release in small sets of retained jumps, load that turns",
        lambda comm: beam(
            comm,
            release=fx.ProgressiveRelease(),
            supports=[*HELD_FAR, *pins(0.0, 0.3, 0.1, 0.5)],
            faces={"contact": True},
            options=fx.CondensedOptions(rows=2.0),
        ),
        [fx.Static(until=fx.Time(3.0))],
    ),
    "ramp": Golden(
        "release by a ramp with opening",
        lambda comm: beam(comm, release=fx.RampRelease()),
        until(6),
    ),
    "ramp_increments": Golden(
        "release by a ramp over increments",
        lambda comm: beam(comm, release=fx.RampRelease(increments=3)),
        until(4, initial=0.04, maximum=0.04, **INCREMENTS),
    ),
    "viscosity": Golden(
        "step release with viscosity",
        lambda comm: beam(comm, fx.VCCT(GIc=0.2, viscosity=1e-2)),
        until(4, initial=0.03, maximum=0.03, **INCREMENTS),
    ),
    "enhanced": Golden(
        "enhanced VCCT: onset and propagation toughness, growth that runs away and is arrested",
        lambda comm: beam(
            comm,
            fx.EnhancedVCCT(GIc=lambda x: np.where(x[0] < 9.5, 0.25, 0.15), GIc_p=0.18),
        ),
        until(7),
    ),
    "closure_second_order": Golden(
        "exact closure, second-order elements, toughness by position",
        lambda comm: beam(
            comm,
            fx.VCCT(
                GIc=lambda x: 0.2 + 0.01 * x[0], GIIc=0.6, mix=fx.BK(eta=1.6), method="closure"
            ),
            mesh={"order": 2, "dx": 2.0},
        ),
        until(4),
    ),
    "critical_stress": Golden(
        "critical stress, release along an amplitude, in several steps and increments",
        lambda comm: plate(
            comm,
            fx.CriticalStress(120.0, 90.0, distance=0.25),
            fx.AmplitudeRelease((0.0, 1e-5, 4e-5), (1.0, 0.75, 0.0), first_increment=1e-5),
        ),
        [
            *until(3),
            fx.Static(until=fx.Releases(7), initial=2e-5, maximum=5e-5, **INCREMENTS),
        ],
    ),
    "crack_opening": Golden(
        "critical crack opening against crack length, VCCT watched",
        lambda comm: plate(
            comm,
            fx.CrackOpening(([0.0, 0.6], [2e-3, 3e-3]), distance=0.25),
            watch=[fx.VCCT(GIc=1.0)],
        ),
        until(6),
    ),
    "crack_length": Golden(
        "crack length against time, bonds in the normal direction only",
        lambda comm: plate(
            comm,
            fx.CrackLengthVsTime((0.0, 0.5, 1.0), (2.7, 4.1, 6.0), reference="bottom_left"),
            normal_only=True,
        ),
        [fx.Static(until=fx.Time(0.7))],
    ),
    "fatigue": Golden(
        "low-cycle fatigue with contact, loads out of step, then between two extremes",
        pressed,
        [
            fx.Cycles(period=(0.0, 4.0), until=fx.Releases(3)),
            fx.Cycles(maximum=1.0, ratio=0.1, until=fx.Releases(5)),
        ],
    ),
    "dynamic": Golden(
        "implicit dynamics, linear bodies, damping, release over an increment",
        lambda comm: moved(comm, fx.Inertia(rayleigh=(10.0, 1e-8))),
        [fx.Dynamic(until=fx.Time(1e-4), dt=5e-6)],
        long=True,
    ),
    "dynamic_finite": Golden(
        "implicit dynamics with finite strain and lumped mass",
        lambda comm: moved(comm, fx.FiniteStrain(), fx.Inertia(rho_inf=0.5, lumped=True)),
        [fx.Dynamic(until=fx.Time(5e-5), dt=5e-6)],
        long=True,
    ),
    "temperature": Golden(
        "thermal strain as a load, toughness against temperature",
        cooled,
        [fx.Static(until=fx.Time(2.0))],
    ),
    "temperature_newton": Golden(
        "moduli against temperature, increments",
        warmed,
        until(4, initial=0.1, maximum=0.2, **INCREMENTS),
        long=True,
    ),
    "finite_strain": Golden(
        "finite strain, contact, event stepping, load that turns",
        bent,
        [fx.Static(until=fx.Time(2.0))],
        long=True,
    ),
    "finite_friction": Golden(
        "finite strain, faces that slide with friction, increments",
        lambda comm: flexure(comm, [fx.FiniteStrain()], friction=0.3),
        [fx.Static(until=fx.Time(1.5), initial=0.25, maximum=0.25, **INCREMENTS)],
        long=True,
    ),
    "neo_hookean": Golden(
        "neo-Hookean arms under forces, opening control",
        lambda comm: bent(
            comm,
            fx.VCCT(GIc=1.0),
            materials={"upper": fx.NeoHookean(7e3, 0.3), "lower": fx.NeoHookean(6e3, 0.25)},
            supports=HELD_FAR,
            loads=FORCES,
            monitors=MONITORS,
            effects=[],
            faces={},
        ),
        until(2, stepping="opening", opening=("top", "bottom"), maximum=2.0),
    ),
    "finite_path": Golden(
        "finite strain under forces, path following",
        lambda comm: bent(
            comm, fx.VCCT(GIc=1.0), supports=HELD_FAR, loads=FORCES, monitors=MONITORS, faces={}
        ),
        until(2, stepping="path", maximum=2.0),
    ),
    "plastic": Golden(
        "arms that yield, contact, load that turns",
        lambda comm: bent(
            comm,
            materials=fx.Plastic(70e3, 0.3, yield_stress=40.0, hardening=1e3),
            effects=[],
            supports=[*HELD_FAR, *pins(0.0, 0.6, 0.1)],
        ),
        [fx.Static(until=fx.Time(1.6), initial=0.2, maximum=0.2, **INCREMENTS)],
        long=True,
    ),
    "follower": Golden(
        "pressure that follows the arms, finite strain",
        follower,
        until(1, initial=0.25, maximum=0.25, **INCREMENTS),
        long=True,
    ),
    "newton_progressive": Golden(
        "progressive release of linear bodies by the nonlinear solver",
        lambda comm: beam(comm, release=fx.ProgressiveRelease(), solver="newton"),
        until(3),
    ),
    "two_interfaces": Golden(
        "two interfaces with contact in one laminate, a mode-mix law each",
        laminate,
        [fx.Static(until=fx.Time(1.2))],
    ),
    "non_matching": Golden(
        "faces with nodes that do not match",
        lambda comm: beam(comm, faces={"contact": True}, mesh={"nx_lower": 14, "ny_lower": 2}),
        until(6),
    ),
    "axisymmetric": Golden(
        "penny-shaped crack, pressure on its faces, path following",
        disc,
        until(3, stepping="path"),
    ),
    "iterative": Golden(
        "iterative condensation in small sets of retained jumps",
        lambda comm: beam(
            comm,
            mesh={"dx": 0.5, "ny": 2},
            options=fx.CondensedOptions(method="iterative", rows=1.0, rtol=1e-10),
        ),
        until(8),
    ),
    "small_sets": Golden(
        "many small sets of retained jumps: condensed again and again, steps in sequence",
        lambda comm: beam(
            comm,
            mesh={"dx": 0.5, "ny": 2},
            options=fx.CondensedOptions(rows=0.0),
        ),
        [*until(5), *until(12)],
    ),
    "restart": Golden(
        "stopped in the middle of increments and continued from the checkpoint",
        lambda comm: beam(
            comm,
            release=fx.ProgressiveRelease(),
            faces={"contact": True},
            supports=[*HELD_FAR, *pins(0.0, 0.3, 0.1, 0.5)],
        ),
        [fx.Static(until=fx.Time(3.0), initial=0.05, maximum=0.1, **INCREMENTS)],
        stop=25,
    ),
    "restart_finite": Golden(
        "finite strain with contact, stopped and continued from the checkpoint",
        bent,
        [fx.Static(until=fx.Time(2.2), initial=0.2, maximum=0.2, **INCREMENTS)],
        stop=9,
        long=True,
    ),
}


@dataclass(frozen=True)
class Result:
    """What is kept of an analysis.

    Attributes:
        columns: Names of the columns, in order.
        rows: The history.
        ends: Why the last step ended, and norms of the last state.
    """

    columns: list[str]
    rows: list[dict[str, float | int | str]]
    ends: dict[str, float | str]


class _Stopped(Exception):
    """Ends a run from outside."""


class _StopAt:
    """Observer that ends a run after some rows."""

    def __init__(self, rows: int) -> None:
        self.left = rows

    def __call__(self, event: str, row: Any) -> None:
        self.left -= 1
        if self.left < 0:
            raise _Stopped


def run(name: str, comm: MPI.Intracomm, rows: int | None = None) -> Result:
    """Run a scene by its name; collective.

    Args:
        name: Key of :data:`SCENES`.
        comm: Communicator.
        rows: Rows after which the run is given up; the result holds no more than these.
    """
    golden = SCENES[name]
    scene = golden.make(comm)
    given_up = [] if rows is None else [_StopAt(rows)]
    with suppress(_Stopped):
        if golden.stop is None:
            for step in golden.steps:
                scene.run(step, progress=False, observers=given_up)
        else:
            scene = _interrupted(golden, scene, comm, rows)
    if rows is not None:
        result = Result(scene.history.columns, scene.history.rows, {})
        scene.close()
        return result
    ends: dict[str, float | str] = {"reason": scene.history.reason}
    u = fx.displacement_function(scene)
    mine = u.x.array[: u.function_space.dofmap.index_map.size_local * u.function_space.dofmap.bs]
    ends["displacement"] = float(np.sqrt(comm.allreduce(float(mine @ mine))))
    for column, values in scene.history.details.get("tips", {}).items():
        if column not in ("interface", "released"):
            ends[f"tips.{column}"] = float(np.linalg.norm(values))
    scene.close()
    return Result(scene.history.columns, scene.history.rows, ends)


def _interrupted(
    golden: Golden, scene: fx.Scene, comm: MPI.Intracomm, rows: int | None
) -> fx.Scene:
    """Run the only step, stop it at a row, continue it in a new scene."""
    (step,) = golden.steps
    assert golden.stop is not None
    made = tempfile.TemporaryDirectory() if comm.rank == 0 else None
    folder = Path(comm.bcast(made.name if made else None))
    kept = fx.Checkpoint(folder / "state.npz", every=1)
    stopped = False
    try:
        scene.run(step, progress=False, checkpoint=kept, observers=[_StopAt(golden.stop)])
    except _Stopped:
        stopped = True
    assert stopped, f"the step ended before row {golden.stop}"
    scene.close()
    again = golden.make(comm)
    given_up = [] if rows is None else [_StopAt(rows - golden.stop)]
    with suppress(_Stopped):
        again.run(step, progress=False, checkpoint=kept, restart=True, observers=given_up)
    comm.Barrier()
    if made is not None:
        made.cleanup()
    return again
