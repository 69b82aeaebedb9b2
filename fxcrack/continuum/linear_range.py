"""What the displacement of linear bodies says against the assumptions it was found with.

Rotations. The strain of linear bodies is e = (H + H^t)/2, H the gradient of the displacement. What
it leaves out of the Green-Lagrange strain is H^t H / 2: w^2/2 where a part of a body turns by the
angle w and hardly strains. Lever arms and lengths err by about as much, and tension or pressure in
thin parts, which stiffens or weakens them as they turn, has no effect at all.

First-order triangles. Their strain is constant in each cell, so that in bending it jumps from cell
to cell and they are far too stiff. (Tetrahedra are told by their shape,
:mod:`fxcrack.interface.locking`.) The difference between the strain and its mean over the cells at
the nodes estimates the error (O. C. Zienkiewicz, J. Z. Zhu, A simple error estimator and adaptive
procedure for practical engineering analysis, Int. J. Numer. Meth. Engng 24 (1987) 337-357): its
square over that of the strain is the part of the energy that belongs to the error.
"""

from __future__ import annotations

from fxcrack.base import compat  # noqa: F401  # isort: skip  (orders MPI before DOLFINx)
import dolfinx.la
import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.continuum.cell_gradients import CellGradients
from fxcrack.continuum.continuum import Continuum

LARGE = 0.2
"""Rotation in radians that is not small: half its square is 2 %."""
LARGE_STRAIN = 0.05
"""Strain that is not small in bodies that yield: stresses err by 5 %."""
ENOUGH = 10_000
"""Cells of a rank whose rotation is looked at, about; all below twice as many."""
STIFF = 0.1
"""Part of the energy that belongs to the error beyond which triangles are warned of."""


def largest_rotation(continuum: Continuum, cells: CellGradients) -> float:
    """Largest rotation at the middle of a cell, radians; collective, the same on every rank."""
    turn = 0.5 * (cells.gradient - np.swapaxes(cells.gradient, 1, 2))
    # each component of the rotation stands twice in the antisymmetric part
    angle = np.sqrt(0.5 * np.einsum("cij,cij->c", turn, turn))
    return float(max(continuum.comm.allgather(float(angle.max(initial=0.0)))))


def error_of_triangles(continuum: Continuum, cells: CellGradients) -> float:
    """Part of the energy of first-order triangles that belongs to their error; collective.

    Strains are averaged over the cells of one material only, as they may jump between two.

    Args:
        continuum: Solid bodies of first-order triangles.
        cells: Gradients of the displacement.

    Returns:
        Between 0 and 1, the same on every rank up to round-off; 0 without strain.
    """
    strain = 0.5 * (cells.gradient + np.swapaxes(cells.gradient, 1, 2))
    index_map, size = continuum.space.dofmap.index_map, continuum.gdim**2 + 1
    error = whole = 0.0
    for part in continuum.part_cells:
        mine = part[part < len(cells.volume)]
        volume, nodes = cells.volume[mine], cells.nodes[mine]
        e = strain[mine].reshape(len(mine), continuum.gdim**2)
        sums = dolfinx.la.vector(index_map, size)
        table = sums.array.reshape(-1, size)
        table[:] = 0.0
        given = np.column_stack([e * volume[:, None], volume])
        for corner in nodes.T:
            np.add.at(table, corner, given)
        sums.scatter_reverse(dolfinx.la.InsertMode.add)
        sums.scatter_forward()
        at_corners = sums.array.reshape(-1, size)[nodes]
        mean = (at_corners[:, :, :-1] / at_corners[:, :, -1:]).mean(axis=1)
        error += float(volume @ ((mean - e) ** 2).sum(axis=1))
        whole += float(volume @ (e**2).sum(axis=1))
    error, whole = np.sum(continuum.comm.allgather((error, whole)), axis=0)
    return float(min(error / whole, 1.0)) if whole > 0.0 else 0.0


def warn_of_range(continuum: Continuum, displacement: Array, said: set[str]) -> None:
    """Warn, once each, where linear bodies have left what they assume; collective.

    Args:
        continuum: Solid bodies whose strain is small.
        displacement: Of the dofs that this rank owns, shape (n_local,), length.
        said: What was warned of before, "rotation" or "triangles"; it is added to.
    """
    domain = continuum.mesh.domain
    triangles = continuum.order == 1 and domain.topology.cell_name() == "triangle"
    n_cells = int(domain.topology.index_map(continuum.mesh.tdim).size_local)
    # rotations change little from cell to cell; the error of triangles is a sum over all
    every = 1 if triangles else max(1, n_cells // ENOUGH)
    cells = CellGradients.of(continuum, displacement, every=every)
    angle = largest_rotation(continuum, cells)
    if angle > LARGE and "rotation" not in said:
        said.add("rotation")
        log.warn(
            "parts of the bodies have turned by up to %.2g radians, and linear bodies take "
            "rotations as small: lengths and lever arms err by up to about %.2g %%, and tension or "
            "pressure in thin parts neither stiffens nor weakens them; give the Scene "
            "effects=[FiniteStrain()]",
            angle,
            50.0 * angle**2,
        )
    if triangles and "triangles" not in said:
        part = error_of_triangles(continuum, cells)
        if part > STIFF:
            said.add("triangles")
            log.warn(
                "the strains of first-order triangles jump between neighbouring cells, as in "
                "bending, and %.2g of the strain energy belongs to that error: the bodies are too "
                "stiff; give the Scene order=2, or take quadrilaterals",
                part,
            )


def warn_of_large_strain(continuum: Continuum, displacement: Array, said: set[str]) -> None:
    """Warn once where bodies that yield have left small strain; collective.

    The strain of plasticity is e = (H + H^t)/2 as well: beside what rotations cost, stresses and
    areas err by about the strain itself.

    Args:
        continuum: Solid bodies, some of which yield.
        displacement: Of the dofs that this rank owns, shape (n_local,), length.
        said: What was warned of before, "large strain"; it is added to.
    """
    n_cells = int(continuum.mesh.domain.topology.index_map(continuum.mesh.tdim).size_local)
    cells = CellGradients.of(continuum, displacement, every=max(1, n_cells // ENOUGH))
    angle = largest_rotation(continuum, cells)
    strain = 0.5 * (cells.gradient + np.swapaxes(cells.gradient, 1, 2))
    mine = float(np.abs(np.linalg.eigvalsh(strain)).max(initial=0.0))
    largest = float(max(continuum.comm.allgather(mine)))
    if (angle > LARGE or largest > LARGE_STRAIN) and "large strain" not in said:
        said.add("large strain")
        log.warn(
            "bodies that yield have strained by up to %.2g and turned by up to %.2g radians, and "
            "plasticity is for small strain and rotation: stresses and lengths err by up to about "
            "%.2g %%",
            largest,
            angle,
            100.0 * max(largest, 0.5 * angle**2),
        )


__all__ = ["error_of_triangles", "largest_rotation", "warn_of_large_strain", "warn_of_range"]
