"""Elements through which a fatigue front has come in part.

While the front passes the part phi of the element ahead of a node, its bond is an elastic ligament,

    F_i = k_i (1 - phi)/phi w_i,      k_i the bond force over the opening at phi = 0,

i the normal and the tangential direction: a bond at phi = 0, nothing at phi = 1, and in between the
force falls and the opening rises in proportion to phi as long as the rate stays the same. The
energy that the bodies lose to a ligament per area that its front advances is

    G_i = -1/2 w_i^2 dk_i/dphi/A = 1/2 k_i (w_i/phi)^2/A,

the product of the force F/(1 - phi) and the opening w/phi of crack closure. However k_i is chosen,
the element sets free what its release does, as the integral over phi says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.criteria.crack_closure import Normalisation, closure_weights
from fxcrack.criteria.probe import FrontProbe, State
from fxcrack.interface.tips import Tips

_SMALL = 1e-6
"""Modes with less than this part of the work of closure take the stiffness of the others."""


@dataclass(eq=False)
class Ligaments:
    """What is left of the bonds of an interface.

    Attributes:
        part: Part phi of the element ahead of each slave node that the front has passed, shape
            (n_nodes,).
        stiffness: k in the normal and in the tangential direction, shape (n_nodes, 2),
            force/length; inf where the faces are pressed together, NaN before growth.
    """

    part: Array
    stiffness: Array

    @classmethod
    def none(cls, n_nodes: int) -> Ligaments:
        """Bonds as they are at first."""
        return cls(np.zeros(n_nodes), np.full((n_nodes, 2), np.nan))

    def begin(self, tips: Tips, rows: Ints, force: Array, opening: Array) -> Bools:
        """Stiffnesses of ligaments from crack closure.

        Args:
            tips: Front nodes.
            rows: Those of them at which a ligament begins, shape (m,).
            force: Their bond forces in tip frames, shape (m, 3), force.
            opening: Openings behind them in tip frames, shape (m, 3), length.

        Returns:
            Whether closing the crack takes work there, shape (m,); the others keep their bonds.
        """
        work = force * opening
        # modes that would take up energy count no more than in the rates of the criterion
        normal, along = work[:, 0], np.maximum(work[:, 1:], 0.0).sum(axis=1)
        whole = np.maximum(normal, 0.0) + np.maximum(along, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            k = np.stack(
                [force[:, 0] / opening[:, 0], along / (opening[:, 1:] ** 2).sum(axis=1)], axis=1
            )
        weak = np.stack([normal, along], axis=1) <= _SMALL * whole[:, None]
        k = np.where(weak, k[:, ::-1], k)
        k[weak[:, 0] & (force[:, 0] < 0.0), 0] = np.inf
        good = (whole > 0.0) & ~weak.all(axis=1)
        self.stiffness[tips.node[rows[good]]] = k[good]
        return np.asarray(good)

    def put(
        self,
        probe: FrontProbe,
        tips: Tips,
        state: State,
        normalisation: Normalisation,
        force: Array,
        opening: Array,
    ) -> None:
        """Replace forces and openings at tips with ligaments by those that give their G.

        Args:
            probe: The interface.
            tips: Front nodes.
            state: State of the solver.
            normalisation: What crack closure divides by.
            force: Forces at the tips in their frames, shape (n, 1, 3), force; changed.
            opening: Openings they are multiplied with, likewise, length.
        """
        rows = np.flatnonzero(self.part[tips.node] > 0.0)
        if not len(rows):
            return
        nodes = tips.node[rows]
        phi, k = self.part[nodes, None], self.stiffness[nodes][:, [0, 1, 1]]
        jumps = np.einsum("nci,nc->ni", tips.frame[rows], probe.jumps(nodes, state)) / phi
        weights = closure_weights(
            tips.d_ahead[rows], tips.d_behind[rows], tips.width[rows], 1, normalisation,
            tips.straight[rows],
        )  # fmt: skip
        rigid = ~np.isfinite(k)
        force[rows, 0] = np.where(rigid, 0.0, np.where(rigid, 0.0, k) * jumps)
        opening[rows, 0] = jumps * (0.5 / (tips.area[rows, None] * weights))
