"""Strain and stress of each ply of a continuum shell, and its section forces, after a run.

A cell holds its plies as one stiffness over the thickness, with the moments of the plies. Strains
in the plane and shears across it are those of the displacement of the cell, continuous over the
thickness. Across the plies it is the normal stress that is continuous: that of the cell, linear
over the thickness (its moments of order 0 and 1), and the strain of each ply follows from it. Each
ply's stress is that of its own stiffness. Values are means over the 2 x 2 points in the plane of a
cell at which it is integrated and where they are most accurate.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
import ufl
from dolfinx import fem

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.base.files import replacing
from fxcrack.continuum.kinematics import green_lagrange
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.ply import square_strain
from fxcrack.continuum.shell_cells import ShellCells
from fxcrack.continuum.shell_hexahedron import values as shapes
from fxcrack.continuum.tied_cells import TiedCells
from fxcrack.output.fields import displacement_function
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of

LABELS = ("11", "22", "33", "23", "13", "12")
PLACES = ("bottom", "middle", "top")
_SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0
"""Exact for the moments of stresses that are quadratic over a ply."""


@dataclass(frozen=True)
class PlyResults:
    """Strains and stresses of the plies of a group of cells, the same on every rank.

    One row for each ply of each cell, cells in input order, plies from the bottom. The second axis
    of positions, strains and stresses is the place in the ply: bottom, middle, top. Voigt order
    11, 22, 33, 23, 13, 12 in the axes of the ply, engineering shears. At finite strain these are
    the Green-Lagrange strain and the second Piola-Kirchhoff stress. Strains are whole, with the
    thermal ones. Stresses 23 and 13 carry the
    shear factors: their integral over the thickness is the shear force, their distribution is not
    that of equilibrium.

    Attributes:
        cell: Number of the cell in the input, shape (n_rows,).
        ply: Number of the ply from the bottom of the laminate, from 0, shape (n_rows,).
        angle: Of the ply, degrees, shape (n_rows,).
        x: Positions, shape (n_rows, 3, 3), length.
        strain: Shape (n_rows, 3, 6).
        stress: Shape (n_rows, 3, 6), force/length^2.
        forces: Forces per width of each cell about its middle, in laminate axes: N11, N22, N12,
            M11, M22, M12, Q13, Q23; shape (n_cells, 8), force/length and force.
        centres: Centres of the cells, shape (n_cells, 3), length.
    """

    cell: Ints
    ply: Ints
    angle: Array
    x: Array
    strain: Array
    stress: Array
    forces: Array
    centres: Array

    def of_ply(self, ply: int) -> dict[str, Array]:
        """Positions, strains and stresses of one ply, rows by cell.

        Args:
            ply: From the bottom, from 0; -1 is the top ply.

        Raises:
            InputError: There is no such ply.
        """
        n = int(self.ply.max()) + 1
        if not -n <= ply < n:
            raise InputError(f"there is no ply {ply}; the laminate has plies 0 to {n - 1}")
        on = self.ply == ply % n
        return {"x": self.x[on], "strain": self.strain[on], "stress": self.stress[on]}

    def to_csv(self, path: str | Path) -> None:
        """Write one line for each place of each ply; not collective, call it on one rank."""
        head = ["cell", "ply", "angle", "place", "x", "y", "z"]
        head += [f"e{k}" for k in LABELS] + [f"s{k}" for k in LABELS]
        with (
            replacing(Path(path)) as partial,
            open(partial, "w", newline="", encoding="utf-8") as file,
        ):
            out = csv.writer(file)
            out.writerow(head)
            for i in range(len(self.cell)):
                for j, place in enumerate(PLACES):
                    values = [*self.x[i, j], *self.strain[i, j], *self.stress[i, j]]
                    start = [int(self.cell[i]), int(self.ply[i]), float(self.angle[i]), place]
                    out.writerow(start + [float(v) for v in values])


def ply_results(source: Analysis | HasAnalysis, group: str | None = None) -> PlyResults:
    """Strains and stresses of the plies of a continuum shell at the present state; collective.

    Args:
        source: A scene or its analysis, after a step.
        group: Group of cells, as in the materials of the scene; may be left out where there is
            one continuum shell.

    Raises:
        InputError: No step was run yet, or the group is no continuum shell.
    """
    analysis = analysis_of(source)
    shells = analysis.continuum.shell_cells
    named = {cells.name: cells for cells in shells.values()}
    if not named:
        raise InputError(
            "ply_results: the scene has no continuum shell; give a group of cells the material "
            "ContinuumShell(laminate, ...)"
        )
    if group is None:
        if len(named) > 1:
            raise InputError(
                f"ply_results: the scene has several continuum shells; name one of "
                f"{', '.join(sorted(named))}"
            )
        (cells,) = named.values()
    elif group not in named:
        unknown_name("continuum shell", group, list(named))
    else:
        cells = named[group]
    u = displacement_function(analysis)
    finite = isinstance(analysis.solver, NewtonSolver) and analysis.solver.bodies.finite
    return _evaluated(analysis, cells, u, finite)


def _evaluated(analysis: Analysis, cells: ShellCells, u: fem.Function, finite: bool) -> PlyResults:
    continuum = analysis.continuum
    evaluate = _of_form(analysis, cells, u, finite)
    if cells.order == 1:
        tied = next(t for t in continuum.tied_cells.values() if t.shell is cells)
        evaluate = _of_tied(tied, u, finite)
    domain, on = continuum.mesh.domain, cells.stacking
    owned = on.cells < domain.topology.index_map(3).size_local
    original = np.asarray(compat.original_cell_index(domain), dtype=np.int64)
    kinds = np.column_stack([on.axis, on.up, on.layer])
    comm = continuum.comm
    tables = []
    for kind in sorted(set().union(*comm.allgather({tuple(k) for k in kinds.tolist()}))):
        axis, up, layer = kind
        mine = np.flatnonzero((kinds == kind).all(axis=1) & owned)
        plies = cells.layers[layer]
        zeta = _places(plies)
        values = evaluate(on.cells[mine], axis, bool(up), zeta.ravel())
        values = values.reshape(len(mine), len(plies.plies), 3, 4, 10).mean(axis=3)
        tables.append(_of_layer(cells, layer, values, cells.heights[mine], zeta, finite))
        tables[-1]["cell"] = original[on.cells[mine]]
    rows = [_rows(t) for t in tables]
    ours = {key: np.concatenate([r[key] for r in rows]) for key in rows[0]}
    per_cell = {
        key: np.concatenate([t[key] for t in tables]) for key in ("cell", "forces", "centres")
    }
    ours, per_cell = (_gathered(comm, table) for table in (ours, per_cell))
    order = np.lexsort((ours["ply"], ours["cell"]))
    by_cell = np.argsort(per_cell["cell"], kind="stable")
    return PlyResults(
        cell=ours["cell"][order].astype(np.int64),
        ply=ours["ply"][order].astype(np.int64),
        angle=ours["angle"][order],
        x=ours["x"][order],
        strain=ours["strain"][order],
        stress=ours["stress"][order],
        forces=per_cell["forces"][by_cell],
        centres=per_cell["centres"][by_cell],
    )


Evaluate = Callable[[Ints, int, bool, Array], Array]
"""Strains, position and rise of temperature of cells, of their axis across, whether it runs up, and
zeta, shape (n,), to shape (n_cells, 4 n, 10)."""


def _of_form(analysis: Analysis, cells: ShellCells, u: fem.Function, finite: bool) -> Evaluate:
    """The strains of the displacement."""
    continuum = analysis.continuum
    strain = continuum.model.strain(u, continuum.x)
    if finite:
        strain = green_lagrange(continuum.model, u, continuum.x)
    local = ufl.dot(cells.strain_rotation, strain)
    rise: Any = 0 * continuum.x[0]
    if continuum.temperature is not None:
        continuum.temperature.set(analysis.time)
        rise = continuum.temperature.rise
    wanted = ufl.as_vector(
        [*(local[i] for i in range(6)), *(continuum.x[i] for i in range(3)), rise]
    )

    def evaluate(on: Ints, axis: int, up: bool, zeta: Array) -> Array:
        expression = fem.Expression(wanted, _points(axis, up, zeta))
        found = np.asarray(expression.eval(continuum.mesh.domain, on.astype(np.int32)))
        return found.reshape(len(on), -1, 10)

    return evaluate


def _of_tied(tied: TiedCells, u: fem.Function, finite: bool) -> Evaluate:
    """The tied and enhanced strains of first-order cells."""

    def evaluate(on: Ints, axis: int, up: bool, zeta: Array) -> Array:
        points = _points(2, True, zeta)  # these cells are numbered upwards
        here = np.isin(tied.cells, on)
        strain = tied.strains(u, points, finite=finite)[here]
        x = np.einsum("pk,ckx->cpx", shapes(points), tied.x[here])
        return np.concatenate([strain, x, np.zeros((*x.shape[:2], 1))], axis=-1)

    return evaluate


def _places(plies: Laminate) -> Array:
    """Zeta at the bottom, middle and top of each ply of a cell, shape (n_plies, 3)."""
    ends = plies.interfaces() / plies.thickness
    return np.array([[a, 0.5 * (a + b), b] for a, b in pairwise(ends)])


def _points(axis: int, up: bool, zeta: Array) -> Array:
    """Reference points: four in the plane for each zeta, shape (4 n, 3)."""
    gauss = 0.5 + 0.5 / np.sqrt(3.0) * np.array([-1.0, 1.0])
    points = np.empty((len(zeta), 4, 3))
    others = [i for i in range(3) if i != axis]
    points[..., others] = np.stack(np.meshgrid(gauss, gauss), axis=-1).reshape(4, 2)
    points[..., axis] = (0.5 + (zeta if up else -zeta))[:, None]
    return points.reshape(-1, 3)


def _of_layer(
    cells: ShellCells, layer: int, values: Array, heights: Array, zeta: Array, finite: bool
) -> dict[str, Any]:
    """Strains, stresses and forces of cells of one layer.

    Args:
        cells: The continuum shell.
        layer: Which layer of cells.
        values: Strains in laminate axes, positions and rise of temperature, shape
            (n_cells, n_plies, 3, 10).
        heights: Thickness of each cell, shape (n_cells,).
        zeta: From :func:`_places`.
        finite: Whether the strain is finite, and with it the thermal one.
    """
    plies = cells.layers[layer].plies
    k13, k23 = cells.shear_factors
    root = np.sqrt(np.array([1.0, 1.0, 1.0, k23, k13, 1.0]))
    whole = np.empty((*values.shape[:3], 6))  # strains less the thermal ones, laminate axes
    sigma = np.empty_like(whole)
    free = np.empty_like(whole)
    moduli = [p.stiffness() * np.outer(root, root) for p in plies]
    for i, (ply, c) in enumerate(zip(plies, moduli, strict=True)):
        rise, expansion = values[:, i, :, 9:], ply.thermal_expansion()
        free[:, i] = rise * expansion
        if finite:
            free[:, i] += 0.5 * rise**2 * square_strain(expansion)
        whole[:, i] = values[:, i, :, :6] - free[:, i]
        sigma[:, i] = whole[:, i] @ c
    weight = _SIMPSON * (zeta[:, 2] - zeta[:, 0])[:, None]
    forces = np.zeros((len(values), 8))
    for first, power in ((0, 0), (3, 1)):
        moment = np.einsum("pj,npjc->nc", weight * zeta**power, sigma[..., [0, 1, 5]])
        forces[:, first : first + 3] = moment * heights[:, None] ** (1 + power)
    forces[:, 6:] = np.einsum("pj,npjc->nc", weight, sigma[..., [4, 3]]) * heights[:, None]
    mean, slope = (
        factor * np.einsum("pj,npj->n", weight * zeta**k, sigma[..., 2])
        for k, factor in ((0, 1.0), (1, 12.0))
    )
    across = mean[:, None, None] + slope[:, None, None] * zeta
    strain, stress = np.empty_like(whole), np.empty_like(whole)
    others = [0, 1, 3, 4, 5]
    for i, (ply, c) in enumerate(zip(plies, moduli, strict=True)):
        whole[:, i, :, 2] = (across[:, i] - whole[:, i][..., others] @ c[others, 2]) / c[2, 2]
        strain[:, i] = ply.to_ply(whole[:, i] + free[:, i])
        stress[:, i] = ply.stress_to_ply(whole[:, i] @ c)
    return {
        "ply": cells.first_plies[layer] + np.arange(len(plies)),
        "angle": np.array([p.angle for p in plies]),
        "x": values[..., 6:9],
        "strain": strain,
        "stress": stress,
        "forces": forces,
        "centres": values[..., 6:9].mean(axis=(1, 2)),
    }


def _rows(table: dict[str, Any]) -> dict[str, Array]:
    """The entries of each ply of each cell as rows of their own."""
    n_cells, n_plies = table["strain"].shape[:2]
    return {
        "cell": np.repeat(table["cell"], n_plies),
        "ply": np.tile(table["ply"], n_cells),
        "angle": np.tile(table["angle"], n_cells),
        **{key: table[key].reshape(-1, *table[key].shape[2:]) for key in ("x", "strain", "stress")},
    }


def _gathered(comm: Any, table: dict[str, Array]) -> dict[str, Array]:
    """The rows of all ranks; collective."""
    parts = comm.allgather(table)
    return {key: np.concatenate([p[key] for p in parts]) for key in table}


__all__ = ["PlyResults", "ply_results"]
