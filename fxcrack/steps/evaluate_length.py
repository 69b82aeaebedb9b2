"""Crack length as a given function of time, applied to the tips of one interface.

    l_3 = l_1 + d_12 + d_23,    f = (l(t) - (l_3 - d_23))/d_23

l_1 is the straight line from the reference point to the initial tip, the rest runs along the slave
surface. In small strain all positions are reference positions: the reference point, the mean
current position of its nodes, moves by a mean displacement that is small beside every length.
In 3-D each front node is measured through the nearest node of the initial front.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack import log
from fxcrack.criteria import CrackLengthVsTime
from fxcrack.interface.front import Tips
from fxcrack.interface.path import SurfacePaths
from fxcrack.solve.condensed import CondensedModel
from fxcrack.solve.jump_system import Equilibrium

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_SAME_TIME = 1e-9
"""The curve begins, and f jumps up from 0, this fraction of the time before its first entry."""


def mean_position(model: CondensedModel, where: str) -> Array:
    """Mean reference position of the nodes of a group, shape (3,), length; collective.

    Raises:
        InputError: The mesh has no such group, or it holds no node.
    """
    continuum = model.continuum
    nodes = continuum.owned_nodes(where)
    total = np.append(continuum.positions()[nodes].sum(axis=0), len(nodes))
    total = continuum.comm.allreduce(total, op=MPI.SUM)
    return np.asarray(total[:3] / total[3])


class LengthEvaluator:
    """Growth along a curve of crack length against total time; collective.

    Args:
        model: Condensed model, with its front in the initial state.
        p: Number of the pair.
        criterion: Curve and reference nodes.

    Attributes:
        reference: Reference point, shape (3,), length.
        ends: Time of the last entry of the curve: growth is over then.

    Raises:
        InputError: The reference nodes do not exist.
    """

    degree = 1
    ahead = 0.0
    behind = 0.0

    def __init__(self, model: CondensedModel, p: int, criterion: CrackLengthVsTime) -> None:
        self.criterion = criterion
        self.front = model.fronts[p]
        self.paths = SurfacePaths(self.front)
        self.reference = mean_position(model, criterion.reference)
        self.ends = float(criterion.times[-1])
        surface = self.front.surface
        self._first = np.linalg.norm(surface.x - self.reference, axis=1)
        self._starts = criterion.can_start(self._first)
        self._length = np.zeros(surface.n_nodes)
        self._moves = np.zeros(surface.n_nodes, dtype=bool)
        self._known: tuple[int, bytes] | None = None
        initial = self.paths.initial
        stuck = initial[~self._starts[initial]]
        if len(stuck):
            i = int(stuck[np.argmin(self._first[stuck])])
            log.warn(
                "interface '%s': the first tabulated crack length %g is larger than the distance "
                "%g from reference '%s' to the first bonded node at (%s); %s of %d tips will "
                "never propagate: let the curve begin with a smaller length",
                model.pairs[p].title,
                criterion.lengths[0],
                self._first[i],
                criterion.reference,
                ", ".join(f"{c:.6g}" for c in surface.x[i, : model.continuum.gdim]),
                "all" if len(stuck) == len(initial) else str(len(stuck)),
                len(initial),
            )

    def lengths(self, tips: Tips) -> tuple[Array, Bools]:
        """Crack length l_3 of the tips, and whether they can move at all, shape (n,) each."""
        key = (self.front.version, tips.node.tobytes())
        if key != self._known:
            origin, grown = self.paths.origins(tips)
            self._length[tips.node] = self._first[origin] + grown
            self._moves[tips.node] = self._starts[origin]
            self._known = key
        return self._length[tips.node], self._moves[tips.node]

    def measure(self, tips: Tips, state: Equilibrium, time: float) -> Array:
        """F and l_3 of the tips, shape (n, 2)."""
        length, moves = self.lengths(tips)
        begin = self.criterion.times[0]
        if abs(time - begin) <= _SAME_TIME * abs(begin):
            time = begin
        f = self.criterion.value(time, length, tips.d_behind)
        return np.stack([np.where(moves, f, 0.0), length], axis=1)

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """F, and the crack length from the reference point to the tip."""
        f, length = measured.T
        return f, {"length": length}

    def needs(self, tips: Tips) -> Ints:
        """Nothing: neither forces nor openings count."""
        return np.zeros(0, dtype=np.int64)

    def breaks(self) -> tuple[float, ...]:
        """Times at which the curve bends."""
        return tuple(self.criterion.times)
