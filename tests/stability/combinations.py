"""Random tiny scenes that combine effects, by seed: what a scene is, and how it is built.

``Combination.of(seed)`` draws one. :mod:`stability.invariants` says what must hold in it, and
:mod:`stability.relations` what must not change when it is described in another way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import fxcrack as fx  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import RawMesh, on_root
from fxcrack.mesh.read import gmsh_model, prepare
from fxcrack.meshes.blocks import Blocks

Array = npt.NDArray[np.float64]
LENGTH, HEIGHT, CRACK = 6.0, 0.8, 2.0
OPENING = 0.3
"""Displacement of the loaded end at which f is about 1, where bodies are linear."""
DEAD_LOADS = ("linear", "newton", "temperature", "inertia", "finite, inertia")
"""Bodies that a force may load: others may lose their equilibrium, which is no fault."""


@dataclass(frozen=True)
class Combination:
    """One random scene.

    Attributes:
        bodies: Linear, newton (linear ones by the nonlinear solver), finite, neo-Hookean, plastic,
            temperature, inertia; the last one also together with others.
        cell: Shape of the cells.
        order: Of the elements.
        n: Elements along the layers.
        matching: Whether the two sides of interfaces have the same nodes.
        interfaces: Their number, 1 to 3.
        contact: Whether open faces may press on each other.
        friction: Coefficient, ``None`` without; needs contact.
        criterion: What releases bonds.
        release: How.
        stepping: How the load is followed.
        force: Whether the upper end is loaded by a force instead of a displacement.
        load: Direction at the upper end.
        turns: Load at times 1, 2, ... over that of the first onset, roughly; none for a load that
            is proportional to time.
        soft: Modulus of every second layer; that of the others is 1.
    """

    bodies: str = "linear"
    cell: str = "quadrilateral"
    order: int = 1
    n: int = 6
    matching: bool = True
    interfaces: int = 1
    contact: bool = True
    friction: float | None = None
    criterion: str = "VCCT"
    release: str = "step"
    stepping: str = "event"
    force: bool = False
    load: tuple[float, float, float] = (0.0, 1.0, 0.0)
    turns: tuple[float, ...] = (1.3,)
    soft: float = 1.0

    @classmethod
    def of(cls, seed: int) -> Combination:
        """The scene of a seed."""
        rng = np.random.default_rng([7, seed])

        def one(*of: Any) -> Any:
            return of[int(rng.integers(len(of)))]

        bodies = one(
            "linear", "linear", "newton", "finite", "neo-Hookean", "plastic", "temperature",
            "inertia", "finite, inertia",
        )  # fmt: skip
        solid = one(True, False, False, False)
        cell = one("hexahedron", "tetrahedron") if solid else one("quadrilateral", "triangle")
        contact = one(True, True, False)
        friction = one(None, None, 0.3) if contact else None
        criterion = one("VCCT", "power", "BK", "closure", "stress", "own mix", "enhanced")
        release = one("step", "progressive", "ramp")
        if criterion == "stress" or friction is not None:
            release = "step"
        if criterion == "enhanced":
            release, friction = "enhanced", None
        stepping = one("event", "increment", "path")
        if "inertia" in bodies:
            stepping = "increment"
        if stepping == "path" and bodies in ("temperature", "plastic"):
            stepping = "event"  # a path needs a load that is proportional and can be taken back
        turns = tuple(one(-0.6, 0.0, 0.5, 1.2, 1.6) for _ in range(one(1, 2)))
        load = one((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.6, 1.0, 0.0))
        return cls(
            bodies, cell, 1 if solid else one(1, 1, 2), one(4, 5) if solid else one(6, 7),
            one(True, True, True, False), 1 if solid else one(1, 1, 2, 3), contact, friction,
            criterion, release, stepping, one(True, False, False) and bodies in DEAD_LOADS,
            (load[0], load[1], one(0.0, 0.5)) if solid else load,
            () if stepping == "path" else turns, one(1.0, 0.1, 1e-3),
        )  # fmt: skip

    @property
    def solid(self) -> bool:
        """Whether the scene is three-dimensional."""
        return self.cell in ("hexahedron", "tetrahedron")

    @property
    def dynamic(self) -> bool:
        """Whether the bodies have inertia."""
        return "inertia" in self.bodies

    @property
    def finite(self) -> bool:
        """Whether strains and rotations are finite."""
        return "finite" in self.bodies or self.bodies == "neo-Hookean"

    @property
    def kind(self) -> str:
        """Row of the table it counts in."""
        faces = "friction" if self.friction else "contact" if self.contact else "open faces"
        return f"{self.bodies}; {faces}; {self.release}"


@dataclass(frozen=True)
class Described:
    """Another description of the same scene.

    Attributes:
        lengths: Unit of length.
        moduli: Unit of stress.
        turned: Rotation or reflection of everything, rows of a matrix.
        exchanged: Slaves and masters exchanged.
        numbers: Seed of other numbers of nodes and cells, 0 for those of the mesh generator.
    """

    lengths: float = 1.0
    moduli: float = 1.0
    turned: tuple[tuple[float, ...], ...] | None = None
    exchanged: bool = False
    numbers: int = 0

    def turn(self, gdim: int) -> Array:
        """The matrix, shape (gdim, gdim)."""
        return np.eye(gdim) if self.turned is None else np.array(self.turned)


AS_DRAWN = Described()


def renumbered(raw: RawMesh, seed: int) -> RawMesh:
    """The same mesh with other numbers of nodes and cells."""
    rng = np.random.default_rng(seed)
    nodes, cells = rng.permutation(len(raw.points)), rng.permutation(len(raw.cells))
    points = np.empty_like(raw.points)
    points[nodes] = raw.points
    back = np.argsort(cells)
    return replace(
        raw,
        points=points,
        cells=nodes[raw.cells][cells],
        cell_groups={k: np.sort(back[v]) for k, v in raw.cell_groups.items()},
        groups={k: replace(g, rows=nodes[g.rows]) for k, g in raw.groups.items()},
    )


def raw_mesh(c: Combination) -> RawMesh:
    """Layers on top of each other, each with its own nodes."""
    model = Blocks()
    for i in range(c.interfaces + 1):
        x = np.linspace(0.0, LENGTH, c.n + 1 + (0 if c.matching else i % 2))
        y = HEIGHT * (i + np.linspace(0.0, 1.0 + 0.25 * i, 2 if c.order == 2 or c.solid else 3))
        y += 0.5 * 0.25 * HEIGHT * i * (i - 1)
        z = (np.linspace(0.0, 1.5, 3),) if c.solid else ()
        layer = model.add(f"layer{i}", (x, y, *z), c.cell, c.order)
        model.group(f"under{i}", layer.part(y=float(y[0])))
        model.group(f"over{i}", layer.part(y=float(y[-1])))
        model.group(f"far{i}", layer.part(x=LENGTH))
        model.group(f"end{i}", layer.part(x=0.0, y=float(y[-1])))
        model.group(f"low{i}", layer.part(x=0.0, y=float(y[0])))
    with gmsh_model("layers") as gmsh:
        model.write(gmsh.model)
        return prepare(gmsh.model, "layers")


def mesh_of(c: Combination, comm: MPI.Intracomm, how: Described) -> fx.Mesh:
    """The mesh, in another description; collective."""

    def make() -> RawMesh:
        raw = raw_mesh(c)
        turn = how.turn(raw.points.shape[1])
        raw = replace(raw, points=how.lengths * raw.points @ turn.T)
        return renumbered(raw, how.numbers) if how.numbers else raw

    return distribute(on_root(comm, make), comm, "layers")


@dataclass(frozen=True)
class Reference:
    """The linear answer to a displacement of the loaded end by OPENING.

    Attributes:
        rate: Largest energy release rate.
        force: Reaction of the end, shape (gdim,).
    """

    rate: float
    force: tuple[float, ...]


def criterion_of(c: Combination, rate: float, size: Described) -> Any:
    """The criterion that is met at about a given energy release rate."""
    g = rate * size.moduli * size.lengths
    stress = size.moduli * np.sqrt(rate / LENGTH * c.n)
    mixes: dict[str, dict[str, Any]] = {
        "VCCT": {},
        "power": {"GIIc": 2.0 * g, "mix": fx.Power(am=2.0, an=1.4)},
        "BK": {"GIIc": 3.0 * g, "mix": fx.BK(eta=1.6)},
        "closure": {"method": "closure"},
        "own mix": {"mix": lambda one, two, three: (one + 0.7 * two + three) / g},
    }
    if c.criterion == "stress":
        return fx.CriticalStress(stress, 1.5 * stress, distance=0.5 * size.lengths)
    # waves jump beyond the toughness; shorter increments of a load that begins at once do not help
    common: dict[str, Any] = {"unstable_tolerance": np.inf, "tolerance": 1e3 if c.dynamic else 0.2}
    if c.criterion == "enhanced":
        return fx.EnhancedVCCT(GIc=g, GIc_p=0.8 * g, **common)
    return fx.VCCT(GIc=g, **common, **mixes[c.criterion])


RELEASES: dict[str, Callable[[], Any]] = {
    "step": fx.StepRelease, "enhanced": fx.StepRelease, "ramp": fx.RampRelease,
    "progressive": fx.ProgressiveRelease, "default": lambda: None,
}  # fmt: skip


def _effects(c: Combination) -> list[Any]:
    out: list[Any] = []
    if "finite" in c.bodies:
        out.append(fx.FiniteStrain())
    if c.dynamic:
        out.append(fx.Inertia(rho_inf=1.0))
    if c.bodies == "temperature":
        out.append(fx.Temperature([(0.0, 0.0), (1.0, 20.0)]))
    return out


def _material(c: Combination, i: int, how: Described) -> Any:
    e = how.moduli * (c.soft if i % 2 else 1.0)
    if c.bodies == "plastic":
        return fx.Plastic(e, 0.3, yield_stress=0.02 * e, hardening=0.1 * e)
    if c.bodies == "neo-Hookean":
        return fx.NeoHookean(e, 0.3)
    # the unit of time stays
    return fx.Isotropic(e, 0.3, 1e-4 * (1 + i), how.moduli / how.lengths**2)


def _interface(c: Combination, i: int, how: Described) -> fx.Interface:
    slave, master = f"under{i + 1}", f"over{i}"
    if how.exchanged:
        slave, master = master, slave
    start, along = CRACK + i, how.turn(3 if c.solid else 2)[:, 0]
    return fx.Interface(
        slave,
        master,
        bonded=lambda x: along @ x[: len(along)] >= (start - 1e-6) * how.lengths,
        contact=c.contact,
        friction=c.friction,
        name=f"bond{i}",
    )


def scene_of(
    c: Combination,
    amplitude: fx.Amplitude | None,
    reference: Reference,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    how: Described = AS_DRAWN,
) -> fx.Scene:
    """The scene, as drawn or in another description; collective."""
    top, gdim = c.interfaces, 3 if c.solid else 2
    turn, axes = how.turn(gdim), "xyz"[:gdim]
    zero = dict.fromkeys(axes, 0.0)
    supports = [fx.Displacement(f"far{i}", **zero) for i in range(top + 1)]
    supports.append(fx.Displacement("low0", **zero))
    loads: list[Any] = []
    grows: dict[str, Any] = {} if amplitude is None else {"amplitude": amplitude}
    if c.force:
        force = how.moduli * how.lengths ** (gdim - 1) * turn @ np.array(reference.force)
        loads.append(fx.PointForce(f"end{top}", tuple(map(float, force)), **grows))
    else:
        way = OPENING * how.lengths * turn @ np.array(c.load[:gdim])
        moved = dict(zip(axes, map(float, way), strict=True))
        supports.append(fx.Displacement(f"end{top}", **moved, **grows))
    return fx.Scene(
        mesh_of(c, comm, how),
        materials={f"layer{i}": _material(c, i, how) for i in range(top + 1)},
        model=fx.Solid() if c.solid else fx.PlaneStrain(),
        supports=supports,
        loads=loads,
        debonds=[
            fx.Debond(
                _interface(c, i, how), criterion_of(c, reference.rate, how), RELEASES[c.release]()
            )
            for i in range(top)
        ],
        effects=_effects(c),
        solver="newton" if c.bodies == "newton" else None,
    )


@lru_cache(maxsize=4)
def reference_of(c: Combination) -> Reference:
    """The linear answer that loads and toughness of a scene are measured by."""
    plain = replace(
        c, bodies="linear", criterion="VCCT", release="step", friction=None, force=False,
        stepping="increment", turns=(1.0,),
    )  # fmt: skip
    scene = scene_of(plain, fx.Amplitude((0.0, 1.0), (0.0, 1.0)), Reference(1e6, ()))
    step = fx.Static(until=fx.Time(1.0), stepping="increment", initial=1.0, maximum=1.0)
    last = scene.run(step, progress=False)[-1]
    scene.close()
    bonds = range(c.interfaces)
    rates = [sum(float(last[f"G{m}[bond{i}]"]) for m in ("I", "II", "III")) for i in bonds]
    force = [float(last[f"R[end{c.interfaces}.{x}]"]) for x in "xyz"[: 3 if c.solid else 2]]
    return Reference(max(*rates, 1e-4 * OPENING**2), tuple(force))


def step_of(c: Combination) -> tuple[fx.Amplitude | None, fx.Static]:
    """The load, ``None`` for one that is proportional to time, and the step that follows it."""
    unit = 20.0 if c.dynamic else 1.0  # some times the way of waves through the layers
    times = tuple(unit * t for t in range(len(c.turns) + 1))
    amplitude = fx.Amplitude(times, (0.0, *c.turns)) if c.turns else None
    end = fx.Time(times[-1] if c.turns else 2.0)
    cutbacks = {"max_cutbacks": 40}
    if c.dynamic:
        return amplitude, fx.Dynamic(until=end, dt=0.05 * unit, **cutbacks)
    until = [end, fx.Releases(6)]
    if c.stepping == "increment":
        cutbacks["initial"] = 0.25
    return amplitude, fx.Static(until=until, stepping=c.stepping, maximum=0.25, **cutbacks)
