"""Internal forces of the bodies in explicit dynamics: a sparse product, or assembly.

Linear bodies may use either; which is faster depends on element and machine and is found out by
timing both. Nonlinear bodies assemble their residual and nothing else. The temperature of linear
bodies is a load (:class:`fxcrack.continuum.thermal_strain.ThermalLoad`), so that they take the
product; that of others is in their residual.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.la
import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.halo import Halo
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.kernels import fast_form
from fxcrack.continuum.stiffness_rows import StiffnessRows
from fxcrack.continuum.stress import cell_means
from fxcrack.continuum.term import Term
from fxcrack.continuum.thermal_strain import is_linear

_NO_FORM = object()
_TRIALS = 5
"""Evaluations of which the fastest counts when operators are compared."""


@dataclass(frozen=True)
class OperatorChoice:
    """Which operator gives the internal forces, and why.

    Attributes:
        name: "product" or "assembly".
        why: The reason, one sentence.
        seconds: Seconds of one evaluation, of the operators that were timed.
    """

    name: str
    why: str
    seconds: dict[str, float]


class NodeUnknowns(Protocol):
    """Unknowns of nodes that are not those of the displacement space, one for one with them."""

    def stiffness(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Stiffness on the unknowns of that of the space, which is destroyed; collective."""
        ...

    def nodal(self, values: Array) -> Array:
        """Values of the owned dofs of the space of those of the unknowns, shape (n_local,)."""
        ...

    def forces(self, values: Array) -> Array:
        """Forces on the unknowns of those on the owned dofs of the space, shape (n_local,)."""
        ...


