"""The cells of a continuum shell: thickness coordinate, laminate axes, stiffness, integration.

    zeta    coordinate across a cell, -1/2 on its lower and 1/2 on its upper face
    e3      along grad zeta, e1 the user's direction in the plane across e3, e2 = e3 x e1
    C       sum_i c_i zeta^i turned from the laminate axes (e1, e2, e3) to the global ones

zeta is linear in the reference coordinates of a cell, so that it and its gradient are fields of a
discontinuous first-order space; nothing depends on how the nodes of a cell are numbered.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.reduced_integration import WeightedMeasure, rule
from fxcrack.continuum.stacking import find_stacking
from fxcrack.mesh import Mesh

_DEGREE = {1: 2, 2: 4}
"""Of the stiffness over the thickness, by order: strains are of half that degree in zeta."""
_SAME_THICKNESS = 0.02
"""Laminate and mesh may differ by this part without a warning."""
_LOST = 10.0 * float(np.finfo(np.float64).eps)
"""Relative error of a bending stiffness from rounding the entries of K, over (length/thickness)^4.

The entries are of the size of the stiffness across the thickness, E area/t, while bending resists
with E t^3/length^3. Strips of 8 cells with length/thickness 1000 and 3000: 2 and 0.3 times this.
"""
_TOO_MUCH_LOST = 1e-3
"""Of the bending stiffness, above which there is a warning."""
_PARALLEL = 1e-3
"""Sine of the angle between the user's axis and the normal below which it has no direction."""

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


