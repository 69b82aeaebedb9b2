"""J2 plasticity with isotropic hardening at small strain: radial return at quadrature points.

    f = q - sigma_y(p) <= 0,    q = sqrt(3/2 s : s),    d e_p = 3/2 s/q dp

Backward Euler: 3 mu p + sigma_y(p) = q_trial + 3 mu p_n is piecewise linear and increasing in p, so
its root is a closed form. The tangent is that of the algorithm (Simo and Hughes 1998, box 3.2).
The stored energy is the elastic one; all plastic work counts as dissipated.
"""

from __future__ import annotations

from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.kinematics import Axisymmetric, PlaneStress
from fxcrack.continuum.materials import Plastic
from fxcrack.continuum.term import Term, parts_of

Ints = npt.NDArray[np.int32]

_NEUTRAL = 1e-12
"""Stresses that exceed the yield stress by less than this part of it are on the yield surface: such
points are elastic, whatever round-off says."""


class Plasticity(Term):
    """The parts of a continuum made of :class:`fxcrack.Plastic`.

    Args:
        continuum: Materials, model, measures and temperature.

    Raises:
        InputError: The model is plane stress.
    """

    name = "plasticity"
    path_dependent = True
    closed = False

    def __init__(self, continuum: Continuum) -> None:
        if isinstance(continuum.model, PlaneStress):
            raise InputError(
                "Plastic: its thickness strain is not solved for in plane stress; use PlaneStrain, "
                "Axisymmetric or Solid"
            )
        self._continuum = continuum
        domain = continuum.mesh.domain
        n = 6 if continuum.gdim == 3 else 4
        self._shears = n - 3
        vector, scalar = (_at_points(continuum, shape) for shape in ((n,), ()))
        self._stress, self._normal = fem.Function(vector), fem.Function(vector)
        self._soft, self._softer, self._density = (fem.Function(scalar) for _ in range(3))
        self._soft.x.array[:] = 1.0
        self._dofs = scalar.dofmap.list
        points = compat.interpolation_points(scalar)
        self._points = [
            PlasticPart(continuum, i, len(points)) for i in parts_of(continuum, "plastic")
        ]
        self._u = fem.Function(continuum.space)
        strain = continuum.model.strain(self._u, continuum.x)
        self._strain = fem.Expression(self._with_normals(strain), points)
        self._rise: Any = None
        if continuum.temperature is not None:
            self._rise = fem.Expression(continuum.temperature.rise, points)
        self._moduli = [
            tuple(fem.Constant(domain, PETSc.ScalarType(v)) for v in (p.mu, p.bulk))
            for p in self._points
        ]
        self._integrated: Any = None
        self._plastic_work = 0.0
        self._thermal_work = 0.0

    def _with_normals(self, strain: Any) -> Any:
        """Strain with three normal components before the shears."""
        model = self._continuum.model
        if model.gdim == 3 or isinstance(model, Axisymmetric):
            return strain
        return ufl.as_vector([strain[0], strain[1], 0, strain[2]])

    def _inner(self, stress: Any, strain: Any) -> Any:
        return ufl.inner(stress, self._with_normals(strain))

    def _parts(self) -> Any:
        c = self._continuum
        for points, (mu, bulk) in zip(self._points, self._moduli, strict=True):
            yield mu, bulk, c.parts[points.part][2]

    def energy(self, u: fem.Function) -> Any:
        """Elastic energy of the present stress."""
        s = self._stress
        trace = s[0] + s[1] + s[2]
        total = 0
        for mu, bulk, dx in self._parts():
            square = sum(s[i] ** 2 for i in range(3)) - trace**2 / 3
            square += 2 * sum(s[3 + i] ** 2 for i in range(self._shears))
            total += (square / (4 * mu) + trace**2 / (18 * bulk)) * self._continuum.weight * dx
        return total

    def residual(self, u: fem.Function, v: Any) -> Any:
        """Stress times strain of the test function."""
        ev = self._continuum.model.strain(v, self._continuum.x)
        density = self._inner(self._stress, ev) * self._continuum.weight
        return sum(density * dx for _, _, dx in self._parts())

    def tangent(self, u: fem.Function, v: Any, du: Any) -> Any:
        """Tangent of the algorithm: bulk, shear lowered by the return, less the flow direction."""
        model, x = self._continuum.model, self._continuum.x
        ev, e = model.strain(v, x), self._with_normals(model.strain(du, x))
        trace = e[0] + e[1] + e[2]
        deviator = [e[i] - trace / 3 for i in range(3)]
        deviator += [e[3 + i] / 2 for i in range(self._shears)]
        total = 0
        for mu, bulk, dx in self._parts():
            stress = 2 * mu * self._soft * ufl.as_vector(deviator)
            stress -= 2 * mu * self._softer * ufl.inner(self._normal, e) * self._normal
            stress += bulk * trace * ufl.as_vector([1] * 3 + [0] * self._shears)
            total += self._inner(stress, ev) * self._continuum.weight * dx
        return total

    def stresses(self, u: fem.Function) -> list[tuple[Any, Any]]:
        """Stress of the last update."""
        return [(self._stress, dx) for _, _, dx in self._parts()]

    def begin(self, time: float, dt: float) -> None:
        """Set the temperature at the end of the increment."""
        if self._continuum.temperature is not None:
            self._continuum.temperature.set(time)

    def update(self, u: fem.Function) -> None:
        """Return to the yield surface at all points."""
        self._u.x.array[:] = u.x.array
        domain = self._continuum.mesh.domain
        for p in self._points:
            strain = np.asarray(self._strain.eval(domain, p.cells)).reshape(p.stress.shape).copy()
            thermal = None
            if self._rise is not None:
                rise = np.asarray(self._rise.eval(domain, p.cells)).reshape(-1, 1)
                thermal = rise * p.expansion
                strain -= thermal
            normal, soft, softer = p.update(strain, thermal)
            dofs = self._dofs[p.cells].ravel()
            for function, value in ((self._stress, p.trial_stress), (self._normal, normal)):
                function.x.array.reshape(-1, value.shape[1])[dofs] = value
            self._soft.x.array[dofs] = soft
            self._softer.x.array[dofs] = softer

    def begin_at(self, u: fem.Function) -> None:
        """Keep what the temperature has done at rest before the bodies move; collective."""
        self.commit(u)

    def commit(self, u: fem.Function) -> None:
        """Keep plastic strain and stress, add the plastic work; collective."""
        self._plastic_work += self.path_spent(u)
        self._thermal_work += self.path_work(u)
        for p in self._points:
            p.commit()

    def path_spent(self, u: fem.Function) -> float:
        """Plastic work since the last commit."""
        return self._integral([p.plastic_work() for p in self._points])

    def path_work(self, u: fem.Function) -> float:
        """Work of the temperature since the last commit."""
        if self._rise is None:
            return 0.0
        return self._integral([p.thermal_work() for p in self._points])

    def _integral(self, densities: list[Array]) -> float:
        if self._integrated is None:
            density = self._density * self._continuum.weight
            self._integrated = fem.form(sum(density * dx for _, _, dx in self._parts()))
        for p, density in zip(self._points, densities, strict=True):
            self._density.x.array[self._dofs[p.cells].ravel()] = density
        comm = self._continuum.comm
        return float(comm.allreduce(fem.assemble_scalar(self._integrated), op=MPI.SUM))

    def spent(self) -> dict[str, float]:
        """Plastic work up to the last commit, force x length."""
        return {"plastic_energy": self._plastic_work}

    def work(self) -> float:
        """Work of the temperature up to the last commit, force x length."""
        return self._thermal_work

    def equivalent_strain(self) -> fem.Function:
        """Equivalent plastic strain of the last commit, mean of each cell."""
        c = self._continuum
        out = fem.Function(fem.functionspace(c.mesh.domain, ("DG", 0)), name="plastic_strain")
        for p in self._points:
            out.x.array[p.cells] = p.equivalent.reshape(-1, self._dofs.shape[1]).mean(axis=1)
        out.x.scatter_forward()
        return out

    def state(self) -> dict[str, Array]:
        """Plastic strain, stress and sums of the last commit.

        Returns:
            "sums": plastic work and work of the temperature, force x length, shape (2,); and of
            each part i "i.stress" and the others of :meth:`PlasticPart.committed`.
        """
        out = {"sums": np.array([self._plastic_work, self._thermal_work])}
        for i, p in enumerate(self._points):
            out |= {f"{i}.{key}": value.copy() for key, value in p.committed().items()}
        return out

    def places(self) -> dict[str, Place]:
        """Cells whose points the arrays belong to."""
        return {f"{i}.{key}": p.cells for i, p in enumerate(self._points) for key in p.committed()}

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        self._plastic_work, self._thermal_work = (float(x) for x in state["sums"])
        for i, p in enumerate(self._points):
            p.set({key: state[f"{i}.{key}"].copy() for key in p.committed()})


