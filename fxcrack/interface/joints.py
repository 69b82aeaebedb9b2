"""Joints of shells in the transformation T: which unknowns of their nodes follow others.

See :mod:`fxcrack.continuum.shell_joints` for the constraints. Of the nodes of a joint one keeps its
unknowns, the others follow it; a node that is a slave of an interface follows its masters, so that
it is the one the rest of its joint follows.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError
from fxcrack.continuum.shell_joints import ShellJoints, joint_constraints
from fxcrack.interface.nodes import InterfaceNodes


def joint_terms(
    joints: ShellJoints, nodes: InterfaceNodes, which: Ints, slaves: dict[int, tuple[str, Array]]
) -> tuple[Bools, Ints, Ints, Array]:
    """Terms of T of the nodes of joints; the same on every rank.

    Args:
        joints: The joints.
        nodes: The interface nodes, those of joints among them.
        which: Support column of each of their unknowns, -1 if free, shape (n_nodes, n_unknowns).
        slaves: Title of the interface and position of its nodes that are slaves, by global node.

    Returns:
        Which unknowns follow others, shape (n_nodes, n_unknowns), and rows, columns and entries of
        what they follow, each of shape (n_terms,), rows and columns in the order of the unknowns
        of the interface nodes.

    Raises:
        InterfaceError: Several nodes of a joint are slaves of interfaces.
    """
    masters = np.arange(len(joints.nodes))
    for rows in joints.groups():
        taken = [int(r) for r in rows if int(joints.nodes[r]) in slaves]
        if len(taken) > 1:
            (one, x), (other, _) = (slaves[int(joints.nodes[r])] for r in taken[:2])
            raise InterfaceError(
                f"the shells that meet at {format_point(x)} are slaves of interface "
                f"'{one}' and of '{other}' there; a joint of shells can follow one master surface "
                "only: exchange slave and master of one of them, or end it before the joint"
            )
        masters[rows] = taken[0] if taken else rows[0]
    at = nodes.find(joints.nodes)
    terms = joint_constraints(joints, which[at] >= 0, masters)
    follows = np.zeros(which.shape, dtype=bool)
    if not terms:
        none = np.zeros(0, dtype=np.int64)
        return follows, none, none, np.zeros(0)
    s, c, m, k, value = (np.array(column) for column in zip(*terms, strict=True))
    follows[at[s], c] = True
    return follows, nodes.layout.dof(at[s], c), nodes.layout.dof(at[m], k), value.astype(float)


__all__ = ["joint_terms"]