class FurtherNodes:
    """Nodes whose values rows of the stiffness need though they are no ghosts of this rank.

    A row is complete with the contributions of all ranks. Where three ranks meet in a node, a cell
    of the second may connect a node of the first with one of the third, which the first shares no
    cell with.

    Args:
        continuum: Displacement space.
        columns: Global columns of the rows of this rank, shape (n,).
    """

    def __init__(self, continuum: Continuum, columns: Ints) -> None:
        index_map, comm = continuum.space.dofmap.index_map, continuum.comm
        self._unknowns, self._n_owned = continuum.layout.n_unknowns, int(index_map.size_local)
        sizes = comm.allgather(self._n_owned)
        ranges = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        nodes = np.unique(columns // self._unknowns)
        first, end = ranges[comm.rank], ranges[comm.rank + 1]
        outside = nodes[(nodes < first) | (nodes >= end)]
        self.nodes = np.setdiff1d(outside, np.asarray(index_map.ghosts, dtype=np.int64))
        self.exist = any(comm.allgather(len(self.nodes) > 0))
        self._halo = Halo(comm, ranges, self.nodes)

    def values(self, x: Array) -> Array:
        """A local array and the values of these nodes behind it; collective.

        Args:
            x: Shape (n_local + number of ghost dofs,).

        Returns:
            The array itself where no rank needs more.
        """
        if not self.exist:
            return x
        owned = x[: self._n_owned * self._unknowns].reshape(-1, self._unknowns)
        return np.concatenate([x, self._halo.fetch(owned).ravel()])


def local_matrix(continuum: Continuum, matrix: PETSc.Mat) -> tuple[sp.csr_matrix, FurtherNodes]:
    """Rows of the owned dofs of a matrix, columns in local numbers: owned, ghosts, further nodes.

    Collective.

    Args:
        continuum: Displacement space.
        matrix: Matrix on it, assembled.

    Returns:
        Shape (n_local, n_local + number of ghost and further dofs); the further nodes.
    """
    index_map, n = continuum.space.dofmap.index_map, continuum.layout.n_unknowns
    indptr, columns, values = matrix.getValuesCSR()
    columns = columns.astype(np.int64)
    further = FurtherNodes(continuum, columns)
    local = columns - continuum.offset
    outside = np.flatnonzero((local < 0) | (local >= continuum.n_local))
    ghosts = np.concatenate([np.asarray(index_map.ghosts, dtype=np.int64), further.nodes])
    order = np.argsort(ghosts)
    nodes, unknown = np.divmod(columns[outside], n)
    place = order[np.searchsorted(ghosts[order], nodes)] if len(outside) else nodes
    local[outside] = n * (index_map.size_local + place) + unknown
    width = n * (index_map.size_local + len(ghosts))
    out = sp.csr_matrix((values, local.astype(np.int32), indptr), shape=(continuum.n_local, width))
    out.sort_indices()
    return out, further


class InternalForces:
    """Internal forces of bodies at a displacement.

    Args:
        continuum: Displacement space.
        terms: What acts in the bodies, all but inertia.

    Attributes:
        u: The displacement, ghosts up to date.
        linear: Whether forces are linear in the displacement: elasticity alone, whose moduli stay.
        finite: Whether they may turn and stretch by any amount.
        path_dependent: Whether energies follow from the states passed: plasticity, or a
            temperature that changes in nonlinear bodies.
        choice: Which operator is used; set by :meth:`choose`.
        evaluations: How often forces were evaluated.
        on_unknowns: What :attr:`u` holds in place of the unknowns of the space; ``None`` where it
            holds these.
    """

    def __init__(self, continuum: Continuum, terms: Sequence[Term]) -> None:
        self.continuum = continuum
        self.terms = list(terms)
        self.u = fem.Function(continuum.space, name="displacement")
        field = continuum.temperature
        self.linear = all(t.constant for t in terms) and is_linear(continuum)
        heated = field is not None and not self.linear and not field.effect.steady
        self.finite = not self.linear and any(t.finite for t in terms)
        self._yields = any(t.path_dependent for t in terms)
        self.path_dependent = heated or self._yields
        self.evaluations = 0
        self.on_unknowns: NodeUnknowns | None = None
        self.choice = OperatorChoice("assembly", "nothing else was chosen", {})
        self._by_cells = [t for t in terms if t.by_cells]
        self._changing = [t for t in terms if not t.constant and _has_state(t)]
        self._form: Any = None
        self._energies: dict[str, Any] = {}
        self._matrix: sp.csr_matrix | None = None
        self._rows: StiffnessRows | None = None
        self._further: FurtherNodes | None = None
        self._vector = fem.Function(continuum.space)
        self._in_space: fem.Function | None = None
        self._evaluate: Callable[[], Array] = self._assembled

    # -- operators -----------------------------------------------------------------------

    def choose(self, operator: str) -> None:
        """Choose how forces are evaluated; collective.

        Args:
            operator: "product", "assembly", or "auto": the faster one.
        """
        comm = self.continuum.comm
        if not self.linear:
            self.choice = OperatorChoice("assembly", "forces are not linear in displacement", {})
            self._compile()
            return
        candidates: dict[str, Callable[[], Array]] = {
            "product": self._product,
            "assembly": self._assembled,
        }
        if self.on_unknowns is not None:
            operator, why = "product", "nodes of the shells have unknowns of their own"
        elif self.continuum.temperature is not None:
            operator, why = "product", "the temperature of linear bodies is a load"
        else:
            why = "it was asked for"
        if operator != "auto":
            self._evaluate = candidates[operator]
            self.choice = OperatorChoice(operator, why, {})
            self._evaluate()
            return
        seconds = {}
        for name, evaluate in candidates.items():
            evaluate()  # compiles and assembles what it needs
            best = np.inf
            for _ in range(_TRIALS):
                start = time.process_time()
                evaluate()
                best = min(best, time.process_time() - start)
            seconds[name] = float(comm.allreduce(best, op=MPI.MAX))
        faster = min(seconds, key=lambda name: seconds[name])
        self._evaluate = candidates[faster]
        why = "the faster one: " + ", ".join(f"{k} {1e3 * s:.3g} ms" for k, s in seconds.items())
        self.choice = OperatorChoice(faster, why, seconds)
        if faster == "assembly":
            self.forget_stiffness()

    def stiffness(self) -> sp.csr_matrix:
        """Linear elastic stiffness at zero strain, of the owned rows; collective.

        Its columns are those of :meth:`columns`.
        """
        if self._matrix is None:
            matrix = self.continuum.stiffness()
            if self.on_unknowns is not None:
                matrix = self.on_unknowns.stiffness(matrix)
            self._matrix, self._further = local_matrix(self.continuum, matrix)
            matrix.destroy()
        return self._matrix

    def columns(self) -> Array:
        """Displacements that the columns of :meth:`stiffness` belong to; collective.

        The array of :attr:`u` itself, ghosts included, unless rows of some rank need more nodes.
        """
        return self.u.x.array if self._further is None else self._further.values(self.u.x.array)

    def forget_stiffness(self) -> None:
        """Free the memory of :meth:`stiffness`, which is assembled again where it is needed."""
        self._matrix = self._rows = None

    def _product(self) -> Array:
        if self._rows is None:
            continuum = self.continuum
            every = np.ones(continuum.n_local, dtype=bool)
            size = continuum.layout.n_unknowns
            self._rows = StiffnessRows(self.stiffness(), every, size, continuum.comm)
        return self._rows(self.columns())

    def _compile(self) -> None:
        if self._form is None:
            v, comm = ufl.TestFunction(self.continuum.space), self.continuum.comm
            u = self._displacement()
            forms = [t.residual(u, v) for t in self.terms if not t.by_cells]
            self._form = fast_form(comm, sum(forms)) if forms else _NO_FORM

    def _displacement(self) -> fem.Function:
        """The displacement that terms take, always the same function, up to date; collective."""
        if self.on_unknowns is None:
            return self.u
        if self._in_space is None:
            self._in_space = fem.Function(self.continuum.space)
        x, n = self._in_space.x, self.continuum.n_local
        x.array[:n] = self.on_unknowns.nodal(self.u.x.array[:n])
        x.scatter_forward()
        return self._in_space

    def _assembled(self) -> Array:
        self._compile()
        u = self._displacement()
        values = self._vector.x.array
        values[:] = 0.0
        if self._form is not _NO_FORM:
            fem.assemble_vector(values, self._form)
        for term in self._by_cells:
            term.add_residual(values, u)
        if self.continuum.comm.size > 1:
            self._vector.x.scatter_reverse(dolfinx.la.InsertMode.add)
        found = np.asarray(values[: self.continuum.n_local])
        return found if self.on_unknowns is None else self.on_unknowns.forces(found)

    # -- states passed -------------------------------------------------------------------

    def begin(self, time: float) -> None:
        """Set the time of the displacement: temperatures of nonlinear bodies; collective."""
        if not self.linear:
            for term in self.terms:
                term.begin(time, 0.0)

    def commit(self) -> None:
        """Keep the state that belongs to the last :meth:`forces`; collective."""
        if self.path_dependent:
            for term in self.terms:
                term.commit(self._displacement())

    def spent(self) -> dict[str, float]:
        """Energies dissipated up to the last commit by name, force x length; collective."""
        out: dict[str, float] = {}
        for term in self.terms:
            for name, value in term.spent().items():
                out[name] = out.get(name, 0.0) + value
        return out

    def work(self) -> float:
        """Work of the temperature of nonlinear bodies up to the last commit, force x length."""
        return 0.0 if self.linear else sum(term.work() for term in self.terms)

    def state(self) -> dict[str, Array]:
        """Committed state of the terms of this rank, as copies; shapes as in :meth:`Term.state`."""
        if not self.path_dependent:
            return {}
        named = [(i, t.state()) for i, t in enumerate(self.terms)]
        return {f"{i}.{k}": np.array(v) for i, state in named for k, v in state.items()}

    def places(self) -> dict[str, Place]:
        """Where the arrays of :meth:`state` are defined."""
        named = [(i, t.places()) for i, t in enumerate(self.terms)]
        return {f"{i}.{k}": place for i, places in named for k, place in places.items()}

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        if self.path_dependent:
            for i, term in enumerate(self.terms):
                start = f"{i}."
                mine = {k[len(start) :]: v for k, v in state.items() if k.startswith(start)}
                term.restore(mine)

    def stress(self) -> fem.Function:
        """Cauchy stress of nonlinear bodies at :attr:`u`, means of cells; collective.

        Components in the order of ``model.stress_labels``, force/length^2.
        """
        u = self._displacement()
        for term in self._changing:
            term.update(u)
        return cell_means(self.continuum, [p for t in self.terms for p in t.stresses(u)])

    # -- forces and energies -------------------------------------------------------------

    def forces(self) -> Array:
        """Internal forces at :attr:`u`, shape (n_local,), force; collective.

        The array is overwritten by the next call.
        """
        self.evaluations += 1
        for term in self._changing:
            term.update(self._displacement())
        return self._evaluate()

    def tangent_product(self, direction: Array) -> Array:
        """Tangent stiffness at :attr:`u` times a direction; collective.

        Args:
            direction: Shape (n_local,), length.

        Returns:
            A new array of shape (n_local,), force.
        """
        x, n, comm = self.u.x, self.continuum.n_local, self.continuum.comm
        before = x.array.copy()
        if self.linear or self._yields:
            x.array[:n] = direction
            x.scatter_forward()
            # bodies that yield are stiffest where they do not: in unloading
            out = self._product() if self._yields else self.forces().copy()
        else:
            # a motion far below any displacement that matters, far above round-off
            scale = comm.allreduce(float(np.abs(direction).max(initial=0.0)), op=MPI.MAX)
            small = 1e-7 * self._length / scale
            sides = []
            for sign in (1.0, -1.0):
                x.array[:n] = before[:n] + sign * small * direction
                x.scatter_forward()
                sides.append(self.forces().copy())
            out = (sides[0] - sides[1]) / (2.0 * small)
        x.array[:] = before
        return np.asarray(out)

    @property
    def _length(self) -> float:
        """Length of the smallest cell, to scale motions; found once."""
        if not hasattr(self, "_smallest"):
            domain, tdim = self.continuum.mesh.domain, self.continuum.mesh.tdim
            n = domain.topology.index_map(tdim).size_local
            sizes = domain.h(tdim, np.arange(n, dtype=np.int32))
            low = float(np.min(sizes, initial=np.inf))
            self._smallest = float(self.continuum.comm.allreduce(low, op=MPI.MIN))
        return self._smallest

    def stored(self) -> float:
        """Energy stored at :attr:`u`, force times length; collective."""
        u = self._displacement()
        if not self._energies:
            comm = self.continuum.comm
            forms = [t.energy(u) for t in self.terms if not t.by_cells]
            total = [e for e in forms if e is not None]
            self._energies = {"stored": fast_form(comm, sum(total))} if total else {}
        value = sum(fem.assemble_scalar(form) for form in self._energies.values())
        value += sum(term.stored(u) for term in self._by_cells)
        return float(self.continuum.comm.allreduce(value, op=MPI.SUM))


def _has_state(term: Term) -> bool:
    """Whether a term stores anything that a new displacement changes."""
    return bool(term.state())


__all__ = ["FurtherNodes", "InternalForces", "NodeUnknowns", "OperatorChoice", "local_matrix"]
