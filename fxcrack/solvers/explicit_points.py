"""Unknowns of explicit dynamics at nodes of shells that have masses of their own.

The mass m of a node of a shell lies at the height c above the reference surface and has the
inertia j about its centre: its kinetic energy is 1/2 m (u' + c w')^2 + 1/2 j w'^2. Displacement u
and change w of the director are coupled by it where c is not zero, and where interfaces act on a
point of a face at the distance z from the reference surface, d = u + z w. In place of u and w these
nodes have d and a second unknown e that forces on the point do not accelerate:

    u = (1 - z kappa) d - z e,    w = kappa d + e,    kappa = m (z - c)/(j + m (z - c)^2)

The kinetic energy is 1/2 mu d'^2 + 1/2 nu e'^2 with

    mu = m j/(j + m (z - c)^2),    nu = j + m (z - c)^2

so that 1/mu = 1/m + (z - c)^2/j, what a force on the point meets. Masses stay diagonal, and ties,
bonds, softening, contact and friction of points are those of the nodes of solids with the mass mu.

Nodes of no interface take the centre of their mass as the point, z = c, in which d and e = w are
uncoupled; in components in which a support holds u and leaves w free they take z = 0, d = u.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports

_SAME = 1e-9
"""Distances that differ by less than this part of the largest one are the same."""


class FacePoints:
    """Nodes whose unknowns are the motion of a point and what is left; none in solids.

    Args:
        continuum: Displacement space.
        pairs: Interfaces.
        mass: Lumped mass of u and w, owned dofs, shape (n_local,).
        height: Height c of the mass of the owned nodes of shells, shape (n_nodes,), length.
        supports: Prescribed components of u and w.

    Raises:
        InputError: Interfaces are on both faces of a shell at one node, or a support holds one of u
            and w of a direction at an interface and leaves the other free.

    Attributes:
        local: The nodes that this rank owns, shape (n,).
        exist: Whether any rank has some.
        supports: Prescribed components of d and e.
    """

    def __init__(
        self, continuum: Continuum, pairs: Sequence[Pair], mass: Array, height: Array,
        supports: Supports,
    ) -> None:  # fmt: skip
        self._continuum = continuum
        self._layout = layout = continuum.layout
        nodes, z = _points(pairs)
        mine = layout.is_owned(nodes)
        faces: Ints = layout.to_local(nodes[mine])
        self.local: Ints = np.union1d(faces, np.flatnonzero(height)).astype(np.int64)
        self.exist = bool(continuum.comm.allreduce(len(self.local) > 0, op=MPI.LOR))
        self._z = np.zeros((len(self.local), 3))
        self._on_face = np.isin(self.local, faces)
        self._given = supports
        if len(self.local):
            m, j = layout.by_node(mass)[self.local][:, [0, 3]].T[..., None]
            centre = height[self.local][:, None]
            which = supports.which.reshape(-1, 6)[self.local]
            pinned = (which[:, :3] >= 0) & (which[:, 3:] < 0)
            self._z[:] = np.where(pinned, 0.0, centre)
            self._z[np.searchsorted(self.local, faces)] = z[mine][:, None]
            self._off = self._z - centre
            self._m, self._j = m, j
            self._kappa = m * self._off / (j + m * self._off**2)
        self.supports = self._prescribed(supports) if self.exist else supports

    def _halves(self, values: Any) -> tuple[Any, Any, Any]:
        """A copy by node, and its two halves at the nodes."""
        by_node = self._layout.by_node(values.copy())
        return by_node, by_node[self.local, :3], by_node[self.local, 3:]

    def _put(self, by_node: Any, first: Any, second: Any) -> Any:
        by_node[self.local, :3], by_node[self.local, 3:] = first, second
        return by_node.ravel()

    def motion(self, values: Array) -> Array:
        """Motion d, e of the motion u, w of the owned dofs, shape (n_local,)."""
        if not len(self.local):
            return values
        by_node, u, w = self._halves(values)
        d = u + self._z * w
        return np.asarray(self._put(by_node, d, w - self._kappa * d))

    def nodal(self, values: Array) -> Array:
        """Motion u, w of the motion d, e of the owned dofs, shape (n_local,)."""
        if not len(self.local):
            return values
        by_node, d, e = self._halves(values)
        w = self._kappa * d + e
        return np.asarray(self._put(by_node, d - self._z * w, w))

    def forces(self, values: Array) -> Array:
        """Forces on d and e of those on u and w of the owned dofs, shape (n_local,)."""
        if not len(self.local):
            return values
        by_node, on_u, on_w = self._halves(values)
        second = on_w - self._z * on_u
        return np.asarray(self._put(by_node, on_u + self._kappa * second, second))

    def nodal_forces(self, values: Array) -> Array:
        """Forces on u and w of those on d and e of the owned dofs, shape (n_local,)."""
        if not len(self.local):
            return values
        by_node, on_d, on_e = self._halves(values)
        on_u = on_d - self._kappa * on_e
        return np.asarray(self._put(by_node, on_u, on_e + self._z * on_u))

    def masses(self, values: Array) -> Array:
        """Masses of d and e of those of u and w that this was made with, times any factor."""
        if not len(self.local):
            return values
        by_node, m, j = self._halves(values)
        whole = j + m * self._off**2
        return np.asarray(self._put(by_node, m * j / whole, whole))

    def stiffness(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Stiffness on d and e of that on u and w, which is destroyed; collective."""
        if not self.exist:
            return matrix
        layout, n = self._layout, self._layout.n_local
        one = sp.identity(n, format="lil")
        for c in range(3):
            u, w = layout.dof(self.local, c), layout.dof(self.local, 3 + c)
            if len(u):
                z, kappa = self._z[:, c], self._kappa[:, c]
                one[u, u], one[u, w] = 1.0 - z * kappa, -z
                one[w, u], one[w, w] = kappa, np.ones(len(z))
        rows = sp.csr_matrix(one)
        change = PETSc.Mat().createAIJ(
            size=((n, layout.n_global), (n, layout.n_global)), comm=self._continuum.comm,
            csr=(rows.indptr, rows.indices + layout.offset, rows.data),
        )  # fmt: skip
        out = matrix.PtAP(change)
        for old in (matrix, change):
            old.destroy()
        return out

    def maps(self, local: Ints) -> Array:
        """What takes d and e to u and w at owned nodes, shape (n, 6, 6)."""
        out = np.tile(np.eye(6), (len(local), 1, 1))
        if len(self.local):
            at = np.minimum(np.searchsorted(self.local, local), len(self.local) - 1)
            rows = np.flatnonzero(self.local[at] == local)
            z, kappa = self._z[at[rows]], self._kappa[at[rows]]
            for c in range(3):
                out[rows, c, c], out[rows, c, 3 + c] = 1.0 - z[:, c] * kappa[:, c], -z[:, c]
                out[rows, 3 + c, c] = kappa[:, c]
        return out

    def _prescribed(self, supports: Supports) -> Supports:
        """Prescribed d and e of prescribed u and w; collective."""
        which, on_u, on_w = self._halves(supports.which)
        value, at_u, at_w = self._halves(supports.value)
        moves = np.array([*(c.moves for c in supports.columns), False])
        at_u, at_w = np.where(moves[on_u], at_u, 0.0), np.where(moves[on_w], at_w, 0.0)
        both = (on_u >= 0) & (on_w >= 0)
        alone = ((on_u >= 0) != (on_w >= 0)) & self._on_face[:, None]
        mixed = both & (on_u != on_w) & (at_u != 0.0) & (at_w != 0.0)
        problem = None
        if np.any(alone | mixed):
            at = np.argwhere(alone | mixed)[0]
            column = max(on_u[tuple(at)], on_w[tuple(at)])
            x = self._continuum.positions()[self.local[at[0]]]
            kind = "of a node of an interface" if alone[tuple(at)] else "of a node"
            where = f"{'xyz'[at[1]]}, {kind} near {x.round(6)}"
            what = (
                f"holds displacement or director alone, in {where}; hold both there (Clamp, "
                "Symmetry), or let the group of the interface's cells end before the support"
                if alone[tuple(at)]
                else f"and another one move displacement and director, in {where}, by "
                "amplitudes of their own, and the mass of the shell lies off the mesh or at an "
                "interface there; let one of them rest"
            )
            problem = f"Explicit: support '{supports.columns[column].title}' {what}"
        raise_on_all_ranks(self._continuum.comm, problem)
        if not len(self.local):
            return supports
        # of two columns the one that moves the node; the other one rests
        column = np.where(at_u == 0.0, np.where(at_w == 0.0, on_u, on_w), on_u)
        column_d, column_e = np.where(on_u < 0, -1, column), np.where(on_w < 0, -1, column)
        column_e = np.where(on_u < 0, on_w, column_e)
        d = at_u + self._z * at_w
        e = at_w - self._kappa * d
        # any entry of a column whose coordinate is 0
        d, e = (np.where(moves[c], x, 1.0) for c, x in ((column_d, d), (column_e, e)))
        return replace(
            supports, which=self._put(which, column_d, column_e), value=self._put(value, d, e)
        )

    def reactions(self, on_unknowns: Array, n_columns: int) -> Array:
        """Reactions by support column, shape (n_columns,); this rank's part.

        Args:
            on_unknowns: Reactions at prescribed d, e and others, else 0, shape (n_local,), force.
            n_columns: Number of columns.
        """
        which, nodal = self._given.which, self.nodal_forces(on_unknowns)
        held = np.flatnonzero(which >= 0)
        return np.bincount(which[held], self._given.value[held] * nodal[held], n_columns)


