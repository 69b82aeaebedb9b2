"""New pairings of faces that slide: which nodes they leave as they are, what energy they take."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.equilibrium.cohesive_bonds import CohesiveBonds
from fxcrack.solvers.increment_work import IncrementWork

Forces = Callable[[], PETSc.Vec]


def pulling(index: list[Ints], force: Array, soft: CohesiveBonds) -> list[Bools]:
    """Nodes per pair whose bonds are released but still carry a force, shape (n_nodes,).

    Args:
        index: Number of each retained jump per pair, shape (n_nodes, gdim), -1 where there is none.
        force: Given forces, shape (n_retained,), force.
        soft: Softening bonds.
    """
    carried = np.append(force != 0.0, False)
    out = [carried[numbers].any(axis=1) for numbers in index]
    for bond in soft.bonds:
        out[bond.where[0]][bond.where[1]] = True
    return out


def pressed(index: list[Ints], closed: Bools) -> list[Bools]:
    """Nodes per pair that are in contact, shape (n_nodes,).

    Args:
        index: As for :func:`pulling`.
        closed: Normal components in contact, shape (n_retained,).
    """
    touch = np.append(closed, False)
    return [touch[numbers].any(axis=1) for numbers in index]


class PairingEnergy:
    """Energy taken by new pairings of faces that slide.

    Contact forces move to other master points, and gaps that are not zero there close: on the way
    to the next equilibrium the interfaces do work, of which friction and bonds explain a part. The
    rest is this energy.

    Attributes:
        energy: What it is so far.
    """

    def __init__(self) -> None:
        self.energy = 0.0
        self._before: PETSc.Vec | None = None

    @property
    def pending(self) -> bool:
        """Whether there is a new pairing whose equilibrium has not been accepted yet."""
        return self._before is not None

    def begin(self, forces: PETSc.Vec) -> None:
        """Keep the forces of interfaces and supports before a new pairing, owned from now on."""
        self.forget()
        self._before = forces

    def book(
        self, bodies: WeakForm, u: PETSc.Vec, step: PETSc.Vec, work: IncrementWork, n_forces: int,
        forces: Forces,
    ) -> None:  # fmt: skip
        """Add the energy of the pairing at hand, if there is one; collective.

        By Simpson's rule in elastic bodies, which have forces in half of the displacement at any
        speed, by the trapezoidal one in others.

        Args:
            bodies: The form terms, in the state after the increment, before and after.
            u: Displacement after the increment, owned dofs.
            step: Its change.
            work: Work along the increment.
            n_forces: Number of force patterns.
            forces: Forces of interfaces and supports where the bodies are, owned by the caller.
        """
        if self._before is None:
            return
        middle = _half_way(bodies, u, step, forces) if bodies.closed else None
        both = forces()
        both.axpy(1.0, self._before)
        done = 0.5 * float(both.dot(step))
        both.destroy()
        if middle is not None:
            done = (done + 2.0 * middle) / 3.0
        given = done - work.support_work(n_forces)
        self.energy -= given + work.bonds + work.friction + work.contact
        self.forget()

    def forget(self) -> None:
        """Discard a pairing whose equilibrium has not been accepted."""
        if self._before is not None:
            self._before.destroy()
            self._before = None


def _half_way(bodies: WeakForm, u: PETSc.Vec, step: PETSc.Vec, forces: Forces) -> float:
    """Work on a step of the forces half of it before its end, in which the bodies are."""
    half = step.copy()
    half.aypx(-0.5, u)
    bodies.set(half)
    middle = forces()
    bodies.set(u)
    out = float(middle.dot(step))
    middle.destroy()
    half.destroy()
    return out


__all__ = ["PairingEnergy", "pressed", "pulling"]
