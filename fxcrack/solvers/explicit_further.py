"""Forces on the bodies that are assembled anew in each increment of explicit dynamics.

Pressures that follow the bodies do external work; bulk viscosity dissipates.
"""

from __future__ import annotations

from collections.abc import Sequence

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.la
import ufl
from dolfinx import fem

from fxcrack.base.arrays import Array
from fxcrack.continuum.bulk_viscosity import BulkViscosity
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.kernels import fast_form


class FurtherForces:
    """Pressures that follow the bodies, and bulk viscosity.

    Args:
        continuum: Displacement space.
        following: The pressures.
        u: Displacement of the bodies, which they follow.

    Attributes:
        viscosity: Bulk viscosity of the present step, if any.
        pressures: Forces of the pressures in the present increment, shape (n_local,); ``None``:
            there are none.
        viscous: Likewise, forces of the bulk viscosity.
    """

    def __init__(
        self, continuum: Continuum, following: Sequence[FollowerPressure], u: fem.Function
    ) -> None:
        self._following = list(following)
        self.viscosity: BulkViscosity | None = None
        self.pressures: Array | None = None
        self.viscous: Array | None = None
        self._n, self._parallel = continuum.n_local, continuum.comm.size > 1
        if self._following:
            v = ufl.TestFunction(continuum.space)
            # one form each: each has a surface of its own
            self._forms = [fast_form(continuum.comm, t.residual(u, v)) for t in self._following]
            self._vector = fem.Function(continuum.space)

    @property
    def exist(self) -> bool:
        """Whether there are any."""
        return bool(self._following) or self.viscosity is not None

    def find(self, time: float, velocity: Array) -> Array:
        """All of them at the present displacement, shape (n_local,), force; collective.

        Args:
            time: Of the displacement.
            velocity: In the middle of the last increment, owned dofs, shape (n_local,).
        """
        total = 0.0 * velocity
        if self._following:
            x = self._vector.x
            x.array[:] = 0.0
            for term, form in zip(self._following, self._forms, strict=True):
                term.begin(time, 0.0)
                fem.assemble_vector(x.array, form)
            if self._parallel:
                x.scatter_reverse(dolfinx.la.InsertMode.add)
            self.pressures = -x.array[: self._n]
            total += self.pressures
        self.viscous = None
        if self.viscosity is not None:
            self.viscous = -self.viscosity.forces(velocity)
            total += self.viscous
        return total


__all__ = ["FurtherForces"]
