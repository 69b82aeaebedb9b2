"""``write_deck``: a scene and its steps as a keyword deck, to be checked in another program.

Reading the deck again gives the same history. What a deck has no word for is refused by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import check_instance, check_list
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.generalised_plane_strain import GeneralisedPlaneStrain
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import PlaneStress
from fxcrack.continuum.loads import Monitor
from fxcrack.continuum.section import Section
from fxcrack.continuum.temperature import Temperature
from fxcrack.criteria import Fatigue
from fxcrack.deck.gather import Gathered, gather
from fxcrack.deck.lines import number
from fxcrack.deck.procedures import DeckStep
from fxcrack.deck.write_conditions import ConditionLines
from fxcrack.deck.write_debond import debond_lines
from fxcrack.deck.write_interfaces import InterfaceLines, nodal_toughness
from fxcrack.deck.write_mesh import MeshLines
from fxcrack.deck.write_properties import material_lines
from fxcrack.deck.write_shells import section_lines
from fxcrack.deck.write_steps import ends_of, refuse, step_lines
from fxcrack.effects import FiniteStrain
from fxcrack.scene import Scene
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.partial_growth import why_by_node
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
    toughness = [nodal_toughness(d, p) for d, p in zip(scene.debonds, scene.pairs, strict=False)]
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


class _Writer:
    """Makes the lines; the mesh is on rank 0 only, the others find the same refusals."""

    def __init__(self, scene: Scene, mesh: Gathered | None, toughness: list[Array | None]) -> None:
        self.scene, self.mesh, self.toughness = scene, mesh, toughness
        self.inertia: Inertia | None = None
        self._body = MeshLines(scene, mesh)
        self._conditions = ConditionLines(scene, mesh, self._body)

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
        explicit = any(isinstance(s.step, Explicit) for s in chosen)
        for effect in given.effects:
            if isinstance(effect, Temperature):
                refuse(f"the effect {type(effect).__name__}")
            if isinstance(effect, Inertia):
                self.inertia = effect
        interfaces = InterfaceLines(
            self.scene, self.mesh, self._body, self.toughness, explicit=explicit
        )
        model = [
            *self._body.lines(explicit=explicit),
            *self._properties(),
            *interfaces.lines(),
            *self._velocity(),
        ]
        conditions = [*self._conditions.supports(), *self._conditions.loads()]
        tail: list[str] = []
        start = 0.0
        for i, (step, end) in enumerate(zip(chosen, ends, strict=True)):
            tail += self._step(step, end - start, conditions if i == 0 else [], interfaces)
            start = end
        return [
            *("*HEADING", f"written by fxcrack: {self.scene.mesh.name}"),
            *(*model, *self._conditions.sets),
            *(*self._conditions.amplitudes(ends[-1] if ends else 1.0), *tail),
        ]

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

    # -- steps ---------------------------------------------------------------------------

    def _step(
        self, step: DeckStep, length: float, conditions: list[str], interfaces: InterfaceLines
    ) -> list[str]:
        finite = any(isinstance(e, FiniteStrain) for e in self.scene.input.effects)
        explicit = isinstance(step.step, Explicit)
        plane_stress = isinstance(self.scene.input.model, PlaneStress)
        if isinstance(step.step, Explicit) and step.step.bulk[1] and plane_stress:
            refuse(f"step '{step.name}': quadratic bulk viscosity in plane stress")
        out = [*step_lines(step, length, self.inertia, finite=finite), *conditions]
        if conditions and explicit:
            out += interfaces.in_step
        for i, debond in enumerate(self.scene.debonds):
            grows = debond.interface.title in step.grow
            if explicit and not grows:
                refuse(f"step '{step.name}', in which '{debond.interface.title}' may not grow")
            if grows and not explicit:
                nodal = self.toughness[i] is not None
                out += debond_lines(
                    debond, step.step, self.scene.pairs, nodal=nodal,
                    in_part=self._grows_in_part(step),
                )  # fmt: skip
        monitors = [line for m in self.scene.input.monitors for line in self._monitor(m)]
        if monitors:
            out += ["*OUTPUT, HISTORY", *monitors]
        return [*out, "*END STEP"]

    def _grows_in_part(self, step: DeckStep) -> bool:
        """Whether fronts of fatigue grow in part in a step where nothing else is named."""
        scene = self.scene
        grow = [d.criterion for d in scene.debonds if d.interface.title in step.grow]
        criteria = [c for c in grow if isinstance(c, Fatigue)]
        linear = scene.analysis.linear
        return not why_by_node(scene.continuum, scene.pairs, criteria, linear=linear)

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


def _as_deck_step(scene: Scene, step: Static | Cycles | Explicit, i: int) -> DeckStep:
    return DeckStep(f"step {i + 1}", step, tuple(d.interface.title for d in scene.debonds))
