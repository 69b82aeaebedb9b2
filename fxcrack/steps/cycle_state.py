"""State of a low-cycle fatigue step at its tips: cycles, accumulated growth, what is reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools
from fxcrack.criteria import CycleRates
from fxcrack.criteria.ligaments import Ligaments


@dataclass(frozen=True)
class TipCycle:
    """One stabilised cycle at the tips of an interface.

    Attributes:
        rates: Energy release rates at n front nodes.
        dadN: Growth per cycle, shape (n,), length: by the law, 0 below the threshold, the whole
            element beyond the upper limit.
        peak: What the evaluator measured at each node at its own G_max, which need not be the
            instant at which others have theirs, shape (n, m).
    """

    rates: CycleRates
    dadN: Array
    peak: Array

    def column(self, name: str) -> Array:
        """G_max, dG, G_c or dadN, shape (n,)."""
        return self.dadN if name == "dadN" else np.asarray(getattr(self.rates, name))


_COLUMNS = ("N", "interface", "node", "a", "G_max", "dG", "G_c", "dadN", "released")


@dataclass
class FatigueState:
    """What cycles leave behind for later ones.

    Attributes:
        N: Cycles so far, over all steps.
        waiting: Per pair, slave nodes at which onset is still to come, shape (n_nodes,).
        credit: Per pair, growth within the element of each slave node, shape (n_nodes,), length.
        ligaments: Per pair, elements that fronts have passed in part.
        table: One entry per tip and stabilised cycle in each column: N and the crack length at
            its beginning (of the tip in 2-D, the mean of the front in 3-D), the values of
            :class:`TipCycle` there, and whether the tip was released at its end.
    """

    N: float = 0.0
    waiting: dict[int, Bools] = field(default_factory=dict)
    credit: dict[int, Array] = field(default_factory=dict)
    ligaments: dict[int, Ligaments] = field(default_factory=dict)
    table: dict[str, list[float | int | str | bool]] = field(
        default_factory=lambda: {name: [] for name in _COLUMNS}
    )

    def register_front(self, p: int, front: npt.NDArray[np.int64], n_nodes: int) -> None:
        """Register a front; the nodes of the first one on a pair wait for onset.

        Args:
            p: Number of the pair.
            front: Slave nodes at the front, shape (n,).
            n_nodes: Number of slave nodes of the pair.
        """
        if p not in self.waiting:
            self.waiting[p] = np.zeros(n_nodes, dtype=np.bool_)
            self.waiting[p][front] = True
            self.credit[p] = np.zeros(n_nodes)
            self.ligaments[p] = Ligaments.none(n_nodes)

    def tabulate(
        self,
        N: float,
        interface: str,
        nodes: npt.NDArray[np.int64],
        lengths: Sequence[float],
        cycle: TipCycle,
        released: Bools,
    ) -> None:
        """Add one entry per tip of an interface to every column of the table.

        Args:
            N: Cycles at the beginning of the cycle.
            interface: Title of the interface.
            nodes: Slave nodes at the front, shape (n,).
            lengths: Crack length of each tip, shape (n,), length.
            cycle: The stabilised cycle at the tips.
            released: Whether each tip is released at its end, shape (n,).
        """
        n = len(nodes)
        rates = [cycle.column(name).tolist() for name in ("G_max", "dG", "G_c", "dadN")]
        columns = [[N] * n, [interface] * n, nodes.tolist(), lengths, *rates, released.tolist()]
        for name, values in zip(_COLUMNS, columns, strict=True):
            self.table[name] += values
