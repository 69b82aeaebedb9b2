"""First-order continuum-shell cells: tied and enhanced strains, condensed cell by cell in numpy.

    e = L E + N a,      W = 1/2 int e : C(zeta) : e dV

with the tied covariant strains E of :mod:`fxcrack.continuum.shell_hexahedron`, turned by L into the
axes of the laminate, and six strains a of the cell alone: one that is linear across the thickness
in E_33, less its mean, and five in the plane of the cell, in the natural frame of its centre times
j0/j, so that even stresses do no work on them (Simo and Rifai 1990). As E is a combination T s of
the samples s of the element, and W is quadratic in s and a, the minimum over a is found once:

    W = 1/2 s . D s,    D = A - B^t Q^-1 B
    A = int (L T)^t C L T,    B = int N^t C L T,    Q = int N^t C N

Neither Newton's method nor explicit dynamics solves for a again, at any rotation. Custom forms are
not needed: what UFL would need unknowns of the cell for is a matrix of each cell here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fxcrack.base import compat  # isort: skip
import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import raise_on_all_ranks
from fxcrack.continuum.shell_cells import ShellCells
from fxcrack.continuum.shell_frames import covariant_to_axes
from fxcrack.continuum.shell_hexahedron import at_points, gradients, hexahedron
from fxcrack.continuum.strain_cells import StrainCells
from fxcrack.continuum.tied_forces import TiedForces

_CENTRE = np.array([[0.5, 0.5, 0.5]])
_CHUNK = 500


@dataclass(frozen=True)
class _Geometry:
    """Cells at some points.

    Attributes:
        volume: |J|, shape (n_cells, n_points), length^3.
        axes: Rows are the laminate axes, shape (n_cells, n_points, 3, 3).
        to_axes: Local Voigt strains per covariant strain, shape (n_cells, n_points, 6, 6).
    """

    volume: Array
    axes: Array
    to_axes: Array


class TiedCells:
    """Owned cells of one continuum shell of first order.

    Args:
        space: Displacement space, first order.
        shell: The cells, their stacking direction, laminate and axes.

    Attributes:
        shell: As given.
        cells: Local cells, owned, shape (n_cells,).
        nodes: Local nodes of each, the third direction upwards across the thickness, shape
            (n_cells, 8).
        strain_cells: Energy, forces and stiffness, strains condensed.
        forces: Energy and forces alone, in a tenth of the time.

    Raises:
        InputError: A cell is turned inside out.
    """

    def __init__(self, space: fem.FunctionSpace, shell: ShellCells) -> None:
        self.shell = shell
        on = shell.stacking
        n_owned = space.mesh.topology.index_map(3).size_local
        self._owned = np.flatnonzero(on.cells < n_owned)
        self.cells = on.cells[self._owned]
        order = _orders()[on.axis[self._owned], on.up[self._owned].astype(int)]
        nodes = np.asarray(space.dofmap.list, dtype=np.int64)[self.cells]
        self.nodes = np.take_along_axis(nodes, order, axis=1)
        self.x = space.tabulate_dof_coordinates()[self.nodes]
        self._check(space)
        samples, moduli = hexahedron().samples, self._condensed()
        none = np.zeros((len(self.cells), 1, len(samples.pairs), 0))
        matrices = samples.matrices[None]
        self.strain_cells = StrainCells(self.x, matrices, None, none, moduli[:, None])
        self.forces = TiedForces(self.x, samples, moduli)

    def _check(self, space: fem.FunctionSpace) -> None:
        """Refuse cells whose volume changes its sign; collective."""
        corners = np.array([(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)], dtype=float)
        tangents = np.einsum("pik,ckx->cpxi", gradients(corners), self.x)
        det = np.linalg.det(tangents)
        bad = np.flatnonzero((det * np.sign(det[:, :1]) <= 0.0).any(axis=1))
        raise_on_all_ranks(
            compat.plain_comm(space.mesh.comm),
            f"ContinuumShell of '{self.shell.name}': {len(bad)} cells are degenerate or turned "
            f"inside out, the first about {format_point(self.x[bad[0]].mean(axis=0))}; mend the "
            "mesh there"
            if len(bad)
            else None,
        )

    # -- strains and moduli --------------------------------------------------------------

    def _at(self, points: Array, chosen: slice) -> _Geometry:
        tangents = np.einsum("pik,ckx->cpxi", gradients(points), self.x[chosen])
        inverse = np.linalg.inv(tangents)
        normal = inverse[..., 2, :] / np.linalg.norm(inverse[..., 2, :], axis=-1, keepdims=True)
        along = self.shell.direction[self._owned[chosen]][:, None]
        first = along - np.einsum("cpx,cpx->cp", along + 0.0 * normal, normal)[..., None] * normal
        first /= np.linalg.norm(first, axis=-1, keepdims=True)
        axes = np.stack([first, np.cross(normal, first), normal], axis=-2)
        return _Geometry(np.abs(np.linalg.det(tangents)), axes, covariant_to_axes(tangents, axes))

    def _enhanced(self, points: Array, at: _Geometry, chosen: slice) -> Array:
        """N in laminate axes, shape (n_cells, n_points, 6, 6)."""
        centre = self._at(_CENTRE, chosen)
        r, s, t = (2.0 * points - 1.0).T
        modes = np.zeros((len(points), 6, 5))
        modes[:, 0, 0], modes[:, 1, 1] = r, s
        modes[:, 5, 2:] = np.stack([r, s, r * s], axis=-1)
        ratio = centre.volume / at.volume
        turned = np.einsum("cst,pta->cpsa", centre.to_axes[:, 0], modes)
        out = np.empty((*turned.shape[:-1], 6))
        out[..., 0] = at.to_axes[..., 2] * t[:, None] - self._mean_linear[chosen][:, None]
        out[..., 1:] = ratio[..., None, None] * turned
        return np.asarray(out)

    @cached_property
    def _mean_linear(self) -> Array:
        """Mean of the strain that is linear across the thickness, shape (n_cells, 6)."""
        element, at = hexahedron(), self._at(hexahedron().points, slice(None))
        weight = at.volume * element.weights
        linear = at.to_axes[..., 2] * (2.0 * element.points[:, 2:] - 1.0)
        mean = np.einsum("cp,cps->cs", weight, linear)
        return np.asarray(mean / weight.sum(axis=1, keepdims=True))

    def _stiffness(self, points: Array, chosen: slice) -> Array:
        """C in laminate axes, shape (n_cells, n_points, 6, 6)."""
        layers = np.stack(self.shell.polynomials)[self.shell.stacking.layer[self._owned[chosen]]]
        powers = (points[:, 2:] - 0.5) ** np.arange(layers.shape[1])
        return np.asarray(np.einsum("pi,cist->cpst", powers, layers))

    def _condensed(self) -> Array:
        """D, shape (n_cells, n_samples, n_samples)."""
        element = hexahedron()
        n = len(element.samples.pairs)
        out = np.empty((len(self.cells), n, n))
        rule = element.points, element.weights
        for k in range(0, len(out), _CHUNK):
            chosen = slice(k, k + _CHUNK)
            rows, moduli, modes = self._rows(*rule, element.interpolation, chosen)
            force = moduli @ rows
            flat = (len(rows), -1, n)
            stiff = rows.reshape(flat).transpose(0, 2, 1) @ force.reshape(flat)
            inner, coupling = _coupled(modes, moduli, force)
            stiff -= coupling.transpose(0, 2, 1) @ np.linalg.solve(inner, coupling)
            out[chosen] = 0.5 * (stiff + stiff.transpose(0, 2, 1))
        return out

    def _rows(
        self, points: Array, weights: Array, interpolation: Array, chosen: slice
    ) -> tuple[Array, Array, Array]:
        """L T, C with the weights, and N at points of some cells."""
        at = self._at(points, chosen)
        moduli = self._stiffness(points, chosen) * (at.volume * weights)[..., None, None]
        return at.to_axes @ interpolation, moduli, self._enhanced(points, at, chosen)

    @cached_property
    def _enhancement(self) -> Array:
        """Enhanced strains a per sampled strain, shape (n_cells, 6, n_samples)."""
        element = hexahedron()
        whole = slice(None)
        rows, moduli, modes = self._rows(
            element.points, element.weights, element.interpolation, whole
        )
        inner, coupling = _coupled(modes, moduli, moduli @ rows)
        return np.asarray(-np.linalg.solve(inner, coupling))

    # -- results -------------------------------------------------------------------------

    def changes(self, u: fem.Function) -> Array:
        """Displacements of the nodes of each cell, shape (n_cells, 8, 3), length."""
        return np.asarray(np.asarray(u.x.array).reshape(-1, 3)[self.nodes])

    def strains(self, u: fem.Function, points: Array, *, finite: bool) -> Array:
        """Strains, tied and enhanced, at points of each cell.

        Args:
            u: Displacement.
            points: In the order of :attr:`nodes`, zeta last and upwards, on the unit cube, shape
                (n_points, 3).
            finite: Green-Lagrange strains.

        Returns:
            Voigt strains in laminate axes, shape (n_cells, n_points, 6).
        """
        change = self.changes(u)
        sampled = self.strain_cells.covariant(change, finite=finite)[:, 0]
        samples, interpolation = at_points(points)
        middle = self.x + (0.5 * change if finite else 0.0)
        matrices = samples.matrices
        covariant = np.einsum("kij,cix,cjx->ck", matrices, middle, change, optimize=True)
        at = self._at(points, slice(None))
        tied = np.einsum("cpst,ptk,ck->cps", at.to_axes, interpolation, covariant, optimize=True)
        own = np.einsum("cak,ck->ca", self._enhancement, sampled)
        extra = np.einsum("cpsa,ca->cps", self._enhanced(points, at, slice(None)), own)
        return np.asarray(tied + extra)

    def stress_means(self, u: fem.Function, *, finite: bool) -> Array:
        """Means over each cell of the stress in global axes.

        Args:
            u: Displacement.
            finite: Cauchy stress of the Green-Lagrange strain, with the displacement gradient of
                each point.

        Returns:
            Voigt order 11, 22, 33, 23, 13, 12, shape (n_cells, 6), force/length^2.
        """
        element, whole = hexahedron(), slice(None)
        at = self._at(element.points, whole)
        moduli = self._stiffness(element.points, whole)
        local = np.einsum("cpst,cpt->cps", moduli, self.strains(u, element.points, finite=finite))
        tensor = np.empty((*local.shape[:2], 3, 3))
        for k, (i, j) in enumerate(_PAIRS):
            tensor[..., i, j] = tensor[..., j, i] = local[..., k]
        tensor = np.einsum("cpai,cpab,cpbj->cpij", at.axes, tensor, at.axes, optimize=True)
        if finite:
            slopes = gradients(element.points)
            before = np.einsum("pik,ckx->cpxi", slopes, self.x)
            after = np.einsum("pik,ckx->cpxi", slopes, self.x + self.changes(u))
            f = after @ np.linalg.inv(before)
            volume = np.linalg.det(f)[..., None, None]
            tensor = f @ tensor @ f.swapaxes(-1, -2) / volume
        weight = at.volume * element.weights
        mean = np.einsum("cp,cpij->cij", weight, tensor) / weight.sum(axis=1)[:, None, None]
        return np.stack([mean[:, i, j] for i, j in _PAIRS], axis=-1)


_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def _coupled(modes: Array, moduli: Array, force: Array) -> tuple[Array, Array]:
    """Q and N^t C L T, shapes (n_cells, 6, 6) and (n_cells, 6, n_samples)."""
    n, _, _, n_samples = force.shape
    flat = modes.reshape(n, -1, modes.shape[-1]).transpose(0, 2, 1)
    inner = flat @ (moduli @ modes).reshape(n, -1, modes.shape[-1])
    return inner, flat @ force.reshape(n, -1, n_samples)


def _orders() -> Ints:
    """Nodes of a DOLFINx cell in the order of this element, shape (3 axes, down or up, 8)."""
    out = np.empty((3, 2, 8), dtype=np.int64)
    for axis in range(3):
        first, second = [k for k in range(3) if k != axis]
        for up in (0, 1):
            for n in range(8):
                place = np.empty(3, dtype=np.int64)
                place[first], place[second] = n % 2, n // 2 % 2
                place[axis] = n // 4 if up else 1 - n // 4
                out[axis, up, n] = place @ np.array([1, 2, 4])
    return out


__all__ = ["TiedCells"]
