"""Crack tips of a deck at its output increments, as text in the numbers of the deck's nodes.

At the start the bonded and open nodes of each interface and its tips, numbered as cracks; then, at
the increments that FREQUENCY of ``*DEBOND`` asks for and at the last of each step, every crack with
initial and current tip, accumulated length along the slave surface, f, and the quantities of the
criterion by their usual names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array, Ints
from fxcrack.history import Row
from fxcrack.output.usual_names import usual_name
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack

_INCREMENTS = ("increment",)
_OF_CYCLES = ("increment", "onset", "release")
"""Events that count as increments."""


@dataclass(frozen=True, eq=False)
class NodeNames:
    """Names of the slave nodes of an interface in the deck.

    Attributes:
        x: Positions, shape (n, 3), length.
        names: "12" or "instance.12", one per node.
    """

    x: Array
    names: tuple[str, ...]

    def of(self, x: Array) -> list[str]:
        """Names of the nodes nearest to some positions, shape (m, 3)."""
        _, found = cKDTree(self.x).query(x)
        return [self.names[i] for i in np.atleast_1d(found)]


@dataclass(eq=False)
class TipReport:
    """Observer of a run that keeps the text.

    Args:
        analysis: The analysis.
        nodes: Names of slave nodes by the title of the interface.

    Attributes:
        text: The text so far, the same on every rank.
    """

    analysis: Analysis
    nodes: Mapping[str, NodeNames]
    text: str = ""
    _step: str = ""
    _frequency: Mapping[str, int] = field(default_factory=dict)
    _increment: int = 0
    _said: int = -1
    _counted: tuple[str, ...] = _INCREMENTS

    def begin(self, step: str, frequency: Mapping[str, int], *, cycles: bool) -> None:
        """Begin a step.

        Args:
            step: Its name.
            frequency: Increments between two outputs by the title of the interface, 0 for none.
            cycles: Whether it is a step of cycles, where a release is an increment.
        """
        self._counted = _OF_CYCLES if cycles else _INCREMENTS
        self._step, self._frequency, self._increment, self._said = step, frequency, 0, -1

    def __call__(self, event: str, row: Row) -> None:
        """Take the cracks at an event."""
        if not self.text:
            self.text = "INITIAL STATE OF THE BONDS\n\n" + "".join(
                self._initial(number, crack)
                for number, crack in enumerate(self.analysis.cracks, start=1)
            )
        counts = event in self._counted
        self._increment += counts
        last = event == "end" and self._said != self._increment
        if not (counts or last):
            return
        due = []
        for number, crack in enumerate(self.analysis.cracks, start=1):
            every = self._frequency.get(crack.title, 0)
            if every and (last or self._increment % every == 0):
                due.append(self._crack(number, crack, float(row["time"])))
        if due:
            self._said = self._increment
            self.text += (
                f"\nCRACK TIP LOCATION AND ASSOCIATED QUANTITIES: step '{self._step}', increment "
                f"{self._increment}, time {float(row['time']):.6g}\n\n" + "".join(due)
            )

    def _names(self, crack: Crack, nodes: Ints) -> list[str]:
        return self.nodes[crack.title].of(crack.front.surface.x[nodes])

    def _initial(self, number: int, crack: Crack) -> str:
        interface = crack.debond.interface
        bonded = self.analysis.pairs[number - 1].bonded
        tips = crack.tips()
        names = ", ".join(self._names(crack, tips.node)) if len(tips) else "none"
        return (
            f"crack {number}: slave '{interface.slave}', master '{interface.master}': "
            f"{int(bonded.sum())} slave nodes bonded, {int((~bonded).sum())} open; tips: {names}\n"
        )

    def _crack(self, number: int, crack: Crack, time: float) -> str:
        values = crack.evaluate(crack.tips(), self.analysis.solver.state, time)
        if not len(values.tips):
            return f"crack {number}: no tip is left\n"
        origins = crack.paths.origins(values.tips)
        titles = [usual_name(f"{name}[x]").removesuffix("[x]") for name in values.report]
        head = ["crack", "initial tip", "current tip", "crack length", "f", *titles]
        lines = ["".join(f"{word:>14}" for word in head)]
        initial = self._names(crack, np.asarray(origins.nearest, dtype=np.int64))
        current = self._names(crack, values.tips.node)
        for i, (first, now) in enumerate(zip(initial, current, strict=True)):
            numbers = [origins.grown[i], values.f[i], *(v[i] for v in values.report.values())]
            cells = [str(number), first, now, *(f"{float(v):.5g}" for v in numbers)]
            lines.append("".join(f"{cell:>14}" for cell in cells))
        return "\n".join(lines) + "\n"


__all__ = ["NodeNames", "TipReport"]
