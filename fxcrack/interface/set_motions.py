"""Motions of a set of nodes that is coupled to a reference point."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.couplings import Constraint, Coupling
from fxcrack.continuum.dof_layout import DofLayout

FREE = 1e-9
"""Singular value of scaled motions below which they move no dof of the set, or are held."""
_ROUND_OFF = 1e-12
"""Distance from the reference below which there is none, over the largest coordinate."""
_LARGE = 0.05
"""Rotation in radians from which it is said that rotations of couplings are small ones: the nodes
are off by half its square, 0.1 %, of their distance from the reference."""


def coupled_motions(
    layout: DofLayout, coupling: Coupling, nodes: Ints, x: Array, directors: Array
) -> tuple[Ints, Array, Ints]:
    """What the coupled dofs do in unit motions of the reference.

    Args:
        layout: Unknowns of nodes and their numbers.
        coupling: The coupling.
        nodes: Its nodes in any numbering, shape (n,).
        x: Their positions, shape (n, 3).
        directors: Their directors where they have any, shape (n, 3).

    Returns:
        Unknown and dof (in the numbering of the nodes) of each coupled dof, the motions between
        them: shapes (n_dofs,), (n_dofs, n_motions), (n_dofs,).

    Raises:
        InputError: No component of the nodes follows.
    """
    gdim = layout.gdim
    r = np.zeros((len(x), 3))
    r[:, :gdim] = x[:, :gdim]
    r[:, : len(coupling.point)] -= np.asarray(coupling.point)
    # a node at the reference has no lever: one of round-off would let rotations move it
    size = max(np.abs(x).max(initial=0.0), np.abs(coupling.point).max())
    r[np.abs(r) <= _ROUND_OFF * size] = 0.0
    axes = np.eye(3)
    turns = [np.cross(axes[i], r) for i in (range(3) if gdim == 3 else (2,))]
    parts, unknowns = [], []
    for axis in coupling.components:
        c = "xyz".index(axis)
        if c >= gdim:
            continue
        shift = np.tile(np.eye(gdim)[c], (len(x), 1))
        parts.append(np.column_stack([shift, *(t[:, c] for t in turns)]))
        unknowns.append(c)
    if layout.n_unknowns > gdim + len(layout.shared) and coupling.rotations:
        for c in range(3):
            turn = [np.cross(axes[i], directors)[:, c] for i in range(3)]
            parts.append(np.column_stack([np.zeros((len(x), 3)), *turn]))
            unknowns.append(gdim + c)
    if not parts:
        raise InputError(f"Coupling('{coupling.title}'): no component of the nodes follows")
    of = np.repeat(unknowns, len(x))
    return of, np.concatenate(parts), layout.dof(np.tile(nodes, len(parts)), of)


def motion_basis(motions: Array, held: Bools) -> tuple[Ints, Array]:
    """Basis of the motions that leave held dofs at rest, the identity at some of the others.

    Args:
        motions: What each dof does in each free motion, shape (n, k).
        held: Dofs at rest, shape (n,).

    Returns:
        Which of the dofs that are not held the basis is the identity at, shape (m,), and the basis
        on these dofs, shape (n_not_held, m).
    """
    size = np.abs(motions).max(axis=0, initial=0.0)
    scaled = motions / np.where(size > 0.0, size, 1.0)
    if held.any() and scaled.shape[1]:
        _, s, vectors = np.linalg.svd(scaled[held], full_matrices=True)
        rank = int((s > FREE * max(float(s[0]), 1e-300)).sum())
        scaled = scaled[~held] @ vectors[rank:].T
    else:
        scaled = scaled[~held]
    if not scaled.size:
        return np.zeros(0, dtype=np.int64), np.zeros((len(scaled), 0))
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    u = u[:, s > FREE * max(float(s[0]), 1e-300)]
    _, _, order = scipy.linalg.qr(u.T, mode="economic", pivoting=True)
    slots = np.sort(order[: u.shape[1]])
    basis = np.linalg.solve(u[slots].T, u.T).T
    basis[np.abs(basis) < 1e-14] = 0.0
    return slots.astype(np.int64), np.asarray(basis)


def warn_of_turns(
    continuum: Continuum, constraints: tuple[Constraint, ...], displacement: Array
) -> None:
    """Say so once where a reference has turned further than small rotations go; collective.

    Args:
        continuum: The bodies, whose rotations are finite.
        constraints: Couplings and equations.
        displacement: Of the dofs that this rank owns, shape (n_local,).
    """
    layout = continuum.layout
    gdim = layout.gdim
    for coupling in constraints:
        if not isinstance(coupling, Coupling) or coupling.mean:
            continue
        local = continuum.owned_nodes(coupling.where).astype(np.int64)
        x = continuum.positions()[local]
        _, motions, dofs = coupled_motions(layout, coupling, local, x, np.zeros_like(x))
        mine = motions, displacement[dofs]
        every = layout.comm.allgather(mine)
        motions, moved = (np.concatenate(p) for p in zip(*every, strict=True))
        size = np.abs(motions).max(axis=0, initial=0.0)
        size[size == 0.0] = 1.0
        found = np.linalg.lstsq(motions / size, moved, rcond=FREE)[0] / size
        angle = float(np.linalg.norm(found[gdim:]))
        if angle > _LARGE:
            log.warn(
                "Coupling('%s') has turned by %.2g radians, but its rotations are small ones: its "
                "nodes move apart by half the square of that, %.1e of their distance from the "
                "reference",
                coupling.title,
                angle,
                0.5 * angle**2,
            )


__all__ = ["FREE", "coupled_motions", "motion_basis", "warn_of_turns"]
