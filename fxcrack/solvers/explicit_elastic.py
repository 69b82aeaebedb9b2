"""Bonds with a stiffness of their own in explicit dynamics, as other programs have them.

    p = -A (K_nn d_n n + K_ss d_s s + K_tt d_t t)

on the slave of a bonded pair with the jump d and the tributary area A. They take part in the
stable increment, and their energy in the middle of increments is 1/2 d^n . K d^{n+1}. By default
the stiffness is that of the cells beside them: the smaller modulus of both sides over the height of
the slave's cells, h = 2 V/A of its node.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.cell_stiffness import moduli_at_nodes
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.pair import Pair


class ElasticBonds:
    """Springs between the faces of bonded pairs.

    Args:
        lumped: The interfaces.
        pairs: Those of which some have a stiffness.
        continuum: The bodies, for the default stiffness; collective.

    Attributes:
        local: Stiffness of each row in its frame, shape (n_rows, gdim), force/length; 0 where
            bonds are exact.
        active: Whether the spring of each row holds, shape (n_rows,).
    """

    def __init__(
        self, lumped: LumpedInterface, pairs: Sequence[Pair], continuum: Continuum
    ) -> None:
        self._lumped, gdim = lumped, continuum.gdim
        self.local = np.zeros((lumped.n_rows, gdim))
        self.active = np.zeros(lumped.n_rows, dtype=bool)
        moduli: Array | None = None
        for pair, rows in zip(pairs, lumped.row_of, strict=True):
            given = pair.interface.stiffness
            if given is None:
                continue
            has = rows >= 0
            area = pair.surface.areas[has]
            if given == "auto":
                if moduli is None:
                    columns = moduli_at_nodes(continuum).T
                    moduli = np.array([lumped.nodes.gather(c.copy())[:, 0] for c in columns]).T
                per_area = self._adjacent(moduli, rows[has], area)
            else:
                per_area = np.tile(np.asarray(given, dtype=float), (len(area), 1))
            self.local[rows[has]] = (area[:, None] * per_area)[:, :gdim]
        self.renew()

    def _adjacent(self, moduli: Array, rows: Ints, area: Array) -> Array:
        """Stiffness per area from the cells beside rows, shape (n, 3), force/length^3."""
        lumped = self._lumped
        slave = moduli[lumped.slave[rows]]
        weights = lumped.weights[rows]
        least = slave[:, :2].copy()
        at = np.repeat(np.arange(len(rows)), np.diff(weights.indptr))
        np.minimum.at(least, at, moduli[weights.indices, :2])
        height = 2.0 * slave[:, 2] / area
        return np.asarray(least[:, [0, 1, 1]] / height[:, None])

    def hold(self, rows: Bools) -> None:
        """Let the springs of some rows hold, of those that have one, shape (n_rows,)."""
        self.active = rows & np.any(self.local > 0.0, axis=1)
        self.renew()

    def renew(self) -> None:
        """Take ties and frames that have changed."""
        self.exist = bool(self.active.any())
        if not self.exist:
            return
        open_rows = self._lumped.open
        self._at = np.flatnonzero(self.active[open_rows])
        frames = self._lumped.frames[open_rows[self._at]]
        local = self.local[open_rows[self._at]]
        self._stiffness = np.einsum("nci,ni,ndi->ncd", frames, local, frames)

    @property
    def rows(self) -> Ints:
        """Rows whose springs hold, shape (n,)."""
        return np.asarray(self._lumped.open[self._at])

    def stiffness_of(self, rows: Ints) -> Array:
        """Global stiffness of some rows, shape (n, gdim, gdim), force/length."""
        frames = self._lumped.frames[rows]
        return np.asarray(np.einsum("nci,ni,ndi->ncd", frames, self.local[rows], frames))

    def forces(self, jumps: Array) -> Array:
        """Forces on the slave side, shape (n_open, gdim), of jumps of that shape, length."""
        out = np.zeros_like(jumps)
        out[self._at] = -np.einsum("ncd,nd->nc", self._stiffness, jumps[self._at])
        return out

    def energies(self, before: Array, after: Array) -> Array:
        """1/2 d^n . K d^{n+1} of all rows, shape (n_rows,), force times length.

        Args:
            before: Jumps of the open rows at the start of an increment, shape (n_open, gdim).
            after: At its end, same shape.
        """
        out = np.zeros(self._lumped.n_rows)
        out[self.rows] = -0.5 * (before[self._at] * self.forces(after)[self._at]).sum(axis=1)
        return out


__all__ = ["ElasticBonds"]
