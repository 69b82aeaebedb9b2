"""Supports where an interface is: which jumps they hold, and what they may not do there.

The rules are those of design.md, section 2; every rank finds the same verdict.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fxcrack import log
from fxcrack.continuum import Continuum
from fxcrack.errors import InterfaceError
from fxcrack.interface.pairing import Pair
from fxcrack.interface.supports import SupportColumn, Supports
from fxcrack.mesh.raw import place

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def align_frames(
    pairs: list[Pair],
    which: list[Ints],
    jumped: list[npt.NDArray[np.bool_]],
    supports: Supports,
    gdim: int,
) -> tuple[list[Array], list[npt.NDArray[np.bool_]]]:
    """Turn the frames of slave nodes that supports hold, and mark the jumps held with them.

    Args:
        pairs: Interfaces.
        which: Per pair, support column of each (slave node, component), -1 if free.
        jumped: Per pair, the slave nodes that have a jump, shape (n_nodes,).
        supports: For the titles in messages.
        gdim: Dimension.

    Returns:
        Frames and held components per pair.

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
            normal = frame[node, :, 0]
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
                        f"at {place(pair.surface.x[node])} in a direction oblique to it; "
                        "hold it along the interface or across it, or end the support before it"
                    )
        frames.append(frame)
        held.append(hold)
    return frames, held


class NodeReplica:
    """What every rank knows of the displacement nodes that take part in an interface."""

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        supports: Supports,
        jumped: list[npt.NDArray[np.bool_]],
    ) -> None:
        gdim, comm = continuum.gdim, continuum.comm
        used = [p.surface.dofs[j] for p, j in zip(pairs, jumped, strict=True)]
        used += [p.masters[j].ravel() for p, j in zip(pairs, jumped, strict=True)]
        self.blocks = np.unique(np.concatenate(used)) if used else np.zeros(0, dtype=np.int64)
        self.gdim = gdim
        self.low = continuum.offset // gdim
        self.mine = np.flatnonzero(
            (self.blocks >= self.low) & (self.blocks < self.low + continuum.n_local // gdim)
        )
        self.comm = comm
        local = (self.blocks[self.mine] - self.low)[:, None] * gdim + np.arange(gdim)
        self.which = self.share(supports.which[local].astype(float)).astype(np.int64)
        self.value = self.share(supports.value[local])

    def share(self, mine: Array) -> Array:
        """Combine what owners know of their nodes, shape (n_mine, gdim) to (n_blocks, gdim)."""
        out = np.zeros((len(self.blocks), self.gdim))
        for where, what in self.comm.allgather((self.mine, mine)):
            out[where] = what
        return out

    def find(self, dofs: Ints) -> Ints:
        """Position of global displacement nodes in the replica."""
        return np.searchsorted(self.blocks, dofs)


def _moves_alike(a: SupportColumn, b: SupportColumn, at_a: float, at_b: float) -> bool:
    """Whether two prescribed dofs always have the same displacement."""
    one, other = (c.scale * at if c.moves else 0.0 for c, at in ((a, at_a), (b, at_b)))
    if one == other == 0.0:
        return True
    return a.support.amplitude == b.support.amplitude and abs(one - other) <= 1e-12 * abs(one)


def check_slaves(
    pairs: list[Pair],
    jumped: list[npt.NDArray[np.bool_]],
    replica: NodeReplica,
    supports: Supports,
) -> None:
    """Enforce the rules of design.md, section 2; the same verdict on every rank.

    Open nodes whose support their masters do not share lose their jump: they cannot be bonded
    or touch, but nothing else is lost. ``jumped`` is changed in place.
    """
    seen: dict[int, str] = {}
    for pair, taking_part in zip(pairs, jumped, strict=True):
        for node in np.flatnonzero(taking_part):
            dof = int(pair.surface.dofs[node])
            if dof in seen:
                raise InterfaceError(
                    f"the node at {place(pair.surface.x[node])} is a slave of interface "
                    f"'{seen[dof]}' and of '{pair.title}'; a node can be a slave only once: "
                    "let the surfaces end before each other or exchange slave and master of one"
                )
            seen[dof] = pair.title
        slave = replica.find(pair.surface.dofs)
        supported = taking_part.copy()
        supported[taking_part] = (replica.which[slave[taking_part]] >= 0).any(axis=1)
        for node in np.flatnonzero(supported):
            column = _unshared_support(pair, int(node), int(slave[node]), replica, supports)
            if column is None:
                continue
            if pair.bonded[node]:
                raise InterfaceError(
                    f"support '{column.title}' holds the slave node at "
                    f"{place(pair.surface.x[node])} of interface '{pair.title}', but not its "
                    "master nodes in the same way; support both faces there alike, or end the "
                    "support or the interface before each other"
                )
            taking_part[node] = False
            if pair.interface.contact:
                log.warn(
                    "interface '%s': no contact at the node at %s, which support '%s' holds",
                    pair.title,
                    place(pair.surface.x[node]),
                    column.title,
                )


def _unshared_support(
    pair: Pair, node: int, slave: int, replica: NodeReplica, supports: Supports
) -> SupportColumn | None:
    """A support of a slave node that its masters do not carry in the same way."""
    masters = replica.find(pair.masters[node][pair.weights[node] != 0.0])
    for c in np.flatnonzero(replica.which[slave] >= 0):
        column: SupportColumn = supports.columns[int(replica.which[slave, c])]
        for m in masters:
            k = replica.which[m, c]
            if k < 0 or not _moves_alike(
                supports.columns[k], column, replica.value[m, c], replica.value[slave, c]
            ):
                return column
    return None
