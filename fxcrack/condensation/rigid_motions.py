"""Whether the supports hold the bodies against moving as one rigid whole.

The rigid motions of the model, restricted to the supported displacement components, must be
linearly independent: the smallest eigenvalue of their Gram matrix must not vanish. The check
needs no factorisation and does not depend on what a direct solver notices.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.errors import SolverError
from fxcrack.condensation.mumps_schur import mumps_message
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import Axisymmetric
from fxcrack.interface.supports import Supports


def rigid_motions(continuum: Continuum) -> Array:
    """Rigid motions on the owned dofs, scaled to unit length, shape (n_local, n_motions)."""
    gdim, layout = continuum.gdim, continuum.layout
    x = continuum.positions()[: layout.n_owned, :gdim]
    low = continuum.comm.allreduce(x.min(axis=0, initial=np.inf), op=_least)
    high = continuum.comm.allreduce(x.max(axis=0, initial=-np.inf), op=_most)
    size = max(float((high - low).max()), 1e-300)
    s = (x - 0.5 * (low + high)) / size
    motions, still = [], np.zeros(3)
    if isinstance(continuum.model, Axisymmetric):
        motions.append(layout.rigid_motion(np.tile([0.0, 1.0], (len(s), 1)), still))
    else:
        motions += [layout.rigid_motion(np.tile(e, (len(s), 1)), still) for e in np.eye(gdim)]
        planes = [(0, 1)] if gdim == 2 else [(0, 1), (1, 2), (0, 2)]
        for i, j in planes:
            turn = np.zeros((len(s), gdim))
            turn[:, i], turn[:, j] = -s[:, j], s[:, i]
            axis = np.cross(np.eye(3)[i], np.eye(3)[j])
            motions.append(layout.rigid_motion(turn, axis / size))
    return np.stack(motions, axis=1)


def check_held(continuum: Continuum, supports: Supports) -> None:
    """Refuse a model that can move as a whole; collective.

    Raises:
        SolverError: It can.
    """
    held = rigid_motions(continuum)[supports.which >= 0]
    gram = continuum.comm.allreduce(held.T @ held)
    eigenvalues, vectors = np.linalg.eigh(gram)
    free = vectors[:, eigenvalues <= 1e-12 * max(float(eigenvalues[-1]), 1e-300)]
    if free.shape[1]:
        raise SolverError(f"{mumps_message(-10, 0)} (the supports leave the whole {_ways(free)})")


def _ways(free: Array) -> str:
    """What motions that nothing holds do, in words.

    Args:
        free: Coefficients of the rigid motions, shape (n_motions, n_free), orthonormal columns.
    """
    names = {1: ["y"], 3: ["x", "y"], 6: ["x", "y", "z"]}[len(free)]
    moves = [n for n, row in zip(names, free, strict=False) if row @ row > 1.0 - 1e-6]
    words = [f"free to move along {' and '.join(moves)}"] if moves else []
    if free.shape[1] > len(moves):
        words.append("free to turn")
    return ", and ".join(words)


def _least(a: Array, b: Array) -> Array:
    return np.minimum(a, b)


def _most(a: Array, b: Array) -> Array:
    return np.maximum(a, b)
