"""Friction on condensed bodies: which nodes take part, and what it dissipates in an increment.

The states belong to slave nodes of pairs; every set of retained jumps numbers them anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.coulomb import OPEN, SLIP, STICK, FrictionState
from fxcrack.equilibrium.friction import Friction
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.front import Front
from fxcrack.interface.pair import Pair


@dataclass(frozen=True)
class FrictionWork:
    """Energy that friction dissipates in an increment predicted on a tangent, corrected at its end.

    Attributes:
        predicted: Energy on the predicted path, force times length.
        start: Tangential jumps at its beginning, shape (m, d - 1), length.
        jump: Those predicted for its end, shape (m, d - 1), length.
        traction: Tangential contact forces predicted there, shape (m, d - 1), force.
    """

    predicted: float
    start: Array
    jump: Array
    traction: Array

    @classmethod
    def of(cls, system: ContactSystem, points: list[tuple[float, Equilibrium]]) -> FrictionWork:
        """The predicted path, while the system still has the tangent it was predicted on."""
        friction = system.friction
        assert friction is not None
        end = points[-1][1]
        return cls(
            sum(friction.dissipation(system, a, b) for (_, a), (_, b) in pairwise(points)),
            friction.of(points[0][1].jump)[:, 1:],
            friction.of(end.jump)[:, 1:],
            friction.traction(system, end)[:, 1:],
        )

    def energy(self, system: ContactSystem, end: Equilibrium) -> float:
        """Energy up to the corrected end, on whose tangent the system is now.

        The corrections of slips and forces grow with the square of the increment.
        """
        friction = system.friction
        assert friction is not None
        rough = friction.mu > 0.0
        more = (friction.of(end.jump)[:, 1:] - self.jump)[rough]
        change = friction.traction(system, end)[rough, 1:] - self.traction[rough]
        lost = np.sum((self.traction[rough] + 0.5 * change) * more)
        lost += np.sum(change * (self.jump - self.start)[rough]) / 3.0
        return self.predicted - float(lost)


def nodes_of(pair: Pair, front: Front, index: Ints) -> Ints:
    """Slave nodes that may touch: open, paired, with a retained normal jump.

    Args:
        pair: The interface.
        front: Its front.
        index: Numbers of its retained jumps, -1 elsewhere, shape (n_nodes, gdim).

    Returns:
        Shape (k,).
    """
    if not pair.interface.contact:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(~front.bonded & pair.can_touch & (index[:, 0] >= 0))


def make_friction(
    system: ContactSystem,
    pairs: list[Pair],
    fronts: list[Front],
    index: list[Ints],
    before: FrictionState | None,
) -> None:
    """Make the block of contact nodes of a set of retained jumps.

    Args:
        system: The dense system of the set.
        pairs: Interfaces.
        fronts: Their fronts.
        index: Numbers of the retained jumps per pair, shape (n_nodes, gdim).
        before: What the nodes remember, ``None`` at the start.
    """
    friction = Friction(index[0].shape[1])
    known: dict[tuple[int, int], int] = {}
    if before is not None:
        friction.error = before.error
        known = {(int(p), int(k)): i for i, (p, k) in enumerate(before.where)}
    for p, (pair, front, numbers) in enumerate(zip(pairs, fronts, index, strict=True)):
        nodes = nodes_of(pair, front, numbers)
        gap = pair.gap[nodes]
        status = np.where(gap <= 0.0, STICK, OPEN)
        reference = np.zeros((len(nodes), friction.dim - 1))
        direction = np.zeros_like(reference)
        direction[:, 0] = 1.0
        for j, node in enumerate(nodes):
            i = known.get((p, int(node)))
            if before is not None and i is not None:
                status[j] = before.states.status[i]
                direction[j], reference[j] = before.states.direction[i], before.reference[i]
        _add(friction, p, pair, nodes, numbers, status, direction, reference)
    system.set_friction(friction)


def _add(
    friction: Friction,
    p: int,
    pair: Pair,
    nodes: Ints,
    index: Ints,
    status: Ints,
    direction: Array,
    reference: Array,
) -> None:
    mu = np.zeros(len(nodes)) if pair.friction is None else pair.friction[nodes]
    where = np.column_stack([np.full(len(nodes), p), nodes])
    friction.add(index[nodes], where, mu, pair.gap[nodes], status, direction, reference)


def contact_share(
    system: ContactSystem, pair: Pair, index: Ints, nodes: Ints, state: Equilibrium
) -> tuple[Array, Ints, Array]:
    """What contact takes over from the bonds of nodes that are released.

    Pressure stays, and so does shear up to mu times the pressure: what exceeds it is released.

    Args:
        system: The dense system.
        pair: The interface.
        index: Numbers of its retained jumps, -1 elsewhere, shape (n_nodes, gdim).
        nodes: Slave nodes, shape (k,).
        state: Present equilibrium.

    Returns:
        Forces on the slave side, shape (k, d), force; status, shape (k,), and slip direction,
        shape (k, d - 1), of the nodes.
    """
    friction = system.friction
    assert friction is not None
    components = index[nodes]
    force = np.zeros(components.shape)
    inside = components >= 0
    force[inside] = system.forces(state, components[inside])
    pressed = (force[:, 0] > 0.0) & inside[:, 0]
    mu = np.zeros(len(nodes)) if pair.friction is None else pair.friction[nodes]
    shear = np.linalg.norm(force[:, 1:], axis=1)
    bound = mu * np.maximum(force[:, 0], 0.0)
    slips = pressed & (shear > bound)
    direction = np.zeros((len(nodes), friction.dim - 1))
    direction[:, 0] = 1.0
    direction[slips] = -force[slips, 1:] / shear[slips, None]
    stays = np.where(shear > bound, bound / np.where(shear > 0.0, shear, 1.0), 1.0)
    taken = np.where(pressed[:, None], force, 0.0)
    taken[:, 1:] *= stays[:, None]
    return taken, np.where(slips, SLIP, np.where(pressed, STICK, OPEN)), direction


def release_to_contact(
    system: ContactSystem, p: int, pair: Pair, index: Ints, nodes: Ints, state: Equilibrium
) -> Array:
    """Move bonded nodes to the contact nodes.

    Args:
        system: The dense system.
        p: Number of the pair.
        pair: The interface.
        index: Numbers of its retained jumps, -1 elsewhere, shape (n_nodes, gdim).
        nodes: Slave nodes, shape (k,).
        state: Present equilibrium.

    Returns:
        Given forces, those of the nodes their bond forces less what contact takes over, shape
        (n_retained,), force.

    Raises:
        NotPositiveDefinite: A body would come free; nothing is changed.
    """
    friction = system.friction
    assert friction is not None
    nodes = nodes[index[nodes, 0] >= 0]
    taken, status, direction = contact_share(system, pair, index, nodes, state)
    reference = np.zeros((len(nodes), friction.dim - 1))
    _add(friction, p, pair, nodes, index, status, direction, reference)
    try:
        friction.condensed(system, np.zeros(0, dtype=np.int64))
    except NotPositiveDefinite:
        friction.drop(len(nodes))
        raise
    components = index[nodes]
    force = state.force.copy()
    inside = components >= 0
    rows = components[inside]
    force[rows] = system.forces(state, rows) - taken[inside]
    system.set_friction(friction)
    system.contact[components[:, 0]] = system.touches[components[:, 0]] = True
    return force


__all__ = [
    "FrictionWork",
    "contact_share",
    "make_friction",
    "nodes_of",
    "release_to_contact",
]
