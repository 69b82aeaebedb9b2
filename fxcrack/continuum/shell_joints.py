"""Kinks and T joints of shells: nodes of smooth parts that meet at one point.

With D and w the directors and their changes at nodes m and s of a joint,

    u_s = u_m,    w_s . D_m = -w_m . D_s

The displacement is common, and the angle between the parts stays: the first is exact, the second
exact for any rotation about the line and, of the others, to first order. The component of w along
the line stays free in both, as at a free edge of a plate with shear deformation.
"""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError
from fxcrack.mesh import Mesh

_FOLDED = 0.25
"""Sine of the angle between directors below which a joint cannot hold the angle of its parts."""


@dataclass(frozen=True)
class ShellJoints:
    """Nodes that meet, the same on every rank.

    Attributes:
        nodes: Global nodes, shape (n,).
        joint: Number of the joint of each, ascending, shape (n,).
        directors: Their directors, shape (n, 3).
    """

    nodes: Ints
    joint: Ints
    directors: Array

    def groups(self) -> list[Ints]:
        """Rows of the nodes of each joint."""
        if not len(self.joint):
            return []
        return np.split(np.arange(len(self.joint)), 1 + np.flatnonzero(np.diff(self.joint)))


NO_JOINTS = ShellJoints(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
"""Of bodies whose nodes nothing but interfaces connects."""


def find_joints(mesh: Mesh, space: fem.FunctionSpace, order: int, directors: Array) -> ShellJoints:
    """Joints of the nodes of a space; collective.

    Args:
        mesh: Surface mesh with its joints.
        space: Unknowns of the shells.
        order: Their order.
        directors: Directors of the local nodes, shape (n_local_nodes, 3).

    Raises:
        InputError: The order is not that of the mesh, or parts are folded back on each other.
    """
    comm = mesh.comm
    if not len(mesh.joints):
        return NO_JOINTS
    if order != mesh.order:
        raise InputError(
            f"mesh '{mesh.name}': a surface with kinks or T joints needs a mesh of the order of "
            f"the unknowns, {order}; mesh it with that order, or leave order out"
        )
    given = np.asarray(mesh.domain.geometry.input_global_indices)
    geometry, nodes = compat.geometry_dofmap(mesh.domain), np.asarray(space.dofmap.list)
    of_point = np.full(len(given), -1, dtype=np.int64)
    of_point[geometry.ravel()] = nodes.ravel()
    index_map = space.dofmap.index_map
    rows = np.argsort(given, kind="stable")
    place = np.searchsorted(given[rows], mesh.joints[:, 0])
    place = np.minimum(place, len(given) - 1)
    local = of_point[rows[place]]
    mine = np.flatnonzero(
        (given[rows[place]] == mesh.joints[:, 0]) & (local >= 0) & (local < index_map.size_local)
    )
    numbers = np.zeros(len(mesh.joints), dtype=np.int64)
    numbers[mine] = index_map.local_range[0] + local[mine]
    found = np.zeros((len(mesh.joints), 6))
    found[mine, :3] = directors[local[mine]]
    found[mine, 3:] = space.tabulate_dof_coordinates()[local[mine]]
    comm.Allreduce(MPI.IN_PLACE, numbers, op=MPI.SUM)
    comm.Allreduce(MPI.IN_PLACE, found, op=MPI.SUM)
    joints = ShellJoints(numbers, mesh.joints[:, 1], found[:, :3].copy())
    _check_angles(joints, found[:, 3:], mesh.name)
    return joints


def _check_angles(joints: ShellJoints, x: Array, title: str) -> None:
    """Refuse parts that are folded back; the same on every rank."""
    for rows in joints.groups():
        sine = np.linalg.norm(
            np.cross(joints.directors[rows[1:]], joints.directors[rows[0]]), axis=1
        )
        if sine.min() < _FOLDED:
            raise InputError(
                f"mesh '{title}': parts of the shell that meet at {format_point(x[rows[0]])} lie "
                "on each other or go on in the same direction there; give them nodes of their own "
                "and an interface, or smaller cells if the surface is smooth"
            )


def joint_constraints(
    joints: ShellJoints, held: Bools, masters: Ints
) -> list[tuple[int, int, int, int, float]]:
    """Unknowns of nodes that follow those of other nodes of their joint.

    Args:
        joints: The joints.
        held: Unknowns that supports prescribe, shape (n, 6).
        masters: Row of the node that each node follows, its own row for one that follows none,
            shape (n,).

    Returns:
        One entry for each term: row and unknown that follow, row and unknown that are followed, and
        the factor.
    """
    out = []
    for s, m in enumerate(masters.tolist()):
        if s == m:
            continue
        out += [(s, c, m, c, 1.0) for c in range(3) if not held[s, c]]
        on_master, on_slave = joints.directors[m], joints.directors[s]
        free = np.where(held[s, 3:], 0.0, np.abs(on_master))
        c = int(np.argmax(free))
        if free[c] < 0.3:
            continue  # supports hold what the angle depends on
        out += [(s, 3 + c, s, 3 + k, -on_master[k] / on_master[c]) for k in range(3) if k != c]
        out += [(s, 3 + c, m, 3 + k, -on_slave[k] / on_master[c]) for k in range(3)]
    return [entry for entry in out if entry[4] != 0.0]


__all__ = ["NO_JOINTS", "ShellJoints", "find_joints", "joint_constraints"]
