"""The second-order part of the strain energy of linear bodies, cell by cell, in numpy.

The Green-Lagrange strain of a displacement u is e(u) + q(u), with the small strain e and

    q(u) = 1/2 H^t H,    H: gradient of u.

Linear bodies leave q out. With their stress s = C (e - e_th) the energy it adds is of third and of
fourth order in the displacement,

    V3 = int s : q dV,    V4 = 1/2 int q : C : q dV.

The derivative of V3 + V4 in a direction v is that of int s : q, which is twice V3 for v = u and
holds the geometric stiffness K_g of the stress, and the forces r of the stress C q:

    K_g u = int s : sym(H^t grad v) dV,    r = int C q : e(v) dV.

No form is compiled: cells are integrated in chunks, as only a few products are wanted per step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import dolfinx.la
import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.cell_assembly import add_forces
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import Axisymmetric, PlaneStress
from fxcrack.continuum.materials import stiffness_of
from fxcrack.continuum.reduced_integration import rule
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_cells import ShellCells
from fxcrack.continuum.shell_frames import covariant_to_axes
from fxcrack.continuum.shell_temperature import ShellTemperature
from fxcrack.continuum.strain_cells import StrainCells
from fxcrack.continuum.temperature import ByTemperature, expansion_of

_CHUNK = 400
"""Cells handled together."""
_KEPT = 2.0e8
"""Bytes of gradients up to which they are kept instead of computed for each product."""


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """Integrals of a displacement.

    Attributes:
        third: V3, force x length.
        fourth: V4, force x length.
        geometric: K_g u on the dofs that this rank owns, shape (n_local,), force.
        stretching: r likewise.
    """

    third: float
    fourth: float
    geometric: Array
    stretching: Array


class _Kind(Protocol):
    """Owned cells of one kind.

    Attributes:
        nodes: Their local nodes, shape (n_cells, n_nodes).
    """

    nodes: Ints

    def geometric(self, at: slice, u: Array, x: Array) -> Array:
        """Forces K_g x of some cells, of the stress of u; shapes (n, n_nodes, n_unknowns)."""
        ...

    def stretching(self, at: slice, u: Array) -> tuple[Array, Array]:
        """V4 of some cells, shape (n,), and their forces r, shape (n, n_nodes, n_unknowns)."""
        ...


class SecondOrderCells:
    """All cells of linear bodies.

    Args:
        continuum: The bodies; the present temperature is that of the stress.
    """

    def __init__(self, continuum: Continuum) -> None:
        self._continuum = continuum
        self._kinds: list[_Kind] = []
        if isinstance(continuum, ShellBodies):
            thermal = None if continuum.temperature is None else ShellTemperature(continuum)
            for i, part in enumerate(continuum.shell_parts):
                given = None if thermal is None else thermal.stress(i)
                self._kinds.append(_Tied(part.nodes, part.strain_cells, given))
            return
        for i in range(len(continuum.parts)):
            tied = continuum.tied_cells.get(i)
            if tied is not None:
                self._kinds.append(_Tied(tied.nodes, tied.strain_cells, None))
            elif i in continuum.shell_cells:
                self._kinds += _shell_solids(continuum, i)
            else:
                self._kinds.append(_solid(continuum, i))

    @staticmethod
    def covers(continuum: Continuum) -> bool:
        """Whether there is such an energy.

        Not in generalised plane strain, which has no finite strain, and not where moduli depend on
        temperature or continuum shells have one.
        """
        if continuum.layout.shared:
            return False
        if continuum.temperature is None or isinstance(continuum, ShellBodies):
            return True
        tabulated = any(isinstance(m, ByTemperature) for m in continuum.part_materials)
        return not (tabulated or continuum.shell_cells)

    def of(self, u: Array) -> SecondOrder:
        """Integrals of a displacement; collective.

        Args:
            u: Of the dofs that this rank owns, shape (n_local,), length.
        """
        local = self._local(u)
        stretch = np.zeros_like(local)
        fourth = 0.0
        for kind in self._kinds:
            for at, mine in self._chunks(kind, local):
                energy, force = kind.stretching(at, mine)
                fourth += float(energy.sum())
                add_forces(stretch, kind.nodes[at], force.reshape(len(mine), -1))
        geometric = self.geometric(u, u)
        stretching = self._summed(stretch)
        comm = self._continuum.comm
        third, fourth = np.sum(comm.allgather((0.5 * float(u @ geometric), fourth)), axis=0)
        return SecondOrder(third, fourth, geometric, stretching)

    def geometric(self, u: Array, x: Array) -> Array:
        """K_g x of the stress of u; collective.

        Args:
            u: Displacement that causes the stress, shape (n_local,), length.
            x: Another displacement, likewise.

        Returns:
            Forces on the dofs that this rank owns, shape (n_local,).
        """
        first, second = self._local(u), self._local(x)
        out = np.zeros_like(first)
        for kind in self._kinds:
            moved = self._chunks(kind, second)
            for (at, mine), (_, other) in zip(self._chunks(kind, first), moved, strict=True):
                force = kind.geometric(at, mine, other)
                add_forces(out, kind.nodes[at], force.reshape(len(mine), -1))
        return self._summed(out)

    def _chunks(self, kind: _Kind, local: Array) -> list[tuple[slice, Array]]:
        """Cells handled together, and their values, shape (n, n_nodes, n_unknowns)."""
        by_node = local.reshape(-1, self._continuum.layout.n_unknowns)
        every = (slice(k, k + _CHUNK) for k in range(0, len(kind.nodes), _CHUNK))
        return [(at, by_node[kind.nodes[at]]) for at in every]

    def _local(self, owned: Array) -> Array:
        """Values of the local dofs, ghosts too; collective."""
        function = fem.Function(self._continuum.space)
        function.x.array[: len(owned)] = owned
        function.x.scatter_forward()
        return np.asarray(function.x.array).copy()

    def _summed(self, local: Array) -> Array:
        """Sum over ranks on the owned dofs of forces on the local ones; collective."""
        function = fem.Function(self._continuum.space)
        function.x.array[:] = local
        function.x.scatter_reverse(dolfinx.la.InsertMode.add)
        return np.asarray(function.x.array[: self._continuum.n_local]).copy()


class _Tied:
    """Cells with strains quadratic in their vectors (:mod:`strain_cells`)."""

    def __init__(self, nodes: Ints, cells: StrainCells, thermal: Array | None) -> None:
        self.nodes, self._cells, self._thermal = nodes, cells, thermal

    def geometric(self, at: slice, u: Array, x: Array) -> Array:
        """See :class:`_Kind`."""
        given = None if self._thermal is None else self._thermal[at]
        stress = self._cells.stress(at, self._cells.linear_part(at, _vectors(u)), given)
        return np.asarray(self._cells.forces(_vectors(x), stress).reshape(x.shape))

    def stretching(self, at: slice, u: Array) -> tuple[Array, Array]:
        """See :class:`_Kind`."""
        strain = self._cells.quadratic_part(_vectors(u))
        stress = self._cells.stress(at, strain, None)
        force = self._cells.forces(self._cells.vectors[at], stress)
        return 0.5 * np.einsum("cpk,cpk->c", stress, strain), force.reshape(u.shape)


def _vectors(u: Array) -> Array:
    """Unknowns of cells as vectors, shape (n, n_vectors, 3)."""
    return u.reshape(len(u), -1, 3)


Moduli = Callable[[slice], Array]
"""C of some cells, broadcast to shape (n, n_points, n_strains, n_strains)."""


class _Solid:
    """Solid cells with one quadrature rule.

    Args:
        continuum: The bodies.
        cells: Owned cells, shape (n_cells,).
        quadrature: Points of the reference cell, shape (n_points, tdim), and weights, shape
            (n_points,).
        moduli: C.
        held: Thermal stress per degree, on the strains of the model; ``None`` for none.
    """

    def __init__(
        self,
        continuum: Continuum,
        cells: Ints,
        quadrature: tuple[Array, Array],
        moduli: Moduli,
        held: Array | None,
    ) -> None:
        domain, self._model = continuum.mesh.domain, continuum.model
        self._continuum, self._cells, self._moduli, self._held = continuum, cells, moduli, held
        self.nodes = np.asarray(continuum.space.dofmap.list)[cells].astype(np.int64)
        self._corners = compat.geometry_dofmap(domain)[cells]
        cell = getattr(basix.CellType, domain.topology.cell_name())
        self._points, self._weights = quadrature
        self._geometry = _table(cell, continuum.mesh.order, self._points)
        self._shapes = _table(cell, continuum.order, self._points)
        self._known: dict[int, tuple[Array, Array, Array]] = {}
        n = continuum.gdim
        self._voigt = [(i, i) for i in range(n)]
        self._ring = isinstance(self._model, Axisymmetric)
        self._voigt += [(1, 2), (0, 2), (0, 1)] if n == 3 else [(0, 1)]

    def _measure(self, at: slice) -> tuple[Array, Array, Array]:
        """What :meth:`_measured` gives, kept where it is little."""
        if at.start not in self._known:
            found = self._measured(at)
            if 8.0 * len(self.nodes) * found[0][0].size > _KEPT:
                return found
            self._known[at.start] = found
        return self._known[at.start]

    def _measured(self, at: slice) -> tuple[Array, Array, Array]:
        """Gradients of the shape functions (n, n_nodes, p gdim), volumes and radii (n, p)."""
        x = self._continuum.mesh.domain.geometry.x[self._corners[at]][:, :, : self._model.gdim]
        n, n_points, gdim = len(x), len(self._weights), self._model.gdim
        flat = self._geometry[1:].transpose(2, 1, 0).reshape(x.shape[1], -1)
        jacobian = (x.swapaxes(1, 2) @ flat).reshape(n, gdim, n_points, gdim).swapaxes(1, 2)
        inverse = np.linalg.inv(jacobian)
        slopes = self._shapes[1:].transpose(1, 2, 0) @ inverse
        volume = np.abs(np.linalg.det(jacobian)) * self._weights
        radius = x[:, :, 0] @ self._geometry[0].T
        weight = self._model.weight([radius, None])
        return slopes.swapaxes(1, 2).reshape(n, -1, n_points * gdim), volume * weight, radius

    def _strains(self, gradient: Array, hoop: Array, *, quadratic: bool) -> Array:
        """Voigt strains of the model, shape (n, p, n_strains), engineering shears."""
        h = gradient
        if quadratic:
            h, hoop = 0.5 * h.swapaxes(-1, -2) @ h, 0.5 * hoop**2
        n = self._model.gdim
        parts = [h[..., i, i] for i in range(n)]
        if self._ring:
            parts.append(hoop)
        parts += [h[..., i, j] + h[..., j, i] for i, j in self._voigt[n:]]
        return np.stack(parts, axis=-1)

    def _gradient(self, slopes: Array, radius: Array, u: Array) -> tuple[Array, Array]:
        """H, shape (n, p, gdim, gdim), and the strain u_r/r of a ring, shape (n, p)."""
        n, n_points, gdim = len(u), len(self._weights), self._model.gdim
        h = (u.swapaxes(1, 2) @ slopes).reshape(n, gdim, n_points, gdim).swapaxes(1, 2)
        if not self._ring:
            return h, np.zeros(h.shape[:2])
        return h, u[:, :, 0] @ self._shapes[0].T / radius

    def _stress(self, at: slice, strain: Array) -> Array:
        return np.asarray((self._moduli(at) @ strain[..., None])[..., 0])

    def _thermal(self, at: slice) -> Array | float:
        """Stress of the present temperature, shape (n, p, n_strains)."""
        field = self._continuum.temperature
        if self._held is None or field is None:
            return 0.0
        space = field.rise.function_space
        rise = field.rise.x.array[space.dofmap.list[self._cells[at]]]
        table = space.element.basix_element.tabulate(0, self._points)[0][..., 0]
        return np.asarray(np.einsum("cn,pn->cp", rise, table)[..., None] * self._held)

    def _forces(self, slopes: Array, radius: Array, first: Array, hoop: Array) -> Array:
        """Forces int P : grad v + P_tt v_r/r of stresses times volumes, (n, n_nodes, gdim)."""
        n, n_points, gdim = len(first), len(self._weights), self._model.gdim
        out = slopes @ first.swapaxes(2, 3).reshape(n, n_points * gdim, gdim)
        if self._ring:
            out[..., 0] += (hoop / radius) @ self._shapes[0]
        return np.asarray(out)

    def _tensor(self, stress: Array) -> tuple[Array, Array]:
        """Tensor in the plane or in space, and hoop stress, of Voigt stresses of the model."""
        n = self._model.gdim
        out = np.zeros((*stress.shape[:-1], n, n))
        order = list(range(n)) + [k + n + int(self._ring) for k in range(len(self._voigt) - n)]
        for k, (i, j) in zip(order, self._voigt, strict=True):
            out[..., i, j] = out[..., j, i] = stress[..., k]
        return out, stress[..., n] if self._ring else np.zeros(stress.shape[:-1])

    def geometric(self, at: slice, u: Array, x: Array) -> Array:
        """See :class:`_Kind`."""
        slopes, volume, radius = self._measure(at)
        strain = self._strains(*self._gradient(slopes, radius, u), quadratic=False)
        stress, hoop = self._tensor(self._stress(at, strain) - self._thermal(at))
        h, moved = self._gradient(slopes, radius, x)
        return self._forces(
            slopes, radius, h @ stress * volume[..., None, None], moved * hoop * volume
        )

    def stretching(self, at: slice, u: Array) -> tuple[Array, Array]:
        """See :class:`_Kind`."""
        slopes, volume, radius = self._measure(at)
        strain = self._strains(*self._gradient(slopes, radius, u), quadratic=True)
        stress = self._stress(at, strain)
        energy = 0.5 * np.einsum("cp,cps,cps->c", volume, stress, strain)
        tensor, hoop = self._tensor(stress)
        return energy, self._forces(slopes, radius, tensor * volume[..., None, None], hoop * volume)


def _solid(continuum: Continuum, i: int) -> _Solid:
    """Cells of an ordinary solid part."""
    material, model = continuum.part_materials[i], continuum.model
    whole = stiffness_of(material)
    moduli = model.reduce(whole)
    held = None
    expansion = expansion_of(material)
    if continuum.temperature is not None and expansion.any():
        if isinstance(model, PlaneStress):
            held = moduli @ expansion[[0, 1, 5]]
        else:
            keep = {2: [0, 1, 5], 3: list(range(6))}[model.gdim]
            keep = [0, 1, 2, 5] if isinstance(model, Axisymmetric) else keep
            held = (whole @ expansion)[keep]
    cell = getattr(basix.CellType, continuum.mesh.domain.topology.cell_name())
    points = basix.make_quadrature(cell, continuum.degree)
    cells = continuum.part_cells[i].astype(np.int64)
    return _Solid(continuum, cells, points, lambda at: moduli, held)


def _shell_solids(continuum: Continuum, i: int) -> list[_Kind]:
    """Cells of a second-order continuum shell, one kind per reference axis across it.

    Strains are those at the points of the reduced rule, which thin cells do not lock in.
    """
    shell = continuum.shell_cells[i]
    on = shell.stacking
    owned = on.cells < continuum.mesh.domain.topology.index_map(3).size_local
    out: list[_Kind] = []
    for axis in range(3):
        chosen = np.flatnonzero(owned & (on.axis == axis))
        if not len(chosen):
            continue
        points, weights = _reduced(axis)
        out.append(
            _Solid(
                continuum, on.cells[chosen].astype(np.int64), (points, weights),
                _LaminateModuli(continuum, shell, chosen, points[:, axis] - 0.5), None,
            )
        )  # fmt: skip
    return out


def _reduced(axis: int) -> tuple[Array, Array]:
    """Two Gauss points in the plane and three across the thickness, and their weights."""
    metadata = rule(axis, 2, 3)
    return metadata["quadrature_points"], metadata["quadrature_weights"]


class _LaminateModuli:
    """C of continuum-shell cells in global axes, the axes of each cell those of its middle."""

    def __init__(
        self, continuum: Continuum, shell: ShellCells, chosen: Ints, heights: Array
    ) -> None:
        on, domain = shell.stacking, continuum.mesh.domain
        x = domain.geometry.x[compat.geometry_dofmap(domain)[on.cells[chosen]]]
        middle = np.full((1, 3), 0.5)
        table = _table(basix.CellType.hexahedron, continuum.mesh.order, middle)[1:, 0]
        inverse = np.linalg.inv(np.einsum("cni,jn->cij", x, table))
        sign = np.where(on.up[chosen], 1.0, -1.0)
        normal = inverse[np.arange(len(chosen)), on.axis[chosen]] * sign[:, None]
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        along = shell.direction[chosen]
        along = along - np.einsum("cx,cx->c", along, normal)[:, None] * normal
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        self._axes = np.stack([along, np.cross(normal, along), normal], axis=1)
        self._layers, self._layer = np.stack(shell.polynomials), on.layer[chosen]
        self._heights = sign[:, None] * heights

    def __call__(self, at: slice) -> Array:
        turn = covariant_to_axes(np.broadcast_to(np.eye(3), self._axes[at].shape), self._axes[at])
        turn[..., 3:] *= 0.5  # of tensor components to begin with, here of engineering shears
        powers = self._heights[at, :, None] ** np.arange(self._layers.shape[1])
        local = np.einsum("cpi,cist->cpst", powers, self._layers[self._layer[at]])
        return np.asarray(turn.swapaxes(1, 2)[:, None] @ local @ turn[:, None])


def _table(cell: basix.CellType, order: int, points: Array) -> Array:
    """Lagrange shape functions and their gradients, shape (1 + tdim, n_points, n_nodes)."""
    element = basix.create_element(
        basix.ElementFamily.P, cell, order, basix.LagrangeVariant.gll_warped
    )
    return np.asarray(element.tabulate(1, np.asarray(points))[..., 0])


__all__ = ["SecondOrder", "SecondOrderCells"]
