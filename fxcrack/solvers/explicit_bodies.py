"""What the internal forces of the bodies do to their motion in an increment of explicit dynamics.

At chosen dofs, those of interfaces and those that are prescribed, forces are needed themselves. At
all others only the velocity changes,

    v^{n+1/2} = v^{n-1/2} - (h/m) f_int(u^n)

which with a stiffness is one product with the rows of these dofs
(:mod:`fxcrack.continuum.stiffness_rows`).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.sparse import Product
from fxcrack.continuum.block_product import BlockProduct, fast_product
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.continuum.stiffness_rows import StiffnessRows


class BodyMotion:
    """Internal forces at chosen dofs, and the change of velocity at all others.

    Args:
        bodies: Internal forces.
        chosen: Owned dofs whose forces are wanted, shape (n_chosen,).
        first: Owned dofs whose velocity is wanted before that of others, shape (n_first,).
    """

    def __init__(self, bodies: InternalForces, chosen: Ints, first: Ints) -> None:
        self._bodies, self._chosen = bodies, chosen
        n = bodies.continuum.n_local
        later = np.ones(n, dtype=bool)
        later[first] = False
        later[chosen] = False
        early = ~later
        early[chosen] = False
        self._later, self._early = later, np.flatnonzero(early)
        self._first: Product | None = None
        self._u = bodies.u.x.array
        self._others = np.ones(n, dtype=bool)
        self._others[chosen] = False
        self._h = 0.0
        self._per_mass = np.ones(n)
        self._scale, self._changes = np.zeros(n), np.zeros(n)
        self._rows: list[tuple[BlockProduct | Product, slice]] = []
        self._rest: StiffnessRows | None = None
        self._first_h = 1.0

    def prepare(self, inverse_mass: Array) -> None:
        """Take the operator that was chosen, and masses.

        Args:
            inverse_mass: One over the mass of the owned dofs, shape (n_local,).
        """
        self._per_mass, self._h = inverse_mass, 0.0
        self._rows, self._rest, self._first = [], None, None
        if self._bodies.choice.name == "product":
            stiffness = self._bodies.stiffness()
            self._bodies.forget_stiffness()
            continuum, chosen = self._bodies.continuum, self._chosen
            size = continuum.layout.n_unknowns
            n = _whole_nodes(chosen, size)
            by_nodes = fast_product(stiffness[chosen[:n]], size, continuum.comm)
            self._rows = [(by_nodes, slice(0, n))]
            if n < len(chosen):
                self._rows.append((Product(stiffness[chosen[n:]]), slice(n, None)))
            scaled = sp.diags(-inverse_mass[self._early])
            self._first = Product(sp.csr_matrix(scaled @ stiffness[self._early]))
            self._first_h = 1.0
            self._rest = StiffnessRows(stiffness, self._later, size, continuum.comm)

    def forces(self, out: Array, h: float) -> None:
        """Internal forces at the chosen dofs; collective.

        Args:
            out: Overwritten, shape (n_chosen,), force.
            h: Time from the last velocity to the next, for :meth:`change_others`.
        """
        self._bodies.evaluations += 1
        if self._rest is not None:
            if h != self._h:
                self._scale, self._h = np.where(self._later, -h * self._per_mass, 0.0), h
                if self._first is not None:
                    self._first.data *= h / self._first_h
                    self._first_h = h
            self._u = self._bodies.columns()
            for product, part in self._rows:
                product.into(self._u, out[part])
            return
        forces = self._bodies.forces()
        np.take(forces, self._chosen, out=out)
        if h != self._h:
            self._scale, self._h = np.where(self._others, -h * self._per_mass, 0.0), h
        # a copy: energies evaluate forces at other displacements in the meantime
        np.multiply(forces, self._scale, out=self._changes)

    def change_first(self, velocity: Array) -> None:
        """Change the velocity at the first dofs, in place; follows :meth:`forces`.

        Args:
            velocity: Of the owned dofs, shape (n_local,), length/time.
        """
        if self._first is None:
            velocity += self._changes
        elif len(self._early):
            velocity[self._early] += self._first(self._u)

    def change_others(self, velocity: Array) -> None:
        """Change the velocity at all dofs but the first and the chosen ones, in place.

        Args:
            velocity: Of the owned dofs, shape (n_local,), length/time.
        """
        if self._rest is not None:
            self._rest.push(self._u, self._scale, velocity)

    def whole(self) -> Array:
        """Internal forces at the owned dofs at the present displacement, shape (n_local,), force.

        Collective.
        """
        if self._rest is None:
            return self._bodies.forces().copy()
        u = self._bodies.columns()  # rows may need more nodes than the displacement has
        out = self._rest(u)
        if self._first is not None and len(self._early):
            out[self._early] = self._first(u) / (-self._first_h * self._per_mass[self._early])
        found = np.empty(len(self._chosen))
        for product, part in self._rows:
            product.into(u, found[part])
        out[self._chosen] = found
        return out


def _whole_nodes(dofs: Ints, size: int) -> int:
    """How many dofs at the beginning are all those of a node, one node after the other.

    Args:
        dofs: Shape (n,).
        size: Unknowns of a node.
    """
    nodes = dofs[: len(dofs) // size * size].reshape(-1, size)
    whole = (nodes[:, 0] % size == 0) & np.all(np.diff(nodes, axis=1) == 1, axis=1)
    return size * (len(whole) if whole.all() else int(np.argmin(whole)))


__all__ = ["BodyMotion"]
