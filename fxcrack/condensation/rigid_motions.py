"""Whether the supports, and rigid surfaces, hold the bodies against moving as one rigid whole.

The rigid motions of the model, restricted to the supported displacement components, must be
linearly independent: their smallest singular value must not vanish. The check needs no
factorisation and does not depend on what a direct solver notices. Whether each body is held, by
supports and bonds, is answered by :mod:`fxcrack.condensation.free_bodies`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import SolverError
from fxcrack.condensation.mumps_schur import mumps_message
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import Axisymmetric
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports

_UNSEEN = 1e-8
"""A motion is free of which the supports see no more than this part of what they see of others."""


def rigid_motions(continuum: Continuum) -> Array:
    """Rigid motions on the owned dofs, scaled to unit length, shape (n_local, n_motions)."""
    gdim, layout = continuum.gdim, continuum.layout
    x = continuum.positions()[: layout.n_owned, :gdim]
    low = continuum.comm.allreduce(x.min(axis=0, initial=np.inf), op=_least)
    high = continuum.comm.allreduce(x.max(axis=0, initial=-np.inf), op=_most)
    size = max(float((high - low).max()), 1e-300)
    one = np.zeros(len(x), dtype=np.int64)
    return motions_of(continuum, one, 0.5 * (low + high)[None], np.array([size]))


def motions_of(continuum: Continuum, body: Ints, centre: Array, size: Array) -> Array:
    """Rigid motions of bodies on the owned dofs, each about its centre and scaled by its size.

    Args:
        continuum: The bodies.
        body: Number of the body of each owned node (further nodes are ignored), shape (n,).
        centre: Centre of each body, shape (n_bodies, gdim), length.
        size: Size of each body, shape (n_bodies,), length.

    Returns:
        Shape (n_local, n_motions); translations move by 1, rotations by 1 at a distance of the
        size.
    """
    gdim, layout = continuum.gdim, continuum.layout
    body = body[: layout.n_owned]
    x = continuum.positions()[: layout.n_owned, :gdim]
    s = (x - centre[body]) / size[body][:, None]
    motions, still = [], np.zeros(3)
    if isinstance(continuum.model, Axisymmetric):
        motions.append(layout.rigid_motion(np.tile([0.0, 1.0], (len(s), 1)), still))
    else:
        motions += [layout.rigid_motion(np.tile(e, (len(s), 1)), still) for e in np.eye(gdim)]
        # a section that turns about an axis in its plane shears
        planes = [(0, 1)] if continuum.mesh.gdim == 2 else [(0, 1), (1, 2), (0, 2)]
        for i, j in planes:
            turn = np.zeros((len(s), gdim))
            turn[:, i], turn[:, j] = -s[:, j], s[:, i]
            axis = np.cross(np.eye(3)[i], np.eye(3)[j])
            motions.append(layout.rigid_motion(turn, axis / size[body][:, None]))
    return np.stack(motions, axis=1)


def held_dofs(continuum: Continuum, supports: Supports) -> Ints:
    """Owned dofs that supports or a foundation hold, sorted."""
    held = supports.which >= 0
    nodes, layout = continuum.weakly_held, continuum.layout
    for i in range(layout.n_unknowns if len(nodes) else 0):
        held[layout.dof(nodes, i)] = True
    return np.flatnonzero(held)


def _at_rigid(continuum: Continuum, pair: Pair, motions: Array) -> Array:
    """Motions of this rank's nodes that a rigid surface holds or may hold, across it or in all.

    Args:
        continuum: The bodies.
        pair: An interface with a rigid master.
        motions: Rigid motions, shape (n_local, n_motions).

    Returns:
        Shape (n, n_motions).
    """
    layout, gdim = continuum.layout, continuum.gdim
    dofs = pair.surface.dofs
    touches = pair.bonded | pair.interface.contact
    mine = np.flatnonzero(layout.is_owned(dofs) & pair.paired & touches)
    local = layout.to_local(dofs[mine])
    moved = motions[layout.dof(local[:, None], np.arange(gdim))]
    if pair.surface.point_maps is not None:
        maps = pair.surface.point_maps[mine]
        moved = np.einsum("ncj,njm->ncm", maps, motions[layout.dofs(local)])
    moved = np.einsum("nci,ncm->nim", pair.frames[mine], moved)
    holds = np.ones((len(mine), gdim), dtype=bool)
    holds[:, 1:] = (pair.bonded[mine] & (not pair.interface.normal_only))[:, None]
    return np.asarray(moved[holds])


def check_held(continuum: Continuum, supports: Supports, pairs: Sequence[Pair] = ()) -> None:
    """Refuse a model that can move as a whole; collective.

    Args:
        continuum: The bodies.
        supports: Prescribed components.
        pairs: Interfaces; those with a rigid master hold the bodies as well.

    Raises:
        SolverError: It can.
    """
    motions = rigid_motions(continuum)
    held = motions[held_dofs(continuum, supports)]
    rigid = [_at_rigid(continuum, pair, motions) for pair in pairs if pair.rigid is not None]
    held = np.concatenate([held, *rigid])
    if supports.following is not None:
        held = np.concatenate([held, supports.following.residual(continuum.layout, motions)])
    triangles = continuum.comm.allgather(np.linalg.qr(held, mode="r"))
    none = np.zeros((held.shape[1],) * 2)
    _, seen, vectors = np.linalg.svd(np.vstack([none, *triangles]), full_matrices=False)
    free = vectors[seen <= _UNSEEN * max(float(seen[0]), 1e-300)].T
    if free.shape[1]:
        raise SolverError(
            f"{mumps_message(-10, 0)} (the supports leave the whole model {ways(free)})"
        )


def ways(free: Array) -> str:
    """What motions that nothing holds do, in words.

    Args:
        free: Coefficients of the rigid motions, shape (n_motions, n_free), orthonormal columns.
    """
    names = {1: ["y"], 3: ["x", "y"], 4: ["x", "y", "z"], 6: ["x", "y", "z"]}[len(free)]
    moves = [n for n, row in zip(names, free, strict=False) if row @ row > 1.0 - 1e-6]
    words = [f"free to move along {' and '.join(moves)}"] if moves else []
    if free.shape[1] > len(moves):
        words.append("free to turn" + _about(free))
    return ", and ".join(words)


def _about(free: Array) -> str:
    """The direction of the axis, in words, where all turns of a body in space have one."""
    if len(free) < 6:
        return ""
    # the turns of motions_of are about z, x and -y
    axes, seen, _ = np.linalg.svd(free[[4, 5, 3]] * [[1.0], [-1.0], [1.0]])
    if seen[0] < 1e-3 or (len(seen) > 1 and seen[1] > 1e-6):
        return ""
    axis = axes[:, 0]
    axis *= np.sign(axis[np.flatnonzero(np.abs(axis) > 1e-3)[0]])
    return f" about an axis along ({', '.join(f'{c + 0.0:g}' for c in np.round(axis, 3))})"


def _least(a: Array, b: Array) -> Array:
    return np.minimum(a, b)


def _most(a: Array, b: Array) -> Array:
    return np.maximum(a, b)
