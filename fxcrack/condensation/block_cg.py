"""Conjugate gradients on several right-hand sides that share their search directions.

    A X = B,   X_new = X + P (P^t A P)^+ P^t R

Every column is minimised over the directions of all (O'Leary 1980); directions that have become
dependent are left out by the pseudo-inverse (Ji and Li 2017).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.errors import ConvergenceError, SolverError
from fxcrack.condensation.block_matrix import Block, BlockMatrix, column_products, inner_products
from fxcrack.condensation.mumps_schur import mumps_message

_DEPENDENT = 1e-13  # of the largest eigenvalue of the scaled P^t A P: round-off
MAX_ITERATIONS = 1000


def block_cg(
    matrix: BlockMatrix,
    precondition: Callable[[Block], Block],
    right: Block,
    allowed: Callable[[Array], Array],
    *,
    start: Block | None = None,
    max_iterations: int = MAX_ITERATIONS,
) -> tuple[Block, Block, int]:
    """Solve for a block; collective.

    Args:
        matrix: A, symmetric positive definite.
        precondition: M, an approximate inverse, symmetric positive definite.
        right: B, shape (n_owned, k).
        allowed: Largest squared energy norm of the error per column, shape (k,), given the
            present b.x + r.x, which grows to b.A^-1 b. The error is estimated by r.M r.
        start: First X, shape (n_owned, k); zero by default; overwritten.
        max_iterations: When to give up.

    Returns:
        X, the residual B - A X, and the number of iterations.

    Raises:
        ConvergenceError: Not solved within the iterations allowed.
        SolverError: A is not positive definite.
    """
    comm = matrix.comm
    x = np.zeros_like(right) if start is None else start
    residual = right.copy() if start is None else right - matrix @ x
    z = precondition(residual).astype(np.float64)
    direction = z
    for iteration in range(max_iterations + 1):
        energy, error = column_products(comm, (x, right + residual), (residual, z))
        limit = allowed(energy)
        if not np.all(np.isfinite(error)):
            raise SolverError(mumps_message(-10, 0))
        if np.all(error <= limit):
            return x, residual, iteration
        if iteration == max_iterations:
            break
        product = matrix @ direction
        gram, pull = inner_products(comm, (direction, product), (direction, residual))
        inverse = _pseudo_inverse(gram)
        step = inverse @ pull
        x += direction @ step
        residual -= product @ step
        z = precondition(residual).astype(np.float64)
        direction = z - direction @ (inverse @ inner_products(comm, (product, z))[0])
    worst = float(np.sqrt((error / np.maximum(limit, 1e-300)).max()))
    raise ConvergenceError(
        f"the iterative solver stopped after {max_iterations} iterations with an error "
        f"{worst:.1e} times the one allowed; use method='schur' (direct), elements of better "
        "shape, or a larger rtol"
    )


def _pseudo_inverse(gram: Array) -> Array:
    """Inverse of P^t A P on the directions that are independent.

    Raises:
        SolverError: It is not positive.
    """
    diagonal = np.diagonal(gram)
    if np.any(diagonal < 0.0):
        raise SolverError(mumps_message(-10, 0))
    scale = np.where(diagonal > 0.0, np.sqrt(diagonal), np.inf)
    values, vectors = np.linalg.eigh(gram / scale / scale[:, None])
    if values[0] < -1e-8 * values[-1] or not values[-1] > 0.0:
        raise SolverError(mumps_message(-10, 0))
    keep = values > _DEPENDENT * values[-1]
    out: Array = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T / scale / scale[:, None]
    return out
