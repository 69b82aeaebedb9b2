"""Pairing slave nodes with a rigid surface: gaps and normals from its formula, no master nodes.

The jump of a node is its displacement, so that nothing but gap and frame depends on where the
surface is. A plane has the same normal everywhere: its pairing holds for any displacement. On
curved surfaces normal and gap are those of the point below the node at the start, and with finite
strain those below its present position x,

    n . u + g = phi(x),    g = n . (X - foot),    foot = x - phi(x) n
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.generalised_plane_strain import GeneralisedPlaneStrain
from fxcrack.continuum.kinematics import Axisymmetric
from fxcrack.interface.frames import local_frames
from fxcrack.interface.pair import FACING, NEAR, Pair, has_slid
from fxcrack.interface.rigid import RigidSurface
from fxcrack.interface.surface import FacetSurface, facet_element


def check_symmetry(where: str, surface: RigidSurface, model: object) -> None:
    """Refuse a plane of symmetry that is none.

    Args:
        where: Beginning of the message.
        surface: The rigid surface.
        model: Model of the bodies.

    Raises:
        InterfaceError: Bodies of revolution, or strains out of the plane, are not mirrored by it.
    """
    _, normals = surface.measure(np.zeros((1, 3)))
    if isinstance(model, Axisymmetric) and abs(normals[0, 0]) > 1e-9:
        raise InterfaceError(
            f"{where}: {surface} is no plane of symmetry of bodies of revolution; its normal must "
            "be the axis, (0, 1) or (0, -1), or leave symmetry out"
        )
    if isinstance(model, GeneralisedPlaneStrain):
        # e_zz of the whole is even about the plane: it does not change along the normal
        for axis, name in enumerate(("curvature_x", "curvature_y")):
            if getattr(model, name) != 0.0 and abs(normals[0, axis]) > 1e-9:
                raise InterfaceError(
                    f"{where}: symmetry about {surface} does not allow {name} = "
                    f"{getattr(model, name)}: the strain out of the plane is alike on both sides "
                    f"of a plane of symmetry; give {name}=0.0 (the default), or model both halves"
                )


def _facing(surface: FacetSurface, normals: Array) -> Array:
    """Least cosine between a rigid surface's normal at a node and those of the facets around it.

    Args:
        surface: Slave surface.
        normals: Normals of the rigid surface at its nodes, shape (n_nodes, 3).

    Returns:
        Shape (n_nodes,): -1 where a facet lies flat on the rigid surface, be it beside a facet that
        stands upright on the same edge; 1 where there is no facet.
    """
    points = np.asarray(facet_element(surface.kind, surface.order).points)
    unit, _ = surface.facet_normals(points)
    out = np.ones(surface.n_nodes)
    np.minimum.at(out, surface.facets, np.einsum("fmc,fmc->fm", unit, normals[surface.facets]))
    return out


def find_partners(
    surface: RigidSurface,
    slave: FacetSurface,
    bonded: Bools,
    tolerance: float,
    where: str,
    continuum: Continuum,
) -> tuple[Bools, Array, Array]:
    """Slave nodes that lie on a rigid surface, with normals and gaps there.

    Args:
        surface: The rigid surface.
        slave: Slave surface.
        bonded: Its bonded nodes, shape (n_nodes,).
        tolerance: Largest distance of a node that is paired, length.
        where: Beginning of messages.
        continuum: The bodies.

    Returns:
        Whether nodes are paired, shape (n_nodes,); unit normals, shape (n_nodes, 3); gaps, shape
        (n_nodes,), length.

    Raises:
        InterfaceError: A bonded node is away from the surface, or the body is on its other side.
    """
    surface.check_model(where, continuum.model, continuum.gdim)
    gap, normals = surface.measure(slave.x)
    near = np.abs(gap) <= tolerance
    facing = _facing(slave, normals)
    there = bonded & near if np.any(bonded & near) else near
    behind = there & (facing > -FACING)
    if np.any(behind) and 2 * int(behind.sum()) >= int(there.sum()):
        side = "reverse its normal" if surface.flat else "exchange inside=True and False"
        i = int(np.argmax(behind))
        raise InterfaceError(
            f"{where}: the body is on the wrong side of the {surface}: at "
            f"{format_point(slave.x[i])} the outward normal of '{slave.name}' is "
            f"{format_point(slave.normals[i])}, and that of the rigid surface, "
            f"{format_point(normals[i])}, must be opposite; {side}, or name the surface of the "
            "body that faces it"
        )
    paired = near & (facing < FACING)
    lost = bonded & ~paired
    if np.any(lost):
        far = np.where(lost, np.abs(gap), -1.0)
        i = int(np.argmax(far))
        why = (
            f"the farthest at {format_point(slave.x[i])} by {abs(gap[i]):.3g} (search tolerance "
            f"{tolerance:.3g})"
            if far[i] > tolerance
            else f"one of them at {format_point(slave.x[i])}, where the two do not face each other"
        )
        raise InterfaceError(
            f"{where}: {int(lost.sum())} bonded slave nodes do not lie on the {surface}, {why}; "
            "move the surface to them, take them out of the bonded set, or raise "
            "Interface(tolerance=...)"
        )
    through = ~paired & (gap < -tolerance) & (facing < FACING)
    if np.any(through):
        i = int(np.argmin(np.where(through, gap, np.inf)))
        raise InterfaceError(
            f"{where}: {int(through.sum())} slave nodes lie behind the {surface}, the farthest at "
            f"{format_point(slave.x[i])} by {-gap[i]:.3g} (search tolerance {tolerance:.3g}); move "
            "the surface, or name a slave surface that lies in front of it"
        )
    return paired, normals, gap


def renewed_on(
    pair: Pair, bonded: Bools, u_slave: Array, pressed: Bools | None = None, *,
    turned: float | None = None,
) -> Pair | None:  # fmt: skip
    """A pair with normals and gaps of its open nodes where they are now.

    Args:
        pair: The pair as it is, with a rigid master.
        bonded: Slave nodes that are bonded now, or whose bonds still pull, shape (n_nodes,).
        u_slave: Displacements of the slave nodes, shape (n_nodes, gdim), length.
        pressed: Nodes that are in contact, which follow the smallest change, shape (n_nodes,);
            ``None`` where that is not known.
        turned: Angle by which the normal below a node turns before it is paired anew, in place of
            what is chosen otherwise.

    Returns:
        ``None`` if no gap that may close has changed enough to matter.
    """
    surface = pair.rigid
    assert surface is not None
    gdim = u_slave.shape[1]
    x = pair.surface.x.copy()
    x[:, :gdim] += u_slave
    distance, normals = surface.measure(x)
    facing = _facing(pair.whole_surface.moved(x), normals) < FACING
    over = ~bonded & (pair.paired | facing)
    near = over & (distance < NEAR * pair.surface.facet_size)
    turn = np.linalg.norm(normals[:, :gdim] - pair.frames[:, :, 0], axis=1)
    slid = has_slid(turn, pressed) if turned is None else turn > turned
    if not np.any(near & (slid | ~pair.paired)):
        return None
    if surface.flat:
        over &= ~pair.paired  # the gaps of all others are as they were
    frames, gaps = pair.frames.copy(), pair.gap.copy()
    frames[over] = local_frames(normals, gdim)[over]
    foot = x - distance[:, None] * normals
    gaps[over] = np.einsum("nc,nc->n", pair.surface.x - foot, normals)[over]
    return replace(pair, paired=pair.paired | over, frames=frames, gap=gaps)
