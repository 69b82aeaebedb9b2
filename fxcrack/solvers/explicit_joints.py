"""Kinks and T joints of shells in explicit dynamics: forces that keep parts together.

With the conditions C v = 0 of :mod:`fxcrack.continuum.shell_joints` on the unknowns at the nodes of
a joint, their masses M and the accelerations a they would have without the joint,

    f = -C^T (C M^-1 C^T)^-1 C a

are the forces with which C v stays zero; they do no work, and masses stay diagonal. Unknowns that
supports prescribe count as infinite mass, and conditions of which they leave nothing free are
dropped. The stable increment can only become longer. Joints have few nodes, so that every rank
knows all of them.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InputError
from fxcrack.base.sparse import Product
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.shell_joints import ShellJoints
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.supports import Supports
from fxcrack.solvers.explicit_points import FacePoints

_FREE = 1e-2
"""What supports leave of a condition, over all of it, below which they hold what it says."""


class JointForces:
    """Forces between the parts of shells at kinks and T joints; none in solids.

    Args:
        continuum: The bodies.
        supports: Prescribed unknowns.
        points: Unknowns of nodes that are not displacement and change of the director.
        at_interface: Nodes of interfaces, shape (n,).

    Raises:
        InputError: A node belongs to a joint and to an interface.

    Attributes:
        exist: Whether there are joints.
        free: Owned dofs at joints that are not prescribed, shape (n_free,).
        forces: Forces of joints on the owned dofs in the present increment, shape (n_local,).
    """

    def __init__(
        self, continuum: Continuum, supports: Supports, points: FacePoints, at_interface: Ints
    ) -> None:
        layout = continuum.layout
        joints: ShellJoints = layout.joints
        self.exist = bool(len(joints.nodes))
        self.free: Ints = np.zeros(0, dtype=np.int64)
        self.forces = np.zeros(continuum.n_local if self.exist else 0)
        if not self.exist:
            return
        both = np.intersect1d(joints.nodes, at_interface)
        if len(both):
            raise InputError(
                f"Explicit: {len(both)} nodes at kinks or T joints of the shells belong to an "
                "interface as well, whose masses the joint would couple; end the interface before "
                "the joint, use a Dynamic step, or ContinuumShell on hexahedra of first order"
            )
        self._nodes = nodes = InterfaceNodes(layout, joints.nodes)
        self._dofs = layout.dofs(nodes.local)
        held = supports.which[self._dofs] >= 0
        self._held = nodes.share(held).ravel()
        self.free, self._fixed = self._dofs[~held], self._dofs[held]
        maps = nodes.share(points.maps(nodes.local))
        rows = _conditions(joints, nodes.find(joints.nodes), len(nodes))
        to_space = sp.block_diag([sp.coo_matrix(m) for m in maps], format="csr")
        self._conditions = sp.csr_matrix(rows @ to_space)
        self._groups = joints.groups()
        self._at = np.zeros((len(nodes), 6))

    def prepare(self, inverse_mass: Array) -> None:
        """Take the masses of a step; collective.

        Args:
            inverse_mass: One over the mass of the owned dofs, shape (n_local,).
        """
        if not self.exist:
            return
        self._inverse = inverse_mass
        whole = self._nodes.gather(inverse_mass).ravel()
        projector = _projector(self._conditions, whole, self._held, self._groups)
        width = self._at.shape[1]
        mine = slice(width * self._nodes.mine.start, width * self._nodes.mine.stop)
        self._project = Product(sp.csr_matrix(projector[mine]))

    def find(self, at_free: Array, velocity: Array, fixed: Ints, given: Array, h: float) -> None:
        """Find :attr:`forces`; collective.

        Args:
            at_free: All other forces at :attr:`free`, shape (n_free,), force.
            velocity: In the middle of the last increment, owned dofs, shape (n_local,).
            fixed: Owned dofs that are prescribed, ascending, shape (n,).
            given: Their velocities, shape (n,), length/time.
            h: Time from the last velocity to the next.
        """
        if not self.exist:
            return
        a = self.forces  # work space: other dofs stay zero
        a[self.free] = at_free * self._inverse[self.free]
        at = self._fixed
        a[at] = (given[np.searchsorted(fixed, at)] - velocity[at]) / h
        every = self._nodes.gather(a)
        a[self._dofs.ravel()] = -self._project(every.ravel())

    def move(self, velocity: Array, before: Array, at_free: Array, h: float) -> None:
        """Set the velocity of :attr:`free` at the end of an increment, in place.

        Args:
            velocity: Owned dofs, shape (n_local,), length/time.
            before: That of :attr:`free` in the middle of the last increment, shape (n_free,).
            at_free: All other forces there, shape (n_free,), force.
            h: Time from the last velocity to the next.
        """
        if self.exist:
            free = self.free
            velocity[free] = before + h * self._inverse[free] * (at_free + self.forces[free])


def _conditions(joints: ShellJoints, at: Ints, n_nodes: int) -> sp.csr_matrix:
    """The matrix C on displacements and changes of directors, four rows for each node but one.

    Args:
        joints: The joints.
        at: Places of their nodes, shape (n,).
        n_nodes: Number of places.
    """
    rows: list[int] = []
    columns: list[int] = []
    values: list[float] = []
    n = 0
    for group in joints.groups():
        m = int(group[0])
        for s in group[1:].tolist():
            for c in range(3):
                rows += [n + c, n + c]
                columns += [6 * int(at[s]) + c, 6 * int(at[m]) + c]
                values += [1.0, -1.0]
            for node, director in ((s, joints.directors[m]), (m, joints.directors[s])):
                rows += [n + 3] * 3
                columns += [6 * int(at[node]) + 3 + c for c in range(3)]
                values += director.tolist()
            n += 4
    return sp.csr_matrix((values, (rows, columns)), shape=(n, 6 * n_nodes))


def _projector(
    conditions: sp.csr_matrix, inverse: Array, held: Bools, groups: list[Ints]
) -> sp.csr_matrix:
    """C^T (C M^-1 C^T)^+ C with the conditions that supports leave, joint by joint.

    Args:
        conditions: C.
        inverse: One over the masses, shape (n_columns,).
        held: Prescribed unknowns, same shape.
        groups: Rows of the nodes of each joint.
    """
    blocks, first = [], 0
    for group in groups:
        rows = conditions[first : first + 4 * (len(group) - 1)]
        first += rows.shape[0]
        columns = np.unique(rows.indices)
        c = rows[:, columns].toarray()
        whole = np.einsum("ij,j,ij->i", c, inverse[columns], c)
        c = c / np.sqrt(whole)[:, None]
        left = (c * np.where(held[columns], 0.0, inverse[columns])) @ c.T
        size, vectors = np.linalg.eigh(left)
        keep = size > _FREE
        c = (vectors[:, keep] / np.sqrt(size[keep])).T @ c
        blocks.append((columns, c.T @ c))
    n = conditions.shape[1]
    at = [np.meshgrid(columns, columns, indexing="ij") for columns, _ in blocks]
    entries = np.concatenate([b.ravel() for _, b in blocks])
    i, j = (np.concatenate([grid[k].ravel() for grid in at]) for k in (0, 1))
    return sp.csr_matrix((entries, (i, j)), shape=(n, n))


__all__ = ["JointForces"]
