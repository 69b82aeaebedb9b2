"""Shells on a surface mesh: the continuum of :class:`fxcrack.Shell`.

    W = 1/2 int [e0 e1] [A B; B D] [e0; e1] dA

with the strains of :mod:`fxcrack.continuum.shell_strains` in the axes of each section and the
stiffness of :mod:`fxcrack.continuum.section`. Cells are integrated and condensed by
:mod:`fxcrack.continuum.strain_cells`; what is downstream sees a stiffness on six unknowns a node.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.fem.petsc
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.continuum.cell_assembly import add_matrices, cell_pattern
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.continuum.kinematics import Shell
from fxcrack.continuum.section import Section
from fxcrack.continuum.shell_frames import (
    cell_signs,
    covariant_to_axes,
    nodal_directors,
    section_axes,
)
from fxcrack.continuum.shell_joints import find_joints
from fxcrack.continuum.shell_layout import ShellLayout
from fxcrack.continuum.shell_strains import ShellElement, shell_element
from fxcrack.continuum.strain_cells import StrainCells
from fxcrack.continuum.temperature import Temperature
from fxcrack.mesh import Mesh


@dataclass(frozen=True)
class ShellPart:
    """Owned cells of one section.

    Attributes:
        section: Its section.
        cells: Local cells, shape (n_cells,).
        nodes: Local nodes of the cells, shape (n_cells, n_nodes).
        axes: Axes of the section at the integration points, rows, shape (n_cells, n_points, 3, 3).
        area: Area each integration point stands for, of the rule of the bending energy (0 at
            points of another rule), shape (n_cells, n_points), length^2.
        soft: The same of the rules of all other energy, weighted as they are.
        strain_cells: Strains, stiffness and energy of the cells; strains e0 and e1 per point.
    """

    section: Section
    cells: Ints
    nodes: Ints
    axes: Array
    area: Array
    soft: Array
    strain_cells: StrainCells


class ShellBodies(Continuum):
    """Shells on one surface mesh.

    Args:
        mesh: Surface mesh in space with named groups.
        materials: One section, or one per cell group covering every cell once.
        model: The kinematic model.
        order: Order of the unknowns, 1 or 2; that of the mesh by default.
        temperature: Temperature of the shells; ``None`` for none.

    Attributes:
        element: Reference element.
        signs: 1 or -1 per owned cell: turns its own normal to the top, shape (n_cells,).
        directors: Directors of the local nodes, ghosts too, shape (n_local_nodes, 3).
        shell_parts: Cells of each section.

    Raises:
        InputError: A cell shape or order that does not exist, sections that do not cover the
            cells once, an axis across the shell, a kink whose smooth parts share their nodes, a
            surface with one side.
    """

    layout: ShellLayout

    def __init__(
        self,
        mesh: Mesh,
        materials: Section | Mapping[str, Section],
        model: Shell,
        *,
        order: int | None = None,
        temperature: Temperature | None = None,
    ) -> None:
        super().__init__(mesh, materials, model, order=order, temperature=temperature)
        self.shell = model
        kind = mesh.domain.topology.cell_name()
        if kind == "triangle" and self.order == 2:
            raise InputError(
                f"mesh '{mesh.name}': second-order triangles lock on curved shells; use "
                "second-order quadrilaterals, or triangles of first order"
            )
        self.element: ShellElement = shell_element(kind, self.order)
        n_cells = mesh.domain.topology.index_map(2).size_local
        self._nodes = np.asarray(self.space.dofmap.list[:n_cells], dtype=np.int64)
        self._x = self.positions()[self._nodes]
        self.signs = cell_signs(mesh, self._upward(n_cells))
        self.directors = nodal_directors(self.space, self._normals_at_nodes(), mesh.name)
        self.layout = ShellLayout(self.comm, self.directors, self.layout.n_owned, self.height)
        self.layout.joints = find_joints(mesh, self.space, self.order, self.directors)
        self.shell_parts = [
            self._part(s, c) for s, c in zip(self.sections, self.part_cells, strict=True)
        ]

    @property
    def sections(self) -> list[Section]:
        """The section of each part."""
        return list(self.part_materials)  # type: ignore[arg-type]

    def check_material(self, material: Any) -> None:
        """Refuse what is no section.

        Raises:
            InputError: Says what to give.
        """
        if not isinstance(material, Section):
            raise InputError(
                f"materials: {material!r} is not a section; shells need e.g. "
                "Section(Isotropic(E=70e3, nu=0.3), thickness=1.5), or one per cell group"
            )

    def _moduli(self, i: int) -> tuple[Any, Any]:
        """No UFL stiffness: sections are integrated cell by cell."""
        return None, None

    # -- geometry ------------------------------------------------------------------------

    def _normals_at_nodes(self) -> Array:
        """Unit normals of owned cells at their nodes, to the top, (n_cells, n_nodes, 3)."""
        tangents = np.einsum("dmk,ckx->dcmx", self.element.node_gradients, self._x)
        normal = np.cross(tangents[0], tangents[1])
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-300)
        return np.asarray(normal * self.signs[:, None, None])

    def _upward(self, n_cells: int) -> Array:
        """Component of each owned cell's own unit normal in the direction its section has up."""
        tangents = np.einsum("dk,ckx->dcx", self.element.centre_gradients, self._x)
        normal = np.cross(tangents[0], tangents[1])
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-300)
        out = np.zeros(n_cells)
        for section, cells in zip(self.sections, self.part_cells, strict=True):
            if section.up is not None:
                up = np.asarray(section.up, dtype=float)
                out[cells] = normal[cells] @ (up / np.linalg.norm(up))
        return out

    def _part(self, section: Section, cells: npt.NDArray[np.int32]) -> ShellPart:
        """Strains and stiffness of the owned cells of a section; collective."""
        element, nodes, x = self.element, self._nodes[cells], self._x[cells]
        sign = self.signs[cells]
        directors = self.directors[nodes]
        vectors = np.stack([x, directors], axis=2).reshape(len(x), 2 * nodes.shape[1], 3)
        tangents = np.einsum("dpk,ckx->dcpx", element.gradients, x)
        area_vector = np.cross(tangents[0], tangents[1])
        jacobian = np.linalg.norm(area_vector, axis=-1)
        normal = area_vector / jacobian[..., None] * sign[:, None, None]
        axes, fits = section_axes(normal, section.axis)
        problem = None
        if not fits:
            problem = (
                f"Section: axis = {section.axis} is normal to the shell, near "
                f"{format_point(x.mean(axis=(0, 1)))}; give a direction in its tangent plane"
            )
        raise_on_all_ranks(self.comm, problem)
        d = np.einsum("pk,ckx->cpx", element.values, directors)
        to_axes = covariant_to_axes(np.stack([tangents[0], tangents[1], d], axis=-1), axes)
        weight = jacobian * element.weights
        rule = element.bending > 0.0
        size = (weight * rule).sum(axis=1)
        k = np.minimum(section.height**2 / size, 1.0)[:, None]
        soft = ((1.0 - k) * element.soft[0] + k * element.soft[1]) * weight
        bending = weight * element.bending
        stiffness = replace(section, offset=0.0).stiffness()
        moduli = soft[..., None, None] * stiffness
        moduli[..., 6:, 6:] = bending[..., None, None] * stiffness[6:, 6:]
        if section.offset:  # strains of the middle: e0 + offset e1
            to_middle = np.eye(12) + section.offset * np.eye(12, k=6)
            moduli = to_middle.T @ moduli @ to_middle
        local = np.zeros((*weight.shape, 12, 9))
        local[..., :6, :6] = to_axes
        local[..., 6:, 6:] = to_axes[..., [0, 1, 5]]
        thickness = np.zeros((*weight.shape, 12, 1))
        thickness[..., 6:, 0] = to_axes[..., 2]  # E1_33, 0 at the middle
        thickness[..., :6, 0] = -section.offset * to_axes[..., 2]
        enhanced = [thickness]
        if self.shell.enhanced_membrane and nodes.shape[1] == 4:
            enhanced.append(self._membrane_modes(x, sign, section, jacobian))
        return ShellPart(
            section, np.asarray(cells, dtype=np.int64), nodes, axes, weight * rule, soft,
            StrainCells(
                vectors, element.matrices_at(section.offset), local, np.concatenate(enhanced, -1),
                moduli,
            ),
        )  # fmt: skip

    def _membrane_modes(self, x: Array, sign: Array, section: Section, jacobian: Array) -> Array:
        """Five membrane strains of quadrilaterals, in the natural frame of the centre times j0/j.

        (Simo and Rifai 1990.) Shape (n_cells, n_points, 12, 5).
        """
        g = np.einsum("dk,ckx->dcx", self.element.centre_gradients, x)
        normal = np.cross(g[0], g[1])
        j0 = np.linalg.norm(normal, axis=-1)
        normal = normal / j0[:, None] * sign[:, None]
        axes, _ = section_axes(normal, section.axis)
        to_axes = covariant_to_axes(np.stack([g[0], g[1], normal], axis=-1), axes)[..., [0, 1, 5]]
        r, s = (2.0 * self.element.points - 1.0).T
        zero = 0.0 * r
        modes = np.array(
            [[r, zero, zero, zero, zero], [zero, s, zero, zero, zero], [zero, zero, r, s, r * s]]
        )
        out = np.zeros((*jacobian.shape, 12, 5))
        out[..., :6, :] = np.einsum(
            "cp,cek,kap->cpea", j0[:, None] / jacobian, to_axes, modes, optimize=True
        )
        return out

    # -- forces --------------------------------------------------------------------------

    def compile(self) -> None:
        """Compile the form that says what is coupled."""
        if self._form is None:
            self._form = cell_pattern(self.space)

    def stiffness(self) -> PETSc.Mat:
        """Assemble K, shape (n_global, n_global); the caller destroys it."""
        self.compile()
        matrix = dolfinx.fem.petsc.create_matrix(self._form)
        matrix.zeroEntries()
        for part in self.shell_parts:
            add_matrices(matrix, part.nodes, part.strain_cells.stiffness())
        matrix.assemble()
        return matrix

    def height(self, face: Face) -> float:
        """Coordinate z of a face, length; collective.

        Raises:
            InputError: The face's cells have sections with several positions of this side.
        """
        cells = self.mesh.group(face.group, dim=2).entities
        mine = [
            s.face(face.side)
            for s, c in zip(self.sections, self.part_cells, strict=True)
            if np.isin(c, cells).any()
        ]
        found = sorted({z for z in self.comm.allgather(mine) for z in z})
        if not found:
            raise InputError(f"Face '{face}': group '{face.group}' holds no cell")
        if found[-1] - found[0] > 1e-12 * max(abs(found[0]), abs(found[-1])):
            raise InputError(
                f"Face '{face}': its cells belong to sections whose {face.side} lies at z = "
                f"{found[0]:g} and at {found[-1]:g}; name a face of one section, or give the "
                "sections offsets that put this side at one height"
            )
        return float(found[0])

    def director_function(self) -> fem.Function:
        """Directors as a function of the space of the unknowns, in the place of w."""
        out = fem.Function(self.space)
        out.x.array.reshape(-1, 6)[:, 3:] = self.directors
        return out

    def mass_density(self, density: Any, a: Any, v: Any) -> Any:
        """Virtual work of the inertia per area, int rho (a + z a_w) . (v + z v_w) dz; UFL."""
        on_u, on_w = (ufl.as_vector([a[i + k] for i in range(3)]) for k in (0, 3))
        u, w = (ufl.as_vector([v[i + k] for i in range(3)]) for k in (0, 3))
        mixed = ufl.inner(on_u, w) + ufl.inner(on_w, u)
        return (
            density[0] * ufl.inner(on_u, u) + density[1] * mixed + density[2] * ufl.inner(on_w, w)
        )

    def change_of_director(self, q: Any) -> Any:
        """UFL change of the director among the unknowns."""
        return ufl.as_vector([q[i] for i in range(3, 6)])


__all__ = ["ShellBodies", "ShellPart"]
