"""Forces, openings and jumps at the tips, as criteria ask for them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_solve

from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria.crack_closure import opens
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.tips import Tips
from fxcrack.solvers.base import Solver

_UNBOUNDED = 1e100
"""Jump per force of a unit that holds a body alone."""


def bond_forces(solver: Solver, p: int, tips: Tips, state: Equilibrium) -> Array:
    """Tension-positive bond forces at the tips in the tip frames, shape (n, k, 3).

    Loads on the crack faces are carried on to the faces that would open.
    """
    index = solver.index[p][tips.force_nodes]
    rows = np.unique(index[index >= 0])
    values = np.zeros(solver.system.n_retained)
    values[rows] = -solver.system.forces(state, rows)
    vectors = solver.vectors(p, tips.force_nodes, values)
    if np.any(solver.face_loads):
        vectors = vectors + _loads_to_come(solver, p, tips, state)
    out = np.einsum("nci,nkc->nki", tips.frame, vectors)
    if tips.force_nodes.shape[1] > 1:
        # at the end of a surface there is no midside node ahead
        out[tips.force_nodes[:, 0] == tips.force_nodes[:, 1], 1] = 0.0
    return np.asarray(out)


def _loads_to_come(solver: Solver, p: int, tips: Tips, state: Equilibrium) -> Array:
    """Load on the faces the crack is about to open, if that of the wake goes on there.

    A pressure p on the faces leaves the bond forces short by p times the part of the tip's
    tributary area that is still bonded (as superposing the uniform stress -p shows); without
    this the error of G goes with the square root of the element size only.

    Returns:
        Global vectors per force node, shape (n, k, 3).
    """
    areas = solver.pairs[p].surface.areas
    loads = solver.face_loads @ state.loads[solver.n_loads - len(solver.loads) :]
    wake = solver.vectors(p, tips.wake_nodes, loads).sum(axis=(1, 2))
    density = wake / areas[tips.wake_nodes].sum(axis=(1, 2))[:, None]
    whole = areas[tips.force_nodes][..., None] * density[:, None]
    present = solver.vectors(p, tips.force_nodes, loads)
    to_come = whole - present
    to_come[~np.any(density, axis=1)] = 0.0
    return np.asarray(to_come)


def openings(solver: Solver, p: int, tips: Tips, state: Equilibrium) -> Array:
    """Openings behind the tips in the tip frames, shape (n, k, 3), length."""
    jump = solver.vectors(p, tips.wake_nodes, state.jump)
    jump = np.einsum("nkm,nkmc->nkc", tips.wake_weights, jump)
    return np.asarray(np.einsum("nci,nkc->nki", tips.frame, jump))


def closure_jumps(solver: Solver, p: int, tips: Tips, force: Array) -> Array:
    """Jumps that letting each unit go alone would open, shape (n, k, 3), length.

    Args:
        solver: The model.
        p: Number of the pair.
        tips: Front nodes.
        force: Their bond forces in tip frames, shape (n, k, 3).
    """
    out = np.zeros_like(force)
    for i in range(len(tips)):
        nodes = np.unique(tips.force_nodes[i])
        index = solver.index[p][nodes]
        order = np.searchsorted(nodes, tips.force_nodes[i, : len(nodes)])
        frames, pulls = solver.frames[p][nodes], force[i, : len(nodes)]
        local = np.zeros((len(nodes), solver.continuum.gdim))
        local[order] = _turned(frames[order], pulls @ tips.frame[i].T)
        free = index >= 0
        jump = _released(solver, index, free, local, frames)[order] @ tips.frame[i]
        if not opens(pulls[None, :, 0], jump[None, :, 0])[0]:
            # pressed together: it stays closed, shear alone is released
            jump = _released(solver, index, free, local, frames, tips.frame[i][:, 0])
            jump = jump[order] @ tips.frame[i]
        out[i, : len(nodes)] = jump
    return out


def _turned(frames: Array, vectors: Array) -> Array:
    """Global vectors, shape (k, 3), in local frames of shape (k, gdim, gdim)."""
    return np.asarray(np.einsum("kci,kc->ki", frames, vectors[:, : frames.shape[1]]))


def _released(
    solver: Solver,
    index: Ints,
    free: npt.NDArray[np.bool_],
    force: Array,
    frames: Array,
    normal: Array | None = None,
) -> Array:
    """Jumps of a unit without some of its bonds, global vectors of shape (k, 3).

    Args:
        solver: The model.
        index: Components in the window, shape (k, gdim).
        free: Those let go, likewise.
        force: Their bond forces in local frames, likewise.
        frames: These, shape (k, gdim, gdim).
        normal: Direction, shape (3,), in which nothing moves, be it none of the local frames' (they
            do not turn with the bodies); ``None`` for none.
    """
    jump = np.zeros(index.shape)
    star = solver.system.reduced(index[free])
    try:
        factor = solver.system.cholesky.factorise(star, index[free])
    except NotPositiveDefinite:
        if normal is not None:
            tangential = free & (np.arange(index.shape[1]) > 0)
            return _released(solver, index, tangential, force, frames)
        factor = np.eye(len(star)) / np.sqrt(_UNBOUNDED)
    jump[free] = cho_solve((factor, True), force[free])
    if normal is not None:
        k = len(index)
        across = np.zeros((*index.shape, k))
        across[range(k), :, range(k)] = np.einsum("kci,c->ki", frames, normal[: frames.shape[1]])
        held = across[free]
        given = cho_solve((factor, True), held)
        jump[free] -= given @ np.linalg.lstsq(held.T @ given, held.T @ jump[free])[0]
    world = np.zeros((len(index), 3))
    world[:, : index.shape[1]] = np.einsum("kci,ki->kc", frames, jump)
    return world
