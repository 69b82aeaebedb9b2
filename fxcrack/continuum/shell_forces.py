"""Nodal forces of dead loads on shells at amplitude 1.

Loads on a face act at X + z D and do work on u + z w:

    int t . (u + z w) dA,    -+ int p D . (u + z w) dA  on top and bottom

with the area of the reference surface (thickness/radius neglected as in the strains); a body force
does the work int b . (u + z w) dz dA. Moments act on edges and nodes, m . (D x w).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)

import dolfinx.fem.petsc
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.cell_assembly import cell_vector
from fxcrack.continuum.face import Face
from fxcrack.continuum.loads import (
    BodyForce,
    Field,
    Moment,
    PointMoment,
    Pressure,
    Traction,
)
from fxcrack.continuum.shell_bodies import ShellBodies, ShellPart
from fxcrack.continuum.shell_temperature import ShellTemperature
from fxcrack.continuum.thermal_strain import ThermalLoad


def shell_load(shell: ShellBodies, load: Any) -> PETSc.Vec | None:
    """Nodal forces of a load on shells; collective.

    Args:
        shell: The shells.
        load: The load.

    Returns:
        Forces and couples on the owned dofs; the caller destroys the vector. ``None`` for loads
        that are as those of solids.

    Raises:
        InputError: The load does not fit shells.
    """
    if isinstance(load, ThermalLoad):
        forces = ShellTemperature(shell).forces(load.pattern)
        nodes = [p.nodes for p in shell.shell_parts]
        return cell_vector(shell.space, list(zip(nodes, forces, strict=True)))
    if isinstance(load, PointMoment):
        return _point_moment(shell, load)
    if isinstance(load, Moment):
        return _moment(shell, load)
    if isinstance(load, BodyForce):
        return _body_force(shell, load)
    if isinstance(load, Traction | Pressure):
        if isinstance(load.where, Face):
            return _face_load(shell, load, load.where)
        if shell.mesh.group(load.where).dim == 2:
            raise InputError(
                f"load '{load.title}': '{load.where}' is a group of cells; name one of its faces, "
                f"Face('{load.where}', 'top') or 'bottom'"
            )
        if isinstance(load, Pressure):
            raise InputError(
                f"load '{load.title}': a pressure acts on a face of a shell, Face(group, 'top') or "
                "'bottom'; give a Traction on edges"
            )
        _check_border(shell, load.where, load.title)
    return None


def _check_border(shell: ShellBodies, where: str, title: str) -> None:
    """Refuse edges inside a shell, on which DOLFINx integrates nothing; collective."""
    edges = shell.mesh.group(where, dim=1).entities
    topology = shell.mesh.domain.topology
    topology.create_connectivity(1, 2)
    offsets = topology.connectivity(1, 2).offsets
    inside = np.any(offsets[edges + 1] - offsets[edges] > 1)
    raise_on_all_ranks(
        shell.comm,
        f"load '{title}': edges of group '{where}' lie inside the shell; only edges of one cell "
        "can be loaded per length: give a PointForce, or a Traction on a face"
        if inside
        else None,
    )
    if len(shell.mesh.joints):
        _check_no_joint(shell, edges, title)


def _check_no_joint(shell: ShellBodies, edges: npt.NDArray[np.int32], title: str) -> None:
    """Refuse edges at which shells meet, each of which has one: they would be loaded twice."""
    domain, joints = shell.mesh.domain, shell.mesh.joints
    domain.topology.create_connectivity(1, 2)
    mine = edges[edges < domain.topology.index_map(1).size_local]
    points = compat.geometry_of_entities(domain, 1, mine)[:, :2]
    node = np.asarray(domain.geometry.input_global_indices)[points]
    by_node = np.argsort(joints[:, 0])
    place = np.minimum(np.searchsorted(joints[by_node, 0], node), len(joints) - 1)
    place = by_node[place]
    place = np.where(joints[place, 0] == node, -1 - joints[place, 1], node)
    ends = np.concatenate(shell.comm.allgather(np.sort(place, axis=1)))
    if len(np.unique(ends, axis=0)) < len(ends):
        raise InputError(
            f"load '{title}': shells meet at some of its edges, and each has an edge there; give a "
            "PointForce, or a group of edges that ends before the joint"
        )


def _check_three(value: Sequence[Any], title: str) -> None:
    given = len(value) if hasattr(value, "__len__") else "no list of"
    if given != 3:
        raise InputError(f"load '{title}': {given} components given, 3 needed")


def _at_points(shell: ShellBodies, value: Field, x: Array, title: str) -> Array:
    """A number or a function of position at points of shape (n_cells, n_points, 3); collective."""
    if not callable(value):
        return np.full(x.shape[:2], float(value))
    found, problem = np.zeros(x.shape[:2]), None
    try:
        found = numbers_at(f"load '{title}'", "value", value, x.reshape(-1, 3)).reshape(found.shape)
    except InputError as error:  # on this rank, perhaps
        problem = str(error)
    raise_on_all_ranks(shell.comm, problem)
    return found


def _cells_of(shell: ShellBodies, part: ShellPart, where: str | None) -> Ints:
    """Rows of a part's cells that belong to a group."""
    if where is None:
        return np.arange(len(part.cells))
    return np.flatnonzero(np.isin(part.cells, shell.mesh.group(where, dim=2).entities))


