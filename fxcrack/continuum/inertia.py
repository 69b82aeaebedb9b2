"""What the user says about inertia: density, damping and the time integration.

    M a_{n+1-alpha_m} + C v_{n+1-alpha_f} + f_{n+1-alpha_f} = 0        (generalised alpha)

Impulses of contact change velocities alone, by w in the middle of an increment; forces of the end
contain their mean over it, M w/dt.

Chung and Hulbert (1993); Hilber, Hughes and Taylor's method and Newmark's are choices of the
parameters. Pure data; :mod:`fxcrack.continuum.inertia` makes forms of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    between,
    flag,
    keep,
    keep_floats,
    list_of,
    not_negative,
    number,
    number_or_function,
    positive,
    shown,
)
from fxcrack.base.errors import InputError, SolverError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.loads import Field
from fxcrack.continuum.reduced_integration import whole_measure
from fxcrack.continuum.section import Section
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.temperature_field import interpolate_given
from fxcrack.continuum.term import Term


@dataclass(frozen=True)
class Inertia:
    """Inertia of the bodies: implicit dynamics.

    Args:
        density: Mass per undeformed volume of all bodies; that of the materials by default.
        rho_inf: What is left of a motion too fast for the increment after one increment, 0 to 1:
            1 damps nothing, 0 damps it at once. The parameters follow from it.
        alpha_m: Weight of the old acceleration, if chosen by hand (together with ``alpha_f``).
        alpha_f: Weight of the old forces and velocity.
        rayleigh: Damping C = r_M M + r_K K by mass (1/time) and by stiffness at zero strain (time).
        lumped: Mass at the nodes alone; first-order bodies only.
        velocity: Velocity at time 0, a number or a function of position per component; at rest by
            default.

    Raises:
        InputError: A number is out of range, or the method would be unstable or of first order.
    """

    density: float | None = None
    rho_inf: float = 0.8
    alpha_m: float | None = None
    alpha_f: float | None = None
    rayleigh: tuple[float, float] = (0.0, 0.0)
    lumped: bool = False
    velocity: tuple[Field, ...] | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.density is not None:
            positive("Inertia", density=self.density)
        between("Inertia", "rho_inf", self.rho_inf, 0.0, 1.0)
        for name in ("alpha_m", "alpha_f"):
            if getattr(self, name) is not None:
                between("Inertia", name, getattr(self, name), -1.0, 0.5)
        keep_floats(self, "density", "rho_inf", "alpha_m", "alpha_f")
        keep(self, lumped=flag("Inertia", "lumped", self.lumped))
        if (self.alpha_m is None) != (self.alpha_f is None):
            raise InputError("Inertia: give alpha_m and alpha_f together, or rho_inf alone")
        velocity = list_of(self.velocity)
        if self.velocity is not None and velocity is None:
            raise InputError(
                f"Inertia: velocity = {shown(self.velocity)} must have one entry per component, "
                "each a number or a function of position, e.g. (0.0, 1.0)"
            )
        if velocity is not None:
            for i, component in enumerate(velocity):
                number_or_function("Inertia", f"velocity[{i}]", component)
            keep(self, velocity=tuple(velocity))
        m, f, _, _ = self.parameters
        if not m <= f <= 0.5:
            raise InputError(
                f"Inertia: alpha_m = {m}, alpha_f = {f} is not unconditionally stable; "
                "alpha_m <= alpha_f <= 1/2 is"
            )
        rayleigh = list_of(self.rayleigh)
        if rayleigh is None or len(rayleigh) != 2:
            raise InputError(
                f"Inertia: rayleigh = {shown(self.rayleigh)} must be two numbers that are not "
                "negative"
            )
        not_negative("Inertia", **{f"rayleigh[{i}]": r for i, r in enumerate(rayleigh)})
        keep(self, rayleigh=tuple(float(r) for r in rayleigh))

    @classmethod
    def hht(cls, alpha: float = -0.05, **others: object) -> Inertia:
        """Hilber, Hughes and Taylor's method, -1/3 <= alpha <= 0."""
        if not -1.0 / 3.0 <= number("Inertia.hht", "alpha", alpha) <= 0.0:
            raise InputError(f"Inertia.hht: alpha = {alpha} must lie between -1/3 and 0")
        return cls(alpha_m=0.0, alpha_f=-alpha, **others)  # type: ignore[arg-type]

    @classmethod
    def newmark(cls, **others: object) -> Inertia:
        """Newmark's method with constant mean acceleration: no numerical damping."""
        return cls(alpha_m=0.0, alpha_f=0.0, **others)  # type: ignore[arg-type]

    @property
    def parameters(self) -> tuple[float, float, float, float]:
        """Alpha_m, alpha_f, beta, gamma; second order in the increment."""
        if self.alpha_m is not None and self.alpha_f is not None:
            m, f = self.alpha_m, self.alpha_f
        else:
            m = (2.0 * self.rho_inf - 1.0) / (self.rho_inf + 1.0)
            f = self.rho_inf / (self.rho_inf + 1.0)
        return m, f, 0.25 * (1.0 - m + f) ** 2, 0.5 - m + f


