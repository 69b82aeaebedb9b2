"""The tangent of nonlinear bodies on another set of retained jumps, through the accepted state."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.condensation.free_bodies import FreeBodies
from fxcrack.condensation.iterative import Roles
from fxcrack.equilibrium.contact import ContactSystem
from fxcrack.interface.jump_coordinates import JumpCoordinates, build_coordinates
from fxcrack.interface.pair import Pair, with_friction
from fxcrack.interface.supports import Supports
from fxcrack.solvers.interface_solver import Condensed
from fxcrack.solvers.newton_state import ResumedTangent
from fxcrack.solvers.tangent import CondensedTangent


class CondensedRequest(NamedTuple):
    """What is condensed onto which jumps.

    Attributes:
        pairs: Interfaces.
        roles: Which of their jumps are retained.
        supports: Prescribed components.
        loads: Amplitudes of supports and load factors of the accepted state, shape (n_loads,).
        followed: Sets of this rank's nodes whose mean displacement is wanted, each of shape (n,).
    """

    pairs: list[Pair]
    roles: Roles
    supports: Supports
    loads: Array
    followed: list[Ints]


def condense_tangent(
    tangent: CondensedTangent,
    request: CondensedRequest,
    u: PETSc.Vec,
    *,
    restraint: Callable[[Roles, JumpCoordinates], FreeBodies],
    jumps: Callable[[PETSc.Vec, JumpCoordinates], Array],
    resumed: ResumedTangent | None,
    at: float,
) -> Condensed:
    """Condense the bodies in the accepted state onto other jumps; collective.

    Args:
        tangent: The bodies' condensed tangent; condensed anew.
        request: What onto which jumps.
        u: Accepted displacement, owned dofs.
        restraint: What holds the bodies on these jumps.
        jumps: Retained jumps in a displacement.
        resumed: The tangent of a checkpoint that is resumed.
        at: Time of the accepted state.

    Returns:
        The dense system through the accepted state.
    """
    bodies = tangent.bodies
    n_borders = tangent.assemble(request.pairs, request.followed)
    tangent.release_memory()
    start = time.perf_counter()
    coordinates = build_coordinates(
        bodies.continuum.layout, request.pairs, request.roles, request.supports, n_borders
    )
    tangent.timings.add("transform", start)
    bodies.set(u)
    if not bodies.dynamic:  # inertia holds every body
        tangent.restraint = restraint(request.roles, coordinates)
    if resumed is None:
        tangent.condense(coordinates)
    else:
        resumed.condense(tangent, coordinates, at)
    loads = request.loads
    n_forces = len(loads) - len(request.supports.columns)
    system = ContactSystem(
        tangent.condensation.schur, coordinates.n_retained, len(loads), n_forces,
        offset=np.zeros(coordinates.n_last),
    )  # fmt: skip
    system.cholesky.restraint = tangent.restraint
    system.soft_contact = bodies.dynamic and not with_friction(request.pairs)
    residual = tangent.out_of_balance(loads)
    tangent.anchor(system, residual, jumps(u, coordinates), loads).destroy()
    residual.destroy()
    face_loads = -tangent.condensation.borders_on_retained[:, :n_forces]
    return Condensed(coordinates, system, face_loads)


__all__ = ["CondensedRequest", "condense_tangent"]
