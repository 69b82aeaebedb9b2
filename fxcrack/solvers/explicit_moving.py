"""Interfaces of bodies that move far, in explicit dynamics: fronts, faces and pairs follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.interface.finite_sliding import changing, renewed, with_changing
from fxcrack.interface.front import Front
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.pair import Pair
from fxcrack.interface.pairing import local_frames
from fxcrack.interface.rigid import RIGID, RigidSurface
from fxcrack.interface.rigid_pairing import renewed_on
from fxcrack.interface.surface import FacetSurface, gather_surface
from fxcrack.solvers.explicit_interface import InterfaceDynamics

_TURNED = 0.2
"""Angle by which the normal of faces far from each other may turn before they are paired anew."""


def sliding_masters(
    continuum: Continuum, pairs: Sequence[Pair], *, finite: bool
) -> list[FacetSurface | RigidSurface | None]:
    """Undeformed master surfaces of the pairs whose open nodes are paired anew; collective.

    Args:
        continuum: The bodies.
        pairs: Interfaces.
        finite: Whether the bodies turn and stretch by any amount.

    Returns:
        ``None`` for pairs that stay as they are.
    """
    out: list[FacetSurface | RigidSurface | None] = []
    for pair in pairs:
        master = pair.sides[1]
        if not finite or not pair.interface.contact:
            out.append(None)
        elif isinstance(master, str | Face):
            out.append(gather_surface(continuum, master))
        else:
            out.append(pair.rigid)
    return out


def _overlap(pair: Pair) -> Array:
    """By how much nodes overlap a rigid surface at the start where gaps are zero, (n_nodes,)."""
    if pair.rigid is None:
        return np.zeros(len(pair.gap))
    distance, _ = pair.rigid.measure(pair.surface.x)
    return np.where(pair.paired, np.maximum(pair.gap - distance, 0.0), 0.0)


def _nodes_of(lumped: LumpedInterface, master: FacetSurface | RigidSurface) -> Ints:
    """Interface nodes of a master surface, shape (n,); a rigid one has none."""
    if isinstance(master, FacetSurface):
        return lumped.nodes.find(master.dofs)
    return np.zeros(0, dtype=np.int64)


class MovingInterfaces:
    """Front geometry, contact normals and pairs where the bodies are now.

    Args:
        dynamics: Motion of the interfaces.
        pairs: Interfaces; replaced in this list where nodes are paired anew.
        fronts: Their fronts.
        masters: From :func:`sliding_masters`.
    """

    def __init__(
        self, dynamics: InterfaceDynamics, pairs: list[Pair], fronts: Sequence[Front],
        masters: Sequence[FacetSurface | RigidSurface | None],
    ) -> None:  # fmt: skip
        self._dynamics, self._pairs, self._fronts = dynamics, pairs, fronts
        self._masters, lumped = masters, dynamics.lumped
        # nodes of the surfaces that are paired anew: slaves, masters
        self._nodes = [
            None
            if master is None
            else (lumped.nodes.find(pair.surface.dofs), _nodes_of(lumped, master))
            for pair, master in zip(pairs, masters, strict=True)
        ]
        # faces that a gap of zero lets overlap a rigid surface at the start are not pushed out
        self._overlap = [_overlap(pair) for pair in pairs]
        # the normal of a curved surface turns with every increment, and a node that moved along
        # the tangent for some of them would be pushed back by several times its way in one
        self.curved = [p for p, m in enumerate(masters) if isinstance(m, RIGID) and not m.flat]

    def follow_curved(self) -> None:
        """Take normals and gaps of curved rigid surfaces from the present displacement."""
        if any([self._renew_on_rigid(p, turned=0.0) for p in self.curved]):
            self._dynamics.lumped.set_pairing(self._pairs)
            self._dynamics.set_ties(self._dynamics.lumped.tied)
            return
        self._dynamics.lumped.version += 1
        self._dynamics.set_frames()

    def follow(self) -> None:
        """Take front geometry, contact normals and pairs from the present displacement."""
        dynamics, lumped = self._dynamics, self._dynamics.lumped
        gdim, changed = lumped.frames.shape[-1], False
        for p, (front, rows) in enumerate(zip(self._fronts, lumped.row_of, strict=True)):
            x = self._pairs[p].surface.x.copy()
            has = rows >= 0
            x[has, :gdim] += dynamics.u[lumped.slave[rows[has]]]
            front.follow(x)
            frames = local_frames(-front.surface.normals, gdim)
            turn = has
            if self._masters[p] is not None:
                # open pairs keep the normal that their gap was found with
                turn = has & (self._held(p) | ~self._pairs[p].paired)
                rigid = isinstance(self._masters[p], RIGID)
                changed |= self._renew_on_rigid(p) if rigid else self._pair_anew(p)
            turn &= ~lumped.rigid[rows]  # their normals are those of the rigid surface
            lumped.frames[rows[turn]] = frames[turn]
        if changed:
            lumped.set_pairing(self._pairs)
            dynamics.set_ties(lumped.tied)
            return
        lumped.version += 1
        dynamics.set_frames()

    def _held(self, p: int) -> Bools:
        """Slave nodes of a pair whose bonds hold, or still pull, shape (n_nodes,)."""
        rows, dynamics = self._dynamics.lumped.row_of[p], self._dynamics
        pulling = dynamics.bonds.active.copy()
        for fading in dynamics.fading:
            pulling[fading.rows] = True
        return np.asarray(self._fronts[p].bonded | ((rows >= 0) & pulling[rows]))

    def _pair_anew(self, p: int) -> bool:
        """Pair the open nodes with the master surface where it is now; whether any changed."""
        master, nodes, pair = self._masters[p], self._nodes[p], self._pairs[p]
        assert master is not None and nodes is not None
        lumped, u, held = self._dynamics.lumped, self._dynamics.u, self._held(p)
        new = renewed(pair, held, master, u[nodes[0]], u[nodes[1]], turned=_TURNED)
        if new is None:
            return False
        self._pairs[p] = new
        rows = lumped.row_of[p]
        loose = (rows >= 0) & ~held & new.paired
        at, normal = rows[loose], new.frames[loose][:, :, 0]
        lumped.frames[at] = new.frames[loose]
        masters = lumped.nodes.find(new.masters[loose])
        jump = u[lumped.slave[at]] - np.einsum("nk,nkc->nc", new.weights[loose], u[masters])
        gap = np.einsum("nc,nc->n", jump, normal) + new.gap[loose]
        # faces that overlap by the change of their facets alone are not pushed apart at once
        lumped.gap[at] = new.gap[loose] - np.minimum(gap, 0.0)
        return True

    def _renew_on_rigid(self, p: int, *, turned: float | None = None) -> bool:
        """Take normals and gaps on a rigid surface; whether other nodes are paired now."""
        lumped, nodes, pair = self._dynamics.lumped, self._nodes[p], self._pairs[p]
        assert nodes is not None
        held = self._held(p)
        new = renewed_on(pair, held, self._dynamics.u[nodes[0]], turned=turned)
        if new is None:
            return False
        self._pairs[p] = new
        rows = lumped.row_of[p]
        loose = (rows >= 0) & ~held & new.paired
        lumped.frames[rows[loose]] = new.frames[loose]
        lumped.gap[rows[loose]] = new.gap[loose] + self._overlap[p][loose]
        return not np.array_equal(new.paired, pair.paired)

    # -- checkpoints ---------------------------------------------------------------------

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Pairs and gaps that are other ones than at the start, on any number of ranks."""
        out: dict[str, npt.NDArray[Any]] = {}
        for p, (pair, master) in enumerate(zip(self._pairs, self._masters, strict=True)):
            if master is not None:
                out |= {f"pairing.{k}[{p}]": v for k, v in changing(pair, master).items()}
        if out:
            lumped = self._dynamics.lumped
            out |= {"pairing.row_gap": lumped.gap, "pairing.row_frames": lumped.frames}
        return out

    def restore(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take what :meth:`arrays` gave, and the ties with them."""
        lumped = self._dynamics.lumped
        if "pairing.row_gap" not in arrays:
            return
        for p, master in enumerate(self._masters):
            if master is None:
                continue
            known = {
                k: arrays[f"pairing.{k}[{p}]"] for k in changing(self._pairs[p], master)
            }  # fmt: skip
            self._pairs[p] = with_changing(self._pairs[p], master, known)
        lumped.gap[:] = np.asarray(arrays["pairing.row_gap"], dtype=float)
        lumped.frames[:] = np.asarray(arrays["pairing.row_frames"], dtype=float)
        lumped.set_pairing(self._pairs)
        self._dynamics.set_ties(lumped.tied)


__all__ = ["MovingInterfaces", "sliding_masters"]
