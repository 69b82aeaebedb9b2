"""Whether supports and bonds hold every body against moving as a rigid whole.

Pivots of a factorisation do not tell: those of a body held by nothing are round-off, and so are
those of one that is held but thin, soft or next to incompressible beside another. The rigid motions
do: with c_b the coefficients of those of body b, supports and bonds demand

    r_b(x) c_b = 0  at supported dofs,    n (r_s c_s - sum_m W_m r_m c_m) = 0  at held jumps

and the bodies are held if no c but zero fulfils that. Each motion is scaled by the size of its
body, so the singular values of these equations are pure numbers: what a support sees of a motion
that moves its body by its own size. Numbers of bodies, nodes and jumps alone enter, no stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import SolverError
from fxcrack.condensation.mumps_schur import HELD_BY_ROUND_OFF, mumps_message
from fxcrack.condensation.rigid_motions import held_dofs, motions_of, ways
from fxcrack.continuum.bodies import Bodies
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports

_UNSEEN = 1e-8
"""A motion of which supports and bonds see no more than this part is free. Its energy would be the
square of that, below round-off beside the stiffness of the supports."""
_ROWS = 2048
"""Equations reduced at a time."""
MOST = 3
"""Bodies a message names at most."""
_PIVOT_ERROR = 1e-14
"""Round-off of a pivot over the largest one, at most: in double cantilever beams 1e9 times apart
loads were 5e-3 off where this says 7e-3, in arms 2e4 times as long as thick far less than it says.
"""
_NOTHING_LEFT = 1e-15
"""Pivots below this part of the largest are round-off."""


class FreeBodies:
    """The equations that supports and bonds put to the rigid motions, made on first use.

    All methods but :meth:`warn` are collective.

    Args:
        continuum: The bodies.
        supports: Prescribed components.
        pairs: Interfaces.
        bonded: Jump components that are zero, per pair, shape (n_nodes, gdim).
        index: Numbers of further ones that may be held, -1 elsewhere, per pair, likewise.
        frames: Frames of the slave nodes per pair, shape (n_nodes, gdim, gdim).

    Attributes:
        warned: Whether it was said that few digits are left.
    """

    def __init__(
        self,
        continuum: Continuum,
        supports: Supports,
        pairs: Sequence[Pair],
        bonded: Sequence[Bools],
        index: Sequence[Ints],
        frames: Sequence[Array],
    ) -> None:
        self._continuum = continuum
        self._given_supports = supports
        self._given_jumps = list(pairs), list(bonded), list(index), list(frames)
        self._known: dict[bytes, str] = {}
        self.warned = False

    def _prepare(self) -> None:
        """Make the equations."""
        continuum = self._continuum
        self._bodies = bodies = Bodies(continuum)
        motions = motions_of(continuum, bodies.of_node, bodies.centre, bodies.size)
        self._m = motions.shape[1]
        self._n = self._m * bodies.count
        far = float((bodies.far / bodies.size).max(initial=0.0))
        self._unseen = max(_UNSEEN, 64.0 * np.finfo(float).eps * far)
        self._supported = self._at_supports(motions, self._given_supports)
        rows, numbers = self._at_jumps(motions, *self._given_jumps)
        if self._given_supports.following is not None:
            more = self._at_constraints(motions, self._given_supports)
            rows = sp.csr_matrix(sp.vstack([rows, more], format="csr"))
            numbers = np.concatenate([numbers, np.full(more.shape[0], -1)])
        self._fixed = rows[np.flatnonzero(numbers < 0)]
        order = np.flatnonzero(numbers >= 0)
        self._retained, self._numbers = rows[order], numbers[order]

    def _at_supports(self, motions: Array, supports: Supports) -> Array:
        """Reduced equations of supports, shape (count, n_motions, n_motions)."""
        layout, m = self._continuum.layout, self._m
        dofs = held_dofs(self._continuum, supports)
        body = self._bodies.of_node[dofs // layout.n_unknowns]
        mine = np.zeros((self._bodies.count, m, m))
        for b in np.unique(body):
            mine[b] = _reduced(motions[dofs[body == b]], m)
        every = np.concatenate(self._continuum.comm.allgather(mine), axis=1)
        return np.stack([_reduced(rows, m) for rows in every]).reshape(-1, m, m)

    def _at_jumps(
        self,
        motions: Array,
        pairs: Sequence[Pair],
        bonded: Sequence[Bools],
        index: Sequence[Ints],
        frames: Sequence[Array],
    ) -> tuple[sp.csr_matrix, Ints]:
        """Equations of jumps that are zero, and their numbers, -1 for those that always are."""
        layout, m = self._continuum.layout, self._m
        nodes = InterfaceNodes.of_pairs(layout, pairs)
        moved = np.stack([nodes.gather(v) for v in motions.T], axis=-1)
        body = nodes.share(self._bodies.of_node[nodes.local])
        parts, numbers = [sp.csr_matrix((0, self._n))], [np.zeros(0, dtype=np.int64)]
        for pair, fixed, number, frame in zip(pairs, bonded, index, frames, strict=True):
            rows, axis = np.nonzero((fixed | (number >= 0)) & pair.paired[:, None])
            if not len(rows):
                continue
            direction = frame[rows, :, axis]
            slave, master = nodes.find(pair.surface.dofs[rows]), nodes.find(pair.masters[rows])
            on_slave = _points(moved[slave], pair.surface.point_maps, rows, layout.gdim)
            on_master = _points(moved[master], pair.master_maps, rows, layout.gdim)
            weights = pair.weights[rows]
            here = np.arange(len(rows))
            own = np.einsum("nc,ncm->nm", direction, on_slave)
            theirs = -np.einsum("nk,nc,nkcm->nkm", weights, direction, on_master)
            values = np.concatenate([own[:, None], theirs], axis=1)
            of = np.concatenate([body[slave][:, None], body[master]], axis=1)
            columns = m * of[..., None] + np.arange(m)
            r = np.broadcast_to(here[:, None, None], columns.shape)
            parts.append(
                sp.csr_matrix(
                    (values.ravel(), (r.ravel(), columns.ravel())), shape=(len(rows), self._n)
                )
            )
            numbers.append(np.where(number[rows, axis] >= 0, number[rows, axis], -1))
        return sp.csr_matrix(sp.vstack(parts, format="csr")), np.concatenate(numbers)

    def _at_constraints(self, motions: Array, supports: Supports) -> sp.csr_matrix:
        """Equations of dofs that follow others: what they do beside those in rigid motions."""
        following = supports.following
        assert following is not None
        layout, m = self._continuum.layout, self._m
        body = np.repeat(self._bodies.of_node[: layout.n_owned], layout.n_unknowns)
        n_here = layout.n_local
        columns = (m * body[:, None] + np.arange(m)).ravel()
        spread = sp.csr_matrix(
            (motions.ravel(), (np.repeat(np.arange(n_here), m), columns)), shape=(n_here, self._n)
        )
        rows, local = following.mine(layout)
        low, high = np.searchsorted(following.masters, [layout.offset, layout.offset + n_here])
        mine = spread[following.masters[low:high] - layout.offset]
        masters = sp.vstack(layout.comm.allgather(mine), format="csr")
        found = spread[local] - following.matrix[rows] @ masters
        return sp.csr_matrix(sp.vstack(layout.comm.allgather(sp.csr_matrix(found)), format="csr"))

    def find(self, free: Ints | None = None) -> str:
        """What can move, in words; empty if supports and bonds hold every body; collective.

        Args:
            free: Numbers of jumps that hold nothing, shape (k,); none by default.
        """
        gone = np.zeros(0, dtype=np.int64) if free is None else np.unique(free)
        key = gone.tobytes()
        if key not in self._known:
            if not self._known:
                self._prepare()
            self._known[key] = self._find(gone)
        return self._known[key]

    def _find(self, gone: Ints) -> str:
        held = sp.vstack([self._fixed, self._retained[~np.isin(self._numbers, gone)]], format="csr")
        count, m = self._bodies.count, self._m
        whole = held.tocoo()
        together = sp.coo_matrix(
            (np.ones(whole.nnz), (whole.row, whole.col // m)), shape=(held.shape[0], count)
        ).tocsr()
        _, cluster = connected_components(together.T @ together, directed=False)
        loose: list[tuple[int, Array]] = []
        for k in range(cluster.max(initial=-1) + 1):
            members = np.flatnonzero(cluster == k)
            loose += self._motions_left(members, held, together)
        if not loose:
            return ""
        names = self._bodies.names()
        words = [f"{names[b]} {ways(v)}" for b, v in loose[:MOST]]
        more = f"; and {len(loose) - MOST} more" if len(loose) > MOST else ""
        return f"supports and bonds leave {'; '.join(words)}{more}{self._without_bonds()}"

    def _without_bonds(self) -> str:
        """Interfaces whose bonded set holds no node, in words; empty if there is none."""
        none = [p for p in self._given_jumps[0] if not p.bonded.any()]
        if not none:
            return ""
        names = ", ".join(f"'{p.title}'" for p in none)
        return f"; the bonded set of interface {names} holds none of its slave nodes"

    def _motions_left(
        self, members: Ints, held: sp.csr_matrix, together: sp.csr_matrix
    ) -> list[tuple[int, Array]]:
        """Bodies of a cluster that can move, with a basis of their motions."""
        m = self._m
        columns = (m * members[:, None] + np.arange(m)).ravel()
        n = len(columns)
        square = np.zeros((n, n))
        for i, b in enumerate(members):
            rows = np.zeros((m, n))
            rows[:, m * i : m * (i + 1)] = self._supported[b]
            square = _reduced(np.vstack([square, rows]), n)
        mine = np.flatnonzero(np.asarray(together[:, members].sum(axis=1)).ravel() > 0)
        for begin in range(0, len(mine), _ROWS):
            rows = held[mine[begin : begin + _ROWS]][:, columns].toarray()
            square = _reduced(np.vstack([square, rows]), n)
        _, seen, vectors = np.linalg.svd(square)
        left = vectors[seen <= self._unseen]
        out = []
        for i, b in enumerate(members):
            u, size, _ = np.linalg.svd(left[:, m * i : m * (i + 1)].T, full_matrices=False)
            basis = u[:, size > 1e-6]
            if basis.shape[1]:
                out.append((int(b), basis))
        return out

    def check(self) -> None:
        """Refuse bodies that can move freely.

        Raises:
            SolverError: One can; the message names it and its motion.
        """
        why = self.find()
        if why:
            raise SolverError(f"{mumps_message(-10, 0)} ({why})")

    def judge(self, ratio: float) -> None:
        """Say whether a factor may be used whose pivots leave doubt; collective.

        Args:
            ratio: Its smallest pivot over the largest, 0 where it has the wrong sign.

        Raises:
            SolverError: A body can move freely, or round-off is all that is left of the stiffness.
        """
        self.check()
        if ratio <= _NOTHING_LEFT:
            raise SolverError(f"the stiffness matrix cannot be factored: {HELD_BY_ROUND_OFF}")
        self.warn(_PIVOT_ERROR / ratio)

    def warn(self, digits: float) -> None:
        """Warn once that few digits are left.

        Args:
            digits: Relative error that round-off may make.
        """
        if not self.warned:
            self.warned = True
            log.warn(
                "all bodies are held, but stiffnesses are so far apart (soft beside stiff, thin, "
                "nearly incompressible) that round-off may change results by as much as %.0e "
                "of their size; bring moduli or thicknesses nearer together if that is too much",
                min(digits, 1.0),
            )


def _points(values: Array, maps: Array | None, rows: Ints, gdim: int) -> Array:
    """Displacements of surface points per motion, shape (n, ..., gdim, n_motions)."""
    if maps is None:
        return values[..., :gdim, :]
    return np.asarray(np.einsum("...cj,...jm->...cm", maps[rows], values))


def _reduced(rows: Array, n: int) -> Array:
    """A triangle, shape (n, n), with the same singular values and vectors as rows, (k, n)."""
    out = np.zeros((n, n))
    triangle = np.linalg.qr(rows, mode="r")
    out[: len(triangle)] = triangle
    return out


__all__ = ["FreeBodies"]
