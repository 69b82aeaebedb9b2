"""Membrane effects and compression of linear bodies: what their strain leaves out, in numbers.

Loads that grow in proportion leave linear bodies at the displacement u. What their strains leave
out (:mod:`fxcrack.continuum.second_order`) gives the next terms of the equilibrium path (W. T.
Koiter, On the stability of elastic equilibrium, thesis, Delft 1945): with u2 = -K^-1 (K_g u + r),
supports, bonds and contact as they are, the reactions of prescribed displacements change by the
part

    eta = (3 V3 + 4 (V4 - 1/2 u2 K u2))/(u K u),

and so does, with the other sign, the displacement under given forces. Bodies that are free to
contract as they turn do so in u2: nothing is left for cantilever arms and rigid rotation. What is
left is stretching between supports, stiffening by tension and softening by compression.

Compression of what has hardly deflected yet shows in no energy of u. Its part of the buckling load
is the largest mu in K_g x = -mu K x. Two vectors, K x_0 a load that varies in space and K x_1 =
-K_g x_0, span a space whose largest mu is a lower bound, close to it where one mode leads.

Both take back-substitutions and no factorisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.second_order import SecondOrderCells
from fxcrack.solvers.linear import LinearSolver

LARGE = 0.1
"""Part of the stiffness, or of the buckling load, that is not small: loads err by 10 % then.

A circular plate with a clamped edge is there at a deflection of 0.46 of its thickness.
"""
_VECTORS = 2
"""Vectors of the space in which the buckling load is sought."""
_DEPENDENT = 1e-10
"""Part of a vector that is new in the space, squared, below which it is dropped."""


@dataclass(frozen=True)
class SecondOrderEffects:
    """What second order does to linear bodies at their present displacement.

    Attributes:
        stiffening: eta; negative where they become softer.
        buckling: Part of the buckling load that is reached, at least; 0 without compression.
    """

    stiffening: float
    buckling: float


def second_order_effects(solver: LinearSolver, displacement: Array) -> SecondOrderEffects:
    """Estimate them; collective, back-substitutions only.

    Args:
        solver: Linear bodies with :attr:`LinearSolver.responds`.
        displacement: Of the dofs that this rank owns, shape (n_local,), length.
    """
    comm, continuum = solver.continuum.comm, solver.continuum
    cells = SecondOrderCells(continuum)

    def dots(pairs: list[tuple[Array, Array]]) -> Array:
        return np.asarray(np.sum(comm.allgather([float(a @ b) for a, b in pairs]), axis=0))

    found = cells.of(displacement)
    right = found.geometric + found.stretching
    correction = -solver.response(right)
    (relaxed,) = dots([(correction, -right)])
    strained = solver.elastic_work(displacement)
    if not strained > solver.round_off_of_work(displacement):
        return SecondOrderEffects(0.0, 0.0)  # the bodies move as rigid ones, and bear nothing
    eta = (3.0 * found.third + 4.0 * (found.fourth - 0.5 * relaxed)) / strained
    vectors: list[Array] = []
    forces: list[Array] = []  # K x
    softening: list[Array] = []  # -K_g x
    force = _start(continuum)
    for _ in range(_VECTORS):
        x = solver.response(force)
        energy = float(dots([(x, force)])[0])
        if not energy > 0.0:
            break
        vectors.append(x / np.sqrt(energy))
        forces.append(force / np.sqrt(energy))
        force = -cells.geometric(displacement, vectors[-1])
        softening.append(force)
    if not vectors:  # nothing can move
        return SecondOrderEffects(float(eta), 0.0)
    n = len(vectors)
    table = dots([(x, f) for x in vectors for f in forces + softening]).reshape(n, 2 * n)
    return SecondOrderEffects(float(eta), _largest(table[:, :n], table[:, n:]))


def _largest(stiffness: Array, softening: Array) -> float:
    """Largest mu of B x = mu A x, at least 0; A with a unit diagonal, shape (n, n)."""
    a, b = 0.5 * (stiffness + stiffness.T), 0.5 * (softening + softening.T)
    values, modes = eigh(a)
    kept = modes[:, values > _DEPENDENT] / np.sqrt(values[values > _DEPENDENT])
    return max(float(eigh(kept.T @ b @ kept, eigvals_only=True)[-1]), 0.0)


def _start(continuum: Continuum) -> Array:
    """Forces that vary in space and are no mode of anything regular, shape (n_local,)."""
    layout = continuum.layout
    x = continuum.positions()
    low, high = x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf)
    lows, highs = zip(*continuum.comm.allgather((low, high)), strict=True)
    low, size = np.min(lows, axis=0), np.max(np.max(highs, axis=0) - np.min(lows, axis=0))
    place = (x[: layout.n_owned] - low) / size
    out = np.zeros(continuum.n_local)
    forces = out.reshape(layout.n_owned, -1)
    for i in range(continuum.gdim):
        wave = place @ np.roll([5.3, 3.7, 4.3], i)
        forces[:, i] = 1.0 + np.sin(wave + i) + np.cos(5.0 * wave)
    return out


def warn_of_second_order(solver: LinearSolver, displacement: Array, said: set[str]) -> None:
    """Warn, once each, where second-order effects on linear bodies are not small; collective.

    Args:
        solver: Linear bodies.
        displacement: Of the dofs that this rank owns, shape (n_local,), length.
        said: What was warned of before, "rotation" (of which second order is a part), "membrane"
            or "buckling"; it is added to.
    """
    of_stretching = {"membrane", "rotation"}
    if not solver.responds or not SecondOrderCells.covers(solver.continuum):
        return
    if said & of_stretching and "buckling" in said:
        return
    found = second_order_effects(solver, displacement)
    if abs(found.stiffening) > LARGE and not said & of_stretching:
        said.add("membrane")
        log.warn(
            "membrane effects are not small: the bodies stretch as they deflect, or tension or "
            "compression acts along what deflects, and to second order they are %.2g %% %s than "
            "linear bodies are; loads and energy release rates err by as much or more; give the "
            "Scene effects=[FiniteStrain()]",
            100.0 * abs(found.stiffening),
            "stiffer" if found.stiffening > 0.0 else "softer",
        )
    if found.buckling > LARGE and "buckling" not in said:
        said.add("buckling")
        grows = f"deflections are larger by the factor 1/(1 - {found.buckling:.2g}) at least"
        log.warn(
            "compression has reached %.2g of the load at which the linear bodies would buckle, or "
            "more: %s, which linear bodies do not show; give the Scene effects=[FiniteStrain()]",
            found.buckling,
            grows if found.buckling < 1.0 else "the bodies have buckled",
        )


__all__ = ["SecondOrderEffects", "second_order_effects", "warn_of_second_order"]
