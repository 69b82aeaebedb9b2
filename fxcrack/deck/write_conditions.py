"""Supports and loads of a scene as cards of a deck, and their amplitudes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fxcrack.continuum.amplitudes import Amplitude, AmplitudeLike, SmoothStep
from fxcrack.continuum.couplings import Coupling, Equation
from fxcrack.continuum.loads import (
    BodyForce,
    Displacement,
    Load,
    Moment,
    PointForce,
    PointMoment,
    Pressure,
    Traction,
)
from fxcrack.continuum.node_supports import Clamp, Rotation, Symmetry
from fxcrack.deck.gather import Gathered
from fxcrack.deck.lines import broken, number, set_lines
from fxcrack.deck.write_constraints import coupling_lines, equation_lines
from fxcrack.deck.write_mesh import MeshLines
from fxcrack.deck.write_steps import refuse
from fxcrack.effects import FiniteStrain
from fxcrack.interface.supports import AnySupport
from fxcrack.scene import Scene


@dataclass
class ConditionLines:
    """Writes supports and loads.

    Attributes:
        scene: The scene.
        mesh: Its mesh, on rank 0; the others find the same refusals.
        body: Writes the mesh.
        sets: Model data that the conditions name: sets, surfaces, couplings, equations.
    """

    scene: Scene
    mesh: Gathered | None
    body: MeshLines
    sets: list[str] = field(default_factory=list)
    _named: dict[AmplitudeLike, str] = field(default_factory=dict)

    def _amplitude(self, amplitude: AmplitudeLike) -> str:
        """Name of an amplitude."""
        return self._named.setdefault(amplitude, f"AMPLITUDE {len(self._named) + 1}")

    def amplitudes(self, end: float) -> list[str]:
        """Amplitudes of all conditions.

        Args:
            end: Time of the last step's end.
        """
        out = []
        for amplitude, name in self._named.items():
            smooth = isinstance(amplitude, SmoothStep)
            kind = ", DEFINITION=SMOOTH STEP" if smooth else ""
            out.append(f'*AMPLITUDE, NAME="{name}", TIME=TOTAL TIME{kind}')
            if isinstance(amplitude, Amplitude | SmoothStep):
                times, values = list(amplitude.times), list(amplitude.values)
            else:
                times = sorted({0.0, *amplitude.breaks(), end})
                values = [amplitude(t) for t in times]
            if times[0] > 0.0:
                times, values = [0.0, *times], [values[0], *values]
            words = [number(x) for pair in zip(times, values, strict=True) for x in pair]
            out += broken(words, 8, comma=False)
        return out

    def _name_nodes(self, name: str, group: str) -> None:
        """Make a set of a group's nodes under a name of the history."""
        nodes = self.body.nodes_of(group)
        if self.mesh is None or (name == group and self.mesh.groups[group][0] == 0):
            return
        lines = set_lines("NSET", name, nodes)
        if lines[0] not in self.sets:
            self.sets += lines

    def supports(self) -> list[str]:
        """``*BOUNDARY`` cards of the first step."""
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
        node, new = self.body.reference_node(mark)
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

    def loads(self) -> list[str]:
        """Load cards of the first step."""
        out: list[str] = []
        for load in self.scene.input.loads:
            out += self._load(load)
        return out

    def _load(self, load: Load) -> list[str]:
        if isinstance(load, Moment) or (isinstance(load, PointMoment) and not self.body.shell):
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
            if not self.body.whole(load.where):
                refuse(f"load '{title}' on nodes that the elements of a deck do not have")
            first = 4 if isinstance(load, PointMoment) else 1
            n = max(len(self.body.nodes_of(load.where)), 1)
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
        self.sets += self.body.named_surface(title, load.where)
        if isinstance(load, Pressure):
            finite = any(isinstance(e, FiniteStrain) for e in self.scene.input.effects)
            if self.body.shell and not load.follows:
                card = f'*DSLOAD, AMPLITUDE="{name}", FOLLOWER=NO'
                return [card, f'"{title}", P, {number(numbers[0])}']
            if load.follows != finite or self.body.shell:
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


__all__ = ["ConditionLines"]