def _points(pairs: Sequence[Pair]) -> tuple[Ints, Array]:
    """Global nodes with a point of a face, ascending, and the distance of the point; replicated."""
    nodes: list[Ints] = [np.zeros(0, dtype=np.int64)]
    z: list[Array] = [np.zeros(0)]
    for pair in pairs:
        maps, masters, has = pair.surface.point_maps, pair.master_maps, pair.paired
        if maps is None or masters is None:
            continue
        used = pair.weights[has] != 0.0
        nodes += [pair.surface.dofs[has], pair.masters[has][used]]
        z += [maps[has][:, 0, 3], masters[has][used][:, 0, 3]]
    every, heights = np.concatenate(nodes), np.concatenate(z)
    found, at = np.unique(every, return_inverse=True)
    low, high = np.full(len(found), np.inf), np.full(len(found), -np.inf)
    np.minimum.at(low, at, heights)
    np.maximum.at(high, at, heights)
    if np.any(high - low > _SAME * np.abs(heights).max(initial=0.0)):
        raise InputError(
            "Explicit: a shell has interfaces on its top and on its bottom at one node, whose "
            "points share one inertia; use a Dynamic step, or ContinuumShell on hexahedra of first "
            "order"
        )
    return found.astype(np.int64), low


__all__ = ["FacePoints"]
