"""Compliant bonds of linear bodies: springs between slave nodes and their masters.

A bond with a stiffness lies in series with the crack: the jump of a slave node is

    u_s - sum_m W_sm u_m = R (e + delta)

with the jump delta of the crack, which is 0 while the bond holds, and the elongation e of its
spring, which is free and has the energy 1/2 e . D e. The force of the bond is D e, and e is 0 where
no force acts: a bond that has failed and a face that is open lengthen nothing. So the springs
belong to the bodies, once and for all, and whatever holds for delta with exact bonds holds here.
In contact the spring is pressed together.

D is the stiffness per area times the tributary area of the node: what the user gives, or
for faces of shells that of the arms (:mod:`fxcrack.continuum.face_compliance`), the inverse of the
compliances of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.continuum.face_compliance import face_compliance
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair


@dataclass(frozen=True)
class Springs:
    """Stiffness of the springs among the coordinates of this rank.

    Attributes:
        rows: Global coordinates, shape (n,).
        columns: Global coordinates, shape (n,).
        values: Entries, shape (n,), force/length.
    """

    rows: Ints
    columns: Ints
    values: Array


def bond_springs(continuum: Continuum, pairs: Sequence[Pair]) -> list[Array | None]:
    """Stiffness of the springs of every pair, in global axes; collective.

    Returns:
        Per pair ``None`` where its bonds are exact, or shape (n_nodes, gdim, gdim), force/length.

    Raises:
        InputError: Shells are asked for and there are none, the stiffness is one of ``Explicit``,
            or a node stands for no area.
    """
    return [
        None if p.interface.stiffness is None else _of_pair(continuum, p, p.interface.stiffness)
        for p in pairs
    ]


def _of_pair(continuum: Continuum, pair: Pair, given: str | tuple[float, float, float]) -> Array:
    """Stiffness of the springs of a pair, shape (n_nodes, gdim, gdim), force/length; collective."""
    where = f"interface '{pair.title}'"
    if pair.hierarchy is not None:
        raise InputError(
            f"{where}: bonds of second-order tetrahedra have no stiffness of their own, as no node "
            "of theirs stands for its area; leave stiffness out, or use hexahedra"
        )
    area = pair.surface.areas[:, None, None]
    if given == "arms":
        return area * np.linalg.inv(_of_arms(continuum, pair))
    if isinstance(given, str):
        raise InputError(
            f"{where}: stiffness='{given}' is for Explicit; give three numbers per area, or leave "
            "stiffness out: bonds are exact then"
        )
    frames = pair.frames
    local = np.asarray(given)[: continuum.gdim]
    return np.asarray(area * np.einsum("nci,i,ndi->ncd", frames, local, frames))


def _of_arms(continuum: Continuum, pair: Pair) -> Array:
    """Compliance of both arms under each slave node, shape (n_nodes, 3, 3), length^3/force."""
    slave, master = pair.sides
    if (
        not isinstance(continuum, ShellBodies)
        or not isinstance(slave, Face)
        or not isinstance(master, Face)
    ):
        raise InputError(
            f"interface '{pair.title}': stiffness='arms' is that of shells on surface meshes, "
            "Face(group, side); solids and continuum shells have nodes on their faces: leave "
            "stiffness out"
        )
    nodes = InterfaceNodes.of_pairs(continuum.layout, [pair])
    above, below = (
        nodes.share(face_compliance(continuum, face)[nodes.local]) for face in (slave, master)
    )
    masters, weights = pair.feet or pair.under
    paired = np.where(pair.paired, 1.0, 0.0)
    under = np.einsum("nk,nkij->nij", weights * paired[:, None], below[nodes.find(masters)])
    out = above[nodes.find(pair.surface.dofs)] + under
    unused = ~pair.paired  # no spring there; anything that has an inverse
    out[unused] = np.eye(3)
    return np.asarray(out)


def assembled_springs(stiffness: Array, frames: Array, columns: npt.NDArray[np.integer]) -> Springs:
    """Entries of the springs of some nodes.

    Args:
        stiffness: In global axes, shape (n, gdim, gdim), force/length.
        frames: Frames of the nodes, shape (n, gdim, gdim).
        columns: Coordinate of the elongation in each direction of the frame, -1 where there is
            none, shape (n, gdim).
    """
    local = np.einsum("nci,ncd,ndj->nij", frames, stiffness, frames)
    has = (columns[:, :, None] >= 0) & (columns[:, None, :] >= 0)
    rows, others = (
        np.broadcast_to(c, has.shape)[has] for c in (columns[:, :, None], columns[:, None, :])
    )
    return Springs(rows.astype(np.int64), others.astype(np.int64), local[has])


__all__ = ["Springs", "assembled_springs", "bond_springs"]
