"""Slave nodes whose displacement couplings and equations constrain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.following import Following
from fxcrack.interface.pair import Pair


def drop_constrained(
    pairs: Sequence[Pair],
    jumped: list[Bools],
    following: Following | None,
    layout: DofLayout,
    *,
    open_ones: bool = True,
) -> list[Bools]:
    """Take the jump from slave nodes that couplings and equations move; the same on every rank.

    A bonded one must belong to one rigid set with its masters: its jump is zero then. Open ones
    lose contact and nothing else.

    Args:
        pairs: Interfaces.
        jumped: Per pair, the slave nodes that have a jump, shape (n_nodes,); changed in place.
        following: Dofs that follow others.
        layout: Unknowns of nodes and their numbers.
        open_ones: Whether those that are not bonded lose theirs as well.

    Returns:
        Per pair, the bonded nodes whose jump a rigid set holds at zero, shape (n_nodes,).

    Raises:
        InterfaceError: A bonded slave node moves otherwise than its masters.
    """
    rigid = [np.zeros(pair.surface.n_nodes, dtype=bool) for pair in pairs]
    if following is None:
        return rigid
    gdim = layout.gdim
    for pair, has_jump, held in zip(pairs, jumped, rigid, strict=True):
        dofs = layout.dofs(pair.surface.dofs)
        touched = following.marks(dofs)[:, :gdim].any(axis=1) & has_jump
        if not open_ones:
            touched &= pair.bonded
        lost = 0
        for node in np.flatnonzero(touched):
            has_jump[node] = False
            if not pair.bonded[node]:
                lost += 1
                continue
            if pair.rigid is not None:
                raise InterfaceError(
                    f"a coupling or an equation moves the slave node at "
                    f"{format_point(pair.surface.x[node])} of interface '{pair.title}', which is "
                    f"bonded to the {pair.rigid}; leave it out of the group"
                )
            own = _sets(following, dofs[node])
            masters = layout.dofs(pair.masters_under(int(node)))
            alike = all(_sets(following, row) == own for row in masters)
            if not alike or len(own) != 1 or own <= {-1} or not _all_of(following, dofs[node]):
                raise InterfaceError(
                    f"a coupling or an equation moves the slave node at "
                    f"{format_point(pair.surface.x[node])} of interface '{pair.title}', which is "
                    "bonded, otherwise than its master nodes; couple both faces there with all "
                    "components to one reference, or leave the slave nodes out of the group"
                )
            held[node] = True
        if lost and pair.interface.contact:
            log.warn(
                "interface '%s': no contact at %d open slave nodes that couplings or equations "
                "move",
                pair.title,
                lost,
            )
    return rigid


def _sets(following: Following, dofs: Ints) -> set[int]:
    """Constraints that move some dofs; -2 stands for none."""
    return {following.sets.get(int(dof), -2) for dof in dofs}


def _all_of(following: Following, dofs: Ints) -> bool:
    return all(int(dof) in following.sets for dof in dofs)


__all__ = ["drop_constrained"]
