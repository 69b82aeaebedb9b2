"""What supports mean for slave nodes: frames turned to them, jumps held, and what is refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import SupportColumn, Supports


def tell_of_held_bonds(pair: Pair, held: npt.NDArray[np.bool_]) -> None:
    """Say, as information, where supports on both faces keep bonds from ever opening.

    A clamped end is the usual case. Supports that only stop faces from sliding (planes of symmetry,
    axes) are not mentioned.

    Args:
        pair: Interface.
        held: Jump components that supports hold, shape (n_nodes, gdim).
    """
    fixed = np.flatnonzero(held[:, 0] & pair.bonded)
    if len(fixed):
        log.info(
            "interface '%s': supports hold both faces at %d of its bonded nodes, one of them at "
            "%s; those bonds cannot open and show no force",
            pair.title,
            len(fixed),
            format_point(pair.surface.x[fixed[0]]),
        )


def align_frames(
    pairs: Sequence[Pair],
    which: list[Ints],
    jumped: list[npt.NDArray[np.bool_]],
    supports: Supports,
    gdim: int,
) -> tuple[list[Array], list[npt.NDArray[np.bool_]]]:
    """Turn the frames of slave nodes that supports hold, and mark the jumps held with them.

    Args:
        pairs: Interfaces.
        which: Per pair, support column of each component, -1 if free, shape (n_nodes, gdim).
        jumped: Per pair, the slave nodes that have a jump, shape (n_nodes,).
        supports: For the titles in messages.
        gdim: Dimension.

    Returns:
        Per pair the frames, shape (n_nodes, gdim, gdim), and whether a component of the jump is
        held, shape (n_nodes, gdim).

    Raises:
        InterfaceError: A held direction is oblique to the interface.
    """
    frames, held = [], []
    for pair, columns, has_jump in zip(pairs, which, jumped, strict=True):
        frame = pair.frames.copy()
        hold = np.zeros((pair.surface.n_nodes, gdim), dtype=bool)
        for node in np.flatnonzero((columns >= 0).any(axis=1) & has_jump):
            axes = [np.eye(gdim)[c] for c in np.flatnonzero(columns[node] >= 0)]
            if len(axes) == gdim:
                hold[node] = True
                continue
            normal = _symmetric_normal(pair, int(node), axes)
            frame[node] = _with_normal(frame[node], normal)
            for axis in axes:
                along = abs(float(axis @ normal))
                if along > 1.0 - 1e-8:
                    hold[node, 0] = True
                elif along < 1e-8:
                    if gdim == 3 and not hold[node, 1:].any():
                        frame[node] = np.stack([normal, np.cross(axis, normal), axis], axis=1)
                        hold[node, 2] = True
                    else:
                        hold[node, 1] = True
                else:
                    title = supports.columns[columns[node].max()].title
                    raise InterfaceError(
                        f"support '{title}' holds slave node {node} of interface '{pair.title}' "
                        f"at {format_point(pair.surface.x[node])} in a direction oblique to it; "
                        "hold it along the interface or across it, or end the support before it"
                    )
        frames.append(frame)
        held.append(hold)
    return frames, held


_TURN = 1.5
"""How far the normal of a node on a plane of symmetry may be out of it, over half the angle by
which the surface turns from one facet to the next; on a circle of even facets it is 1."""


def _symmetric_normal(pair: Pair, node: int, axes: list[Array]) -> Array:
    """Normal of a slave node, shape (gdim,), in the planes of symmetry it lies on.

    The normal of a curved surface that ends on a plane of symmetry is that of its last facet, half
    a facet away from the end; the whole surface would have it in the plane. It is projected into
    the planes that supports hold the node in if it is out of them by no more than the surface
    turns there.

    Args:
        pair: Interface.
        node: Slave node.
        axes: Directions in which supports hold the node, each of shape (gdim,).
    """
    surface = pair.whole_surface
    normal = pair.frames[node, :, 0]
    around = np.unique(surface.facets[(surface.facets == node).any(axis=1)])
    turn = np.linalg.norm(surface.normals[around] - surface.normals[node], axis=1).max()
    inside = normal.copy()
    for axis in axes:
        along = float(axis @ normal)
        if 1e-8 <= abs(along) <= _TURN * turn:
            inside -= (axis @ inside) * axis
    length = float(np.linalg.norm(inside))
    return inside / length if length > 0.5 else normal


def _with_normal(frame: Array, normal: Array) -> Array:
    """A frame, shape (gdim, gdim), turned so that its first column is another normal."""
    if np.array_equal(frame[:, 0], normal):
        return frame
    if len(normal) == 2:
        return np.array([[normal[0], -normal[1]], [normal[1], normal[0]]])
    first = frame[:, 1] - (frame[:, 1] @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([normal, first, np.cross(normal, first)], axis=1)


def _moves_alike(a: SupportColumn, b: SupportColumn, at_a: float, at_b: float) -> bool:
    """Whether two prescribed dofs always have the same displacement, but for round-off.

    A function of position gives values at nodes whose coordinates differ by round-off; where it
    passes through zero they are equal only beside its largest value.
    """
    one, other = (c.scale * at if c.moves else 0.0 for c, at in ((a, at_a), (b, at_b)))
    round_off = 1e-12 * max(a.largest, b.largest, abs(one))
    if max(abs(one), abs(other)) <= round_off:
        return True
    return a.support.amplitude == b.support.amplitude and abs(one - other) <= round_off


def check_slaves(
    pairs: Sequence[Pair],
    jumped: list[npt.NDArray[np.bool_]],
    nodes: InterfaceNodes,
    which: Ints,
    value: Array,
    supports: Supports,
) -> None:
    """Refuse slave nodes for which no jump can be defined; the same result on every rank.

    A node is a slave once only, and where a support holds a displacement component of a bonded
    slave node, it holds that of the masters in the same way
    (:mod:`fxcrack.interface.jump_coordinates`). Open nodes whose support their masters do not share
    lose their jump: they cannot be bonded or touch, but nothing else is lost.

    Args:
        pairs: Interfaces.
        jumped: Per pair, the slave nodes that have a jump, shape (n_nodes,); changed in place.
        nodes: The interface nodes.
        which: Support column of each of their unknowns, -1 if free, shape
            (n_interface_nodes, n_unknowns).
        value: Entry of that column, same shape.
        supports: For the titles in messages.

    Raises:
        InterfaceError: A node is a slave twice, or a support holds a bonded slave node but not
            its masters.
    """
    seen: dict[int, str] = {}
    for pair, taking_part in zip(pairs, jumped, strict=True):
        for node in np.flatnonzero(taking_part):
            dof = int(pair.surface.dofs[node])
            if dof in seen and pair.rigid is not None:
                raise InterfaceError(
                    f"the node at {format_point(pair.surface.x[node])} is a slave of interface "
                    f"'{seen[dof]}' and of '{pair.title}', and a node can be a slave only once; on "
                    "a plane of symmetry without a crack take Displacement(group, x=0.0) in place "
                    "of an interface, and where cracks run in both let the slave surface of one "
                    "end before the common edge"
                )
            if dof in seen:
                raise InterfaceError(
                    f"the node at {format_point(pair.surface.x[node])} is a slave of interface "
                    f"'{seen[dof]}' and of '{pair.title}'; a node can be a slave only once: "
                    "where surfaces meet at an angle, exchange slave and master of one; those that "
                    "continue each other are one interface: mesh.joined('whole', ['first', "
                    "'second']) for either side, with toughness and friction by position"
                )
            seen[dof] = pair.title
        slave = nodes.find(pair.surface.dofs)
        supported = taking_part.copy()
        displacement = which[slave[taking_part], : nodes.layout.gdim]
        supported[taking_part] = (displacement >= 0).any(axis=1)
        without: dict[str, list[int]] = {}
        for node in np.flatnonzero(supported):
            masters = nodes.find(pair.masters_under(int(node)))
            own = which[slave[node], : nodes.layout.gdim], value[slave[node]]
            if pair.rigid is not None:
                column = _moving_support(pair, int(node), *own, supports)
            else:
                column = _unshared_support(*own, which[masters], value[masters], supports)
            if column is None:
                _check_points_held(pair, int(node), which[slave[node]], which[masters], supports)
                continue
            if pair.bonded[node] and pair.rigid is not None:
                raise InterfaceError(
                    f"support '{column.title}' moves the slave node at "
                    f"{format_point(pair.surface.x[node])} of interface '{pair.title}', which is "
                    f"bonded to the {pair.rigid}; end the support before the bonded part"
                )
            if pair.bonded[node]:
                raise InterfaceError(
                    f"support '{column.title}' holds the slave node at "
                    f"{format_point(pair.surface.x[node])} of interface '{pair.title}', but not "
                    "its master nodes in the same way; support both faces there alike, or end the "
                    "support or the interface before each other"
                )
            taking_part[node] = False
            if pair.interface.contact:
                without.setdefault(column.title, []).append(int(node))
        for title, held in without.items():
            more = f" and {len(held) - 1} more" if len(held) > 1 else ""
            log.warn(
                "interface '%s': no contact at the node at %s%s, which support '%s' holds",
                pair.title,
                format_point(pair.surface.x[held[0]]),
                more,
                title,
            )


def _check_points_held(
    pair: Pair, node: int, which: Ints, master_which: Ints, supports: Supports
) -> None:
    """Refuse a bonded node whose nodes are held, but not the points of both faces.

    Args:
        pair: The interface.
        node: Slave node, held like its masters.
        which: Support columns of its unknowns, -1 if free, shape (n_unknowns,).
        master_which: Those of its masters, shape (k, n_unknowns).
        supports: The columns.

    Raises:
        InterfaceError: Its further unknowns (change of a director) are not held.
    """
    maps, on_master = pair.surface.point_maps, pair.master_maps
    if maps is None or on_master is None or not pair.bonded[node]:
        return
    gdim = maps.shape[1]
    for c in np.flatnonzero(which[:gdim] >= 0):
        moved = np.flatnonzero(maps[node, c] != 0.0)
        below = np.flatnonzero((on_master[node, :, c] != 0.0).any(axis=0))
        if np.all(which[moved] >= 0) and np.all(master_which[:, below] >= 0):
            continue
        raise InterfaceError(
            f"support '{supports.columns[int(which[c])].title}' holds the reference surface at "
            f"the bonded node at {format_point(pair.surface.x[node])} of interface "
            f"'{pair.title}', but not the director that moves its face; hold both by Symmetry or "
            "Clamp, or end the support before the bonded part"
        )


_ALONG = 1e-8
"""Component of a normal below which an axis lies along the surface."""


def _moving_support(
    pair: Pair, node: int, which: Ints, value: Array, supports: Supports
) -> SupportColumn | None:
    """A support that moves a slave node against the rigid surface it is paired with.

    One that moves it along a plane it may slide on without friction is none of these.

    Args:
        pair: Interface with a rigid master.
        node: Slave node.
        which: Support columns of its displacement, -1 if free, shape (gdim,).
        value: Entries of these columns, shape (gdim,) or longer.
        supports: The columns.
    """
    assert pair.rigid is not None
    slides = pair.rigid.flat and pair.friction is None
    slides &= pair.interface.normal_only or not pair.bonded[node]
    for c in np.flatnonzero(which >= 0):
        column = supports.columns[int(which[c])]
        across = abs(float(pair.frames[node, c, 0])) > _ALONG
        if column.moves and value[c] != 0.0 and (across or not slides):
            return column
    return None


def _unshared_support(
    which: Ints, value: Array, master_which: Ints, master_value: Array, supports: Supports
) -> SupportColumn | None:
    """A support of a slave node's displacement that its masters do not have in the same way.

    Args:
        which: Support columns of the node's displacement, -1 if free, shape (gdim,).
        value: Entries of these columns, shape (gdim,) or longer.
        master_which: Support columns of its masters, shape (k, n_unknowns).
        master_value: Entries of these columns, same shape.
        supports: The columns.
    """
    for c in np.flatnonzero(which >= 0):
        column = supports.columns[int(which[c])]
        for k, at_master in zip(master_which[:, c], master_value[:, c], strict=True):
            if k < 0 or not _moves_alike(supports.columns[k], column, at_master, value[c]):
                return column
    return None


__all__ = ["align_frames", "check_slaves", "tell_of_held_bonds"]
