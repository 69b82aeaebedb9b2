"""Pressure on the faces of a crack that is extended to what the crack opens.

Both faces of an interface are loaded, all of it: slave nodes by f_j = int p n N_j w dA, n pointing
into the body of the slave, and their masters by what does the opposite work, -W^t f. In jump
coordinates that is a force on the opening alone,

    f . u = int p delta_n w dA,

so that it does nothing where the faces are bonded (their jumps are zero) and acts on every node
from its release on. Its conjugate is the volume between the faces for p = 1: what was injected.
On second-order tetrahedra W is that of the whole jump of each node, and so is the opening; what the
forces of midside nodes do with the jumps of their corners comes with the jump coordinates
(:mod:`fxcrack.interface.hierarchy`).

Bond forces are found from the equilibrium of a node and so contain p times the area that is still
bonded; :meth:`CrackPressure.under_bonds` says how much that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import basix
import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.errors import InputError
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import AmplitudeLike, Field, Pressure
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports
from fxcrack.interface.surface import FacetSurface, shape_functions

_ACROSS = 1e-8
"""Components of a normal below this are none."""


@dataclass(frozen=True, eq=False)
class CrackPressure:
    """A pressure on both faces of an interface, wherever it is open.

    Attributes:
        title: Name in the history.
        amplitude: Factor in time.
        value: Pressure at amplitude 1, force/length^2, a number or a function of position.
        where: Name of the interface.
        p: Number of the pair.
    """

    title: str
    amplitude: AmplitudeLike
    value: Field
    where: str
    p: int
    _pair: list[Pair] = field(repr=False, default_factory=list)
    _takes: list[Bools] = field(repr=False, default_factory=list)
    _shares: list[Array] = field(repr=False, default_factory=list)

    @classmethod
    def of(
        cls, load: Pressure, pairs: Sequence[Pair], continuum: Continuum, supports: Supports
    ) -> CrackPressure:
        """What a load means in a scene; collective.

        Args:
            load: The pressure, with ``follows_crack``.
            pairs: Interfaces of the scene.
            continuum: Its bodies.
            supports: Its supports.

        Raises:
            InputError: It names no interface, or more than one, or one that cannot have it.
        """
        owner = f"pressure '{load.title}'"
        if isinstance(continuum, ShellBodies):
            raise InputError(f"{owner}: follows_crack is not possible in shells; use solids")
        found = [
            p
            for p, pair in enumerate(pairs)
            if load.where in (pair.title, pair.interface.slave, pair.interface.master)
        ]
        if len(found) != 1:
            names = ", ".join(f"'{pair.title}'" for pair in pairs) or "none"
            raise InputError(
                f"{owner}: follows_crack acts on both faces of one interface, but '{load.where}' "
                f"is {'the name or a surface of none' if not found else 'a surface of several'}; "
                f"give the name of one of them ({names})"
            )
        pair = pairs[found[0]]
        takes = pair.paired & ~_held(pair, continuum, supports)
        parts = pair.title, found[0], [pair], [takes]
        return cls(load.title, load.amplitude, load.value, *parts)

    @property
    def pair(self) -> Pair:
        """The interface as it was paired at the start."""
        return self._pair[0]

    @property
    def takes(self) -> Bools:
        """Slave nodes that take forces: those that may open, shape (n_nodes,)."""
        return self._takes[0]

    @property
    def surface(self) -> FacetSurface:
        """The slave surface by facets of the order of the bodies."""
        pair = self.pair
        if pair.hierarchy is None:
            return pair.surface
        # the facets of the crack are first-order triangles; these are theirs with midside nodes
        whole, n = pair.whole_surface, pair.surface.n_nodes
        number = np.array([n * n, n, 1])
        wanted = np.sort(pair.surface.facets[:, :3], axis=1) @ number
        has = np.isin(np.sort(whole.facets[:, :3], axis=1) @ number, wanted)
        return whole if has.all() else replace(whole, facets=whole.facets[has])

    def _facet_forces(self) -> Array:
        """Forces at amplitude 1 on the slave nodes of each facet, (n_facets, n_nodes, gdim)."""
        if not self._shares:
            surface, gdim = self.surface, self.pair.frames.shape[1]
            cell = getattr(basix.CellType, surface.kind)
            points, weights = basix.make_quadrature(cell, 2 * surface.order + 2)
            xi = np.asarray(points)
            values, _ = shape_functions(surface.kind, surface.order, xi)
            normal, size = surface.facet_normals(xi)
            x = np.einsum("mk,fkc->fmc", values, surface.x[surface.facets])
            pressure = self._values(x)
            breadth = surface.breadth[surface.facets] @ values.T
            each = weights * size * breadth * pressure
            out = -np.einsum("fm,mk,fmc->fkc", each, values, normal[..., :gdim])
            out[~self._takes[0][surface.facets]] = 0.0
            self._shares.append(out)
        return self._shares[0]

    def _values(self, x: Array) -> Array:
        """The pressure at amplitude 1 at positions, shape (..., 3) to (...)."""
        if not callable(self.value):
            return np.full(x.shape[:-1], float(self.value))
        where = f"pressure '{self.title}'"
        return numbers_at(where, "value", self.value, x.reshape(-1, 3)).reshape(x.shape[:-1])

    def values_at(self, xi: Array) -> Array:
        """The pressure at amplitude 1 at reference points of every facet.

        Args:
            xi: Shape (m, dim).

        Returns:
            Shape (n_facets, m), force/length^2.
        """
        surface = self.surface
        shape, _ = shape_functions(surface.kind, surface.order, xi)
        return self._values(np.einsum("mk,fkc->fmc", shape, surface.x[surface.facets]))

    def _at_nodes(self, chosen: Bools | None = None) -> Array:
        surface = self.surface
        forces, facets = self._facet_forces(), surface.facets
        if chosen is not None:
            forces, facets = forces[chosen], facets[chosen]
        out = np.zeros((surface.n_nodes, forces.shape[-1]))
        np.add.at(out, facets, forces)
        return out

    def under_bonds(self, bonded: Bools) -> Array:
        """Forces on the slave side of facets whose nodes are all bonded, at amplitude 1.

        Args:
            bonded: Bonded slave nodes, shape (n_nodes,).

        Returns:
            Shape (n_nodes, gdim), force.
        """
        return self.on_jumps(self._at_nodes(bonded[self.surface.facets].all(axis=1)))

    def on_jumps(self, forces: Array) -> Array:
        """Forces on the jumps of the slave nodes by those on the nodes, (n_nodes, gdim) both.

        The force of a midside node of second-order tetrahedra acts on the jumps of its corners.
        """
        hierarchy, out = self.pair.hierarchy, forces.copy()
        if hierarchy is not None:
            np.add.at(out, hierarchy.ends, 0.5 * forces[hierarchy.midsides][:, None, :])
        return out

    def vector(self, continuum: Continuum) -> PETSc.Vec:
        """Nodal forces at amplitude 1 on both faces; collective; the caller destroys the vector."""
        pair, layout = self.pair.by_nodes(), continuum.layout
        forces = self._at_nodes()
        vector = PETSc.Vec().createMPI((layout.n_local, layout.n_global), comm=continuum.comm)
        on_masters = -pair.forces_on_masters(forces)
        for nodes, values in ((pair.surface.dofs, forces), (pair.masters, on_masters)):
            mine = layout.is_owned(nodes)
            local = layout.to_local(nodes[mine])
            for i in range(values.shape[-1]):
                np.add.at(vector.array, layout.dof(local, i), values[mine][:, i])
        return vector


def _held(pair: Pair, continuum: Continuum, supports: Supports) -> Bools:
    """Bonded slave nodes that supports keep from opening, shape (n_nodes,); collective.

    They never open, and a force on them would only change the reactions.
    """
    nodes = InterfaceNodes.of_pairs(continuum.layout, [pair])
    columns, _ = supports.at_nodes(nodes)
    free = columns[nodes.find(pair.surface.dofs), : continuum.gdim] < 0
    along = np.where(free, np.abs(pair.frames[:, :, 0]), 0.0).max(axis=1)
    return np.asarray(pair.bonded & (along < _ACROSS))


__all__ = ["CrackPressure"]
