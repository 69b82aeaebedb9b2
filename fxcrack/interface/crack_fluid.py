"""Pressure that follows the crack where bodies turn and stretch by any amount.

The fluid between the faces is bounded by the slave surface and by its image on the master side: the
same facets, each node s at its master point x_s + W u_m in place of x_s + u_s. Both sheets are
loaded normal to where they are now,

    f_j(x) = -int p N_j da,    da = (x,1 x x,2) dxi,    f . u = f(x_s) . u_s - f(x_W) . W u_m

so that nothing acts where the faces are bonded: there both sheets are one. The dead load f_0 of
:mod:`fxcrack.interface.crack_pressure` on the undeformed facets is a force pattern of the solver,
with load factor p; the term here adds the rest, p (f(x) - f_0). The volume between the sheets is

    V = -sum_j int_0^1 f_j(x_W + s (x_s - x_W)) . (x_s - x_W) ds    at p = 1,

exact by Simpson's rule, as f is quadratic in the positions (for a ring as well).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import basix
import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.sparse import by_component
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.continuum.follower_work import SIMPSON, FollowerWork
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.kinematics import Axisymmetric
from fxcrack.continuum.term import Term
from fxcrack.interface.crack_pressure import CrackPressure
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.surface import gather_surface, shape_functions


class _Sheet:
    """The facets of a slave surface, wherever their nodes are.

    Args:
        load: The pressure.
        axisymmetric: Whether facets are rings.
    """

    def __init__(self, load: CrackPressure, *, axisymmetric: bool) -> None:
        surface = load.surface
        self._axisymmetric, self.facets = axisymmetric, surface.facets
        cell = getattr(basix.CellType, surface.kind)
        # shape function, area vector and pressure, each of up to the order of the facet or a half
        # more along each edge
        points, weights = basix.make_quadrature(cell, 4 * surface.order)
        xi = np.asarray(points)
        self._values, self._gradient = shape_functions(surface.kind, surface.order, xi)
        normal, _ = surface.facet_normals(xi)
        area = self._area(surface.x)
        outward = np.einsum("fmc,fmc->f", area, normal) >= 0.0
        each = np.asarray(weights) * np.where(outward, 1.0, -1.0)[:, None] * load.values_at(xi)
        if not axisymmetric:
            each = each * (surface.breadth[surface.facets] @ self._values.T)
        each[~load.takes[surface.facets].any(axis=1)] = 0.0
        self._each, self._takes = each, load.takes
        self._shape = surface.n_nodes, load.pair.frames.shape[1]

    def _tangents(self, x: Array) -> Array:
        return np.asarray(np.einsum("dmk,fkc->dfmc", self._gradient, x[self.facets]))

    def _area(self, x: Array) -> Array:
        """Vectors x,1 x x,2 (x,1 x e_z in a plane), shape (n_facets, m, 3)."""
        tangents = self._tangents(x)
        return np.cross(tangents[0], tangents[1] if len(tangents) == 2 else [0.0, 0.0, 1.0])

    def _around(self, x: Array) -> Array:
        """Circumference of rings at the quadrature points, shape (n_facets, m), or ones."""
        if not self._axisymmetric:
            return np.ones(self._each.shape)
        return np.asarray(2.0 * np.pi * (x[self.facets][..., 0] @ self._values.T))

    def forces(self, x: Array, chosen: Bools | None = None) -> Array:
        """f(x) at p = 1.

        Args:
            x: Positions of the nodes, shape (n_nodes, 3), length.
            chosen: Facets that count, shape (n_facets,); all by default.

        Returns:
            Shape (n_nodes, gdim), force.
        """
        each = self._each * self._around(x)
        if chosen is not None:
            each = np.where(chosen[:, None], each, 0.0)
        out = np.zeros(self._shape)
        by_facet = -np.einsum("fm,mk,fmc->fkc", each, self._values, self._area(x))
        np.add.at(out, self.facets, by_facet[..., : self._shape[1]])
        out[~self._takes] = 0.0
        return out

    def tangent(self, x: Array) -> sp.csr_matrix:
        """Change of f(x) with the positions, on components of the nodes, square."""
        n, gdim = self._shape
        tangents, each = self._tangents(x), self._each * self._around(x)
        blocks = np.zeros((*self.facets.shape, self.facets.shape[1], 3, 3))
        turned: tuple[Array, ...]
        if len(tangents) == 2:
            turned = (-_cross(tangents[1]), _cross(tangents[0]))
        else:
            turned = (np.broadcast_to(-_cross(np.array([0.0, 0.0, 1.0])), (*each.shape, 3, 3)),)
        for gradient, matrix in zip(self._gradient, turned, strict=True):
            blocks -= np.einsum(
                "fm,mi,mj,fmcd->fijcd", each, self._values, gradient, matrix, optimize=True
            )
        if self._axisymmetric:
            part = 2.0 * np.pi * self._each
            blocks[..., 0] -= np.einsum(
                "fm,mi,mj,fmc->fijc", part, self._values, self._values, self._area(x), optimize=True
            )
        blocks = blocks[..., :gdim, :gdim].transpose(0, 1, 3, 2, 4)
        at = (gdim * self.facets[:, :, None] + np.arange(gdim)).reshape(len(self.facets), -1)
        k = at.shape[1]
        rows, columns = np.repeat(at, k, axis=1).ravel(), np.tile(at, (1, k)).ravel()
        found = sp.csr_matrix((blocks.ravel(), (rows, columns)), shape=(n * gdim, n * gdim))
        return sp.csr_matrix(sp.diags(np.repeat(self._takes, gdim).astype(float)) @ found)


class _Links(NamedTuple):
    """Slave nodes and masters of the present pairing among the nodes of the interface.

    Attributes:
        slaves: Picks the slave nodes, (n_slaves, n_nodes).
        masters: W, (n_slaves, n_nodes).
    """

    slaves: sp.csr_matrix
    masters: sp.csr_matrix


class CrackFluid(Term):
    """What finite strain changes of the forces of a pressure that follows the crack.

    Args:
        continuum: The bodies.
        pressure: The pressure on the undeformed facets.
        pairs: Interfaces; replaced in this list where nodes are paired anew.

    Attributes:
        pressure: See above.
    """

    symmetric = False
    by_cells = True

    def __init__(
        self, continuum: Continuum, pressure: CrackPressure, pairs: Sequence[Pair]
    ) -> None:
        self.name = f"pressure '{pressure.title}' on faces that turn"
        self.pressure, self._pairs, self._continuum = pressure, pairs, continuum
        pair, master = pressure.pair, pressure.pair.sides[1]
        sides = [gather_surface(continuum, master)] if isinstance(master, str | Face) else []
        self._nodes = nodes = InterfaceNodes.of_pairs(continuum.layout, [pair], sides)
        self._x = nodes.share(continuum.positions()[nodes.local])
        self._sheet = _Sheet(pressure, axisymmetric=isinstance(continuum.model, Axisymmetric))
        self._known: tuple[Pair, _Links] | None = None
        self._rest = np.zeros((pair.surface.n_nodes, 3))
        self._rest = pair.surface.x - self._image(np.zeros_like(self._x))
        self._dead = self._all_forces(np.zeros_like(self._x))
        self._path = FollowerWork(continuum.space)
        self._now = np.zeros_like(self._x)  # displacement of the nodes in the present trial
        self._factor = 0.0

    # -- geometry ------------------------------------------------------------------------

    @property
    def _links(self) -> _Links:
        pair = self._pairs[self.pressure.p]
        if self._known is None or self._known[0] is not pair:
            by_nodes, n = pair.by_nodes(), len(self._nodes)
            slaves = self._nodes.find(pair.surface.dofs)
            rows = np.arange(len(slaves))
            shape = (len(slaves), n)
            picks = sp.csr_matrix((np.ones(len(slaves)), (rows, slaves)), shape=shape)
            masters = self._nodes.find(by_nodes.masters)
            at = np.repeat(rows, masters.shape[1])
            weights = sp.csr_matrix((by_nodes.weights.ravel(), (at, masters.ravel())), shape=shape)
            self._known = pair, _Links(picks, weights)
        return self._known[1]

    def _gather(self, u: Array) -> Array:
        """Displacement of the nodes from that of the local dofs, shape (n_nodes, 3); collective."""
        gdim = self._continuum.gdim
        found = self._nodes.gather(u[: self._continuum.n_local])[:, :gdim]
        return np.pad(found, ((0, 0), (0, 3 - gdim)))

    def _slave(self, u: Array) -> Array:
        return np.asarray(self.pressure.pair.surface.x + self._links.slaves @ u)

    def _image(self, u: Array) -> Array:
        """Master points of the slave nodes, where there are masters, shape (n_slaves, 3)."""
        if self._pairs[self.pressure.p].rigid is not None:
            return np.asarray(self.pressure.pair.surface.x)
        return np.asarray(self._rest + self._links.masters @ (self._x + u))

    def _all_forces(self, u: Array) -> Array:
        """Forces on the nodes at p = 1, shape (n_nodes, gdim)."""
        links, sheet = self._links, self._sheet
        out = links.slaves.T @ sheet.forces(self._slave(u))
        return np.asarray(out - links.masters.T @ sheet.forces(self._image(u)))

    def more_volume(self) -> float:
        """The volume at present (times value) less the part that the dead load has done work on."""
        gdim = self._continuum.gdim
        begin, end = self._image(self._now), self._slave(self._now)
        across = end - begin
        swept = sum(
            w * float(np.vdot(self._sheet.forces(begin + s * across), across[:, :gdim]))
            for s, w in SIMPSON
        )
        return swept - float(np.vdot(self._dead, self._now[:, :gdim]))

    def more_on_faces(self, bonded: Bools | None = None) -> Array:
        """Present forces on the slave side less those of the dead load, with the load factor.

        Args:
            bonded: Count facets alone whose nodes are all bonded, shape (n_nodes,).

        Returns:
            On the jumps of the slave nodes, shape (n_nodes, gdim), force.
        """
        pair = self.pressure.pair
        chosen = None if bonded is None else bonded[self._sheet.facets].all(axis=1)
        now = self._sheet.forces(self._slave(self._now), chosen)
        out = self._factor * (now - self._sheet.forces(pair.surface.x, chosen))
        return self.pressure.on_jumps(out)

    # -- the term ------------------------------------------------------------------------

    def begin(self, time: float, dt: float) -> None:
        """Set the pressure at the end of the increment."""
        self._factor = float(self.pressure.amplitude(time))

    def update(self, u: fem.Function) -> None:
        """Take the displacement of the nodes; collective."""
        self._now = self._gather(u.x.array)

    def add_residual(self, forces: Array, u: fem.Function) -> None:
        """Add what the forces have changed by, on the nodes that this rank owns."""
        layout, gdim = self._continuum.layout, self._continuum.gdim
        change = self._all_forces(self._now) - self._dead
        at = layout.dof(self._nodes.local[:, None], np.arange(gdim))
        forces[at] -= self._factor * change[self._nodes.mine]

    def add_tangent(self, matrix: PETSc.Mat, u: fem.Function) -> None:
        """Add their change with the displacement.

        On meshes that do not match it couples nodes of different cells, for which the matrix has no
        place: these entries are left out, and the iteration takes a few steps more.
        """
        if self._factor == 0.0:
            return
        gdim, links = self._continuum.gdim, self._links
        slaves, masters = (by_component(m, gdim) for m in links)
        found = slaves.T @ self._sheet.tangent(self._slave(self._now)) @ slaves
        if self._pairs[self.pressure.p].rigid is None:
            image = self._sheet.tangent(self._image(self._now))
            found = found - masters.T @ image @ masters
        dofs = (gdim * self._nodes.nodes[:, None] + np.arange(gdim)).ravel()
        mine = slice(gdim * self._nodes.mine.start, gdim * self._nodes.mine.stop)
        own = sp.csr_matrix(-self._factor * found)[mine]
        rows = dofs[mine].astype(PETSc.IntType)
        columns = dofs[own.indices].astype(PETSc.IntType)
        matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_LOCATIONS, False)
        for k, row in enumerate(rows):
            part = slice(own.indptr[k], own.indptr[k + 1])
            matrix.setValues(row, columns[part], own.data[part], addv=PETSc.InsertMode.ADD_VALUES)

    def path_work(self, u: fem.Function) -> float:
        """Work of the change on the straight path from the last state, exact."""
        gdim, last = self._continuum.gdim, self._gather(self._path.u)
        step = self._gather(u.x.array) - last

        def power(s: float, factor: float) -> float:
            change = self._all_forces(last + s * step) - self._dead
            return factor * float(np.vdot(change, step[:, :gdim]))

        return self._path.along(self._factor, power)

    def commit(self, u: fem.Function) -> None:
        """Add the work along the straight path from the last state."""
        self._path.accept(u, self._factor, self.path_work(u))

    def work(self) -> float:
        """Work of the change up to the last commit, force x length; the same on all ranks."""
        return self._path.work

    def state(self) -> dict[str, Array]:
        """State of the work, shapes as in :meth:`FollowerWork.state`."""
        return self._path.state()

    def places(self) -> dict[str, Place]:
        """Where that state is defined."""
        return self._path.places()

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        self._path.restore(state)
        self._factor = self._path.factor


def _cross(a: Array) -> Array:
    """Matrices [a] with [a] b = a x b, shape (..., 3) to (..., 3, 3)."""
    out = np.zeros((*a.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i, j], out[..., j, i] = -a[..., k], a[..., k]
    return out


__all__ = ["CrackFluid"]
