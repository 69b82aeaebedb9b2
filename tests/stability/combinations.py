"""Random small scenes that combine effects, by seed, and what each must fulfil.

    python tests/stability/combinations.py 0 500 --table docs/combinations.md

runs the scenes of the seeds from 0 to 499 and writes which combination holds to what.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import fxcrack as fx  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.history import Row
from fxcrack.meshes.blocks import Blocks, build

Array = npt.NDArray[np.float64]
LENGTH, HEIGHT, CRACK = 10.0, 0.8, 3.0
TOUGHNESS = 1e-4
BALANCE = {"linear": 1e-8, "newton": 1e-4, "finite": 1e-4, "plastic": 1e-3, "temperature": 1e-4,
           "inertia": 1e-8, "finite, inertia": 1e-2}  # fmt: skip
"""Part of the largest energy that may be missing. Linear bodies: the events of softening bonds are
found to 1e-6 of their force. Nonlinear ones: increments are divided at 1e-5 each, but for the
smallest; plastic ones: contact that closes in the smallest leaves the square of it."""


@dataclass(frozen=True)
class Combination:
    """One random scene.

    Attributes:
        bodies: Linear, newton (linear ones by the nonlinear solver), finite, plastic, temperature,
            inertia.
        interfaces: Their number, 1 to 3.
        friction: Coefficient, ``None`` without; needs contact.
        criterion: What releases bonds.
        release: How.
        stepping: How the load is followed.
        load: Direction at the upper end: opening, shear, both.
        turns: Load at times 1, 2, ... over that of the first onset.
        soft: Modulus of every second layer; that of the others is 1.
    """

    bodies: str
    solid: bool
    order: int
    n: int
    interfaces: int
    contact: bool
    friction: float | None
    criterion: str
    release: str
    stepping: str
    load: tuple[float, float]
    turns: tuple[float, ...]
    soft: float

    @classmethod
    def of(cls, seed: int) -> Combination:
        """The scene of a seed."""
        rng = np.random.default_rng(seed)

        def one(*of: Any) -> Any:
            return of[int(rng.integers(len(of)))]

        bodies = one(
            "linear", "linear", "newton", "finite", "plastic", "temperature", "inertia",
            "finite, inertia",
        )  # fmt: skip
        contact = one(True, True, False)
        criterion = one("VCCT", "power", "BK", "closure", "stress", "own mix", "enhanced")
        release = one("step", "progressive", "ramp")
        friction = one(None, None, 0.3) if contact else None
        if criterion == "stress" or friction is not None:
            release = "step"
        if criterion == "enhanced":
            release, friction = "enhanced", None
        dynamic = "inertia" in bodies
        solid = bodies in ("linear", "newton") and one(True, False, False, False)
        return cls(
            bodies, solid, 1 if solid else one(1, 1, 2), one(8, 10, 12), one(1, 1, 2, 3), contact,
            friction, criterion, release, "increment" if dynamic else one("event", "increment"),
            one((0.0, 1.0), (1.0, 0.0), (0.6, 1.0)),
            tuple(one(-0.6, 0.0, 0.5, 1.1, 1.3) for _ in range(one(1, 2, 3))), one(1.0, 0.1, 1e-3),
        )  # fmt: skip

    @property
    def kind(self) -> str:
        """Row of the table it counts in."""
        faces = "friction" if self.friction else "contact" if self.contact else "open faces"
        return f"{self.bodies}; {faces}; {self.release}"


def mesh_of(c: Combination, comm: MPI.Intracomm, lengths: float) -> fx.Mesh:
    def make() -> Blocks:
        model = Blocks()
        x = np.linspace(0.0, LENGTH, c.n + 1)
        for i in range(c.interfaces + 1):
            y = HEIGHT * (i + np.linspace(0.0, 1.0 + 0.25 * i, 2 if c.order == 2 else 3))
            y += 0.5 * 0.25 * HEIGHT * i * (i - 1)
            z = (np.linspace(0.0, 2.0, 3),) if c.solid else ()
            cell = "hexahedron" if c.solid else "quadrilateral"
            layer = model.add(f"layer{i}", (x, y, *z), cell, c.order)
            model.group(f"under{i}", layer.part(y=float(y[0])))
            model.group(f"over{i}", layer.part(y=float(y[-1])))
            model.group(f"far{i}", layer.part(x=LENGTH))
            model.group(f"end{i}", layer.part(x=0.0, y=float(y[-1])))
            model.group(f"low{i}", layer.part(x=0.0, y=float(y[0])))
        return model

    mesh = build(comm, "layers", make)
    mesh.domain.geometry.x[:] *= lengths
    return mesh


def criterion_of(c: Combination, size: float) -> Any:
    """The criterion for a toughness, in moduli times lengths."""
    g = TOUGHNESS * size
    return {
        "VCCT": lambda: fx.VCCT(GIc=g, unstable_tolerance=np.inf),
        "power": lambda: fx.VCCT(
            GIc=g, GIIc=2.0 * g, mix=fx.Power(am=2.0, an=1.4), unstable_tolerance=np.inf
        ),
        "BK": lambda: fx.VCCT(GIc=g, GIIc=3.0 * g, mix=fx.BK(eta=1.6), unstable_tolerance=np.inf),
        "closure": lambda: fx.VCCT(GIc=g, method="closure", unstable_tolerance=np.inf),
        "own mix": lambda: fx.VCCT(
            GIc=g,
            mix=lambda one, two, three: (one + 0.7 * two + three) / g,
            unstable_tolerance=np.inf,
        ),
        "stress": lambda: fx.CriticalStress(0.02, 0.03, distance=1.0),
        "enhanced": lambda: fx.EnhancedVCCT(GIc=g, GIc_p=0.8 * g, unstable_tolerance=np.inf),
    }[c.criterion]()


RELEASES = {
    "step": fx.StepRelease, "enhanced": fx.StepRelease, "ramp": fx.RampRelease,
    "progressive": fx.ProgressiveRelease,
}  # fmt: skip


def scene_of(
    c: Combination,
    amplitude: fx.Amplitude,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    *,
    lengths: float = 1.0,
    moduli: float = 1.0,
    exchanged: bool = False,
) -> fx.Scene:
    """The scene, in other units, or with slaves and masters exchanged."""
    mesh = mesh_of(c, comm, lengths)
    top = c.interfaces
    debonds = []
    for i in range(top):
        start = CRACK + 1.5 * i
        names = (f"over{i}", f"under{i + 1}") if exchanged else (f"under{i + 1}", f"over{i}")
        face = fx.Interface(
            *names,
            bonded=lambda x, s=start: x[0] >= (s - 1e-6) * lengths,
            contact=c.contact,
            friction=c.friction,
            name=f"bond{i}",
        )
        release = RELEASES[c.release]()
        debonds.append(fx.Debond(face, criterion_of(c, moduli * lengths), release))
    third = {"z": 0.0} if c.solid else {}
    supports = [fx.Displacement(f"far{i}", x=0.0, y=0.0, **third) for i in range(top + 1)]
    dx, dy = (lengths * v for v in c.load)
    supports += [
        fx.Displacement(f"end{top}", x=dx, y=dy, amplitude=amplitude),
        fx.Displacement("low0", x=0.0, y=0.0),
    ]
    density = 1.0
    effects: list[Any] = []
    if "finite" in c.bodies:
        effects.append(fx.FiniteStrain())
    if "inertia" in c.bodies:
        effects.append(fx.Inertia(rho_inf=1.0))
    if c.bodies == "temperature":
        effects.append(fx.Temperature([(0.0, 0.0), (1.0, 20.0)]))
    materials: dict[str, Any] = {}
    for i in range(top + 1):
        e = moduli * (c.soft if i % 2 else 1.0)
        if c.bodies == "plastic":
            materials[f"layer{i}"] = fx.Plastic(e, 0.3, yield_stress=0.02 * e, hardening=0.1 * e)
        else:
            materials[f"layer{i}"] = fx.Isotropic(e, 0.3, 1e-5 * (1 + i), density)
    return fx.Scene(
        mesh,
        materials=materials,
        model=fx.Solid() if c.solid else fx.PlaneStrain(),
        supports=supports,
        debonds=debonds,
        effects=effects,
        solver="newton" if c.bodies == "newton" else None,
    )


def onset_of(c: Combination) -> float:
    """Opening at the first onset of linear bodies at small strain; 0.3 where there is none."""
    plain = replace(c, bodies="linear", release="step", stepping="event", friction=None)
    if c.criterion == "enhanced":
        plain = replace(plain, release="enhanced")
    scene = scene_of(plain, fx.Amplitude((0.0, 1.0), (0.0, 1.0)))
    history = scene.run(fx.Static(until=[fx.Releases(1), fx.Time(1.0)]), progress=False)
    scene.close()
    onsets = [float(r["time"]) for r in history if r["event"] == "onset"]
    return min(onsets[0], 0.5) if onsets else 0.3


def step_of(c: Combination, onset: float) -> tuple[fx.Amplitude, fx.Static]:
    """The load, and the step that follows it."""
    unit = 40.0 if "inertia" in c.bodies else 1.0  # some times the way of waves through the layers
    times = tuple(unit * t for t in range(len(c.turns) + 1))
    amplitude = fx.Amplitude(times, (0.0, *(1.03 * onset * t for t in c.turns)))
    end = fx.Time(times[-1])
    if "inertia" in c.bodies:
        return amplitude, fx.Dynamic(until=end, dt=0.05 * unit)
    step = fx.Static(
        until=[end, fx.Releases(12)], stepping=c.stepping, initial=0.2, maximum=0.2,
        max_cutbacks=40,
    )  # fmt: skip
    return amplitude, step


class Invariants:
    """What must hold in every row; an observer.

    Attributes:
        worst: Largest violation of each invariant, over its measure.
    """

    def __init__(self, scene: fx.Scene) -> None:
        self._scene = scene
        self._jump = self._force = 0.0
        self.worst: dict[str, float] = defaultdict(float)
        self._spent: dict[str, float] = {}
        self._work = 1e-300

    def _see(self, name: str, value: float) -> None:
        self.worst[name] = max(self.worst[name], value)

    def __call__(self, event: str, row: Row) -> None:
        solver: Any = self._scene.solver
        system, state = solver.system, solver.state
        n = system.n_retained
        self._jump = max(self._jump, float(np.abs(state.jump).max(initial=0.0)), 1e-300)
        force = system.forces(state, np.arange(n))
        self._force = max(self._force, float(np.abs(force).max(initial=0.0)), 1e-300)
        rows = system.contact
        if rows.any():
            gap = (state.jump + system.gap)[rows]
            self._see("penetration", -float(gap.min()) / self._jump)
        soft = np.zeros(n, dtype=bool)
        soft[system.soft.components] = True
        free = system.free & ~soft & ~system.closed
        if free.any() and system.friction is None:
            wrong = np.abs(force - state.force)[free].max()
            self._see("force on what is released", float(wrong) / self._force)
        self._work = max(self._work, abs(float(row["external_work"])))
        for name in ("friction_energy", "plastic_energy"):
            value = float(row.get(name, 0.0))
            self._see("dissipation falls", (self._spent.get(name, 0.0) - value) / self._work)
            self._spent[name] = max(value, self._spent.get(name, 0.0))


@dataclass
class Result:
    """What came of a scene: where it ended, how well each invariant held."""

    reason: str
    worst: dict[str, float]
    history: fx.History | None


def result_of(c: Combination, onset: float | None = None, **changes: Any) -> Result:
    """Run a scene and measure its invariants; what is refused as input says so."""
    amplitude, step = step_of(c, onset_of(c) if onset is None else onset)
    try:
        scene = scene_of(c, amplitude, **changes)
    except fx.InputError as error:
        return Result(f"refused: {error}", {}, None)
    watch = Invariants(scene)
    try:
        history = scene.run(step, observers=[watch], progress=False)
        reason = history.reason
    except fx.InputError as error:
        return Result(f"refused: {error}", {}, None)
    except fx.EnergyError as error:
        history, reason = scene.history, f"energy: {error}"
    names = ("external_work", "strain_energy", "kinetic_energy")
    sizes = [np.abs(history[k].astype(float)).max() for k in names if k in history.columns]
    size = max(*sizes, 1e-300)
    watch.worst["balance"] = float(np.abs(history["balance"].astype(float)).max() / size)
    if c.stepping == "event" and c.bodies == "linear":
        onsets = [float(r[k]) for r in history if r["event"] == "onset" for k in r if k[:2] == "f["]
        watch.worst["f below 1 at onset"] = 0.0 if not onsets else max(1.0 - max(onsets), 0.0)
    scene.close()
    gc.collect()
    return Result(reason, dict(watch.worst), history)


LIMITS = {"penetration": 1e-8, "force on what is released": 1e-8, "dissipation falls": 1e-8,
          "f below 1 at onset": 1e-6}  # fmt: skip


def faults(c: Combination, result: Result) -> list[str]:
    """Invariants that do not hold."""
    limits = {**LIMITS, "balance": BALANCE[c.bodies]}
    out = [f"{k} {v:.1e}" for k, v in result.worst.items() if not v <= limits[k]]
    return out + ([result.reason] if result.reason.startswith("stopped") else [])


def main() -> None:
    """Run the scenes of some seeds; print what fails, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--seconds", type=float, default=np.inf, help="end after so long")
    given = parser.parse_args()
    rows: dict[str, list[tuple[float, bool]]] = defaultdict(list)
    begun, count, refused = time.monotonic(), 0, 0
    for seed in range(given.first, given.last):
        if time.monotonic() - begun > given.seconds:
            break
        c = Combination.of(seed)
        start = time.monotonic()
        try:
            result = result_of(c)
            bad = faults(c, result)
        except Exception as error:
            result, bad = Result("failed", {}, None), [f"{type(error).__name__}: {error}"]
        if result.reason.startswith("refused"):
            refused += 1
        count += 1
        spent = time.monotonic() - start
        if bad or spent > 20.0:
            print(seed, c, f"{spent:.1f} s", bad, result.reason, flush=True)
        if "balance" in result.worst:
            rows[c.kind].append((result.worst["balance"], bool(bad)))
    print(f"{count} scenes, {refused} refused, {time.monotonic() - begun:.0f} s")
    if given.table:
        given.table.write_text(table(rows, given.first, given.first + count))


def table(rows: dict[str, list[tuple[float, bool]]], first: int, last: int) -> str:
    """The table of the documentation."""
    lines = [
        "# Which combination holds to what",
        "",
        f"Random scenes {first} to {last - 1} of `tests/stability/combinations.py`, which wrote",
        "this table: per combination the number of scenes, the largest error of the energy",
        "balance over the largest energy, and in how many scenes an invariant (balance, no",
        "penetration, no force on what is released, dissipation never falls) did not hold.",
        "",
        "| bodies | faces | release | scenes | balance | not held |",
        "|---|---|---|---|---|---|",
    ]
    for kind in sorted(rows):
        values = rows[kind]
        worst, bad = max(v for v, _ in values), sum(b for _, b in values)
        bodies, faces, release = kind.split("; ")
        lines.append(f"| {bodies} | {faces} | {release} | {len(values)} | {worst:.0e} | {bad} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
