"""Free faces of the bodies in the ring around a tip, which the fields of the tip do not know.

The stress of a unit intensity factor has a traction t_a = s_a m there, and the interaction integral
has the further term

    - int t_a . (H q) dS

On the faces of a straight crack it is zero, and ahead of the tip both sides cancel. The faces of a
curved one leave the plane on which the fields of the tip are free of tractions, and count.
"""

from __future__ import annotations

import basix
import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.criteria.cell_laws import tensor_of_stress, voigt_strain
from fxcrack.criteria.crack_tip_fields import TipFields
from fxcrack.criteria.face_tractions import edge_quadrature
from fxcrack.criteria.front_ring import CellGeometry
from fxcrack.interface.front_cells import FrontCells
from fxcrack.interface.surface import closure_table, shape_functions


def outer_faces(
    cells: FrontCells,
    geometry: CellGeometry,
    q: Array,
    free: Bools,
    fields: TipFields,
    origin: Array,
    above: Bools,
    stiffness: Array,
    n_modes: int,
    thickness: float,
) -> Array:
    """The term as weights of the displacements of the cells' nodes.

    Args:
        cells: The cells of the ring.
        geometry: Their geometry.
        q: Extension at their corners, shape (n_cells, n_corners, gdim).
        free: Whether each facet of a cell is a free face that the fields of the tip may load, shape
            (n_cells, n_facets).
        fields: The crack-tip fields.
        origin: The tip, shape (3,) [length].
        above: Whether each cell is on the side the normal points to, shape (n_cells,).
        stiffness: Of each cell, shape (n_cells, 6, 6) [force/length^2].
        n_modes: Intensity factors that are needed.
        thickness: Thickness of a plane body, 1 otherwise [length].

    Returns:
        Shape (n_modes, n_cells, n_nodes, gdim).
    """
    gdim = geometry.gdim
    out = np.zeros((n_modes, *cells.nodes.shape, gdim))
    kind, table = closure_table(cells.cell_type, cells.order)
    corners = cells.facet_corners
    moves = np.abs(q).max(axis=2)[:, corners].max(axis=2) > 0.0
    chosen = free & moves
    if not chosen.any():
        return out
    points, weights = edge_quadrature(kind)
    values, slopes = shape_functions(kind, cells.order, points)
    linear, _ = shape_functions(kind, 1, points)
    x_nodes = node_positions(cells)
    centre = np.zeros((len(cells.nodes), 3))
    centre[:, :gdim] = cells.corners.mean(axis=1)
    for facet in np.flatnonzero(chosen.any(axis=0)):
        rows = np.flatnonzero(chosen[:, facet])
        local: Ints = table[facet]
        nodes = x_nodes[rows][:, local]
        x = np.einsum("qa,fac->fqc", values, nodes)
        tangents = np.einsum("dqa,fac->fqdc", slopes, nodes)
        area = np.cross(tangents[:, :, 0], _other(tangents))
        away = nodes.mean(axis=1) - centre[rows]
        area *= np.where(np.einsum("fqc,fc->fq", area, away) < 0.0, -1.0, 1.0)[..., None]
        size = weights * thickness
        if geometry.ring:
            size = size * 2.0 * np.pi * x[..., 0]
        shift = np.zeros((len(rows), len(weights), 3))
        n_linear = linear.shape[1]
        shift[..., :gdim] = np.einsum("qa,fac->fqc", linear, q[rows][:, corners[facet][:n_linear]])
        along = _along(tangents, shift, slopes)
        for side in (0, 1):
            here = np.flatnonzero(above[rows] == (side == 0))
            if not len(here):
                continue
            flat = (x[here] - origin).reshape(-1, 3)
            tip = fields.gradients(flat, side)[:n_modes].reshape(
                n_modes, len(here), len(weights), 3, 3
            )
            c = stiffness[rows[here]]
            stress = tensor_of_stress(np.einsum("fij,mfqj->mfqi", c, voigt_strain(tip)))
            force = np.einsum("mfqij,fqj->mfqi", stress, area[here])
            force = force * (size if size.ndim == 1 else size[here])[..., None]
            found = -np.einsum("mfqc,fqa->mfac", force[..., :gdim], along[here])
            # a row holds each node once
            out[:, rows[here][:, None], local[None]] += found
    return out


def node_positions(cells: FrontCells) -> Array:
    """Positions of the displacement nodes, shape (n_cells, n_nodes, 3) [length]."""
    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.equispaced
    n = next(
        d
        for d in (1, 2)
        if basix.create_element(family, cells.cell_type, d, variant).dim == cells.geometry.shape[1]
    )
    geometry = basix.create_element(family, cells.cell_type, n, variant)
    points = basix.create_element(family, cells.cell_type, cells.order, variant).points
    table = geometry.tabulate(0, points)[0, :, :, 0]
    out = np.zeros((*cells.nodes.shape, 3))
    out[..., : cells.geometry.shape[2]] = np.einsum("na,cai->cni", table, cells.geometry)
    return out


def _other(tangents: Array) -> Array:
    """The second tangent of facets, the direction out of the plane in 2-D."""
    if tangents.shape[2] == 2:
        return np.asarray(tangents[:, :, 1])
    out = np.zeros_like(tangents[:, :, 0])
    out[..., 2] = 1.0
    return out


def _along(tangents: Array, shift: Array, slopes: Array) -> Array:
    """Derivatives of shape functions along a vector in the facets, shape (n, n_points, n_nodes)."""
    gram = np.einsum("fqdc,fqec->fqde", tangents, tangents)
    right = np.einsum("fqdc,fqc->fqd", tangents, shift)[..., None]
    share = np.linalg.solve(gram, right)[..., 0]
    return np.asarray(np.einsum("fqd,dqa->fqa", share, slopes))