def _at_points(continuum: Continuum, shape: tuple[int, ...]) -> fem.FunctionSpace:
    domain = continuum.mesh.domain
    element = basix.ufl.quadrature_element(
        domain.basix_cell(), value_shape=shape, scheme="default", degree=continuum.degree
    )
    return fem.functionspace(domain, element)


class PlasticPart:
    """Return mapping at the points of one material, arrays over points.

    Components are three normal ones, then shears; shears are those of the tensor in stress, plastic
    strain and flow direction, engineering shears in the strain given to :meth:`update`.

    Args:
        continuum: The bodies.
        part: Which part.
        n_per_cell: Quadrature points of a cell.

    Attributes:
        cells: Owned cells of the part, shape (n_cells,).
        stress: Stress of the last commit, shape (n_points, n), force/length^2.
        plastic: Plastic strain of the last commit, shape (n_points, n).
        equivalent: Equivalent plastic strain p of the last commit, shape (n_points,).
        thermal: Thermal strain of the last commit, shape (n_points, n); (0, n) without temperature.
        trial_stress: Stress of the last update, shape (n_points, n), force/length^2.
    """

    def __init__(self, continuum: Continuum, part: int, n_per_cell: int) -> None:
        material = continuum.part_materials[part]
        assert isinstance(material, Plastic)
        self.part = part
        c = material.stiffness()
        self.mu, self.bulk = float(c[3, 3]), float(c[0, 1] + 2.0 * c[3, 3] / 3.0)
        self._knots, self._yield, self._slopes = material.curve()
        self.cells: Ints = continuum.part_cells[part]
        n = 6 if continuum.gdim == 3 else 4
        n_points = len(self.cells) * n_per_cell
        self.expansion = material.expansion * np.array([1.0] * 3 + [0.0] * (n - 3))
        self._twice = np.array([1.0] * 3 + [2.0] * (n - 3))  # weights of a tensor product
        self.stress, self.plastic = np.zeros((n_points, n)), np.zeros((n_points, n))
        self.equivalent = np.zeros(n_points)
        self.thermal = np.zeros((n_points, n) if continuum.temperature is not None else (0, n))
        self.trial_stress, self._trial_plastic = self.stress.copy(), self.plastic.copy()
        self._trial_equivalent = self.equivalent.copy()
        self._trial_thermal = self.thermal.copy()

    def update(self, strain: Array, thermal: Array | None) -> tuple[Array, Array, Array]:
        """Trial state at a strain free of thermal strain.

        Args:
            strain: Strain less thermal strain, engineering shears, shape (n_points, n).
            thermal: Thermal strain, shape (n_points, n); ``None`` without temperature.

        Returns:
            Flow direction s/|s|, shape (n_points, n); factor theta of the shear modulus and factor
            theta-bar of the flow direction, each of shape (n_points,) (Simo and Hughes, eqs.
            3.3.14-15).
        """
        three_mu = 3.0 * self.mu
        elastic = strain / self._twice - self.plastic
        trace = elastic[:, :3].sum(axis=1, keepdims=True)
        s = elastic.copy()
        s[:, :3] -= trace / 3.0
        s *= 2.0 * self.mu
        size = np.sqrt(s**2 @ self._twice)
        q = np.sqrt(1.5) * size
        # g(p) = 3 mu p + sigma_y(p) at the knots; its inverse is linear between them
        levels = three_mu * self._knots + self._yield
        target = q + three_mu * self.equivalent
        now = three_mu * self.equivalent + self._stress_at(self.equivalent)
        # points that stay where they are on the yield surface are there to round-off
        flows = target > now * (1.0 + _NEUTRAL)
        k = np.maximum(np.searchsorted(levels, target, side="right") - 1, 0)
        p = self._knots[k] + (target - levels[k]) / (three_mu + self._slopes[k])
        dp = np.where(flows, p - self.equivalent, 0.0)
        normal = np.where(flows[:, None], s / np.where(size > 0.0, size, 1.0)[:, None], 0.0)
        back = np.where(flows, three_mu * dp / np.where(q > 0.0, q, 1.0), 0.0)
        self._trial_equivalent = self.equivalent + dp
        self._trial_plastic = self.plastic + np.sqrt(1.5) * dp[:, None] * normal
        self.trial_stress = (1.0 - back)[:, None] * s
        self.trial_stress[:, :3] += self.bulk * trace
        if thermal is not None:
            self._trial_thermal = thermal
        softer = np.where(flows, 1.0 / (1.0 + self._slopes[k] / three_mu) - back, 0.0)
        return normal, 1.0 - back, softer

    def _stress_at(self, p: Array) -> Array:
        k = np.maximum(np.searchsorted(self._knots, p, side="right") - 1, 0)
        return np.asarray(self._yield[k] + self._slopes[k] * (p - self._knots[k]))

    def plastic_work(self) -> Array:
        """Mean stress times plastic strain of the increment, shape (n_points,), force/length^2.

        Exact, as the elastic energy is.
        """
        mean = 0.5 * (self.stress + self.trial_stress)
        return np.asarray((mean * (self._trial_plastic - self.plastic)) @ self._twice)

    def thermal_work(self) -> Array:
        """Minus mean stress times thermal strain of the increment.

        Shape (n_points,), force/length^2.
        """
        mean = 0.5 * (self.stress + self.trial_stress)
        return np.asarray(-(mean * (self._trial_thermal - self.thermal)) @ self._twice)

    def commit(self) -> None:
        """The trial state becomes the committed one."""
        self.stress, self.plastic = self.trial_stress, self._trial_plastic
        self.equivalent, self.thermal = self._trial_equivalent, self._trial_thermal

    def committed(self) -> dict[str, Array]:
        """The committed arrays by name; shapes as in the attributes of the class."""
        return {
            "stress": self.stress,
            "plastic": self.plastic,
            "equivalent": self.equivalent,
            "thermal": self.thermal,
        }

    def set(self, state: dict[str, Array]) -> None:
        """Set the committed arrays, of the shapes of :meth:`committed`; they are not copied."""
        self.stress, self.plastic = state["stress"], state["plastic"]
        self.equivalent, self.thermal = state["equivalent"], state["thermal"]
