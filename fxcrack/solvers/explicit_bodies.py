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
from fxcrack.continuum.internal_forces import InternalForces


class BodyMotion:
    """Internal forces at chosen dofs, and the change of velocity at all others.

    Args:
        bodies: Internal forces.
        chosen: Owned dofs whose forces are wanted, shape (n_chosen,).
    """

    def __init__(self, bodies: InternalForces, chosen: Ints) -> None:
        self._bodies, self._chosen = bodies, chosen
        n = bodies.continuum.n_local
        self._u = bodies.u.x.array
        self._others = np.ones(n, dtype=bool)
        self._others[chosen] = False
        self._h = 0.0
        self._per_mass = np.ones(n)
        self._scale, self._changes = np.zeros(n), np.zeros(n)
        self._rows: Product | None = None
        self._change: Product | None = None

    def prepare(self, inverse_mass: Array) -> None:
        """Take the operator that was chosen, and masses.

        Args:
            inverse_mass: One over the mass of the owned dofs, shape (n_local,).
        """
        self._per_mass, self._h = inverse_mass, 0.0
        self._rows = self._change = None
        if self._bodies.choice.name == "product":
            stiffness = self._bodies.stiffness()
            self._rows = Product(stiffness[self._chosen])
            keep = sp.diags(np.where(self._others, -inverse_mass, 0.0))
            change = sp.csr_matrix(keep @ stiffness)
            change.eliminate_zeros()
            self._change = Product(change)
            self._h = 1.0
            self._bodies.forget_stiffness()

    def forces(self, out: Array, h: float) -> None:
        """Internal forces at the chosen dofs; collective.

        Args:
            out: Overwritten, shape (n_chosen,), force.
            h: Time from the last velocity to the next, for :meth:`add_change`.
        """
        self._bodies.evaluations += 1
        if self._change is not None and self._rows is not None:
            if h != self._h:
                self._change.data *= h / self._h
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

    def add_change(self, velocity: Array) -> None:
        """Change the velocity at all dofs but the chosen ones, in place; follows :meth:`forces`.

        Args:
            velocity: Of the owned dofs, shape (n_local,), length/time.
        """
        if self._change is not None:
            self._change.add(self._u, velocity)
        else:
            velocity += self._changes

    def whole(self) -> Array:
        """Internal forces at the owned dofs at the present displacement, shape (n_local,), force.

        Collective.
        """
        if self._change is None or self._rows is None:
            return self._bodies.forces().copy()
        u = self._u
        out = self._change(u)
        out *= -1.0 / (self._h * self._per_mass)
        out[self._chosen] = self._rows(u)
        return out


__all__ = ["BodyMotion"]
