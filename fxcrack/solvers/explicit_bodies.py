"""What the internal forces of the bodies do to their motion in an increment of explicit dynamics.

At chosen dofs, those of interfaces and those that are prescribed, forces are needed themselves. At
all others only the velocity changes,

    v^{n+1/2} = v^{n-1/2} - (h/m) f_int(u^n)

which with a stiffness is one product that adds to the velocity in place: its rows are scaled with
h/m beforehand, and those of the chosen dofs are taken out.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.sparse import Product
from fxcrack.continuum.block_product import BlockProduct, fast_product
from fxcrack.continuum.internal_forces import InternalForces


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
        self._rows: Product | None = None
        self._change: BlockProduct | Product | None = None

    def prepare(self, inverse_mass: Array) -> None:
        """Take the operator that was chosen, and masses.

        Args:
            inverse_mass: One over the mass of the owned dofs, shape (n_local,).
        """
        self._per_mass, self._h = inverse_mass, 0.0
        self._rows = self._change = self._first = None
        if self._bodies.choice.name == "product":
            stiffness = self._bodies.stiffness()
            self._bodies.forget_stiffness()
            self._rows = Product(stiffness[self._chosen])
            scaled = sp.diags(-inverse_mass[self._early])
            self._first = Product(sp.csr_matrix(scaled @ stiffness[self._early]))
            keep = sp.diags(np.where(self._later, -inverse_mass, 0.0))
            change = sp.csr_matrix(keep @ stiffness)
            change.eliminate_zeros()
            continuum = self._bodies.continuum
            self._change = fast_product(change, continuum.layout.n_unknowns, continuum.comm)
            self._h = 1.0

    def forces(self, out: Array, h: float) -> None:
        """Internal forces at the chosen dofs; collective.

        Args:
            out: Overwritten, shape (n_chosen,), force.
            h: Time from the last velocity to the next, for :meth:`change_others`.
        """
        self._bodies.evaluations += 1
        if self._change is not None and self._rows is not None:
            if h != self._h:
                self._change.data *= h / self._h
                if self._first is not None:
                    self._first.data *= h / self._h
                self._h = h
            self._u = self._bodies.columns()
            self._rows.into(self._u, out)
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
        if self._change is not None:
            self._change.add(self._u, velocity)

    def whole(self) -> Array:
        """Internal forces at the owned dofs at the present displacement, shape (n_local,), force.

        Collective.
        """
        if self._change is None or self._rows is None:
            return self._bodies.forces().copy()
        u = self._bodies.columns()  # rows may need more nodes than the displacement has
        out = self._change(u)
        if self._first is not None:
            out[self._early] = self._first(u)
        out *= -1.0 / (self._h * self._per_mass)
        out[self._chosen] = self._rows(u)
        return out


__all__ = ["BodyMotion"]
