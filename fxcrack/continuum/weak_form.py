"""All form terms of a scene together: residual, tangent and energies at a displacement.

    r(u) = sum of the terms' residuals,    K(u) = sum of their tangents

Dead loads are not included: they are border columns of the condensed system.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base import compat
from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.inertia import InertiaForces
from fxcrack.continuum.input_order import FileOrder, Place
from fxcrack.continuum.stress import cell_means
from fxcrack.continuum.term import Term

_SAME = 1e-9
"""Nodes of another number of ranks may be off by round-off, in parts of the largest coordinate."""


class WeakForm:
    """A continuum made of terms, with its present displacement.

    Args:
        continuum: Displacement space.
        terms: What acts in the bodies.

    Attributes:
        u: Present (trial) displacement.
        seconds: Seconds spent on each term, updating and assembling.
        began: End and length of the present increment, time.
    """

    def __init__(self, continuum: Continuum, terms: Sequence[Term]) -> None:
        self.continuum = continuum
        self.terms = list(terms)
        self._order = FileOrder(continuum.mesh.domain)
        self.u = fem.Function(continuum.space, name="displacement")
        self.seconds: dict[str, float] = {}
        self.began = 0.0, 0.0
        # one residual and one tangent per term, so that the cost of each can be measured
        self._forms: list[tuple[Term, Any, Any]] = []
        self._energies: dict[str, Any] = {}
        self._matrix: PETSc.Mat | None = None
        self._symmetric: PETSc.Mat | None = None
        self._assembled: tuple[int, ...] | None = None  # version of the terms in the matrix

    @property
    def n_forms(self) -> int:
        """Number of compiled forms."""
        return 2 * sum(f is not None for _, f, _ in self._forms) + len(self._energies)

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric."""
        return all(t.symmetric for t in self.terms)

    @property
    def finite(self) -> bool:
        """Whether bodies may turn and stretch by any amount."""
        return any(t.finite for t in self.terms)

    @property
    def dynamic(self) -> bool:
        """Whether forces depend on how long an increment takes."""
        return any(t.dynamic for t in self.terms)

    @property
    def inertia(self) -> InertiaForces | None:
        """Inertia of the bodies, if they have any."""
        return next((t for t in self.terms if isinstance(t, InertiaForces)), None)

    @property
    def closed(self) -> bool:
        """Whether all work on the bodies is stored, except for that done on interfaces."""
        return all(t.closed for t in self.terms)

    @property
    def accountable(self) -> bool:
        """Whether the energies of an increment are known before it is accepted.

        So they are where all work is stored, or dissipated at once by a law of the material.
        """
        return not self.dynamic and all(t.closed or t.path_dependent for t in self.terms)

    @property
    def path_dependent(self) -> bool:
        """Whether stresses depend on the loading history."""
        return any(t.path_dependent for t in self.terms)

    @property
    def constant(self) -> bool:
        """Whether the tangent does not depend on u."""
        return all(t.constant for t in self.terms)

    @property
    def version(self) -> tuple[int, ...]:
        """Tells constant tangents apart: equal versions, equal tangents."""
        return tuple(t.version for t in self.terms)

    def compile(self) -> None:
        """Compile all forms; collective."""
        if self._forms:
            return
        space = self.continuum.space
        v, du = ufl.TestFunction(space), ufl.TrialFunction(space)
        for term in self.terms:
            if term.by_cells:
                self._forms.append((term, None, None))
                continue
            residual = fem.form(term.residual(self.u, v))
            self._forms.append((term, residual, fem.form(term.tangent(self.u, v, du))))
        energies: dict[str, Any] = {}
        for term in self.terms:
            energy = None if term.by_cells else term.energy(self.u)
            if energy is not None:
                energies[term.energy_name] = energies.get(term.energy_name, 0) + energy
        self._energies = {name: fem.form(energy) for name, energy in energies.items()}

    def set(self, u: PETSc.Vec) -> None:
        """Take a trial displacement (owned dofs) and update the terms; collective."""
        n = self.continuum.n_local
        self.u.x.array[:n] = u.array
        self.u.x.scatter_forward()
        for term in self.terms:
            start = time.perf_counter()
            term.update(self.u)
            self._add(term.name, start)

    def _add(self, what: str, start: float) -> None:
        self.seconds[what] = self.seconds.get(what, 0.0) + time.perf_counter() - start

    def residual(self) -> PETSc.Vec:
        """R(u) on owned dofs; the caller destroys it."""
        self.compile()
        vector = compat.create_vector(self.continuum.space)
        for term, form, _ in self._forms:
            start = time.perf_counter()
            if form is None:
                with vector.localForm() as local:
                    term.add_residual(local.array, self.u)
            else:
                dolfinx.fem.petsc.assemble_vector(vector, form)
            self._add(term.name, start)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return vector

    def _pattern(self) -> Any:
        """A form that couples what any term couples: the displacements of each cell."""
        if len(self._forms) == 1 and self._forms[0][2] is not None:
            return self._forms[0][2]
        space = self.continuum.space
        v, du = ufl.TestFunction(space), ufl.TrialFunction(space)
        return fem.form(ufl.inner(du, v) * ufl.dx(self.continuum.mesh.domain))

    def tangent(self) -> PETSc.Mat:
        """K(u), kept and reassembled in place; owned by this object."""
        self.compile()
        if self._matrix is None:
            self._matrix = dolfinx.fem.petsc.create_matrix(self._pattern())
        if not (self.constant and self._assembled == self.version):
            self._matrix.zeroEntries()
            for term, _, form in self._forms:
                start = time.perf_counter()
                if form is None:
                    term.add_tangent(self._matrix, self.u)
                else:
                    dolfinx.fem.petsc.assemble_matrix(self._matrix, form)
                self._add(term.name, start)
            self._matrix.assemble()
            self._assembled = self.version
        return self._matrix

    def tangents(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        """The symmetric part of K(u), and K(u); owned by this object.

        The interface algebra requires a symmetric S; the iteration converges with this part too.
        """
        matrix = self.tangent()
        if self.symmetric:
            return matrix, matrix
        transposed = matrix.transpose(PETSc.Mat())
        if self._symmetric is None:
            self._symmetric = matrix.duplicate()
        matrix.copy(self._symmetric)
        self._symmetric.axpy(1.0, transposed, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self._symmetric.scale(0.5)
        transposed.destroy()
        return self._symmetric, matrix

    def stored(self) -> dict[str, float]:
        """Energies stored at the present displacement by name, force x length; collective."""
        self.compile()
        known = [t.energy_name for t in self.terms if t.by_cells or t.energy_name in self._energies]
        mine = dict.fromkeys(known, 0.0)
        for name, form in self._energies.items():
            mine[name] = fem.assemble_scalar(form)
        for term in self.terms:
            if term.by_cells:
                mine[term.energy_name] += term.stored(self.u)
        comm = self.continuum.comm
        return {name: float(comm.allreduce(x, op=MPI.SUM)) for name, x in mine.items()}

    def stress(self) -> fem.Function:
        """Cauchy stress at the present displacement, means over the undeformed cells; collective.

        Components in the order of ``model.stress_labels``, force/length^2.
        """
        parts = [part for term in self.terms for part in term.stresses(self.u)]
        return cell_means(self.continuum, parts)

    def spent(self) -> dict[str, float]:
        """Energies dissipated up to the last commit by name, force x length; collective."""
        out: dict[str, float] = {}
        for term in self.terms:
            for name, value in term.spent().items():
                out[name] = out.get(name, 0.0) + value
        return out

    def path_work(self) -> float:
        """Work the terms do on the straight path from the last commit to here; collective."""
        return sum(term.path_work(self.u) for term in self.terms)

    def path_spent(self) -> float:
        """Energy the terms dissipate on the straight path from the last commit; collective."""
        return sum(term.path_spent(self.u) for term in self.terms)

    def work(self) -> float:
        """Work done on the bodies through the terms up to the last commit; collective."""
        return sum(term.work() for term in self.terms)

    def begin(self, time_end: float, dt: float) -> None:
        """An increment of dt ends at a time; collective."""
        self.began = time_end, dt
        for term in self.terms:
            term.begin(time_end, dt)
            term.update(self.u)

    def begin_at(self) -> None:
        """Begin a motion at the present displacement, at rest; collective."""
        for term in self.terms:
            term.begin_at(self.u)

    def commit(self) -> None:
        """Accept the present displacement."""
        for term in self.terms:
            start = time.perf_counter()
            term.commit(self.u)
            self._add(term.name, start)

    def snapshot(self) -> dict[str, Array]:
        """Present displacement and committed state of the terms on this rank, as copies.

        Returns:
            Arrays by name, as :meth:`state` takes them.
        """
        return {k: np.array(v) for k, v in self._local().items() if k != "positions"}

    def state(self, local: dict[str, Array] | None = None) -> dict[str, Array]:
        """Committed state: positions, displacement and the state of the terms; collective.

        Args:
            local: The parts of this rank from an earlier :meth:`snapshot`; the present ones if not
                given.

        Returns:
            On rank 0 fields in the order of :class:`FileOrder`, shape (n_nodes or n_cells, values
            of each), lengths in "positions" and "displacement"; empty on the others. Arrays of
            terms without a place are as in :meth:`Term.state`, on every rank.
        """
        places = self._places()
        return {
            name: self._order.gather(values, places[name]) if name in places else values
            for name, values in {**self._local(), **(local or {})}.items()
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state` of the same mesh and terms; collective.

        Args:
            state: From rank 0, shapes as there, the same on all ranks; of any number of ranks.

        Raises:
            InputError: Cells or their nodes have another order than they had.
        """
        places, local = self._places(), self._local()
        mine = {
            name: self._order.scatter(values, places[name]).reshape(local[name].shape)
            if name in places
            else values
            for name, values in state.items()
        }
        x = local["positions"]
        size = np.abs(x).max(initial=0.0)
        same = bool(np.abs(mine["positions"] - x).max(initial=0.0) <= _SAME * size)
        if not min(self.continuum.comm.allgather(same)):
            raise InputError(
                "the checkpoint does not fit: its mesh has the same cells in another order, or "
                "nodes elsewhere. Give the mesh it was written with, or run without restart"
            )
        self.reset(mine)

    def reset(self, local: dict[str, Array]) -> None:
        """Return to a state of this rank from :meth:`snapshot`; collective."""
        self.u.x.array[:] = local["displacement"]
        for i, term in enumerate(self.terms):
            start = f"{i}."
            term.restore({k[len(start) :]: v for k, v in local.items() if k.startswith(start)})
            term.update(self.u)

    def _local(self) -> dict[str, Array]:
        """The parts of :meth:`state` on this rank."""
        out = {"positions": self.continuum.positions(), "displacement": self.u.x.array}
        for i, term in enumerate(self.terms):
            out |= {f"{i}.{key}": value for key, value in term.state().items()}
        return out

    def _places(self) -> dict[str, Place]:
        """Where they are defined, except for those that are the same on all ranks."""
        out: dict[str, Place] = dict.fromkeys(("positions", "displacement"), self.continuum.space)
        for i, term in enumerate(self.terms):
            out |= {f"{i}.{key}": place for key, place in term.places().items()}
        return out

    def destroy(self) -> None:
        """Free PETSc objects; collective."""
        for matrix in (self._matrix, self._symmetric):
            if matrix is not None:
                matrix.destroy()
        self._matrix = self._symmetric = None
