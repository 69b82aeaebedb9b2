"""The linear elastic continuum: displacement space, materials of its parts, stiffness.

    K u = sum_i lambda_i(t) f_i,      K = int  strain(v)^T C strain(u)  w dV

with the weight w of the kinematic model. No boundary condition is applied here: supports become
columns of the coordinate transformation (:mod:`fxcrack.interface.jump_coordinates`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import basix.ufl
import dolfinx.fem.petsc
import dolfinx.mesh
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base import collective_garbage
from fxcrack.base.arrays import Array
from fxcrack.base.checks import whole
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.continuum.cell_assembly import add_matrices, cell_pattern
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.continuum.face import Face
from fxcrack.continuum.generalised_plane_strain import shared_unknowns
from fxcrack.continuum.kinematics import Axisymmetric, Model, Shell
from fxcrack.continuum.loads import Field
from fxcrack.continuum.materials import Material, stiffness_of
from fxcrack.continuum.shell_cells import ShellCells
from fxcrack.continuum.temperature import ByTemperature, Temperature
from fxcrack.continuum.temperature_field import (
    TemperatureField,
    interpolate_given,
    interpolated,
)
from fxcrack.continuum.tied_cells import TiedCells
from fxcrack.mesh import Mesh

Ints = npt.NDArray[np.int32]


BESIDE_SOLIDS = (
    "the cells of a scene are of one dimension: model shells beside solids as ContinuumShell, on "
    "hexahedra one cell thick"
)
"""What to do where surface cells and volumes are to stand in one scene."""


class Continuum:
    """Elastic bodies on one mesh.

    Args:
        mesh: Mesh with named groups.
        materials: One material, or a material per cell group covering every cell once.
        model: Kinematic model.
        order: Polynomial order of the displacement, 1 or 2; the order of the mesh by default.
        temperature: Temperature of the bodies; ``None`` for none.

    Attributes:
        gdim: Components of a displacement: those of the mesh, in generalised plane strain three.
        space: Displacement space.
        layout: Unknowns of its nodes and their numbers.
        x: UFL position.
        weight: UFL factor of area and volume elements (thickness, ring, 1).
        degree: Quadrature degree of all integrals.
        parts: Stiffness on the model's strains, all stresses per strain, and measure, per material.
        part_materials: The material of each part.
        part_cells: Owned cells of each part.
        shell_cells: Cells of the parts that are continuum shells, by number of the part.
        tied_cells: Of those, the parts of first order: no UFL form of ``parts`` has their strains.
        temperature: The temperature on this mesh, ``None`` where there is none.
        weakly_held: Owned nodes that a foundation (:mod:`fxcrack.continuum.foundation`) holds,
            shape (n,).
        founded: Whether a foundation holds any body, on all ranks.

    Raises:
        InputError: The model does not fit the mesh, or the materials do not cover it once.
    """

    def __init__(
        self,
        mesh: Mesh,
        materials: Material | Mapping[str, Material],
        model: Model | Shell,
        *,
        order: int | None = None,
        temperature: Temperature | None = None,
    ) -> None:
        if model.mesh_gdim != mesh.gdim:
            raise InputError(
                f"{type(model).__name__} needs a mesh of dimension {model.mesh_gdim}, "
                f"but mesh '{mesh.name}' has dimension {mesh.gdim}"
            )
        if model.tdim != mesh.tdim:
            what = "surface cells in space, which are for Shell()" if mesh.tdim == 2 else "volumes"
            raise InputError(
                f"{type(model).__name__} needs cells of dimension {model.tdim}, but mesh "
                f"'{mesh.name}' has {what}; {BESIDE_SOLIDS}"
            )
        if isinstance(model, Axisymmetric):
            r = mesh.domain.geometry.x[:, 0]
            inside = float(r.min(initial=0.0)) < -1e-9 * float(np.abs(r).max(initial=0.0))
            raise_on_all_ranks(
                mesh.comm,
                f"Axisymmetric: mesh '{mesh.name}' has nodes at radius x = {r.min():g}; model one "
                "half-section with x >= 0, the axis at x = 0"
                if inside
                else None,
            )
        self.mesh = mesh
        self.model: Model = cast(Model, model)  # nobody asks a shell for strains of its position
        self.order = mesh.order if order is None else whole("Scene", "order", order)
        if self.order not in (1, 2):
            raise InputError(f"order = {self.order}: only displacements of order 1 and 2 exist")
        self.comm = mesh.comm
        collective_garbage.collect(mesh.comm)
        collective_garbage.watch(self, mesh.comm, mesh.domain.comm)
        self.gdim = model.gdim
        n = model.n_unknowns
        self.space = fem.functionspace(mesh.domain, ("Lagrange", self.order, (n,)))
        n_owned = int(self.space.dofmap.index_map.size_local)
        shared = shared_unknowns(model)
        self.layout = DofLayout(
            self.comm, self.gdim, n_owned, n, shared=[s.unknown for s in shared]
        )
        self.x = ufl.SpatialCoordinate(mesh.domain)
        weight = model.weight(self.x)
        self.weight = (
            fem.Constant(mesh.domain, PETSc.ScalarType(weight))
            if isinstance(weight, float)
            else weight
        )
        self.degree = 2 * self.order + (1 if isinstance(model, Axisymmetric) else 0)
        self.temperature: TemperatureField | None = None
        if temperature is not None:
            self.temperature = TemperatureField(mesh.domain, self.order, temperature)
        for material in materials.values() if isinstance(materials, Mapping) else [materials]:
            self.check_material(material)
        self.weakly_held: Ints = np.zeros(0, dtype=np.int64)
        self.founded = False
        self.part_materials: list[Material] = []
        self.part_cells: list[Ints] = []
        self.shell_cells: dict[int, ShellCells] = {}
        self.tied_cells: dict[int, TiedCells] = {}
        self.parts = self._assign(materials)
        self._form: Any = None
        self._pattern: Any = None

    def check_material(self, material: Any) -> None:
        """Refuse what is no material of these bodies.

        Raises:
            InputError: It is a class, has no stiffness, or is the section of a shell.
        """
        if isinstance(material, type) or not hasattr(material, "stiffness"):
            raise InputError(
                f"materials: {material!r} is not a material; give one, e.g. Isotropic(E=70e3, "
                "nu=0.3), or one per cell group, {'name': Isotropic(...)}"
            )
        if getattr(material, "form", "elastic") == "shell":
            raise InputError(
                "materials: a Section belongs to shells; write Scene(..., model=Shell()) on a "
                f"surface mesh, or give the material itself; {BESIDE_SOLIDS}"
            )

    @property
    def n_local(self) -> int:
        """Dofs that this rank owns."""
        return self.layout.n_local

    @property
    def n_global(self) -> int:
        """Dofs of all ranks."""
        return self.layout.n_global

    @property
    def offset(self) -> int:
        """First global dof of this rank."""
        return self.layout.offset

    def _assign(self, materials: Material | Mapping[str, Material]) -> list[tuple[Any, Any, Any]]:
        """Stiffness, stress per strain and measure, one triple per material."""
        domain, meta = self.mesh.domain, {"quadrature_degree": self.degree}
        index_map = domain.topology.index_map(self.mesh.tdim)
        n_cells = int(index_map.size_local)
        if isinstance(materials, Mapping):
            groups = self._groups(materials)
            names = list(materials)
            self.part_materials = list(materials.values())
        else:
            groups = [np.arange(n_cells + index_map.num_ghosts, dtype=np.int32)]
            names = ["all cells"]
            self.part_materials = [materials]
        self.part_cells = [c[c < n_cells] for c in groups]
        marks, tags = [], []
        for i, (material, cells) in enumerate(zip(self.part_materials, groups, strict=True)):
            found = np.full(len(cells), 3 * i, dtype=np.int32)
            if isinstance(material, ContinuumShell):
                self._check_shell(names[i])
                shell = ShellCells(self.mesh, cells, material, names[i], self.order)
                self.shell_cells[i] = shell
                if self.order == 1:
                    self.tied_cells[i] = TiedCells(self.space, shell)
                found += shell.stacking.axis.astype(np.int32)
            marks.append(found)
            counts = self.comm.allreduce(np.bincount(found - 3 * i, minlength=3))
            tags.append({axis: 3 * i + axis for axis in range(3) if counts[axis]})
        if isinstance(materials, Mapping) or self.shell_cells:
            entities, values = np.concatenate(groups), np.concatenate(marks)
            sort = np.argsort(entities)
            marked = dolfinx.mesh.meshtags(domain, self.mesh.tdim, entities[sort], values[sort])
            dx = ufl.Measure("dx", domain=domain, subdomain_data=marked, metadata=meta)
        else:
            return [(*self._moduli(0), ufl.dx(domain, metadata=meta))]
        parts = []
        for i, tag in enumerate(tags):
            if i in self.shell_cells:
                shell = self.shell_cells[i]
                parts.append((shell.stiffness, shell.stiffness, shell.measure(dx, tag)))
            else:
                parts.append((*self._moduli(i), dx(3 * i)))
        return parts

    def _groups(self, materials: Mapping[str, Material]) -> list[Ints]:
        """Cells of each material, owned and ghost, shapes (n_cells,); collective.

        Raises:
            InputError: A cell has no material or several.
        """
        n_cells = self.mesh.domain.topology.index_map(self.mesh.tdim).size_local
        count = np.zeros(n_cells, dtype=np.int32)
        cells = []
        for name in materials:
            group = self.mesh.group(name, dim=self.mesh.tdim).entities
            cells.append(group)
            count[group[group < n_cells]] += 1
        bad = None
        if np.any(count != 1):
            named = {n for n, g in self.mesh.groups.items() if g.dim == self.mesh.tdim}
            bad = (
                f"materials cover {np.sum(count == 0)} cells of this rank not at all and "
                f"{np.sum(count > 1)} more than once; name every cell group exactly once "
                f"(given: {', '.join(materials)}; not given: "
                f"{', '.join(sorted(named - set(materials))) or 'none'})"
            )
        raise_on_all_ranks(self.comm, bad)
        return cells

    def _check_shell(self, name: str) -> None:
        """Refuse a continuum shell that this continuum cannot hold."""
        if self.mesh.gdim != 3:
            raise InputError(
                f"ContinuumShell of '{name}': it needs a mesh of hexahedra, in 3-D, and "
                f"mesh '{self.mesh.name}' is plane; give a solid material"
            )
        if self.order == 1 and self.temperature is not None:
            raise InputError(
                f"ContinuumShell of '{name}': first-order continuum shells have no temperature; "
                "give Scene(order=2)"
            )

    def _moduli(self, i: int) -> tuple[Any, Any]:
        """Stiffness on the strains of the model, and all its stresses per unit strain."""
        material, model = self.part_materials[i], self.model
        if self.temperature is not None and isinstance(material, ByTemperature):
            return (
                self.by_temperature(i, lambda m: model.reduce(stiffness_of(m))),
                self.by_temperature(i, lambda m: model.recover(stiffness_of(m))),
            )
        domain, c = self.mesh.domain, stiffness_of(material)
        return (
            fem.Constant(domain, self.model.reduce(c)),
            fem.Constant(domain, self.model.recover(c)),
        )

    def by_temperature(self, i: int, quantity: Callable[[Material], Array]) -> Any:
        """A quantity of a part's material at the present temperature, UFL.

        Args:
            i: Which part.
            quantity: Of an elastic material, of any one shape.
        """
        material = self.part_materials[i]
        return interpolated(self.mesh.domain, material, self.temperature, quantity)

    def compile(self) -> None:
        """Compile the stiffness form (cached on disk by DOLFINx); assembly does it otherwise."""
        others = [p for i, p in enumerate(self.parts) if i not in self.tied_cells]
        if self.tied_cells and self._pattern is None:
            self._pattern = cell_pattern(self.space)
        if self._form is None and others:
            u, v = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
            eu, ev = self.model.strain(u, self.x), self.model.strain(v, self.x)
            self._form = fem.form(
                sum(ufl.inner(ufl.dot(c, eu), ev) * self.weight * dx for c, _, dx in others)
            )

    def stiffness(self) -> PETSc.Mat:
        """Assemble K, shape (n_global, n_global); the caller destroys it."""
        self.compile()
        if not self.tied_cells:
            matrix = dolfinx.fem.petsc.assemble_matrix(self._form)
            matrix.assemble()
            return matrix
        matrix = dolfinx.fem.petsc.create_matrix(self._pattern)
        matrix.zeroEntries()
        if self._form is not None:
            dolfinx.fem.petsc.assemble_matrix(matrix, self._form)
        for part in self.tied_cells.values():
            add_matrices(matrix, part.nodes, part.strain_cells.stiffness())
        matrix.assemble()
        return matrix

    def surface(self, where: str | Face) -> Any:
        """UFL measure of a named facet group.

        Raises:
            InputError: The group is the face of a shell.
        """
        if isinstance(where, Face):
            raise InputError(
                f"Face '{where}' belongs to shells; solids have facet groups, named by a string"
            )
        meta = {"quadrature_degree": self.degree}
        facets = self.mesh.group(where, dim=self.mesh.tdim - 1).entities
        marks = dolfinx.mesh.meshtags(
            self.mesh.domain, self.mesh.tdim - 1, facets, np.ones(len(facets), dtype=np.int32)
        )
        return ufl.Measure("ds", domain=self.mesh.domain, subdomain_data=marks, metadata=meta)(1)

    def volume(self, where: str | None) -> Any:
        """UFL measure of a named cell group, of the whole mesh for ``None``."""
        meta = {"quadrature_degree": self.degree}
        if where is None:
            return ufl.dx(self.mesh.domain, metadata=meta)
        cells = self.mesh.group(where, dim=self.mesh.tdim).entities
        marks = dolfinx.mesh.meshtags(
            self.mesh.domain, self.mesh.tdim, cells, np.ones(len(cells), dtype=np.int32)
        )
        return ufl.Measure("dx", domain=self.mesh.domain, subdomain_data=marks, metadata=meta)(1)

    def displacement(self, q: Any) -> Any:
        """UFL displacement among the unknowns, a function of or an argument on ``space``."""
        if self.layout.n_unknowns == self.gdim:
            return q
        return ufl.as_vector([q[i] for i in range(self.gdim)])

    def field(self, value: Field, title: str) -> Any:
        """A number as a UFL constant, a function of positions interpolated in each cell.

        Collective.

        Args:
            value: The number or function.
            title: What it is the value of, for messages.

        Raises:
            InputError: The function fails or gives other than one number per position.
        """
        if not callable(value):
            return fem.Constant(self.mesh.domain, PETSc.ScalarType(value))
        # points inside the cells: a step at a cell boundary stays a step
        element = basix.ufl.element(
            "DG",
            self.mesh.domain.basix_cell(),
            self.order,
            lagrange_variant=basix.LagrangeVariant.legendre,
        )
        function = fem.Function(fem.functionspace(self.mesh.domain, element))
        if isinstance(value, fem.Function):
            function.interpolate(value)
            return function

        interpolate_given(self.comm, function, title, "value", value)
        return function

    def parts_at(self, nodes: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
        """Which parts have cells at global nodes, shape (n, n_parts); collective."""
        dofmap = self.space.dofmap
        out = np.zeros((len(nodes), len(self.part_cells)), dtype=bool)
        for i, cells in enumerate(self.part_cells):
            local = np.unique(np.asarray(dofmap.list)[cells]).astype(np.int32)
            out[:, i] = np.isin(nodes, np.asarray(dofmap.index_map.local_to_global(local)))
        self.comm.Allreduce(MPI.IN_PLACE, out, op=MPI.LOR)
        return out

    def owned_nodes(self, where: str) -> Ints:
        """Displacement nodes of a group that this rank owns; collective.

        Returns:
            Local block indices, ascending, shape (n_found,).

        Raises:
            InputError: No rank finds a node in the group.
        """
        group = self.mesh.group(where)
        self.mesh.domain.topology.create_connectivity(group.dim, self.mesh.tdim)
        if group.points is not None and self.order == self.mesh.order:
            nodes = self._nodes_of_points(group.points)
        else:
            nodes = fem.locate_dofs_topological(self.space, group.dim, group.entities)
        nodes = np.unique(nodes[nodes < self.layout.n_owned])
        if self.comm.allreduce(len(nodes)) == 0:
            raise InputError(f"group '{where}' of mesh '{self.mesh.name}' holds no node")
        return np.asarray(nodes, dtype=np.int32)

    def mean_position(self, where: str) -> Array:
        """Mean position of the nodes of a group, undeformed, shape (3,) [length]; collective.

        Raises:
            InputError: The mesh has no such group, or it holds no node.
        """
        nodes = self.owned_nodes(where)
        total = np.append(self.positions()[nodes].sum(axis=0), len(nodes))
        total = self.comm.allreduce(total, op=MPI.SUM)
        return np.asarray(total[:3] / total[3])

    def _nodes_of_points(self, points: Ints) -> Ints:
        """Displacement nodes at geometry nodes, for a displacement of the geometry's order."""
        geometry, space = compat.geometry_dofmap(self.mesh.domain), self.space.dofmap.list
        of_point = np.full(len(self.mesh.domain.geometry.x), -1, dtype=np.int32)
        of_point[geometry.ravel()] = np.asarray(space).ravel()
        return np.asarray(of_point[points])

    def mass_density(self, density: Any, a: Any, v: Any) -> Any:
        """Virtual work of the inertia of a motion, per volume (shells: per area); UFL.

        Args:
            density: Mass per volume; of shells, its moments over the thickness, shape (3,).
            a: Acceleration, or another motion, of all unknowns.
            v: Test function.
        """
        return density * ufl.inner(self.displacement(a), self.displacement(v))

    def positions(self) -> Array:
        """Positions of the local displacement nodes, owned first, shape (n, 3), length."""
        return np.asarray(self.space.tabulate_dof_coordinates())


__all__ = ["Continuum", "compat"]
