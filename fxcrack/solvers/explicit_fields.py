"""Displacements, reactions and nodal forces of explicit dynamics, as output asks for them."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.solvers.explicit_energies import sums_over_ranks
from fxcrack.solvers.explicit_interface import InterfaceDynamics
from fxcrack.solvers.explicit_joints import JointForces
from fxcrack.solvers.explicit_points import FacePoints
from fxcrack.solvers.explicit_supports import PrescribedMotion


class MotionFields:
    """Fields of the bodies in the present increment.

    Args:
        continuum: Displacement space.
        bodies: Internal forces, with the displacement.
        points: Faces of shells.
        joints: Forces at kinks and T joints of shells.
        lumped: Interfaces with lumped masses.
        dynamics: Their motion and forces.
        prescribed: Motion of the supports.
    """

    def __init__(
        self, continuum: Continuum, bodies: InternalForces, points: FacePoints,
        joints: JointForces, lumped: LumpedInterface, dynamics: InterfaceDynamics,
        prescribed: PrescribedMotion,
    ) -> None:  # fmt: skip
        self._continuum, self._points, self._joints = continuum, points, joints
        self._u = bodies.u.x.array[: continuum.n_local]
        self._lumped, self._dynamics, self._prescribed = lumped, dynamics, prescribed

    def means(self, where: list[Ints]) -> Array:
        """Mean displacements of sets of owned nodes, shape (n_sets, gdim), length; collective."""
        continuum = self._continuum
        u = continuum.layout.displacements(self._points.nodal(self._u))
        sums = [[*u[nodes].sum(axis=0), len(nodes)] for nodes in where]
        flat = np.array(sums_over_ranks(continuum.comm, *np.ravel(sums))).reshape(len(where), -1)
        return np.asarray(flat[:, :-1] / flat[:, -1:])

    def displacement(self) -> PETSc.Vec:
        """Present displacement; collective; the caller destroys it."""
        continuum = self._continuum
        vector = PETSc.Vec().createMPI((continuum.n_local, continuum.n_global), comm=continuum.comm)
        vector.array[:] = self._points.nodal(self._u)
        return vector

    def reactions_by_column(self, reactions: Array, n_columns: int) -> Array:
        """Reactions by support column, shape (n_columns,), force; this rank's part.

        Args:
            reactions: Of the prescribed dofs of this rank, shape (n_prescribed,), force.
            n_columns: Number of support columns.
        """
        prescribed = self._prescribed
        if not self._points.exist:
            return prescribed.by_column(reactions, n_columns)
        on_unknowns = prescribed.on_unknowns(reactions, self._lumped)
        return self._points.reactions(on_unknowns, n_columns)

    def forces(self, at_interface: Ints, at_nodes: Array, reactions: Array) -> PETSc.Vec:
        """Forces of interfaces, joints and supports on the bodies; collective.

        The caller destroys the vector.

        Args:
            at_interface: Owned dofs of the interface nodes of this rank, shape (n,).
            at_nodes: Internal forces and loads on all interface nodes, shape (n_nodes, gdim).
            reactions: Of the prescribed dofs of this rank, shape (n_prescribed,), force.
        """
        vector = self.displacement()
        prescribed, lumped = self._prescribed, self._lumped
        values = np.zeros(self._continuum.n_local)
        values[prescribed.dofs] = reactions[: len(prescribed.dofs)]
        if len(at_interface):
            mine = lumped.nodes.mine
            held = lumped.mass[mine, None] * self._dynamics.a[mine] - at_nodes[mine]
            values[at_interface] = held.ravel()
        if self._joints.exist:
            values += self._joints.forces
        vector.array[:] = self._points.nodal_forces(values)
        return vector


__all__ = ["MotionFields"]