_SAME_LENGTH = 1e-9
"""Increments that differ by less than this part of their length, by round-off, have one tangent."""

REMEMBERED = ("u", "v", "a", "b", "c", "w")


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
        if effect.rayleigh[1] and isinstance(continuum, ShellBodies):
            raise InputError(
                f"Inertia: rayleigh = {effect.rayleigh}: damping by stiffness is not available "
                "with shells; use damping by mass, rayleigh=(r, 0.0)"
            )
        if effect.rayleigh[1] and continuum.tied_cells:
            raise InputError(
                f"Inertia: rayleigh = {effect.rayleigh}: damping by stiffness is not available "
                "with first-order continuum shells; use damping by mass, rayleigh=(r, 0.0), or "
                "Scene(order=2)"
            )
        self._continuum = continuum
        self._effect = effect
        domain = continuum.mesh.domain
        self._densities = [
            fem.Constant(domain, _densities(effect, m)) for m in continuum.part_materials
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
        self._mass_matrix: PETSc.Mat | None = None
        self._w = np.zeros(size)  # velocity jump of the present increment by contact impulses

    def _start(self, velocity: Any) -> None:
        gdim = self._continuum.gdim
        if len(velocity) not in (gdim, self._continuum.mesh.gdim):
            raise InputError(f"Inertia: velocity has {len(velocity)} components, {gdim} needed")
        comm = self._continuum.comm
        for i, v in enumerate(velocity):
            component = self.velocity.sub(i)
            if callable(v):
                interpolate_given(comm, component, "Inertia", f"velocity[{i}]", v)
            else:
                component.interpolate(lambda x, v=v: np.full(x.shape[1], float(v)))

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
            dx = whole_measure(dx)
            if self._effect.lumped:
                dx = dx.reconstruct(metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
            total += c.mass_density(density, a, v) * c.weight * dx
        return total

    def _damping(self, velocity: Any, v: Any) -> Any:
        c = self._continuum
        total = self._by_mass * self._mass(velocity, v)
        if not self._effect.rayleigh[1]:
            return total  # of shells there is no other
        ev, e = c.model.strain(v, c.x), c.model.strain(velocity, c.x)
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
        self._w[:] = 0.0

    def expect(self, dt: float) -> None:
        """Have the tangent of increments of a length before the first one begins.

        Args:
            dt: The length, time.
        """
        self._take_dt(dt)

    def _take_dt(self, dt: float) -> None:
        """Set b_u and c_u for increments of a length; 0 before the first one."""
        if abs(dt - self._dt) <= _SAME_LENGTH * dt:
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
        # an impulse acts half way through the increment
        a = u / (beta * dt**2) + self._known_acceleration(last) - self._w / (2.0 * beta * dt)
        return a, last["v"] + dt * ((1.0 - gamma) * last["a"] + gamma * a) + self._w

    def update(self, u: fem.Function) -> None:
        """Set the trial velocity."""
        if self._moving:
            self.velocity.x.array[:] = self._motion(u.x.array)[1]

    def commit(self, u: fem.Function) -> None:
        """Store the motion; work of the forces that is not kinetic energy counts as dissipated."""
        if not self._moving:
            return
        self._moving = False
        a, v = self._motion(u.x.array)
        w = self._w / self._dt
        new = {
            "u": u.x.array.copy(),
            "v": v,
            "a": a,
            "b": float(self._b_u.value) * u.x.array + self._b_known.x.array - w,
            "c": float(self._c_u.value) * u.x.array + self._c_known.x.array,
            "w": w,
        }
        last = self._last
        step = new["u"] - last["u"]
        mean = 0.5 * (last["b"] + last["w"] + new["b"] + new["w"])
        given = self._product("mass", mean, step)
        gained = 0.5 * self._product("mass", v + last["v"], v - last["v"])
        self._spent["numerical_dissipation"] += given - gained
        if self._damped:
            mean = 0.5 * (last["c"] + new["c"])
            self._spent["damping_energy"] += self._product("damping", mean, step)
        self._last = new
        self.velocity.x.array[:] = v

    def begin_at(self, u: fem.Function) -> None:
        """Begin the motion at a displacement that loads at rest have brought about."""
        if not self._dt > 0.0:
            self._last["u"] = u.x.array.copy()

    # -- contact impulses ----------------------------------------------------------------

    @property
    def impulse_factor(self) -> float:
        """Impulse of a contact force that is found at the end of an increment, time.

        Displacements feel half of the velocity jump w over the increment, so that the force at its
        end is b_u dt/2 M w.
        """
        return 2.0 / (float(self._b_u.value) * self._dt)

    def mass_matrix(self) -> PETSc.Mat:
        """M on the displacements, owned by this object; collective."""
        if self._mass_matrix is None:
            space = self._continuum.space
            v, a = ufl.TestFunction(space), ufl.TrialFunction(space)
            self._mass_matrix = dolfinx.fem.petsc.assemble_matrix(fem.form(self._mass(a, v)))
            self._mass_matrix.assemble()
        return self._mass_matrix

    def last_impulse(self) -> PETSc.Vec | None:
        """Velocity jump of the last committed increment over its length, owned dofs; collective.

        The caller destroys it; ``None`` if there was none.
        """
        w = self._last["w"]
        if not self._continuum.comm.allreduce(bool(w.any()), op=MPI.LOR):
            return None
        out = self.velocity.x.petsc_vec.duplicate()
        out.array[:] = w[: self._continuum.n_local]
        return out

    def jump_velocity(self, w: PETSc.Vec) -> tuple[float, float]:
        """Give the bodies the velocity jump of the contact impulses of this increment; collective.

        Args:
            w: Owned dofs, length/time.

        Returns:
            Length of the increment, and the change of the inertia forces of its end over M w,
            1/time: they contain the mean force of the impulse from now on.
        """
        jump = fem.Function(self._continuum.space)
        jump.x.array[: self._continuum.n_local] = w.array_r
        jump.x.scatter_forward()
        self._w[:] = jump.x.array
        change = 1.0 / self._dt - 0.5 * float(self._b_u.value) * self._dt
        self._b_known.x.array[:] += change * self._w
        return self._dt, change

    def add_loss(self, energy: float) -> None:
        """Add to the energy dissipated by the method."""
        self._spent["numerical_dissipation"] += energy

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
        """Energy dissipated by Rayleigh damping and by the method up to the last commit.

        With the work of all other forces by the trapezoidal rule the energy balance is exact:
        work = kinetic energy + damping energy + numerical dissipation.
        """
        return dict(self._spent)

    def state(self) -> dict[str, Array]:
        """Motion of the last commit, dissipated energies and increment length.

        Returns:
            "u" (length), "v" and "c" (length/time), "a", "b" and "w" (length/time^2; the velocity
            jump of contact impulses over the increment): local dofs, ghosts too, each of shape
            (n_dofs,); "sums": the values of :meth:`spent`, force x length, shape
            (1,), with Rayleigh damping (2,); "dt": length of the last increment, time, shape (1,).
        """
        out = {name: value.copy() for name, value in self._last.items()}
        return out | {"sums": np.array(list(self._spent.values())), "dt": np.array([self._dt])}

    def places(self) -> dict[str, Place]:
        """Space of the motion."""
        return dict.fromkeys(REMEMBERED, self._continuum.space)

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state, with the tangent of its last increment.

        Args:
            state: From :meth:`state`, arrays of the same shapes.
        """
        # states that were saved before there were contact impulses have no "w"
        none = np.zeros_like(state["u"])
        self._last = {name: state.get(name, none).copy() for name in REMEMBERED}
        self._w[:] = 0.0
        self._spent = dict(zip(self._spent, (float(x) for x in state["sums"]), strict=True))
        self._moving = False
        self._take_dt(float(state["dt"][0]))
        for known, name, factor in (
            (self._b_known, "b", self._b_u),
            (self._c_known, "c", self._c_u),
        ):
            known.x.array[:] = self._last[name] - float(factor.value) * self._last["u"]
        self._b_known.x.array[:] += self._last["w"]
        self.velocity.x.array[:] = self._last["v"]


def _densities(effect: Inertia, material: Any) -> Any:
    """Density of a part as :meth:`fxcrack.continuum.continuum.Continuum.mass_density` takes it."""
    density: Any
    if isinstance(material, Section):
        density = material.mass(effect.density)
    else:
        density = getattr(material, "density", None) if effect.density is None else effect.density
    if density is None:
        raise InputError(
            f"Inertia: {material} has no density; give Inertia(density=...) or density= in the "
            "material"
        )
    return np.asarray(density, dtype=PETSc.ScalarType)
