"""Velocity jumps that contact impulses give to bodies.

    M w = G lambda      on the motions that bonds and supports allow

G lambda are the contact forces of an increment times its length. Accelerations do not know of them,
so that generalised alpha, which filters accelerations, makes no energy of contact (nonsmooth
generalised alpha: Chen, Acary, Virlez and Bruels 2013).
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.errors import ConvergenceError
from fxcrack.continuum.inertia import InertiaForces
from fxcrack.interface.jump_coordinates import JumpCoordinates

_TOLERANCE = 1e-14
_MANY = 1000
"""Iterations; mass matrices are well conditioned and need some tens."""


class ContactImpulses:
    """The masses behind the retained jumps.

    Args:
        inertia: Inertia of the bodies.
    """

    def __init__(self, inertia: InertiaForces) -> None:
        self._inertia = inertia
        self._coordinates: JumpCoordinates | None = None
        self._mass: PETSc.Mat | None = None
        self._diagonal: PETSc.Vec | None = None

    def last(self, coordinates: JumpCoordinates) -> Array:
        """Mean forces of the impulses of the last increment; collective.

        Args:
            coordinates: The retained jumps and their numbering.

        Returns:
            Forces on the last coordinates, shape (n_last,): of contact, and the parts of the
            impulse that bonds and supports took.
        """
        w = self._inertia.last_impulse()
        out = np.zeros(coordinates.n_last)
        if w is None:
            return out
        force, q = w.duplicate(), coordinates.transform.createVecRight()
        self._inertia.mass_matrix().mult(w, force)
        coordinates.transform.multTranspose(force, q)
        out = _last_of(q, coordinates)
        for vector in (w, force, q):
            vector.destroy()
        return out

    def apply(
        self, coordinates: JumpCoordinates, force: Array, movable: Bools
    ) -> tuple[Array, float]:
        """Give the bodies the velocity jump of contact forces; collective.

        Args:
            coordinates: The retained jumps and their numbering.
            force: Contact forces at the end of the increment that the solve has found, shape
                (n_retained,), force.
            movable: Components that may move in any way, shape (n_retained,).

        Returns:
            Mean forces of the impulses on the last coordinates as in :meth:`last`, and by how many
            times them the forces at the end have changed: they contain these means now.
        """
        mass, diagonal = self._matrix(coordinates)
        n_inner, n = coordinates.n_inner, len(force)
        allowed, right = diagonal.duplicate(), diagonal.duplicate()
        allowed.set(1.0)
        right.set(0.0)
        if coordinates.transform.comm.rank == 0:
            allowed.array[n_inner:] = 0.0
            allowed.array[n_inner : n_inner + n] = movable
            right.array[n_inner : n_inner + n] = force
        right.scale(self._inertia.impulse_factor)
        jump = _solve(mass, diagonal, right, allowed)
        mass.mult(jump, right)
        impulse = _last_of(right, coordinates)
        w = coordinates.transform.createVecLeft()
        coordinates.transform.mult(jump, w)
        dt, change = self._inertia.jump_velocity(w)
        for vector in (allowed, right, jump, w):
            vector.destroy()
        return impulse / dt, change * dt

    def _matrix(self, coordinates: JumpCoordinates) -> tuple[PETSc.Mat, PETSc.Vec]:
        """T^t M T and its diagonal; collective."""
        if self._coordinates is not coordinates:
            self.destroy()
            self._coordinates = coordinates
        if self._mass is None or self._diagonal is None:
            self._mass = self._inertia.mass_matrix().ptap(coordinates.sparse)
            self._diagonal = self._mass.getDiagonal()
            # of borders, which are no motions, and of shared unknowns, which have no mass
            zero = self._diagonal.array == 0.0
            self._diagonal.array[zero] = 1.0
        return self._mass, self._diagonal

    def destroy(self) -> None:
        """Free all PETSc objects; collective."""
        for thing in (self._mass, self._diagonal):
            if thing is not None:
                thing.destroy()
        self._mass = self._diagonal = self._coordinates = None


def _last_of(q: PETSc.Vec, coordinates: JumpCoordinates) -> Array:
    """The last coordinates of a vector on all ranks, shape (n_last,)."""
    out, comm = np.zeros(coordinates.n_last), q.comm.tompi4py()
    if comm.rank == 0:
        out[:] = q.array_r[coordinates.n_inner :]
    comm.Bcast(out)
    return out


def _solve(
    matrix: PETSc.Mat, diagonal: PETSc.Vec, right: PETSc.Vec, allowed: PETSc.Vec
) -> PETSc.Vec:
    """Conjugate gradients on the allowed components; the caller destroys the solution."""
    x, r, z, p, q = (right.duplicate() for _ in range(5))
    x.set(0.0)
    r.pointwiseMult(right, allowed)
    z.pointwiseDivide(r, diagonal)
    z.copy(p)
    rz = r.dot(z)
    least = _TOLERANCE**2 * rz
    try:
        for _ in range(_MANY):
            if rz <= least:
                return x
            matrix.mult(p, q)
            q.pointwiseMult(q, allowed)
            step = rz / p.dot(q)
            x.axpy(step, p)
            r.axpy(-step, q)
            z.pointwiseDivide(r, diagonal)
            rz, old = r.dot(z), rz
            p.aypx(rz / old, z)
        raise ConvergenceError(f"contact impulses: mass matrix not inverted in {_MANY} iterations")
    finally:
        for vector in (r, z, p, q):
            vector.destroy()


__all__ = ["ContactImpulses"]
