"""``write_deck``: a scene and its steps as a keyword deck, to be checked in another program.

Reading the deck again gives the same history. What a deck has no word for is refused by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import check_instance, check_list
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.amplitudes import Amplitude, AmplitudeLike, SmoothStep
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.couplings import Coupling, Equation
from fxcrack.continuum.face import Face
from fxcrack.continuum.generalised_plane_strain import GeneralisedPlaneStrain
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import PlaneStress
from fxcrack.continuum.loads import (
    BodyForce,
    Displacement,
    Load,
    Moment,
    Monitor,
    PointForce,
    PointMoment,
    Pressure,
    Traction,
)
from fxcrack.continuum.node_supports import Clamp, Rotation, Symmetry
from fxcrack.continuum.section import Section
from fxcrack.continuum.temperature import Temperature
from fxcrack.deck.gather import Gathered, gather
from fxcrack.deck.lines import broken, number, set_lines
from fxcrack.deck.procedures import DeckStep
from fxcrack.deck.write_constraints import coupling_lines, equation_lines
from fxcrack.deck.write_debond import debond_lines
from fxcrack.deck.write_explicit import explicit_interface
from fxcrack.deck.write_mesh import MeshLines
from fxcrack.deck.write_properties import material_lines
from fxcrack.deck.write_shells import section_lines
from fxcrack.deck.write_steps import ends_of, refuse, step_lines
from fxcrack.effects import FiniteStrain
from fxcrack.interface.definition import Interface
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import AnySupport
from fxcrack.scene import Scene
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.debond import Debond
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.static import Static


def write_deck(
    scene: Scene, steps: Sequence[Static | Cycles | Explicit | DeckStep], path: str | Path
) -> None:
    """Write a scene and its steps as a keyword deck; collective, rank 0 writes.

    Second-order quadrilaterals and hexahedra are written as 8- and 20-node elements, whose centre
    nodes other programs leave out. Open faces are in contact in a deck.

    Args:
        scene: The scene, before or after its steps; its input is written, not its state.
        steps: Static and dynamic steps by increments and explicit ones that end at a
            :class:`~fxcrack.Time`, cycles over a period, or steps of a deck.
        path: The file.

    Raises:
        InputError: The scene or a step has something that a deck has no word for.
        FxcrackError: The file could not be written.
    """
    check_instance("write_deck", "scene", scene, Scene, "deck.scene")
    steps = check_list("write_deck", "steps", steps, (Static, Cycles, Explicit, DeckStep))
    mesh = gather(scene.mesh, getattr(scene.continuum, "signs", None))
    toughness = [_nodal_toughness(d, p) for d, p in zip(scene.debonds, scene.pairs, strict=False)]
    comm, lines, problem = scene.mesh.comm, [], None
    try:
        lines = _Writer(scene, mesh, toughness).lines(steps)
    except InputError as error:  # rank 0 alone sees the mesh
        problem = str(error)
    raise_on_all_ranks(comm, problem)
    with all_or_none(comm, f"writing {path}"):
        if comm.rank == 0:
            with replacing(path) as temporary:
                temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _nodal_toughness(debond: Debond, pair: Pair) -> Array | None:
    """Toughness at the slave nodes where it varies along them, shape (n_nodes, 3)."""
    criterion = debond.criterion
    given = [getattr(criterion, name, None) for name in ("GIc", "GIIc", "GIIIc")]
    if not any(callable(v) or np.ndim(v) > 0 for v in given if v is not None):
        return None
    n = pair.surface.n_nodes
    x = pair.surface.x[:, : pair.frames.shape[1]]
    return np.asarray(criterion.toughness_at(x, np.arange(n), n_slave=n))  # type: ignore[attr-defined]


@dataclass
class _Writer:
    """Makes the lines; the mesh is on rank 0 only, the others find the same refusals."""

    scene: Scene
    mesh: Gathered | None
    toughness: list[Array | None]
    amplitudes: dict[AmplitudeLike, str] = field(default_factory=dict)
    sets: list[str] = field(default_factory=list)
    end: float = 0.0
    inertia: Inertia | None = None
    explicit: bool = False
    contact: list[str] = field(default_factory=list)
    references: dict[tuple[object, ...], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin with the mesh."""
        self._body = MeshLines(self.scene, self.mesh)

    def lines(self, steps: Sequence[Static | Cycles | Explicit | DeckStep]) -> list[str]:
        """The whole deck."""
        given = self.scene.input
        if isinstance(given.model, GeneralisedPlaneStrain):
            refuse("the model GeneralisedPlaneStrain")
        if given.stabilise is not None:
            refuse("the argument stabilise of the scene")
        if given.order is not None and given.order != self.scene.mesh.order:
            refuse(
                f"a displacement of order {given.order} on elements of order "
                f"{self.scene.mesh.order}; make the mesh of that order"
            )
        chosen = [s if isinstance(s, DeckStep) else _as_deck_step(self.scene, s, i)
                  for i, s in enumerate(steps)]  # fmt: skip
        ends = ends_of(chosen)
        self.end = ends[-1] if ends else 1.0
        self.explicit = any(isinstance(s.step, Explicit) for s in chosen)
        for effect in given.effects:
            if isinstance(effect, Temperature):
                refuse(f"the effect {type(effect).__name__}")
            if isinstance(effect, Inertia):
                self.inertia = effect
        model = [
            *self._body.lines(explicit=self.explicit),
            *self._properties(),
            *self._interfaces(),
            *self._velocity(),
        ]
        conditions = [*self._supports(), *self._loads()]
        tail: list[str] = []
        start = 0.0
        for i, (step, end) in enumerate(zip(chosen, ends, strict=True)):
            tail += self._step(step, end - start, conditions if i == 0 else [])
            start = end
        return ["*HEADING", f"written by fxcrack: {self.scene.mesh.name}", *model, *self.sets,
                *self._amplitudes(), *tail]  # fmt: skip

    # -- properties ----------------------------------------------------------------------

    def _properties(self) -> list[str]:
        given = self.scene.input
        materials = given.materials
        thickness = getattr(given.model, "thickness", None)
        out: list[str] = []
        if not isinstance(materials, dict):
            items = [("ALL_ELEMENTS", materials)]
        else:
            items = list(materials.items())
        for i, (name, material) in enumerate(items):
            title = f"MATERIAL {i + 1}"
            if isinstance(material, Section | ContinuumShell):
                out += section_lines(name, title, material, self.inertia, self._normals(name))
                continue
            lines, orientation = material_lines(title, material, self.inertia)  # type: ignore[arg-type]
            section = f'*SOLID SECTION, ELSET="{name}", MATERIAL="{title}"'
            out += lines
            if orientation:
                out += orientation
                section += f', ORIENTATION="{title}"'
            out += [section, number(thickness) if thickness else ","]
        return out

    def _normals(self, group: str) -> Array:
        """Normals of the cells of a group; the others than rank 0 have none."""
        if self.mesh is None or group not in self.mesh.groups:
            return self._body.normals
        return self._body.normals[self.mesh.groups[group][1]]

    def _velocity(self) -> list[str]:
        """Velocity of the nodes at the beginning."""
        if self.inertia is None or self.inertia.velocity is None or self.mesh is None:
            return []
        nodes = np.flatnonzero(~self._body.dropped)
        x = np.zeros((len(nodes), 3))
        x[:, : self.mesh.points.shape[1]] = self.mesh.points[nodes]
        out = ["*INITIAL CONDITIONS, TYPE=VELOCITY"]
        for i, component in enumerate(self.inertia.velocity):
            values = np.full(len(nodes), component)
            if callable(component):
                values = numbers_at("Inertia", f"velocity[{i}]", component, x)
            out += [
                f"{node + 1}, {i + 1}, {number(v)}"
                for node, v in zip(nodes, values, strict=True)
                if v
            ]
        return out if len(out) > 1 else []

    # -- interfaces ----------------------------------------------------------------------

    def _interfaces(self) -> list[str]:
        out: list[str] = []
        debonds = list(self.scene.debonds)
        for i, pair in enumerate(self.scene.pairs):
            interface = pair.interface
            debond = debonds[i] if i < len(debonds) else None
            out += self._interface(pair, interface, debond is not None)
            rates = self.toughness[i] if debond is not None else None
            if rates is not None:
                out.append("*NODAL ENERGY RATE")
                nodes = self._slave_numbers(pair, np.ones(pair.surface.n_nodes, dtype=bool))
                out += [
                    f"{node + 1}, " + ", ".join(number(g) for g in row)
                    for node, row in zip(nodes, rates, strict=True)
                    if self.mesh is not None and not self._body.dropped[node]
                ]
        return out

    def _interface(self, pair: Pair, interface: Interface, debonds: bool) -> list[str]:
        title = interface.title
        if interface.is_rigid:
            refuse(f"interface '{title}': a rigid surface as master")
        if interface.stiffness is not None:
            refuse(f"interface '{title}': stiffness of bonds")
        if interface.pairing is not None and self.explicit:
            refuse(f"interface '{title}': pairing='{interface.pairing}'")
        if callable(interface.friction):
            refuse(f"interface '{title}': friction as a function of position")
        slave, master = title, f"{title} master"
        out: list[str] = []
        if self.mesh is not None:
            for name, face in ((slave, pair.sides[0]), (master, pair.sides[1])):
                assert isinstance(face, str | Face)  # rigid ones are refused above
                out += self._surface(name, face)
        if not debonds and not interface.contact and pair.bonded[pair.paired].all():
            return [*out, f'*TIE, NAME="{title}"{_type(interface)}', f'"{slave}", "{master}"']
        if not interface.contact:
            log.warn(
                "write_deck: interface '%s' has no contact, but open faces of a deck touch", title
            )
        if self.explicit:
            return out + self._general(pair, interface)
        adjust = ", ADJUST=0." if interface.gap == "adjust" else ""
        out += [
            f'*SURFACE INTERACTION, NAME="{title}"',
            *([number(pair_thickness)] if (pair_thickness := self._thickness()) else []),
            *(["*FRICTION", number(float(interface.friction))] if interface.friction else []),
            f'*CONTACT PAIR, INTERACTION="{title}", SMALL SLIDING{adjust}{_type(interface)}',
            f'"{slave}", "{master}"',
        ]
        if pair.bonded.any():
            normal = ", NORMAL" if interface.normal_only else ""
            name = f"{title} bonded"
            bonded = np.sort(self._slave_numbers(pair, pair.bonded))
            if self.mesh is not None:
                out += set_lines("NSET", name, bonded[~self._body.dropped[bonded]])
            out += [
                f"*INITIAL CONDITIONS, TYPE=CONTACT{normal}",
                f'"{slave}", "{master}", "{name}"',
            ]
        return out

    def _general(self, pair: Pair, interface: Interface) -> list[str]:
        """Model data of an interface in explicit dynamics; its history data are kept."""
        at = next((i for i, d in enumerate(self.scene.debonds) if d.interface is interface), None)
        debond = None if at is None else self.scene.debonds[at]
        found = explicit_interface(
            interface,
            None if debond is None else debond.criterion,
            None if debond is None else debond.release,
            bonded=bool(pair.bonded.any()),
            nodal=at is not None and self.toughness[at] is not None,
            thickness=self._thickness(),
        )
        self.contact += found.in_step
        out: list[str] = []
        if pair.bonded.any() and self.mesh is not None:
            bonded = np.sort(self._slave_numbers(pair, pair.bonded))
            out = set_lines(
                "NSET", f"{interface.title} bonded", bonded[~self._body.dropped[bonded]]
            )
        return out + found.in_model

    def _thickness(self) -> float:
        return float(getattr(self.scene.input.model, "thickness", 0.0))

    def _surface(self, name: str, where: str | Face) -> list[str]:
        """A surface of a name; none where the deck has it already."""
        if isinstance(where, Face):
            return self._body.side(name, where)
        if name == where or self.mesh is None:
            return []
        dim, members = self.mesh.groups[where]
        if members.ndim == 1 or dim != self.scene.mesh.tdim - 1:
            refuse(f"'{name}' on the edges '{where}' of shells")
        return self._body.surface(name, members)

    def _slave_numbers(self, pair: Pair, chosen: Bools) -> Ints:
        """Nodes of the input at some slave nodes, in their order."""
        if self.mesh is None:
            return np.zeros(0, dtype=np.int64)
        face = pair.sides[0]
        if isinstance(face, Face):
            nodes, points = self._body.side_points(face)
        else:
            nodes = self._body.facet_nodes(self.mesh.groups[face][1])
            points = self.mesh.points[nodes]
        gdim = self.mesh.points.shape[1]
        _, at = cKDTree(points).query(pair.surface.x[chosen][:, :gdim])
        return np.asarray(nodes[at])

    # -- conditions ----------------------------------------------------------------------

    def _amplitude(self, amplitude: AmplitudeLike) -> str:
        """Name of an amplitude."""
        return self.amplitudes.setdefault(amplitude, f"AMPLITUDE {len(self.amplitudes) + 1}")

    def _amplitudes(self) -> list[str]:
        out = []
        for amplitude, name in self.amplitudes.items():
            smooth = isinstance(amplitude, SmoothStep)
            kind = ", DEFINITION=SMOOTH STEP" if smooth else ""
            out.append(f'*AMPLITUDE, NAME="{name}", TIME=TOTAL TIME{kind}')
            if isinstance(amplitude, Amplitude | SmoothStep):
                times, values = list(amplitude.times), list(amplitude.values)
            else:
                times = sorted({0.0, *amplitude.breaks(), self.end})
                values = [amplitude(t) for t in times]
            if times[0] > 0.0:
                times, values = [0.0, *times], [values[0], *values]
            words = [number(x) for pair in zip(times, values, strict=True) for x in pair]
            out += broken(words, 8, comma=False)
        return out

    def _name_nodes(self, name: str, group: str) -> None:
        """Make a set of a group's nodes under a name of the history."""
        nodes = self._body.nodes_of(group)
        if self.mesh is None or (name == group and self.mesh.groups[group][0] == 0):
            return
        lines = set_lines("NSET", name, nodes)
        if lines[0] not in self.sets:
            self.sets += lines

    def _supports(self) -> list[str]:
        cards: list[str] = []
        for support in self.scene.input.supports:
            if isinstance(support, Coupling):
                cards += self._coupling(support)
                continue
            if isinstance(support, Equation):
                for group, _, _ in support.terms:
                    self._name_nodes(group, group)
                self.sets += equation_lines(support)
                continue
            self._name_nodes(support.title, support.where)
            cards += self._support(support)
        return cards

    def _coupling(self, coupling: Coupling) -> list[str]:
        """A coupling: its model data are kept with the sets, its motions belong to the step."""
        mark = coupling.where, coupling.point, coupling.components, coupling.rotations
        new = mark not in self.references
        self.references.setdefault(mark, len(self.references) + 1)
        node = self.references[mark] + (0 if self.mesh is None else len(self.mesh.points))
        self._name_nodes(coupling.title, coupling.where)
        model, boundary = coupling_lines(
            coupling, node, new=new, amplitude=lambda: self._amplitude(coupling.amplitude)
        )
        self.sets += model
        return boundary

    def _support(self, support: AnySupport) -> list[str]:
        if isinstance(support, Clamp):
            return ["*BOUNDARY", f'"{support.title}", ENCASTRE']
        if isinstance(support, Symmetry):
            return ["*BOUNDARY", f'"{support.title}", {support.axis.upper()}SYMM']
        if not isinstance(support, Displacement | Rotation):
            refuse(f"the support {type(support).__name__}('{support.title}')")
        held, moved = [], []
        for i, value in enumerate((support.x, support.y, support.z)):
            if value is None:
                continue
            if callable(value):
                refuse(f"support '{support.title}' as a function of position")
            dof = i + (4 if isinstance(support, Rotation) else 1)
            line = f'"{support.title}", {dof}, {dof}'
            if value == 0.0:
                held.append(line)
            else:
                moved.append(f"{line}, {number(float(value))}")
        name = self._amplitude(support.amplitude) if moved else ""
        return [
            *(["*BOUNDARY", *held] if held else []),
            *([f'*BOUNDARY, AMPLITUDE="{name}"', *moved] if moved else []),
        ]

    def _loads(self) -> list[str]:
        out: list[str] = []
        for load in self.scene.input.loads:
            out += self._load(load)
        return out

    def _load(self, load: Load) -> list[str]:
        if isinstance(load, Moment) or (isinstance(load, PointMoment) and not self._body.shell):
            refuse(f"the load {type(load).__name__}('{load.title}')")
        if isinstance(load, Pressure) and load.follows_crack:
            # it names an interface, which is no group of the mesh
            refuse(f"pressure '{load.title}' with follows_crack")
        name = self._amplitude(load.amplitude)
        title = load.title
        values = load.value if isinstance(load.value, tuple | list) else [load.value]
        if any(callable(v) for v in values):
            refuse(f"load '{title}' as a function of position")
        numbers = [float(v) for v in values]  # type: ignore[arg-type]
        if isinstance(load, PointForce | PointMoment):
            if not self._body.whole(load.where):
                refuse(f"load '{title}' on nodes that the elements of a deck do not have")
            first = 4 if isinstance(load, PointMoment) else 1
            n = max(len(self._body.nodes_of(load.where)), 1)
            self._name_nodes(title, load.where)
            return [
                f'*CLOAD, AMPLITUDE="{name}"',
                *(f'"{title}", {i + first}, {number(v / n)}' for i, v in enumerate(numbers) if v),
            ]
        if isinstance(load, BodyForce):
            if load.where is not None and self.mesh is None:
                return []
            words = [f"{f'{chr(34)}{load.where}{chr(34)}' if load.where else ''}, B{'XYZ'[i]}, "
                     f"{number(v)}" for i, v in enumerate(numbers) if v]  # fmt: skip
            return [f'*DLOAD, AMPLITUDE="{name}"', *words]
        self.sets += self._surface(title, load.where)
        if isinstance(load, Pressure):
            finite = any(isinstance(e, FiniteStrain) for e in self.scene.input.effects)
            if self._body.shell and not load.follows:
                card = f'*DSLOAD, AMPLITUDE="{name}", FOLLOWER=NO'
                return [card, f'"{title}", P, {number(numbers[0])}']
            if load.follows != finite or self._body.shell:
                refuse(
                    f"pressure '{title}' with follows={load.follows} and "
                    f"{'' if finite else 'no '}FiniteStrain: in a deck pressures follow if, and "
                    "only if, rotations are large"
                )
            return [f'*DSLOAD, AMPLITUDE="{name}"', f'"{title}", P, {number(numbers[0])}']
        assert isinstance(load, Traction)
        size = float(np.linalg.norm(numbers))
        direction = ", ".join(number(v / size) for v in numbers)
        return [
            f'*DSLOAD, AMPLITUDE="{name}", FOLLOWER=NO',
            f'"{title}", TRVEC, {number(size)}, {direction}',
        ]

    # -- steps ---------------------------------------------------------------------------

    def _step(self, step: DeckStep, length: float, conditions: list[str]) -> list[str]:
        finite = any(isinstance(e, FiniteStrain) for e in self.scene.input.effects)
        explicit = isinstance(step.step, Explicit)
        plane_stress = isinstance(self.scene.input.model, PlaneStress)
        if isinstance(step.step, Explicit) and step.step.bulk[1] and plane_stress:
            refuse(f"step '{step.name}': quadratic bulk viscosity in plane stress")
        out = [*step_lines(step, length, self.inertia, finite=finite), *conditions]
        if conditions and explicit:
            out += self.contact
        for i, debond in enumerate(self.scene.debonds):
            grows = debond.interface.title in step.grow
            if explicit and not grows:
                refuse(f"step '{step.name}', in which '{debond.interface.title}' may not grow")
            if grows and not explicit:
                nodal = self.toughness[i] is not None
                out += debond_lines(debond, step.step, self.scene.pairs, nodal=nodal)
        monitors = [line for m in self.scene.input.monitors for line in self._monitor(m)]
        if monitors:
            out += ["*OUTPUT, HISTORY", *monitors]
        return [*out, "*END STEP"]

    def _monitor(self, monitor: Monitor) -> list[str]:
        axes = np.flatnonzero(monitor.direction)
        if (
            monitor.plus
            or len(axes) != 1
            or self.mesh is None
            or self.mesh.groups[monitor.where][0] != 0
        ):
            return []
        return [f'*NODE OUTPUT, NSET="{monitor.where}"', f"U{axes[0] + 1}"]


def _type(interface: Interface) -> str:
    """Parameter of a pair that says how nodes follow the master, where the scene does."""
    words = {"node-to-surface": "NODE TO SURFACE", "surface-to-surface": "SURFACE TO SURFACE"}
    return "" if interface.pairing is None else f", TYPE={words[interface.pairing]}"


def _as_deck_step(scene: Scene, step: Static | Cycles | Explicit, i: int) -> DeckStep:
    return DeckStep(f"step {i + 1}", step, tuple(d.interface.title for d in scene.debonds))
