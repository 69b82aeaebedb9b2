"""Surface-to-surface weights: the slave follows the master on the mean over its facets (mortar).

With dual shape functions psi_s of the slave surface, of which each meets the shape function of its
own node only,

    int psi_s N_t dA = delta_st D_s,    D_s = int N_s dA,    W_sm = int psi_s N_m dA / D_s,

u_s = sum_m W_sm u_m makes the two surfaces equal on the mean, int psi_s (u_slave - u_master) = 0.
On each facet psi = D M^-1 N with M = int N N^t dA, so no system of equations is to be solved. The
psi add up to 1 where the master lies under the slave: a uniform traction t gives master node m the
force t sum_s int psi_s N_m = t int N_m, and linear fields come through unchanged; both hold
whichever side is the slave, in contrast to the projection of single nodes. All integrals run over
the segments the surfaces share (:mod:`fxcrack.interface.segments`), as does D where the master ends
under a facet, so that psi adds up to 1 on what has a partner.

The corner functions of second-order triangles have no integral. Dual functions are taken to
first-order corner functions and second-order ones of the midside nodes, which span the same space.

Sources: Wohlmuth 2000 (dual functions), Puso and Laursen 2004 (segments), Popp, Wohlmuth, Gee, Wall
2012 (second order), Cichosz and Bischoff 2011 (facets that are covered in part).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.projection import Projection
from fxcrack.interface.segments import find_segments
from fxcrack.interface.surface import FacetSurface, shape_functions

_COVERED = 0.02
"""Least part of a facet that must have a master under it; below, the facet does not take part."""
_NOTHING = 1e-13
"""Weights below this are round-off."""


@dataclass(frozen=True)
class SurfaceWeights:
    """Weights of slave nodes on the nodes of the master surface.

    Attributes:
        masters: Nodes of the master surface, padded by repetition, shape (n_nodes, k).
        weights: Their weights, rows sum to 1, shape (n_nodes, k).
        whole: Nodes whose weights are means over facets; the others have those of their foot
            point, shape (n_nodes,).
    """

    masters: Ints
    weights: Array
    whole: Bools


def surface_weights(
    slave: FacetSurface, master: FacetSurface, foot: Projection, tolerance: float
) -> SurfaceWeights:
    """Weights of all slave nodes.

    Args:
        slave: Slave surface.
        master: Master surface.
        foot: Projections of the slave nodes, which hold for nodes without a facet that the master
            lies under.
        tolerance: How far the surfaces may be from each other, length.
    """
    found = find_segments(slave, master, tolerance)
    n, k, k_master = slave.n_nodes, slave.facets.shape[1], master.facets.shape[1]
    basis = _dual_basis(slave)
    values = shape_functions(slave.kind, slave.order, found.slave_xi)[0] @ basis.T
    under = shape_functions(master.kind, master.order, found.master_xi)[0]
    breadth = np.einsum(
        "qk,qk->q",
        shape_functions(slave.kind, slave.order, found.slave_xi)[0],
        slave.breadth[slave.facets[found.slave]],
    )
    weight = found.weight * breadth

    n_facets = len(slave.facets)
    mass = np.zeros((n_facets, k, k))
    np.add.at(mass, found.slave, weight[:, None, None] * values[:, :, None] * values[:, None, :])
    own = np.zeros((n_facets, k))
    np.add.at(own, found.slave, weight[:, None] * values)
    covered = np.bincount(found.slave, found.weight, n_facets)
    takes_part = covered > _COVERED * _facet_areas(slave)
    dual = np.zeros((n_facets, k, k))
    dual[takes_part] = own[takes_part, :, None] * np.linalg.inv(mass[takes_part])

    # per pair of facets int psi N_m, then over all of them
    pair, inverse = np.unique(found.slave * len(master.facets) + found.master, return_inverse=True)
    product = np.zeros((len(pair), k, k_master))
    np.add.at(product, inverse, weight[:, None, None] * values[:, :, None] * under[:, None, :])
    s, m = np.divmod(pair, len(master.facets))
    block = dual[s] @ product
    rows = np.broadcast_to(slave.facets[s][:, :, None], block.shape)
    columns = np.broadcast_to(master.facets[m][:, None, :], block.shape)
    total = np.zeros(n)
    np.add.at(total, slave.facets, np.where(takes_part[:, None], own, 0.0))
    matrix = sp.csr_matrix(
        (block.ravel(), (rows.ravel(), columns.ravel())), shape=(n, master.n_nodes)
    )
    whole = total > 0.0
    matrix = sp.diags(1.0 / np.where(whole, total, 1.0)) @ matrix
    matrix, whole = _nodal(slave, sp.csr_matrix(matrix), whole)
    return _padded(matrix, whole, master.facets[foot.facet], foot.weights)


def _dual_basis(slave: FacetSurface) -> Array:
    """Functions with positive integrals, as combinations of the shape functions, shape (k, k)."""
    basis = np.eye(slave.facets.shape[1])
    if _has_linear_corners(slave):
        for middle, ends in _MIDSIDE.items():
            basis[list(ends), middle] = 0.5
    return basis


_MIDSIDE = {3: (1, 2), 4: (0, 2), 5: (0, 1)}
"""Midside nodes of a second-order triangle and the corners beside them."""


def _has_linear_corners(surface: FacetSurface) -> bool:
    """Whether corners have first-order functions in the dual basis."""
    return surface.kind == "triangle" and surface.order == 2


def _nodal(slave: FacetSurface, matrix: sp.csr_matrix, whole: Bools) -> tuple[sp.csr_matrix, Bools]:
    """Weights of displacements of nodes from those of the functions of :func:`_dual_basis`."""
    if not _has_linear_corners(slave):
        return matrix, whole
    rows, columns = [], []
    for middle, ends in _MIDSIDE.items():
        for end in ends:
            rows.append(slave.facets[:, middle])
            columns.append(slave.facets[:, end])
    links = np.unique(np.stack([np.concatenate(rows), np.concatenate(columns)]), axis=1)
    n = slave.n_nodes
    half = sp.csr_matrix((np.full(links.shape[1], 0.5), links), shape=(n, n))
    # a midside node needs both corners beside it
    good = whole & (half @ (~whole).astype(float) == 0.0)
    return sp.csr_matrix(matrix + half @ matrix), good


def _facet_areas(surface: FacetSurface) -> Array:
    """Areas of the facets on their chords or mean planes, without breadth, shape (n_facets,)."""
    corner = surface.x[surface.facets[:, : surface.n_corners]]
    if surface.dim == 1:
        return np.asarray(np.linalg.norm(corner[:, 1] - corner[:, 0], axis=1))
    # half the product of the diagonals, or of two edges
    one = corner[:, -1] - corner[:, 0]
    return np.asarray(0.5 * np.linalg.norm(np.cross(one, corner[:, 2] - corner[:, 1]), axis=1))


def _padded(
    matrix: sp.csr_matrix, whole: Bools, at_foot: Ints, foot_weights: Array
) -> SurfaceWeights:
    """Rows of equal length: those of the matrix, and foot points where there are none."""
    matrix.sum_duplicates()
    matrix.data[np.abs(matrix.data) < _NOTHING] = 0.0
    matrix.eliminate_zeros()
    matrix.sort_indices()
    counts = np.where(whole, np.diff(matrix.indptr), 0)
    width = max(int(counts.max(initial=0)), at_foot.shape[1])
    masters = np.repeat(at_foot[:, :1], width, axis=1)
    weights = np.zeros(masters.shape)
    points = np.flatnonzero(~whole)
    masters[points, : at_foot.shape[1]] = at_foot[points]
    weights[points, : at_foot.shape[1]] = foot_weights[points]
    rows = np.repeat(np.arange(len(whole)), np.diff(matrix.indptr))
    places = np.arange(len(rows)) - matrix.indptr[rows]
    used = whole[rows]
    masters[rows[used], places[used]] = matrix.indices[used]
    weights[rows[used], places[used]] = matrix.data[used]
    weights /= weights.sum(axis=1, keepdims=True)
    return SurfaceWeights(masters, weights, whole)
