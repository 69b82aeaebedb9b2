"""Columns of T for unknowns that have one value for all nodes (:attr:`DofLayout.shared`)."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Bools, Ints
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.supports import Supports


class SharedUnknowns:
    """Those of a layout: all nodes have the column of one node, or that of a support.

    Args:
        layout: Unknowns of nodes and their numbers.
        supports: Prescribed components, some of the shared unknowns among them; collective.
    """

    def __init__(self, layout: DofLayout, supports: Supports) -> None:
        self._layout = layout
        nodes = np.arange(layout.n_owned)
        self._dofs = [layout.dof(nodes, unknown) for unknown in layout.shared]
        mine = [-1] * len(self._dofs)
        self._first = [layout.shared_dof(unknown) for unknown in layout.shared]
        for i, at in enumerate(self._first):
            if at is not None:
                mine[i] = int(supports.which[at])
        if layout.shared:
            mine = layout.comm.bcast(mine, root=layout.shared_owner)
        self._support = mine

    def keep_one(self, own: Bools) -> None:
        """Leave one of the dofs of each that is free a column of its own.

        Args:
            own: Which owned dofs have one, shape (n_local,); changed in place.
        """
        for dofs, at, support in zip(self._dofs, self._first, self._support, strict=True):
            if support < 0:
                own[dofs] = False
                if at is not None:
                    own[at] = True

    def spread(self, column: Ints, support_column: int) -> Ints:
        """Give all its dofs that column; collective.

        Args:
            column: Column of each owned dof, -1 where it has none, shape (n_local,); changed in
                place.
            support_column: First column of the supports.

        Returns:
            Column of each shared unknown, shape (n_shared,).
        """
        found = []
        for dofs, at, support in zip(self._dofs, self._first, self._support, strict=True):
            if support >= 0:
                found.append(support_column + support)
                continue
            mine = -1 if at is None else int(column[at])
            number = int(self._layout.comm.bcast(mine, root=self._layout.shared_owner))
            column[dofs] = number
            found.append(number)
        return np.array(found, dtype=np.int64)

    def without(self, marks: Bools) -> Bools:
        """A copy of marks of the owned dofs, shape (n_local,), that leaves theirs out."""
        out = marks.copy()
        for dofs in self._dofs:
            out[dofs] = False
        return out


__all__ = ["SharedUnknowns"]
