"""Internal forces of bodies in motion whose work over an increment is the change of their energy.

The trapezoidal rule, which the work of an increment is taken by, is exact for linear bodies. For
finite strain the forces f of both ends are completed by what their mean lacks,

    d = f_bar - (f(u_n) + f(u_{n+1}))/2,    f_bar . (u_{n+1} - u_n) = W(u_{n+1}) - W(u_n)

and generalised alpha weighs F = f + e of both ends instead of f:

    (1 - alpha_f) F_{n+1} + alpha_f F_n = (1 - alpha_f) f_{n+1} + alpha_f f_n + d

For alpha_f = 1/2 (rho_inf = 1) the mean of F is f_bar, and work and energies agree to the residual
that the iteration leaves. f_bar keeps momentum and, but for continuum shells of first order, moment
of momentum as well (Simo and Tarnow, ZAMP 43, 1992; Gonzalez, Comput. Methods Appl. Mech. Engrg.
190, 2000). Where the temperature changes, W depends on it as well; the work of the temperature is
what the change of W has beyond that of f_bar, its difference quotient in T: zero at a constant
temperature, and of second order like f_bar.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.neo_hookean import NeoHookeanBodies
from fxcrack.continuum.term import Term
from fxcrack.continuum.tied_elastic import TiedElastic


class _Forms:
    """Forces of a term that gives f_bar as a form: a f_bar + b f(u), and their tangent.

    Args:
        continuum: Displacement space.
        term: The term.
        begin: Displacement at the beginning of the increment.
        mean: Factor a.
        end: Factor b.
        rise: T - T_ref at the beginning, where the bodies have a temperature.
    """

    def __init__(
        self,
        continuum: Continuum,
        term: Elastic | NeoHookeanBodies,
        begin: fem.Function,
        mean: float,
        end: float,
        rise: fem.Function | None,
    ) -> None:
        self._begin = begin
        space = continuum.space
        v, du = ufl.TestFunction(space), ufl.TrialFunction(space)
        self._u, self._middle = fem.Function(space), fem.Function(space)
        both = mean * term.mean_residual(self._u, begin, v, rise)
        # symmetric, and off by the rotation over half an increment: it serves to iterate with
        tangent = 0.5 * mean * term.tangent(self._middle, v, du)
        if end:
            both += end * term.residual(self._u, v)
            tangent += end * term.tangent(self._u, v, du)
        self._both, self._tangent = fem.form(both), fem.form(tangent)
        self._force = fem.form(term.residual(self._u, v))
        self._energy = fem.form(term.energy(self._u))

    def add(self, forces: Array, u: Array) -> None:
        """Add a f_bar + b f(u) to the local dofs."""
        self._u.x.array[:] = u
        fem.assemble_vector(forces, self._both)

    def add_force(self, forces: Array, u: Array) -> None:
        """Add f(u)."""
        self._u.x.array[:] = u
        fem.assemble_vector(forces, self._force)

    def add_tangent(self, matrix: PETSc.Mat, u: Array) -> None:
        """Add the change of a f_bar + b f(u) with u."""
        self._u.x.array[:] = u
        self._middle.x.array[:] = 0.5 * (u + self._begin.x.array)
        dolfinx.fem.petsc.assemble_matrix(matrix, self._tangent)

    def stored(self, u: Array) -> float:
        """Energy in the cells that this rank owns."""
        self._u.x.array[:] = u
        return float(fem.assemble_scalar(self._energy))


class _Cells:
    """The same for forces that are cubic along a line: Simpson's rule gives their mean exactly.

    Args:
        continuum: Displacement space.
        term: The term, of St. Venant-Kirchhoff bodies with quadratic strains.
        begin: Displacement at the beginning of the increment.
        mean: Factor a.
        end: Factor b.
    """

    def __init__(
        self, continuum: Continuum, term: TiedElastic, begin: fem.Function, mean: float, end: float
    ) -> None:
        self._term, self._begin, self._at = term, begin, fem.Function(continuum.space)
        self._weights = mean / 6.0, 4.0 * mean / 6.0, mean / 6.0 + end
        self._middle, self._begun = np.zeros_like(begin.x.array), np.empty(0)

    def _force(self, u: Array) -> Array:
        self._at.x.array[:] = u
        out = np.zeros_like(self._at.x.array)
        self._term.add_residual(out, self._at)
        return np.asarray(out)

    def add(self, forces: Array, u: Array) -> None:
        """Add a f_bar + b f(u) to the local dofs."""
        begin = self._begin.x.array
        for weight, at in zip(self._weights, (begin, 0.5 * (begin + u), u), strict=True):
            forces += weight * self._force(at)

    def add_force(self, forces: Array, u: Array) -> None:
        """Add f(u)."""
        forces += self._force(u)

    def add_tangent(self, matrix: PETSc.Mat, u: Array) -> None:
        """Add the change of a f_bar + b f(u) with u."""
        for weight, at in (
            (0.5 * self._weights[1], 0.5 * (self._begin.x.array + u)),
            (self._weights[2], u),
        ):
            self._at.x.array[:] = at
            self._term.add_tangent(matrix, self._at, weight)

    def stored(self, u: Array) -> float:
        """Energy in the cells that this rank owns."""
        self._at.x.array[:] = u
        return self._term.stored(self._at)


class ConservingForces(Term):
    """A term of finite strain, its forces over an increment of time such that energy is kept.

    Args:
        continuum: Displacement space.
        term: The term.
        effect: The time integration.
    """

    by_cells = True
    finite = True

    def __init__(
        self, continuum: Continuum, term: Elastic | NeoHookeanBodies | TiedElastic, effect: Inertia
    ) -> None:
        self.name = term.name
        self._term, self._space, self._n_local = term, continuum.space, continuum.n_local
        self._comm = continuum.comm
        self._continuum = continuum
        self._old = effect.parameters[1]
        self._mean = 1.0 / (1.0 - self._old)
        self._begin = fem.Function(continuum.space)
        size = len(self._begin.x.array)
        self._begun = False  # whether an equilibrium has been found before the motion
        self._moves = False  # whether an increment of time has begun
        self._force = np.zeros(size)  # f of the last commit, owned dofs
        self._lack = np.zeros(size)  # e there
        self._known = np.zeros(size)  # what F at the end has of the beginning
        self._kinds: _Forms | _Cells | None = None
        self._loss = 0.0
        field = continuum.temperature
        self._rise = None if field is None else fem.Function(field.rise.function_space)
        self._at = self._time = 0.0  # of the last commit, and of the end of the increment
        self._thermal = self._stored = 0.0  # work of the temperature, W of the last commit

    @property
    def _parts(self) -> _Forms | _Cells:
        """Forces and tangents, compiled on first use."""
        if self._kinds is None:
            c, term, begin, mean, rise = (
                self._continuum, self._term, self._begin, self._mean, self._rise,
            )  # fmt: skip
            if isinstance(term, TiedElastic):
                self._kinds = _Cells(c, term, begin, mean, 1.0 - 0.5 * mean)
            else:
                self._kinds = _Forms(c, term, begin, mean, 1.0 - 0.5 * mean, rise)
        return self._kinds

    def add_residual(self, forces: Array, u: fem.Function) -> None:
        """Add F at the end of the increment; f before the first one."""
        if not self._moves:
            self._parts.add_force(forces, u.x.array)
            return
        self._parts.add(forces, u.x.array)
        forces[: self._n_local] += self._known[: self._n_local]

    def add_tangent(self, matrix: PETSc.Mat, u: fem.Function) -> None:
        """Add its change with u, but for what is not symmetric."""
        if not self._moves:
            self._begin.x.array[:] = u.x.array
        self._parts.add_tangent(matrix, u.x.array)

    def stored(self, u: fem.Function) -> float:
        """Strain energy of the cells that this rank owns."""
        return self._parts.stored(u.x.array)

    def stresses(self, u: fem.Function) -> list[tuple[Any, Any]]:
        """Those of the term."""
        return self._term.stresses(u)

    def _summed(self, add: Callable[[Array, Array], None], u: Array) -> Array:
        """Forces at a displacement of the local dofs, summed over ranks; zero where not owned."""
        vector = compat.create_vector(self._space)
        with vector.localForm() as local:
            add(local.array, u)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        out = np.zeros(len(u))
        out[: self._n_local] = vector.array_r
        vector.destroy()
        return out

    def _settle_at(self, u: Array) -> None:
        """Take a displacement for the committed one: the residual there is F; collective."""
        self._begin.x.array[:] = u
        self._force = self._summed(self._parts.add_force, u)
        self._known = self._lack - 0.5 * self._mean * self._force
        if self._rise is not None:
            field = self._continuum.temperature
            assert field is not None
            self._rise.x.array[:] = field.rise.x.array
            self._stored = self._comm.allreduce(self._parts.stored(u), op=MPI.SUM)

    def begin_at(self, u: fem.Function) -> None:
        """Begin the motion at a displacement that loads at rest have brought about."""
        if not self._moves:
            self._settle_at(u.x.array)
            self._begun, self._thermal = True, self._stored

    def begin(self, time: float, dt: float) -> None:
        """Set what the increment knows of its beginning; collective."""
        self._moves = True
        self._set_time(time)
        self._known = -self._mean * (0.5 * self._force + self._old * self._lack)

    def _set_time(self, time: float) -> None:
        """Set the temperature, if there is one."""
        self._time = time
        if self._continuum.temperature is not None:
            self._continuum.temperature.set(time)

    def commit(self, u: fem.Function) -> None:
        """Take the end of the increment for the beginning of the next one; collective.

        What the trapezoidal rule takes of F beyond the work of f_bar counts as dissipated.
        """
        before, n = self._force + self._lack, self._n_local
        both = self._summed(self._parts.add, u.x.array)
        after, end = both + self._known, self._summed(self._parts.add_force, u.x.array)
        step, stored = u.x.array - self._begin.x.array, self._stored
        mean = (both - (1.0 - 0.5 * self._mean) * end) / self._mean
        works = np.array([0.5 * (before + after)[:n] @ step[:n], mean[:n] @ step[:n]])
        work, gained = self._comm.allreduce(works, op=MPI.SUM)
        if self._old != 0.5:
            self._loss += float(work - gained)
        self._lack, self._at = after - end, self._time
        self._settle_at(u.x.array)
        if self._rise is not None:
            self._thermal += float(self._stored - stored - gained)

    def work(self) -> float:
        """Work of the temperature up to the last commit."""
        return self._thermal

    def spent(self) -> dict[str, float]:
        """Energy dissipated by the method, none where it keeps energy."""
        return {} if self._old == 0.5 else {"numerical_dissipation": self._loss}

    def state(self) -> dict[str, Array]:
        """Displacement of the last commit, what its forces lack, energy lost, whether in motion.

        Returns:
            "u" (length) and "lack" (force): local dofs, ghosts too, shape (n_dofs,); "loss": energy
            dissipated by the method, 1 once the bodies have moved, work of the temperature, time,
            and 1 where they began in an equilibrium, shape (5,).
        """
        return {
            "u": self._begin.x.array.copy(),
            "lack": self._lack.copy(),
            "loss": np.array([self._loss, self._moves, self._thermal, self._at, self._begun]),
        }

    def places(self) -> dict[str, Place]:
        """Their spaces."""
        return dict.fromkeys(("u", "lack"), self._space)

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state, F of which is the residual there; collective."""
        self._loss, moves, *more = (float(x) for x in state["loss"])
        self._moves = bool(moves)
        if self._rise is not None:
            self._thermal, self._at, begun = more
            self._begun = bool(begun)
            if self._moves or self._begun:
                self._set_time(self._at)
            else:
                assert self._continuum.temperature is not None
                self._continuum.temperature.clear()
        self._lack = state["lack"].copy()
        self._settle_at(state["u"])


def conserving(continuum: Continuum, terms: Sequence[Term], effect: Inertia) -> list[Term]:
    """The same terms, those of finite strain such that they keep energy in motion."""
    kinds = Elastic, NeoHookeanBodies, TiedElastic
    return [
        ConservingForces(continuum, t, effect) if isinstance(t, kinds) and t.finite else t
        for t in terms
    ]


__all__ = ["ConservingForces", "conserving"]
