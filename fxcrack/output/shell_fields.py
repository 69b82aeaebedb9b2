"""Fields of shells for ParaView: both faces of each section as sheets of their own."""

from __future__ import annotations

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.plot
import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_stress import shell_stress
from fxcrack.output.vtu import Grid

_VTK = (0, 1, 2, 5, 3, 4)
"""Voigt components in VTK's order of a symmetric tensor: xx yy zz xy yz xz."""


def shell_grid(shell: ShellBodies, u: fem.Function, *, finite: bool) -> Grid:
    """This rank's cells at X + z D on bottom and top, with u + z w, stresses and section forces.

    Args:
        shell: The shells.
        u: Their unknowns.
        finite: Whether strains are those of large rotations.
    """
    topology, kinds, _ = dolfinx.plot.vtk_mesh(shell.space)
    width = shell.space.dofmap.dof_layout.num_dofs
    rows = np.asarray(topology).reshape(-1, width + 1)[:, 1:]
    q = u.x.array.reshape(-1, 6)
    x, directors = shell.positions(), shell.directors
    points: list[Array] = []
    cells: list[np.ndarray[tuple[int, int], np.dtype[np.int64]]] = []
    at_points: dict[str, list[Array]] = {"displacement": [], "director": []}
    at_cells: dict[str, list[Array]] = {
        name: [] for name in ("stress", "von_mises", "side", "section_force", "section_moment")
    }
    first = 0
    for part, found in zip(
        shell.shell_parts, shell_stress(shell, u.x.array, finite=finite), strict=True
    ):
        nodes, renumbered = np.unique(rows[part.cells], return_inverse=True)
        for stress, side in zip(found.faces, ("bottom", "top"), strict=True):
            z = part.section.face(side)
            points.append(x[nodes] + z * directors[nodes])
            cells.append(first + renumbered.reshape(-1, width))
            first += len(nodes)
            at_points["displacement"].append(q[nodes, :3] + z * q[nodes, 3:])
            at_points["director"].append(directors[nodes] + q[nodes, 3:])
            at_cells["stress"].append(stress[:, _VTK])
            at_cells["von_mises"].append(_von_mises(stress))
            at_cells["side"].append(np.full(len(stress), 1.0 if side == "top" else -1.0))
            at_cells["section_force"].append(found.forces[:, [0, 1, 5, 3, 4]])
            at_cells["section_moment"].append(found.forces[:, [6, 7, 11]])
    return Grid(
        points=np.concatenate(points),
        cells=np.concatenate(cells),
        kind=int(kinds[0]) if len(kinds) else 0,
        point_data={name: np.concatenate(values) for name, values in at_points.items()},
        cell_data={name: np.concatenate(values) for name, values in at_cells.items()},
        components={
            "stress": [shell.model.stress_labels[i] for i in _VTK],
            "section_force": ["N11", "N22", "N12", "Q2", "Q1"],
            "section_moment": ["M11", "M22", "M12"],
        },
    )


def _von_mises(s: Array) -> Array:
    a, b, c = s[:, :3].T
    shear = (s[:, 3:] ** 2).sum(axis=1)
    return np.asarray(np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3.0 * shear))


__all__ = ["shell_grid"]