class ShellCells:
    """Continuum-shell cells of one group.

    Args:
        mesh: Hexahedra.
        cells: Local cells of the group, owned and ghost.
        shell: What the user asked for.
        name: What messages call the cells.
        order: Order of the displacement, 1 or 2.

    Attributes:
        name: The group.
        order: Order of the displacement.
        stacking: Thickness direction of each cell.
        layers: The part of the laminate in each layer of cells, bottom first.
        first_plies: Number of the first ply in each layer, from 0.
        shear_factors: (k13, k23) in use.
        thickness: Mean thickness of the group, length.
        heights: Thickness of each cell of ``stacking.cells``, length.
        size: Mean side of a cell in the plane, length.
        zeta: Thickness coordinate, a UFL coefficient.
        direction: The user's axis in each cell, not projected, shape (n_cells, 3).
        axes: Unit vectors e1, e2, e3, UFL.
        stiffness: In global axes, UFL, shape (6, 6), force/length^2.
        strain_rotation: Takes Voigt strains from global to laminate axes, UFL, shape (6, 6).

    Raises:
        InputError: The cells do not lie between bottom and top (:mod:`stacking`), or the axis is
            along the normal of a cell.
    """

    def __init__(
        self,
        mesh: Mesh,
        cells: npt.NDArray[np.integer],
        shell: ContinuumShell,
        name: str,
        order: int,
    ) -> None:
        self.shell = shell
        self._mesh, self.name, self.order = mesh, name, order
        self._degree = _DEGREE[order]
        self.stacking = find_stacking(mesh, cells, shell.bottom, shell.top, name)
        domain = mesh.domain
        self._each_cell = fem.functionspace(domain, ("DG", 0))
        self._dofs = _dofs_of(self._each_cell, self.stacking.cells)
        self.zeta = self._coordinate()
        volume, area = self._measured()
        self.heights = volume / area
        self._weight = fem.Function(self._each_cell)
        self._weight.x.array[self._dofs] = np.minimum(1.0, (volume / area) ** 2 / area)
        self.layers = self._divided(volume, area)
        self.shear_factors = shell.shear_factors or (
            shell.laminate.shear_factors() if len(self.layers) == 1 else (1.0, 1.0)
        )
        self.axes = self._axes()
        self._powers = self._moduli()
        turn = _strain_rotation(self.axes)
        local = sum(self.zeta**i * c for i, c in self._powers)
        self.stiffness = ufl.dot(ufl.transpose(turn), ufl.dot(local, turn))
        self.strain_rotation = turn

    # -- geometry -------------------------------------------------------------------------

    def _coordinate(self) -> fem.Function:
        """Zeta as a discontinuous first-order function."""
        domain, on = self._mesh.domain, self.stacking
        space = fem.functionspace(domain, basix.ufl.element("DG", "hexahedron", 1))
        at = np.asarray(space.element.basix_element.points) - 0.5
        zeta = fem.Function(space)
        values = at[:, on.axis].T * np.where(on.up, 1.0, -1.0)[:, None]
        zeta.x.array[space.dofmap.list[on.cells]] = values
        return zeta

    def _measured(self) -> tuple[Array, Array]:
        """Volume and mean area across the thickness of each cell, shapes (n_cells,)."""
        test = ufl.TestFunction(self._each_cell)
        slope = ufl.grad(self.zeta)
        dx = ufl.dx(self._mesh.domain, metadata={"quadrature_degree": 4})
        found = []
        for integrand in (test, ufl.sqrt(ufl.dot(slope, slope)) * test):
            values = fem.Function(self._each_cell)
            values.x.array[:] = fem.assemble_vector(fem.form(integrand * dx)).array
            values.x.scatter_forward()
            found.append(values.x.array[self._dofs])
        return found[0], found[1]

    def _divided(self, volume: Array, area: Array) -> list[Laminate]:
        """The laminate of each layer of cells, cut where the layers meet; collective."""
        comm, on = self._mesh.comm, self.stacking
        owned = on.cells < self._mesh.domain.topology.index_map(3).size_local
        sums = np.zeros((3, on.n_layers))
        for total, value in zip(sums, (volume, area, np.sqrt(area)), strict=True):
            np.add.at(total, on.layer[owned], value[owned])
        sums = comm.allreduce(sums, op=MPI.SUM)
        n_cells = comm.allreduce(int(owned.sum()))
        thickness = sums[0] / sums[1]
        self.thickness = float(thickness.sum())
        self.size = float(sums[2].sum()) / n_cells
        laminate = self.shell.laminate
        if self.shell.section is laminate:
            ratio = self.thickness / laminate.thickness
            if abs(ratio - 1.0) > _SAME_THICKNESS:
                log.warn(
                    "ContinuumShell of '%s': the plies are %.6g thick together, the cells %.6g; "
                    "the plies are taken %.4g times as thick as they were given",
                    self.name,
                    laminate.thickness,
                    self.thickness,
                    ratio,
                )
        self._warn_of_round_off()
        ends = np.concatenate([[0.0], np.cumsum(thickness)]) / self.thickness
        ends[-1] = 1.0
        self.first_plies = [laminate.plies_below(end) for end in ends[:-1]]
        if on.n_layers == 1:
            return [laminate]
        return [laminate.part(a, b) for a, b in pairwise(ends)]

    def _warn_of_round_off(self) -> None:
        """Warn where double precision no longer holds the bending stiffness; collective."""
        mesh = self._mesh
        x = mesh.domain.geometry.x[compat.geometry_dofmap(mesh.domain)[self.stacking.cells].ravel()]
        ends = np.concatenate([x, -x]).reshape(2, -1, 3).max(axis=1, initial=-np.inf)
        mesh.comm.Allreduce(MPI.IN_PLACE, ends, op=MPI.MAX)
        length = float(np.linalg.norm(ends.sum(axis=0)))
        lost = _LOST * (length / self.thickness) ** 4
        if lost > _TOO_MUCH_LOST:
            log.warn(
                "ContinuumShell of '%s': its length %.4g is %.4g times its thickness %.4g; "
                "rounding changes its bending stiffness by about %.1g of itself. "
                "Model a shorter part, or use fx.Shell on the surface, whose unknowns do not "
                "lose these digits",
                self.name,
                length,
                length / self.thickness,
                self.thickness,
                lost,
            )

    def _axes(self) -> list[Any]:
        """Unit vectors of the laminate axes, UFL; collective."""
        slope = ufl.grad(self.zeta)
        normal = slope / ufl.sqrt(ufl.dot(slope, slope))
        self.direction = self._directions()
        direction = self._by_cell(self.direction)
        inside = direction - ufl.dot(direction, normal) * normal
        first = inside / ufl.sqrt(ufl.dot(inside, inside))
        return [first, ufl.cross(normal, first), normal]

    def _directions(self) -> Array:
        """The user's axis in each cell, shape (n_cells, 3); collective."""
        domain, on, axis = self._mesh.domain, self.stacking, self.shell.axis
        centre = np.full((1, 3), 0.5)
        normal = ufl.grad(self.zeta)
        expression = fem.Expression(normal, centre)
        normals = np.asarray(expression.eval(domain, on.cells.astype(np.int32)))
        normals = normals.reshape(-1, 3)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        if axis is None:
            # isotropic in the plane: any direction in it serves, that of each cell its own
            given = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
        elif callable(axis):
            nodes = compat.geometry_dofmap(domain)[on.cells]
            x = domain.geometry.x[nodes].mean(axis=1)
            given, wrong, why = np.ones_like(x.T), None, ""
            try:
                given = np.asarray(axis(np.ascontiguousarray(x.T)), dtype=np.float64)
            except Exception as error:  # whatever the user's function may raise
                why = f"{type(error).__name__}: {error}"
            if why:
                wrong = (
                    f"ContinuumShell of '{self.name}': the function given as axis fails: {why}; it "
                    f"is given positions of shape {x.T.shape}"
                )
            elif given.shape != x.T.shape or not np.all(np.isfinite(given)):
                wrong = (
                    f"ContinuumShell of '{self.name}': axis gives shape {given.shape} at positions "
                    f"of shape {x.T.shape}; return finite directions of the same shape"
                )
            raise_on_all_ranks(self._mesh.comm, wrong)
            given = given.T
        else:
            given = np.broadcast_to(np.asarray(axis, dtype=np.float64), normals.shape)
        sine = np.linalg.norm(np.cross(given, normals), axis=1)
        bad = np.flatnonzero(~(sine > _PARALLEL * np.linalg.norm(given, axis=1)))
        problem = None
        if len(bad):
            nodes = compat.geometry_dofmap(domain)[on.cells[bad[0]]]
            problem = (
                f"ContinuumShell of '{self.name}': axis is along the normal of {len(bad)} cells, "
                f"the first about {format_point(domain.geometry.x[nodes].mean(axis=0))}; give "
                "another direction, or a function of position"
            )
        raise_on_all_ranks(self._mesh.comm, problem, InputError)
        return np.array(given)

    def _by_cell(self, vectors: Array) -> fem.Function:
        """One vector for each cell as a UFL coefficient."""
        domain, cells = self._mesh.domain, self.stacking.cells
        space = fem.functionspace(domain, basix.ufl.element("DG", "hexahedron", 0, shape=(3,)))
        out = fem.Function(space)
        out.x.array.reshape(-1, 3)[_dofs_of(space, cells)] = vectors
        return out

    # -- stiffness and integration --------------------------------------------------------

    def _moduli(self) -> list[tuple[int, Any]]:
        """Powers of zeta and their coefficients in laminate axes, UFL."""
        layers = self.polynomials
        powers = [i for i in range(self._degree + 1) if any(c[i].any() for c in layers)]
        return [(i, self._field([c[i] for c in layers])) for i in powers]

    @cached_property
    def polynomials(self) -> list[Array]:
        """Coefficients c_i of each layer of cells in laminate axes, with the shear factors.

        Each of shape (degree + 1, 6, 6), force/length^2.
        """
        k13, k23 = self.shear_factors
        factor = np.sqrt(np.array([1.0, 1.0, 1.0, k23, k13, 1.0]))
        return [p.polynomial(self._degree) * np.outer(factor, factor) for p in self.layers]

    def _field(self, layers: list[Array]) -> Any:
        """Values of each layer of cells, all of one shape, as a UFL coefficient."""
        domain, on = self._mesh.domain, self.stacking
        if all(np.allclose(c, layers[0], rtol=1e-12, atol=0.0) for c in layers):
            return fem.Constant(domain, np.ascontiguousarray(layers[0]))
        element = basix.ufl.element("DG", "hexahedron", 0, shape=layers[0].shape)
        space = fem.functionspace(domain, element)
        found = fem.Function(space)
        of_layer = np.array([c.ravel() for c in layers])
        by_cell = found.x.array.reshape(-1, of_layer.shape[1])
        by_cell[_dofs_of(space, on.cells)] = of_layer[on.layer]
        return found

    @cached_property
    def thermal(self) -> tuple[Any, Any, Any]:
        """What thermal strain adds to the energy, UFL, at a place in a cell.

        C a and C A in global axes, shape (6,), and (a C a, a C A, A C A), shape (3,); see
        :meth:`fxcrack.Laminate.thermal_polynomials`.
        """
        of_layers = [p.thermal_polynomials(self._degree) for p in self.layers]
        found = []
        for which in range(3):
            layers = [p[which] for p in of_layers]
            powers = [i for i in range(self._degree + 1) if any(c[i].any() for c in layers)] or [0]
            found.append(sum(self.zeta**i * self._field([c[i] for c in layers]) for i in powers))
        turn = ufl.transpose(self.strain_rotation)
        return ufl.dot(turn, found[0]), ufl.dot(turn, found[1]), found[2]

    def measure(self, dx: Any, tags: dict[int, int]) -> Any:
        """The measure of the cells, partially reduced for displacements of second order.

        Args:
            dx: Measure of the mesh with its marked cells.
            tags: Mark of the cells of each thickness axis; those that no rank has are left out.
        """
        if self.order == 1:
            return dx(tuple(tags.values()))
        graded = any(i for i, _ in self._powers)
        parts = []
        for axis, tag in tags.items():
            # a coefficient of its own: UFL 2024.2 (DOLFINx 0.9) takes integrals of one integrand
            # over several marks for one, whatever their rules are
            one = fem.Constant(self._mesh.domain, 1.0)
            for weight, in_plane in ((one - self._weight, 2), (one * self._weight, 3)):
                parts.append((weight, dx(tag, metadata=rule(axis, in_plane, 5 if graded else 3))))
        return WeightedMeasure(parts, dx(tuple(tags.values())))

    def __str__(self) -> str:
        """One line for a terminal."""
        k13, k23 = self.shear_factors
        n_plies = len(self.shell.laminate.plies)
        return (
            f"{self.name}: continuum shell, {n_plies} {'ply' if n_plies == 1 else 'plies'}, "
            f"{len(self.layers)} {'cell' if len(self.layers) == 1 else 'cells'} over the thickness "
            f"{self.thickness:.4g}, side over thickness of a cell "
            f"{self.size * len(self.layers) / self.thickness:.3g}, shear factors {k13:.4g} and "
            f"{k23:.4g}, "
            + (
                "first order, tied and enhanced strains"
                if self.order == 1
                else "partially reduced integration"
            )
        )


def _dofs_of(space: Any, cells: Ints) -> Ints:
    """Blocks of a space with one node per cell, shape of the cells."""
    return np.asarray(space.dofmap.list[cells, 0])


def _strain_rotation(axes: list[Any]) -> Any:
    """Takes Voigt strains from global axes to those of unit vectors, UFL, shape (6, 6)."""
    rows = []
    for i, j in PAIRS:
        row = []
        for k, m in PAIRS:
            a, b = axes[i], axes[j]
            if k == m:
                entry = a[k] * b[k]
            else:
                entry = (a[k] * b[m] + a[m] * b[k]) / 2
            row.append(entry if i == j else 2 * entry)
        rows.append(row)
    return ufl.as_matrix(rows)


__all__ = ["ShellCells"]
