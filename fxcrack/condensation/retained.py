"""Which jump components take part in the condensation, and when to factor again.

Ahead of the front these are the bonded nodes the crack may reach before the next rebase;
behind it, the wake the criterion evaluates; with contact, all open normals, and with friction all
open components of interfaces with contact. How far it reaches is the number of nodes k that costs
least. With a factorisation per set:
ceil(L/k) (t_plain + c n(k)^2), L nodes to go, n retained jumps, c the cost of an entry of S.
With columns by iteration, each computed once: (L/k) t_set + t_column (n(k) - n(0))/2, the last
set being half used on average. The constants are refitted from what was measured last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Bools
from fxcrack.base.errors import InputError
from fxcrack.interface.front import Front
from fxcrack.interface.jump_coordinates import FIXED, FREE, RETAINED
from fxcrack.interface.pair import Pair, with_friction

WAKE_ROWS = 2
"""Rows of open nodes behind the front that stay retained."""


@dataclass
class CostModel:
    """Seconds of a factorisation with n retained jumps: t_plain + c n^2.

    The constants start from `fxcrack bench` on one core (2-D, 211,332 dofs: 0.92 s plain and
    0.97 s with 972 components; 3-D, 126,630 dofs: 2.9 s and 8.1 s with 4,599) and are refitted by
    :meth:`observe`.

    Attributes:
        plain: Seconds of the plain factorisation.
        per_entry: Seconds per entry of S.
    """

    plain: float
    per_entry: float

    @classmethod
    def guess(cls, n_dofs: int, gdim: int) -> CostModel:
        """Constants before anything was measured."""
        if gdim == 2:
            return cls(plain=4.5e-6 * n_dofs, per_entry=5e-8)
        return cls(plain=9e-9 * float(n_dofs) ** (5.0 / 3.0), per_entry=2.5e-7)

    def observe(self, n_retained: int, seconds: float) -> None:
        """Scale both constants so that they give the measured time."""
        ratio = seconds / (self.plain + self.per_entry * n_retained**2)
        self.plain *= ratio
        self.per_entry *= ratio

    def reach(self, counts: npt.NDArray[np.int64]) -> int:
        """Best number of candidate nodes to take.

        Args:
            counts: Cumulative number of retained jumps after each candidate node,
                nearest first, shape (n_candidates,).

        Returns:
            How many candidates, at least 1 if there is one.
        """
        if not len(counts):
            return 0
        times = np.ceil(len(counts) / np.arange(1, len(counts) + 1))
        seconds = (self.plain + self.per_entry * counts.astype(float) ** 2) * times
        return int(np.argmin(seconds)) + 1


@dataclass
class ColumnCost:
    """Seconds where columns of S are computed by iteration, each once.

    The constants start from 3-D problems of `fxcrack bench scale` on one core and are replaced by
    :meth:`observe`.

    Attributes:
        column: Seconds of a column.
        per_set: Seconds of a new set of retained jumps without columns.
    """

    column: float
    per_set: float

    @classmethod
    def guess(cls, n_dofs: int) -> ColumnCost:
        """Constants before anything was measured."""
        return cls(column=2e-6 * n_dofs, per_set=0.02)

    def observe(self, n_columns: int, column_seconds: float, seconds: float) -> None:
        """Take over measured times.

        Args:
            n_columns: Columns computed for the last set.
            column_seconds: Seconds they took.
            seconds: Seconds of the set in all.
        """
        if n_columns:
            self.column = column_seconds / n_columns
        self.per_set = max(seconds - column_seconds, 1e-4)

    def reach(self, counts: npt.NDArray[np.int64]) -> int:
        """Best number of candidate nodes to take.

        Args:
            counts: Cumulative number of retained jumps after each candidate node,
                nearest first, shape (n_candidates,).

        Returns:
            How many candidates, at least 1 if there is one.
        """
        if not len(counts):
            return 0
        k = np.arange(1, len(counts) + 1)
        wasted = 0.5 * self.column * (counts - counts[0]).astype(float)
        return int(np.argmin(self.per_set * len(counts) / k + wasted)) + 1


def choose_roles(
    pairs: list[Pair],
    fronts: list[Front],
    active: list[bool],
    reach: list[float],
    cost: CostModel | ColumnCost,
    *,
    around: list[tuple[float, float]] | None = None,
    keep: Sequence[tuple[int, int]] = (),
    cap_mb: float,
    gdim: int,
) -> list[npt.NDArray[np.int8]]:
    """Roles of all jump components for the next factorisation.

    Args:
        pairs: Interfaces.
        fronts: Their present fronts.
        active: Whether the crack may grow in each.
        reach: Distance the crack may grow before the analysis stops, per pair (inf: unknown),
            length.
        cost: Cost model.
        around: Distances ahead of and behind the tips that the criterion needs, per pair, length.
        keep: (pair, slave node) of bonds that carry a force and must stay retained.
        cap_mb: Memory S may take, MB.
        gdim: Dimension.

    Returns:
        FIXED, FREE or RETAINED per pair and jump component, shape (n_nodes, gdim).

    Raises:
        InputError: Even the smallest useful set exceeds the cap.
    """
    roles, waiting = [], []
    friction = bool(with_friction(pairs))
    n_fixed = 0
    for p, (pair, front, on, far) in enumerate(zip(pairs, fronts, active, reach, strict=True)):
        ahead, behind = (0.0, 0.0) if around is None else around[p]
        role = np.full((pair.surface.n_nodes, gdim), FREE, dtype=np.int8)
        bonded = front.bonded & pair.paired
        role[bonded, 0] = FIXED
        if not pair.interface.normal_only:
            role[bonded] = FIXED
        is_open = ~front.bonded & pair.paired
        if pair.interface.contact:
            may_touch = is_open & pair.can_touch
            role[may_touch, 0] = RETAINED
            if friction:
                role[may_touch] = RETAINED
        if on and is_open.any() and bonded.any():
            x = pair.surface.x
            tips = front.candidates()
            wake = _rings(front, tips, WAKE_ROWS * front.surface.order)
            distance, _ = cKDTree(x[tips] if len(tips) else x[is_open]).query(x)
            margin = 2.0 * front.surface.facet_size
            if behind > 0.0:
                wake |= distance <= behind + margin
            wake &= is_open
            role[wake, 0] = RETAINED
            if not pair.interface.mode_i_only:
                role[wake] = RETAINED
            near = _rings(front, tips, 2 * front.surface.order) & bonded
            if ahead > 0.0:
                near |= bonded & (distance <= ahead + margin)
                far = far + ahead + margin
            if pair.hierarchy is not None:
                # what comes free with a corner is retained with it
                near[pair.hierarchy.beside(np.flatnonzero(near))] = True
                near &= bonded
                distance = pair.hierarchy.nearest(distance)
            role[near] = _retained_of(pair, role[near])
            rest = np.flatnonzero(bonded & ~near & (distance <= far))
            rest = rest[np.lexsort((rest, distance[rest]))]
            waiting += [(float(distance[i]), p, int(i)) for i in rest]
        for which, node in keep:
            if which == p:
                role[node] = RETAINED
        roles.append(role)
        n_fixed += int((role == RETAINED).sum())
    waiting.sort()
    per_node = [1 if pair.interface.normal_only else gdim for pair in pairs]
    counts = n_fixed + np.cumsum([per_node[p] for _, p, _ in waiting], dtype=np.int64)
    most = int(np.sqrt(cap_mb * 1e6 / 8.0 / 2.0))
    if n_fixed > most:
        raise InputError(
            f"at least {n_fixed} jump components must be retained, whose dense matrices exceed "
            f"the cap of {cap_mb:.0f} MB; raise retained_mb, or coarsen the interface"
        )
    fits = counts[counts <= most]
    for _, p, i in waiting[: min(cost.reach(counts), len(fits))]:
        roles[p][i] = _retained_of(pairs[p], roles[p][i])
    return roles


def _retained_of(pair: Pair, role: npt.NDArray[np.int8]) -> npt.NDArray[np.int8]:
    """Roles of bonded nodes once they are retained."""
    out = np.full_like(role, RETAINED)
    if pair.interface.normal_only:
        out[..., 1:] = FREE
    return out


def _rings(front: Front, start: npt.NDArray[np.int64], n: int) -> Bools:
    """Nodes at most n facets away from the start nodes."""
    inside = np.zeros(front.surface.n_nodes, dtype=bool)
    inside[start] = True
    facets = front.surface.facets
    for _ in range(n):
        touched = inside[facets].any(axis=1)
        inside[facets[touched].ravel()] = True
    return inside
