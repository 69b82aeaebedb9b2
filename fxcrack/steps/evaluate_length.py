"""Crack length as a given function of time, applied to the tips of one interface.

    l_3 = l_1 + d_12 + d_23,    f = (l(t) - (l_3 - d_23))/d_23

l_1 is the straight line from the reference point to the initial tip, the rest runs along the slave
surface. In 3-D the initial tip is the point of the initial front that the front node came from.

In small strain positions are those of the undeformed body. With ``moving`` the reference point
and the initial tips take their displacements along: border rows of the condensation give them,
linear between equilibria. Lengths along the surface would differ by its strain only.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack import log
from fxcrack.criteria import CrackLengthVsTime
from fxcrack.interface.path import Origins, SurfacePaths
from fxcrack.interface.tip import Tips
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
        reference: Reference point of the undeformed body, shape (3,), length.
        ends: Time of the last entry of the curve: growth is over then.

    Raises:
        InputError: The reference nodes do not exist.
    """

    degree = 1
    ahead = 0.0
    behind = 0.0

    def __init__(self, model: CondensedModel, p: int, criterion: CrackLengthVsTime) -> None:
        self.model = model
        self.criterion = criterion
        self.front = model.fronts[p]
        self.paths = SurfacePaths(self.front)
        self.reference = mean_position(model, criterion.reference)
        self.ends = float(criterion.times[-1])
        self._known: tuple[int, int, bytes] | None = None
        self._origins: Origins
        surface, initial = model.pairs[p].surface, self.paths.initial  # undeformed
        self._x = surface.x
        self._begin = np.zeros((surface.n_nodes, 3))
        self._grown = np.zeros(surface.n_nodes)
        self._moves = np.zeros(surface.n_nodes, dtype=bool)
        first = np.linalg.norm(surface.x - self.reference, axis=1)
        self._starts = criterion.can_start(first)
        self._followed: list[int] = []
        self._slot = np.zeros(surface.n_nodes, dtype=np.int64)
        if criterion.moving and len(initial):
            self._followed.append(model.follow(model.continuum.owned_nodes(criterion.reference)))
            gdim, n_local = model.continuum.gdim, model.continuum.n_local
            for block in surface.dofs[initial] - model.continuum.offset // gdim:
                here = np.array([block]) if 0 <= block < n_local // gdim else np.zeros(0, dtype=int)
                self._followed.append(model.follow(here))
            self._slot[initial] = 1 + np.arange(len(initial))
        stuck = initial[~self._starts[initial]]
        if len(stuck):
            i = int(stuck[np.argmin(first[stuck])])
            log.warn(
                "interface '%s': the first tabulated crack length %g is larger than the distance "
                "%g from reference '%s' to the first bonded node at (%s); %s of %d tips will "
                "never propagate: let the curve begin with a smaller length",
                model.pairs[p].title,
                criterion.lengths[0],
                first[i],
                criterion.reference,
                ", ".join(f"{c:.6g}" for c in surface.x[i, : model.continuum.gdim]),
                "all" if len(stuck) == len(initial) else str(len(stuck)),
                len(initial),
            )

    def _look_at(self, tips: Tips) -> Origins:
        """Note where the tips come from, when the front has moved."""
        key = (self.front.version, self.front.placed, tips.node.tobytes())
        if key != self._known:
            origins = self._origins = self.paths.origins(tips)
            x = self._x[origins.nodes]
            self._begin[tips.node] = np.einsum("nk,nkc->nc", origins.weights, x)
            self._grown[tips.node] = origins.grown
            self._moves[tips.node] = self._starts[origins.nearest]
            self._known = key
        return self._origins

    def measure(self, tips: Tips, state: Equilibrium, time: float) -> Array:
        """Length of the curve, 1 once it has begun, way of the origins from the reference point.

        Shape (n, 5); the way is that of their displacements alone.
        """
        begin = self.criterion.times[0]
        if abs(time - begin) <= _SAME_TIME * abs(begin):
            time = begin
        origins = self._look_at(tips)
        out = np.zeros((len(tips), 5))
        out[:, 0] = max(self.criterion.length(time), self.criterion.lengths[0])
        out[:, 1] = time >= begin
        if self._followed:
            motion = self.model.motion(state)[self._followed]
            at_tips = motion[self._slot[origins.nodes]]
            way = np.einsum("nk,nkc->nc", origins.weights, at_tips) - motion[0]
            out[:, 2 : 2 + way.shape[1]] = way
        return out

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """F, and the crack length from the reference point to the tip."""
        way = self._begin[tips.node] - self.reference + measured[:, 2:]
        length = np.linalg.norm(way, axis=1) + self._grown[tips.node]
        f = self.criterion.fraction(measured[:, 0], length, tips.d_behind)
        begun = measured[:, 1] > 1.0 - 1e-12  # between two states it is 1 up to round-off, or not
        return np.where(begun & self._moves[tips.node], f, 0.0), {"length": length}

    def needs(self, tips: Tips) -> Ints:
        """Nothing: neither forces nor openings count."""
        return np.zeros(0, dtype=np.int64)

    def breaks(self) -> tuple[float, ...]:
        """Times at which the curve bends."""
        return tuple(self.criterion.times)
