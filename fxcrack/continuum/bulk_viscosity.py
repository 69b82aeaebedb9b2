"""Bulk viscosity: a pressure against the rate of volume change, for waves in explicit dynamics.

    q = (b1 rho c L + b2^2 rho L^2 max(0, -e)) e,      e = tr of the strain rate
    f . v = int q tr(e(v)) w dV

c is the dilatational wave speed and L the square (cube) root of the area (volume) of a cell. The
first term damps the ringing of the highest mode by the fraction b1 of critical, the second spreads
shocks over several cells, in compression alone (von Neumann and Richtmyer, J. Appl. Phys. 21,
1950).
"""

from __future__ import annotations

from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import basix
import dolfinx.la
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kernels import fast_form
from fxcrack.continuum.kinematics import Axisymmetric
from fxcrack.continuum.lumped_mass import density_of


class BulkViscosity:
    """Viscous forces of a velocity; collective.

    Args:
        continuum: Bodies of small strain.
        effect: Their density.
        linear: b1.
        quadratic: b2.

    Raises:
        InputError: A material has no stiffness to take the wave speed from.

    Attributes:
        quadratic: b2.
        changes: Whether it is more than 0, so that damping depends on the motion.
        rate_of_range: Bound on :meth:`compression` over the range of a velocity, 1/length.
    """

    def __init__(
        self, continuum: Continuum, effect: Inertia, linear: float, quadratic: float
    ) -> None:
        self._continuum = continuum
        self.quadratic, self.changes = quadratic, quadratic > 0.0
        domain = continuum.mesh.domain
        self._velocity, self._direction = (fem.Function(continuum.space) for _ in range(2))
        self._vector = fem.Function(continuum.space)
        length = _cell_lengths(continuum)
        v = ufl.TestFunction(continuum.space)
        rate = self._trace(self._velocity)
        form: Any = 0
        for material, (_, _, dx) in zip(continuum.part_materials, continuum.parts, strict=True):
            if not hasattr(material, "stiffness"):
                raise InputError(
                    f"Explicit: bulk viscosity takes its wave speed from the stiffness, and "
                    f"{type(material).__name__} has none; leave bulk out"
                )
            rho = density_of(effect, material)
            stiffest = float(np.max(np.diag(np.asarray(material.stiffness()))[:3]))
            one, two = (
                fem.Constant(domain, PETSc.ScalarType(x))
                for x in (linear * np.sqrt(rho * stiffest), quadratic**2 * rho)
            )
            factor = one * length
            if self.changes:
                factor += two * length**2 * ufl.max_value(-rate, 0)
            product = self._trace(self._direction) * self._trace(v)
            form += factor * product * continuum.weight * dx
        self._form = fast_form(continuum.comm, form)
        self._prepare_rates(length, rate)

    def _prepare_rates(self, length: fem.Function, rate: Any) -> None:
        """Prepare :meth:`compression`; cells count with the square of L over their height."""
        domain, gdim = self._continuum.mesh.domain, self._continuum.gdim
        index_map = domain.topology.index_map(domain.topology.dim)
        self._cells = np.arange(index_map.size_local, dtype=np.int32)
        size = length.x.array[: len(self._cells)]
        across = domain.h(domain.topology.dim, self._cells)
        slender = np.maximum(across / (np.sqrt(gdim) * size), 1.0) ** (2 * (gdim - 1))
        self._slender = slender[:, None]
        points, _ = basix.make_quadrature(domain.basix_cell(), 2)
        self._compression = fem.Expression(ufl.max_value(-rate, 0), points)
        # strain rates of cells whose nodes move apart by the range of the velocity, about
        rates = gdim * (slender * np.maximum(across / size, 1.0) ** (gdim - 1) / size)
        largest = float(rates.max(initial=0.0))
        self.rate_of_range = float(self._continuum.comm.allreduce(largest, op=MPI.MAX))

    def compression(self, velocity: Array) -> float:
        """Largest rate of volume decrease of a velocity of the owned dofs, 1/time; collective.

        Rates of slender cells count by the square of the root of their area (volume) over their
        height, with which quadratic viscosity damps them more.
        """
        x = self._velocity.x
        x.array[: len(velocity)] = velocity
        x.scatter_forward()
        largest = 0.0
        if len(self._cells):
            found = self._compression.eval(self._continuum.mesh.domain, self._cells)
            largest = float((np.asarray(found).reshape(len(self._cells), -1) * self._slender).max())
        return float(self._continuum.comm.allreduce(largest, op=MPI.MAX))

    def _trace(self, u: Any) -> Any:
        model = self._continuum.model
        strain = model.strain(u, self._continuum.x)
        n = 3 if model.gdim == 3 or isinstance(model, Axisymmetric) else 2
        return sum(strain[i] for i in range(n))

    def forces(self, velocity: Array) -> Array:
        """Forces against a velocity of the owned dofs, shape (n_local,) each; collective.

        They are those of :meth:`product` until the next call.
        """
        x = self._velocity.x
        x.array[: len(velocity)] = velocity
        x.scatter_forward()
        return self.product(velocity)

    def product(self, direction: Array) -> Array:
        """Forces with the factors of the last velocity and the rates of a direction; collective.

        Args:
            direction: Shape (n_local,), length/time.

        Returns:
            A new array of shape (n_local,), force.
        """
        x, n = self._direction.x, len(direction)
        x.array[:n] = direction
        x.scatter_forward()
        values = self._vector.x.array
        values[:] = 0.0
        fem.assemble_vector(values, self._form)
        if self._continuum.comm.size > 1:
            self._vector.x.scatter_reverse(dolfinx.la.InsertMode.add)
        return np.array(values[:n])


def _cell_lengths(continuum: Continuum) -> fem.Function:
    """Square or cube root of the area or volume of each cell."""
    out = fem.Function(fem.functionspace(continuum.mesh.domain, ("DG", 0)))
    volume = fem.form(ufl.TestFunction(out.function_space) * ufl.dx)
    fem.assemble_vector(out.x.array, volume)
    out.x.array[:] = out.x.array ** (1.0 / continuum.gdim)
    out.x.scatter_forward()
    return out


__all__ = ["BulkViscosity"]
