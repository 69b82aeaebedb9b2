"""Unknowns of the nodes of a body: how many, their numbers, and what they say of its surface.

Every node has the same number of unknowns. The first ``gdim`` of them are its displacement; further
ones, such as the change of a shell's director, follow. Unknown c of node i is

    dof = n_unknowns i + c

in the numbering of nodes on a rank, over all ranks, or of any list of nodes alike. Each rank owns a
range of consecutive global nodes.

The displacement of the point of a surface that belongs to a node is linear in its unknowns:

    u_point = P q_node,    P = [1  Z],    shape (gdim, n_unknowns)

with Z of shape (gdim, n_unknowns - gdim). Z has no columns in a solid, where the point is the node.
A point of a shell at the signed distance z from its reference surface, with the director's change w
as further unknowns, has Z = z 1: u_point = u + z w.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.face import Face
from fxcrack.continuum.shell_joints import NO_JOINTS


class DofLayout:
    """Dof layout of nodes whose own unknowns are their displacement components alone: solids.

    Further unknowns of solids have one value for all nodes (``shared``). Other bodies derive from
    it and say what their further unknowns do: :meth:`point_maps` and :meth:`rigid_motion`.

    Args:
        comm: Communicator that objects may be sent on.
        gdim: Components of a displacement, 2 or 3.
        n_owned: Nodes that this rank owns.
        n_unknowns: Unknowns of a node, ``gdim`` by default.
        shared: Which of them have one value for all nodes.

    Attributes:
        first_nodes: First global node of each rank, then the number of all nodes, shape
            (comm.size + 1,).
        first_node: First global node of this rank.
        n_local: Dofs that this rank owns.
        n_global: Dofs of all ranks.
        offset: First global dof of this rank.
        shared: Unknowns that have one value for all nodes, the numbers of a whole section.
        joints: Nodes that are kept together without an interface: kinks and T joints of shells.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        gdim: int,
        n_owned: int,
        n_unknowns: int | None = None,
        *,
        shared: Sequence[int] = (),
    ) -> None:
        self.comm = comm
        self.gdim = gdim
        self.n_unknowns = gdim if n_unknowns is None else n_unknowns
        self.shared = tuple(shared)
        self.n_owned = n_owned
        counts = np.zeros(comm.size, dtype=np.int64)
        comm.Allgather(np.array([n_owned], dtype=np.int64), counts)
        self.first_nodes: npt.NDArray[np.integer] = np.concatenate([[0], np.cumsum(counts)])
        self.first_node = int(self.first_nodes[comm.rank])
        self.n_local = self.n_unknowns * n_owned
        self.n_global = self.n_unknowns * int(self.first_nodes[-1])
        self.offset = self.n_unknowns * self.first_node
        self.joints = NO_JOINTS

    @property
    def n_distinct(self) -> int:
        """Number of unknowns of the bodies: those of all nodes, shared ones once."""
        n_nodes, own = int(self.first_nodes[-1]), self.n_unknowns - len(self.shared)
        return own * n_nodes + len(self.shared)

    def dofs(self, nodes: npt.NDArray[np.integer]) -> Ints:
        """All dofs of nodes.

        Args:
            nodes: Nodes in any numbering, shape (...,).

        Returns:
            Dofs in the same numbering, shape (..., n_unknowns).
        """
        return self.dof(np.asarray(nodes)[..., None], np.arange(self.n_unknowns))

    def dof(self, nodes: npt.NDArray[np.integer], unknown: int | npt.NDArray[np.integer]) -> Ints:
        """Dof of one unknown of each node.

        Args:
            nodes: Nodes in any numbering, shape (...,).
            unknown: Which unknown, from 0; of a shape that broadcasts with that of the nodes.

        Returns:
            Dofs in the same numbering, of the common shape.
        """
        return np.asarray(self.n_unknowns * np.asarray(nodes, dtype=np.int64) + unknown)

    def by_node(self, values: Array) -> Array:
        """Values of dofs, shape (n_unknowns n,), seen by node, shape (n, n_unknowns); a view."""
        return values.reshape(-1, self.n_unknowns)

    def displacements(self, values: Array) -> Array:
        """Displacements of nodes, shape (n, gdim), length, in values of their dofs; a view."""
        return self.by_node(values)[:, : self.gdim]

    def is_owned(self, nodes: npt.NDArray[np.integer]) -> Bools:
        """Whether this rank owns global nodes, shape of the nodes."""
        return np.asarray((nodes >= self.first_node) & (nodes < self.first_node + self.n_owned))

    def to_local(self, nodes: npt.NDArray[np.integer]) -> Ints:
        """Numbers on this rank of global nodes that it owns, shape of the nodes."""
        return np.asarray(nodes - self.first_node)

    @property
    def shared_owner(self) -> int:
        """Rank whose first node holds the unknowns that all nodes share: the first with a node."""
        return int(np.argmax(np.diff(self.first_nodes) > 0))

    def shared_dof(self, unknown: int) -> int | None:
        """Owned dof that stands for a shared unknown; ``None`` on ranks that do not hold it."""
        return unknown if self.comm.rank == self.shared_owner else None

    def point_maps(self, name: str | Face, nodes: npt.NDArray[np.integer]) -> Array | None:
        """P at nodes of a named surface: displacement of its points per unknown of their nodes.

        Args:
            name: Facet group, or face of a shell.
            nodes: Nodes of this rank (owned and ghosts), shape (...,).

        Returns:
            Shape (..., gdim, n_unknowns), columns of the displacement first and the identity;
            ``None`` where points are nodes and their unknowns the displacement.
        """
        return None

    def rigid_motion(self, displacement: Array, rotation: Array) -> Array:
        """Unknowns of the owned nodes in a small rigid motion.

        Args:
            displacement: That of the nodes, shape (n_owned, gdim).
            rotation: Vector of the rotation, the same everywhere or one per node, shape (3,) or
                (n_owned, 3), in the units of displacement per length.

        Returns:
            Shape (n_local,).
        """
        out = np.zeros((len(displacement), self.n_unknowns))
        out[:, : self.gdim] = displacement
        return out.ravel()


__all__ = ["DofLayout"]
