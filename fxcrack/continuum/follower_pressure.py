"""Pressure that stays normal to the deformed surface: the traction is -p n on the deformed area.

    r(u; v) = int  p  J F^-t N . v  w dA,    N and dA undeformed

Its tangent is not symmetric. The sheet of plane stress keeps its thickness.
"""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.follower_work import FollowerWork
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.kinematics import Axisymmetric, cofactor
from fxcrack.continuum.loads import AmplitudeLike, Pressure
from fxcrack.continuum.term import Term


class FollowerPressure(Term):
    """A pressure that follows the body.

    Args:
        continuum: Displacement space, model and groups.
        load: Where, how much, when.
    """

    symmetric = False

    def __init__(self, continuum: Continuum, load: Pressure) -> None:
        self.name = f"follower pressure '{load.title}'"
        self._continuum = continuum
        self._load = load
        domain = continuum.mesh.domain
        self._ds = continuum.surface(load.where)
        self._value = continuum.field(load.value, f"load '{load.title}'")
        self._factor = fem.Constant(domain, PETSc.ScalarType(0.0))
        self._path = FollowerWork(continuum.space)
        self._power: tuple[Any, Any, Any, Any] | None = None

    @property
    def amplitude(self) -> AmplitudeLike:
        """Factor in time."""
        return self._load.amplitude

    def residual(self, u: fem.Function, v: Any) -> Any:
        """Minus the forces of the pressure."""
        return self._form(self._factor, u, v)

    def _form(self, factor: Any, u: Any, v: Any) -> Any:
        c = self._continuum
        normal = ufl.FacetNormal(c.mesh.domain)
        area = cofactor(ufl.Identity(c.gdim) + ufl.grad(u)) * normal
        if isinstance(c.model, Axisymmetric):
            area = (1 + u[0] / c.x[0]) * area
        return factor * self._value * ufl.inner(area, v) * c.weight * self._ds

    def begin(self, time: float, dt: float) -> None:
        """Set the pressure at the end of the increment."""
        self._factor.value = self._load.amplitude(time)

    def path_work(self, u: fem.Function) -> float:
        """Work along the straight path from the last state, exact."""
        c = self._continuum
        if self._power is None:
            factor = fem.Constant(c.mesh.domain, PETSc.ScalarType(0.0))
            at, step = fem.Function(c.space), fem.Function(c.space)
            self._power = factor, at, step, fem.form(-self._form(factor, at, step))
        factor, at, step, form = self._power
        step.x.array[:] = u.x.array - self._path.u

        def power(place: float, level: float) -> float:
            factor.value = level
            at.x.array[:] = self._path.u + place * step.x.array
            return float(fem.assemble_scalar(form))

        work = self._path.along(float(self._factor.value), power)
        return float(c.comm.allreduce(work, op=MPI.SUM))

    def commit(self, u: fem.Function) -> None:
        """Add the work along the straight path from the last state."""
        self._path.accept(u, float(self._factor.value), self.path_work(u))

    def work(self) -> float:
        """Work of the pressure up to the last commit, force x length; the same on all ranks."""
        return self._path.work

    def state(self) -> dict[str, Array]:
        """State of the work, shapes as in :meth:`FollowerWork.state`."""
        return self._path.state()

    def places(self) -> dict[str, Place]:
        """Where that state is defined."""
        return self._path.places()

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        self._path.restore(state)
        self._factor.value = self._path.factor