def _positions(shell: ShellBodies, part: ShellPart, rows: Ints) -> Array:
    """Reference surface at the integration points, shape (n_cells, n_points, 3)."""
    x = part.strain_cells.vectors[rows, ::2]
    return np.asarray(np.einsum("pk,ckx->cpx", shell.element.values, x))


def _spread(shell: ShellBodies, part: ShellPart, rows: Ints, on_u: Array, on_w: Array) -> Any:
    """Nodes and vectors of cells under forces per area on u and w, (n_cells, n_points, 3)."""
    force = np.concatenate([on_u, on_w], axis=-1) * part.area[rows][..., None]
    values = np.einsum("pk,cpj->ckj", shell.element.values, force)
    return part.nodes[rows], values.reshape(len(rows), 6 * values.shape[1])


def _face_load(shell: ShellBodies, load: Traction | Pressure, face: Face) -> PETSc.Vec:
    z = shell.height(face)
    if isinstance(load, Traction):
        _check_three(load.value, load.title)
    parts = []
    for part in shell.shell_parts:
        rows = _cells_of(shell, part, face.group)
        x = _positions(shell, part, rows)
        if isinstance(load, Traction):
            force = np.stack([_at_points(shell, v, x, load.title) for v in load.value], axis=-1)
        else:
            side = -1.0 if face.side == "top" else 1.0
            pressure = _at_points(shell, load.value, x, load.title)
            force = side * pressure[..., None] * part.axes[rows][..., 2, :]
        parts.append(_spread(shell, part, rows, force, z * force))
    return cell_vector(shell.space, parts)


def _body_force(shell: ShellBodies, load: BodyForce) -> PETSc.Vec:
    _check_three(load.value, load.title)
    parts = []
    for part in shell.shell_parts:
        rows = _cells_of(shell, part, load.where)
        x = _positions(shell, part, rows)
        force = np.stack([_at_points(shell, v, x, load.title) for v in load.value], axis=-1)
        low, high = part.section.face("bottom"), part.section.face("top")
        parts.append(
            _spread(shell, part, rows, (high - low) * force, 0.5 * (high**2 - low**2) * force)
        )
    return cell_vector(shell.space, parts)


def _moment(shell: ShellBodies, load: Moment) -> PETSc.Vec:
    _check_three(load.value, load.title)
    _check_border(shell, load.where, load.title)
    w = shell.change_of_director(ufl.TestFunction(shell.space))
    d = shell.change_of_director(shell.director_function())
    m = ufl.as_vector([shell.field(v, f"load '{load.title}'") for v in load.value])
    form = ufl.inner(ufl.cross(m, d), w) * shell.surface(load.where)
    vector = dolfinx.fem.petsc.assemble_vector(fem.form(form))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector


def _point_moment(shell: ShellBodies, load: PointMoment) -> PETSc.Vec:
    _check_three(load.value, load.title)
    layout, nodes = shell.layout, shell.owned_nodes(load.where)
    count = shell.comm.allreduce(len(nodes))
    vector = PETSc.Vec().createMPI((layout.n_local, layout.n_global), comm=shell.comm)
    couple = np.cross(np.asarray(load.value, dtype=float) / count, shell.directors[nodes])
    for c in range(3):
        vector.array[layout.dof(nodes, 3 + c)] = couple[:, c]
    return vector


__all__ = ["shell_load"]
