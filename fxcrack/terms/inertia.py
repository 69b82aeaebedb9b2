"""Inertia by the generalised alpha method, the other forces taken at the end of an increment.

With F = f_int - f_ext - p (interface forces p), the balance M a_{n+1-alpha_m} + C v_{n+1-alpha_f} +
(1 - alpha_f) F_{n+1} + alpha_f F_n = 0 divided by 1 - alpha_f is

    F_{n+1} + M b_{n+1} + C c_{n+1} = 0,
    b_{n+1} = (a_{n+1-alpha_m} - alpha_f b_n)/(1 - alpha_f),    c_{n+1} likewise of v_{n+1-alpha_f},

since F_n = -(M b_n + C c_n) is known. Newmark's formulas make b and c linear in u_{n+1}.
"""

from __future__ import annotations

from typing import Any

import dolfinx.fem.petsc
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.continuum import Continuum
from fxcrack.errors import InputError, SolverError
from fxcrack.inertia import Inertia
from fxcrack.terms.base import Term
from fxcrack.terms.file_order import Place

Array = npt.NDArray[np.float64]

REMEMBERED = ("u", "v", "a", "b", "c")


class InertiaForces(Term):
    """Inertia and Rayleigh damping of all bodies.

    The tangent is a constant while the length of the increments is.

    Args:
        continuum: Displacement space, materials and measures.
        effect: Density, damping and method.

    Attributes:
        velocity: Velocity at the trial displacement.

    Raises:
        InputError: A part has no density, or lumped mass is asked of second-order bodies.
    """

    name = "inertia"
    closed = False
    constant = True
    dynamic = True
    energy_name = "kinetic_energy"

    def __init__(self, continuum: Continuum, effect: Inertia) -> None:
        if effect.lumped and continuum.order != 1:
            raise InputError("Inertia: lumped mass exists for first-order bodies only (order=1)")
        self._continuum = continuum
        self._effect = effect
        domain = continuum.mesh.domain
        self._densities = [
            fem.Constant(domain, PETSc.ScalarType(_density(effect, m)))
            for m in continuum.part_materials
        ]
        self._by_mass, self._by_stiffness = (
            fem.Constant(domain, PETSc.ScalarType(r)) for r in effect.rayleigh
        )
        self._damped = any(effect.rayleigh)
        # b = b_u u + b_known, c likewise
        self._b_u, self._c_u = (fem.Constant(domain, PETSc.ScalarType(0.0)) for _ in range(2))
        self._b_known, self._c_known = (fem.Function(continuum.space) for _ in range(2))
        self.velocity = fem.Function(continuum.space, name="velocity")
        if effect.velocity is not None:
            self._start(effect.velocity)
        size = len(self.velocity.x.array)
        self._last = {name: np.zeros(size) for name in REMEMBERED}
        for name in ("v", "c"):
            self._last[name] = self.velocity.x.array.copy()
        if effect.velocity is not None and self._damped:
            for name in ("a", "b"):
                self._last[name] = self._slowing()
        self._dt = 0.0
        self._moving = False  # between the beginning of an increment and its commit
        self._spent = {"numerical_dissipation": 0.0}
        if self._damped:
            self._spent["damping_energy"] = 0.0
        self._products: Any = None

    def _start(self, velocity: Any) -> None:
        gdim = self._continuum.gdim
        if len(velocity) != gdim:
            raise InputError(f"Inertia: velocity has {len(velocity)} components, {gdim} needed")
        self.velocity.interpolate(
            lambda x: np.stack(
                [np.broadcast_to(v(x) if callable(v) else float(v), x.shape[1]) for v in velocity]
            )
        )

    def _slowing(self) -> Array:
        """First acceleration, M a = -C v, of a body without forces; collective."""
        space = self._continuum.space
        v, a = ufl.TestFunction(space), ufl.TrialFunction(space)
        matrix = dolfinx.fem.petsc.assemble_matrix(fem.form(self._mass(a, v)))
        matrix.assemble()
        right = dolfinx.fem.petsc.assemble_vector(fem.form(-self._damping(self.velocity, v)))
        right.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        solver = PETSc.KSP().create(self._continuum.comm)
        solver.setOperators(matrix)
        solver.setType("cg")
        solver.getPC().setType("jacobi")
        solver.setTolerances(rtol=1e-12)
        out = fem.Function(space)
        solver.solve(right, out.x.petsc_vec)
        out.x.scatter_forward()
        for o in (solver, matrix, right):
            o.destroy()
        return np.asarray(out.x.array.copy())

    def _mass(self, a: Any, v: Any) -> Any:
        c = self._continuum
        total = 0
        for density, (_, _, dx) in zip(self._densities, c.parts, strict=True):
            if self._effect.lumped:
                dx = dx.reconstruct(metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
            total += density * ufl.inner(a, v) * c.weight * dx
        return total

    def _damping(self, velocity: Any, v: Any) -> Any:
        c = self._continuum
        ev, e = c.model.strain(v, c.x), c.model.strain(velocity, c.x)
        total = self._by_mass * self._mass(velocity, v)
        for stiffness, _, dx in c.parts:
            total += self._by_stiffness * ufl.inner(ufl.dot(stiffness, e), ev) * c.weight * dx
        return total

    def energy(self, u: fem.Function) -> Any:
        """Kinetic energy at the trial velocity."""
        return 0.5 * self._mass(self.velocity, self.velocity)

    def residual(self, u: fem.Function, v: Any) -> Any:
        """M b + C c."""
        total = self._mass(self._b_u * u + self._b_known, v)
        if self._damped:
            total += self._damping(self._c_u * u + self._c_known, v)
        return total

    def begin(self, time: float, dt: float) -> None:
        """Prepare b(u) and c(u) for an increment."""
        if not dt > 0.0:
            raise SolverError(f"inertia: an increment of length {dt} is no motion; it must be > 0")
        self._moving = True
        alpha_m, alpha_f, _, gamma = self._effect.parameters
        last, keep = self._last, 1.0 - alpha_f
        self._take_dt(dt)
        a = self._known_acceleration(last)
        self._b_known.x.array[:] = (
            (1.0 - alpha_m) * a + alpha_m * last["a"] - alpha_f * last["b"]
        ) / keep
        v = last["v"] + dt * ((1.0 - gamma) * last["a"] + gamma * a)
        self._c_known.x.array[:] = v + alpha_f * (last["v"] - last["c"]) / keep

    def _take_dt(self, dt: float) -> None:
        """Set b_u and c_u for increments of a length; 0 before the first one."""
        if dt == self._dt:
            return
        alpha_m, alpha_f, beta, gamma = self._effect.parameters
        self._dt = dt
        self.version += 1
        self._b_u.value = (1.0 - alpha_m) / (beta * dt**2 * (1.0 - alpha_f)) if dt > 0.0 else 0.0
        self._c_u.value = gamma / (beta * dt) if dt > 0.0 else 0.0

    def _known_acceleration(self, last: dict[str, Array]) -> Array:
        """The part of the new acceleration that is not u/(beta dt^2)."""
        beta, dt = self._effect.parameters[2], self._dt
        known = -(last["u"] + dt * last["v"]) / (beta * dt**2)
        return np.asarray(known - (0.5 / beta - 1.0) * last["a"])

    def _motion(self, u: Array) -> tuple[Array, Array]:
        """Acceleration and velocity at a new displacement."""
        _, _, beta, gamma = self._effect.parameters
        last, dt = self._last, self._dt
        a = u / (beta * dt**2) + self._known_acceleration(last)
        return a, last["v"] + dt * ((1.0 - gamma) * last["a"] + gamma * a)

    def update(self, u: fem.Function) -> None:
        """Set the trial velocity."""
        if self._moving:
            self.velocity.x.array[:] = self._motion(u.x.array)[1]

    def commit(self, u: fem.Function) -> None:
        """Keep the motion; what the forces put in and is no kinetic energy was dissipated."""
        if not self._moving:
            return
        self._moving = False
        a, v = self._motion(u.x.array)
        new = {
            "u": u.x.array.copy(),
            "v": v,
            "a": a,
            "b": float(self._b_u.value) * u.x.array + self._b_known.x.array,
            "c": float(self._c_u.value) * u.x.array + self._c_known.x.array,
        }
        last = self._last
        step = new["u"] - last["u"]
        given = self._product("mass", 0.5 * (last["b"] + new["b"]), step)
        gained = 0.5 * self._product("mass", v + last["v"], v - last["v"])
        self._spent["numerical_dissipation"] += given - gained
        if self._damped:
            mean = 0.5 * (last["c"] + new["c"])
            self._spent["damping_energy"] += self._product("damping", mean, step)
        self._last = new
        self.velocity.x.array[:] = v

    def _product(self, name: str, x: Array, y: Array) -> float:
        """Mass or damping matrix between two vectors; collective."""
        if self._products is None:
            left, right = (fem.Function(self._continuum.space) for _ in range(2))
            forms = {"mass": fem.form(self._mass(left, right))}
            if self._damped:
                forms["damping"] = fem.form(self._damping(left, right))
            self._products = left, right, forms
        left, right, forms = self._products
        left.x.array[:], right.x.array[:] = x, y
        value = fem.assemble_scalar(forms[name])
        return float(self._continuum.comm.allreduce(value, op=MPI.SUM))

    def spent(self) -> dict[str, float]:
        """Energy taken by Rayleigh damping and by the method up to the last commit.

        With the work of all other forces by the trapezoidal rule the balance is exact:
        work = kinetic energy + damping energy + numerical dissipation.
        """
        return dict(self._spent)

    def state(self) -> dict[str, Array]:
        """Motion of the last commit and sums."""
        out = {name: value.copy() for name, value in self._last.items()}
        return out | {"sums": np.array(list(self._spent.values())), "dt": np.array([self._dt])}

    def places(self) -> dict[str, Place]:
        """Space of the motion."""
        return dict.fromkeys(REMEMBERED, self._continuum.space)

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, with the tangent of its last increment."""
        self._last = {name: state[name].copy() for name in REMEMBERED}
        self._spent = dict(zip(self._spent, (float(x) for x in state["sums"]), strict=True))
        self._moving = False
        self._take_dt(float(state["dt"][0]))
        for known, name, factor in (
            (self._b_known, "b", self._b_u),
            (self._c_known, "c", self._c_u),
        ):
            known.x.array[:] = self._last[name] - float(factor.value) * self._last["u"]
        self.velocity.x.array[:] = self._last["v"]


def _density(effect: Inertia, material: Any) -> float:
    density = getattr(material, "density", None) if effect.density is None else effect.density
    if density is None:
        raise InputError(
            f"Inertia: {material} has no density; give Inertia(density=...) or density= in the "
            "material"
        )
    return float(density)
