"""The stable increment of central differences: 2/omega of the highest frequency.

    omega^2 <= theta + |beta_k s_k|

with theta the largest Ritz value of M^-1/2 K M^-1/2 after k steps of Lanczos' method, beta_k its
last off-diagonal entry and s_k the last component of the Ritz vector: the residual of the Ritz
pair, which puts the estimate on the safe side (Parlett, The Symmetric Eigenvalue Problem, 1998,
section 13.2). The start vector depends on the positions of the nodes alone, and the result is
rounded down in its tenth digit, so that it does not depend on the number of ranks.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.solvers.options import ExplicitOptions

STEPS = 24
"""Lanczos steps; enough for a quarter of a percent on even and uneven meshes."""


def start_vector(positions: Array, n_unknowns: int) -> Array:
    """A vector with a part in every mode, of the positions of nodes alone.

    Args:
        positions: Of the owned nodes, shape (n, 3), length.
        n_unknowns: Unknowns of a node.

    Returns:
        Shape (n n_unknowns,).
    """
    place = positions @ np.array([12.9898, 78.233, 37.719])
    return np.asarray(
        (
            np.sin(1e3 * place)[:, None] + np.cos(7e2 * place[:, None] + np.arange(n_unknowns))
        ).ravel()
    )


class HighestFrequency:
    """Estimates the highest frequency of bodies with lumped mass.

    Args:
        comm: Communicator of the bodies.
        mass: Mass of the owned dofs, shape (n_local,).
        start: Start vector, shape (n_local,).

    Attributes:
        vector: The vector that starts the next call, shape (n_local,).
    """

    def __init__(self, comm: MPI.Intracomm, mass: Array, start: Array) -> None:
        self._comm = comm
        self._root = 1.0 / np.sqrt(mass)
        self.vector = start

    def __call__(self, product: Callable[[Array], Array], steps: int = STEPS) -> float:
        """Upper estimate of omega, 1/time; collective.

        The vector that the highest mode is seen in starts the next call.

        Args:
            product: Tangent stiffness times a vector, shape (n_local,) each.
            steps: Lanczos steps.
        """
        q = self.vector / np.sqrt(self._dot(self.vector, self.vector))
        last: Array | float = 0.0
        beta = 0.0
        diagonal, beside, basis = [], [], []
        for _ in range(steps):
            basis.append(q)
            w = self._root * product(self._root * q) - beta * last
            alpha = self._dot(w, q)
            w -= alpha * q
            beta = float(np.sqrt(self._dot(w, w)))
            diagonal.append(alpha)
            beside.append(beta)
            if beta <= 1e-12 * abs(alpha):
                break  # an invariant subspace: very few unknowns
            last, q = q, w / beta
        matrix = np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1)
        values, vectors = np.linalg.eigh(matrix)
        self.vector = sum(s * v for s, v in zip(vectors[:, -1], basis, strict=True))
        return float(np.sqrt(max(values[-1], 0.0) + abs(beside[-1] * vectors[-1, -1])))

    def _dot(self, x: Array, y: Array) -> float:
        return float(self._comm.allreduce(float(x @ y), op=MPI.SUM))


def damped_increment(omega: float, rate: float) -> float:
    """The largest stable increment with damping by the velocity before, time.

    It is the largest for which M - dt/2 C - dt^2/4 K has no negative eigenvalue, with the highest
    ones of K and C taken together: (dt omega/2)^2 + dt rate/2 = 1. Of one mode damped by the
    fraction xi of critical, rate = 2 xi omega, it is 2/omega (sqrt(1 + xi^2) - xi).

    Args:
        omega: Highest frequency, 1/time.
        rate: Largest eigenvalue of M^-1 C, 1/time; 0 without damping.
    """
    if not rate:
        return 2.0 / omega
    return 2.0 / (0.5 * rate + float(np.hypot(0.5 * rate, omega)))


def chosen_increment(options: ExplicitOptions, stable: float) -> float:
    """The increment that a step asks for, time.

    Args:
        options: Controls of the step.
        stable: Largest stable increment.

    Raises:
        InputError: The increment asked for is not stable.
    """
    if options.dt is None:
        return options.safety * stable
    if options.dt > stable:
        raise InputError(
            f"Explicit: dt = {options.dt:g} is above the largest stable increment "
            f"{stable:g}; leave dt out, or let mass be added with mass_scale='dt'"
        )
    return float(options.dt)


def rounded_down(value: float) -> float:
    """A positive number cut after its tenth digit: round-off of sums over ranks is gone."""
    digits = 9 - int(np.floor(np.log10(value)))
    return float(np.floor(value * 10.0**digits) / 10.0**digits)


__all__ = [
    "STEPS",
    "HighestFrequency",
    "chosen_increment",
    "damped_increment",
    "rounded_down",
    "start_vector",
]
