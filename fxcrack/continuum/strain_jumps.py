"""How much of the strain energy belongs to jumps of the strain between cells, at any order.

The strain of finite elements jumps between cells, the true one does not. The recovered strain is
linear between the mean values of the cells at each corner; what it differs by from the strain
estimates the error (O. C. Zienkiewicz, J. Z. Zhu, A simple error estimator and adaptive procedure
for practical engineering analysis, Int. J. Numer. Meth. Engng 24 (1987) 337-357). Its energy over
that of the strain is the part by which bodies are too stiff.

For triangles and tetrahedra of first order :mod:`fxcrack.continuum.linear_range` has the same
without quadrature.
"""

from __future__ import annotations

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import dolfinx.la
import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import Axisymmetric, Model
from fxcrack.continuum.materials import Material, stiffness_of
from fxcrack.continuum.temperature_field import entries


def part_of_jumps(continuum: Continuum, displacement: Array) -> float:
    """Part of the strain energy that belongs to jumps of the strain; collective.

    Strains are averaged over the cells of one material only, as they may jump between two.

    Args:
        continuum: Solid bodies.
        displacement: Of the dofs that this rank owns, shape (n_local,), length.

    Returns:
        Between 0 and 1, the same on every rank; 0 without strain.
    """
    domain, gdim = continuum.mesh.domain, continuum.gdim
    u = fem.Function(continuum.space)
    u.x.array[: len(displacement)] = displacement
    u.x.scatter_forward()
    n = int(domain.topology.index_map(continuum.mesh.tdim).size_local)
    nodes = np.asarray(continuum.space.dofmap.list)[:n].astype(np.int64)
    values = u.x.array.reshape(-1, gdim)[nodes]
    x = domain.geometry.x[compat.geometry_dofmap(domain)[:n]][:, :, :gdim]
    cell = getattr(basix.CellType, domain.topology.cell_name())
    corners = basix.geometry(cell)
    points, weights = basix.make_quadrature(cell, 2 * continuum.order)
    linear = _table(cell, 1, points, 0)[0]

    def strains(at: Array) -> tuple[Array, Array]:
        """Strains at points of the cells, and the volume per reference volume there."""
        jacobian = np.einsum("cni,jpn->cpij", x, _table(cell, continuum.mesh.order, at, 1)[1:])
        moved = np.einsum("cni,jpn->cpij", values, _table(cell, continuum.order, at, 1)[1:])
        gradient = moved @ np.linalg.inv(jacobian)
        e = 0.5 * (gradient + np.swapaxes(gradient, 2, 3))
        return e.reshape(*e.shape[:2], gdim**2), np.abs(np.linalg.det(jacobian))

    at_corners, size = strains(np.asarray(corners))
    inside, volume = strains(np.asarray(points))
    volume = volume * weights
    own = nodes[:, : len(corners)]  # the first nodes of a cell are its corners
    error = whole = 0.0
    for part, material in zip(continuum.part_cells, continuum.part_materials, strict=True):
        mine = part[part < n]
        moduli = _moduli(continuum.model, material)
        sums = dolfinx.la.vector(continuum.space.dofmap.index_map, gdim**2 + 1)
        table = sums.array.reshape(-1, gdim**2 + 1)
        table[:] = 0.0
        weight = size[mine][..., None]
        given = np.concatenate([at_corners[mine] * weight, weight], axis=2)
        np.add.at(table, own[mine].ravel(), given.reshape(-1, gdim**2 + 1))
        sums.scatter_reverse(dolfinx.la.InsertMode.add)
        sums.scatter_forward()
        mean = sums.array.reshape(-1, gdim**2 + 1)[own[mine]]
        smooth = np.einsum("pk,cke->cpe", linear, mean[..., :-1] / mean[..., -1:])
        error += _energy(volume[mine], smooth - inside[mine], moduli)
        whole += _energy(volume[mine], inside[mine], moduli)
    error, whole = np.sum(continuum.comm.allgather((error, whole)), axis=0)
    return float(min(error / whole, 1.0)) if whole > 0.0 else 0.0


def _energy(volume: Array, strain: Array, moduli: Array) -> float:
    """Twice the energy of strains at points, shapes (n, n_points) and (n, n_points, gdim^2)."""
    return float(np.einsum("cp,cpi,cpi->", volume, strain @ moduli, strain))


def _moduli(model: Model, material: Material) -> Array:
    """Stiffness on all components of a strain tensor, shape (gdim^2, gdim^2).

    Of a material tabulated against temperature the first entry; the hoop strain of a ring, which
    follows from the displacement itself, is left out.
    """
    c = model.reduce(stiffness_of(entries(material)[0]))
    if isinstance(model, Axisymmetric):
        c = np.delete(np.delete(c, 2, axis=0), 2, axis=1)
    n = model.gdim
    pairs = [(i, i) for i in range(n)] + ([(1, 2), (0, 2), (0, 1)] if n == 3 else [(0, 1)])
    to_voigt = np.zeros((len(pairs), n, n))
    for k, (i, j) in enumerate(pairs):
        to_voigt[k, i, j] = to_voigt[k, j, i] = 1.0  # engineering shears
    flat = to_voigt.reshape(len(pairs), n * n)
    return np.asarray(flat.T @ c @ flat)


def _table(cell: basix.CellType, order: int, at: Array, derivatives: int) -> Array:
    """Lagrange shape functions and derivatives at points, shape (1 + tdim or 1, n_points, n)."""
    element = basix.create_element(
        basix.ElementFamily.P, cell, order, basix.LagrangeVariant.gll_warped
    )
    return np.asarray(element.tabulate(derivatives, at)[:, :, :, 0])


__all__ = ["part_of_jumps"]
