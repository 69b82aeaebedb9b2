"""What fxcrack is compared with: the same crack growth by two ways of writing a script.

* refactoring: at each release the matrix with the jumps free by then is factored anew and solved
  once. The ordering and the symbolic factorisation are made once and used again: A keeps all
  retained jumps; rows and columns of the fixed ones are zeroed.
* columns: one factorisation of A_II, then one back-solve for each released component gives its
  column of  S = A_WW - A_WI A_II^-1 A_IW; the growth itself runs on S.

Both use the matrices, the tip geometry, the energy release rates and the criterion of fxcrack, and
must give its openings and loads.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InputError
from fxcrack.bench.measure import check_mumps, mumps_cholesky
from fxcrack.bench.problem import Problem
from fxcrack.condensation.retained import CostModel, choose_roles
from fxcrack.criteria import RateCriterion, energy_release_rates
from fxcrack.interface.crack_extent import CrackExtent
from fxcrack.interface.front import Front
from fxcrack.interface.jump_coordinates import JumpCoordinates, build_coordinates
from fxcrack.interface.tips import Tips
from fxcrack.scene import Scene

_SAME_F = 1.0 - 1e-6  # front nodes this near the largest f are released together, as in fxcrack
_UNLIMITED_MB = 1e6


@dataclass(frozen=True)
class Response:
    """Equilibrium at opening 1.

    Attributes:
        jump: Retained jumps, shape (n_retained,), length.
        force: Interface forces of the retained jumps, shape (n_retained,), force.
        load: Reaction of the upper arm's end, force.
    """

    jump: Array
    force: Array
    load: float


class Solver(Protocol):
    """Finds the equilibrium for given free retained components."""

    def respond(self, free: Bools) -> Response:
        """Equilibrium at opening 1 with some retained components free, shape (n_retained,)."""
        ...


class Matrices:
    """A = T^t K T with all jumps the crack may open retained.

    Args:
        problem: Which.
        scene: Its scene.
        ahead: How far the crack may grow, length.
    """

    def __init__(self, problem: Problem, scene: Scene, ahead: float) -> None:
        continuum, (self.pair,) = scene.continuum, scene.pairs
        self.comm = continuum.comm
        self.gdim = continuum.gdim
        self.front = Front(self.pair.surface, self.pair.bonded, self.pair.title)
        roles = choose_roles(
            scene.pairs, [self.front], [True], [ahead], CostModel(1.0, 0.0),
            cap_mb=_UNLIMITED_MB, gdim=self.gdim,
        )  # fmt: skip
        self.coordinates: JumpCoordinates = build_coordinates(
            continuum.layout, scene.pairs, roles, scene.supports, 0
        )
        stiffness = continuum.stiffness()
        self.matrix: PETSc.Mat = stiffness.ptap(self.coordinates.transform)
        stiffness.destroy()
        self.upper, self.lower = problem.load_columns(scene)

    @property
    def n_retained(self) -> int:
        """Number of retained components."""
        return self.coordinates.n_retained

    def last(self, vector: PETSc.Vec) -> Array:
        """Entries of a vector at retained jumps and supports, shape (n_last,); collective."""
        out = np.empty(self.coordinates.n_last)
        if self.comm.rank == 0:
            out[:] = vector.array_r[self.coordinates.n_inner :]
        self.comm.Bcast(out)
        return out

    def global_rows(self, local: Ints) -> npt.NDArray[np.integer]:
        """Global numbers of some last coordinates, on rank 0 alone.

        Args:
            local: Their numbers among the retained jumps and supports, shape (n,).

        Returns:
            Array of shape (n,) on rank 0, (0,) on the others.
        """
        mine = self.coordinates.first + local if self.comm.rank == 0 else local[:0]
        return np.asarray(mine, dtype=PETSc.IntType)

    def destroy(self) -> None:
        """Free matrices; collective."""
        self.matrix.destroy()
        self.coordinates.destroy()


class Refactor:
    """Factors the matrix of the present state at each request."""

    def __init__(self, matrices: Matrices) -> None:
        self._of = matrices
        self._work = matrices.matrix.duplicate(copy=True)
        self._solver = mumps_cholesky(self._work)
        self._vectors = [matrices.matrix.createVecRight() for _ in range(2)]

    def respond(self, free: Bools) -> Response:
        """Equilibrium at opening 1; one numeric factorisation and one back-solve.

        Args:
            free: Whether each retained component is free, shape (n_retained,).
        """
        of, (q, right) = self._of, self._vectors
        n = of.n_retained
        of.matrix.copy(self._work, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        held = np.concatenate([np.flatnonzero(~free), n + np.arange(of.coordinates.n_supports)])
        q.set(0.0)
        right.set(0.0)
        ends = of.global_rows(np.array([n + of.upper, n + of.lower]))
        q.setValues(ends, [0.5, -0.5][: len(ends)])
        q.assemble()
        self._work.zeroRowsColumns(of.global_rows(held), 1.0, q, right)
        self._work.setOption(PETSc.Mat.Option.SPD, True)
        self._solver.setOperators(self._work)
        self._solver.setUp()
        check_mumps(self._solver)
        self._solver.apply(right, q)
        of.matrix.mult(q, right)
        jump, force = of.last(q), of.last(right)
        return Response(jump[:n] * free, force[:n], float(force[n + of.upper]))

    def destroy(self) -> None:
        """Free the factor; collective."""
        for thing in (self._solver, self._work, *self._vectors):
            thing.destroy()


class Columns:
    """Builds S column by column, each by one back-solve, and solves on it.

    Attributes:
        factor_seconds: Seconds of the factorisation.
        column_seconds: Seconds of the back-solves so far.
        n_columns: Number of back-solves so far.
    """

    def __init__(self, matrices: Matrices) -> None:
        self._of = matrices
        coordinates, comm = matrices.coordinates, matrices.comm
        first, _ = matrices.matrix.getOwnershipRange()
        n_last = coordinates.n_last if comm.rank == 0 else 0
        inner = PETSc.IS().createStride(coordinates.n_inner, first, 1, comm=comm)
        last = PETSc.IS().createStride(n_last, first + coordinates.n_inner, 1, comm=comm)
        matrix = matrices.matrix
        self._block = matrix.createSubMatrix(inner, inner)
        self._coupling = matrix.createSubMatrix(inner, last)
        self._corner = matrix.createSubMatrix(last, last)
        inner.destroy()
        last.destroy()
        start = time.perf_counter()
        self._solver = mumps_cholesky(self._block)
        self._solver.setUp()
        check_mumps(self._solver)
        self.factor_seconds = time.perf_counter() - start
        self._unit, self._column = self._coupling.createVecs()
        self._solution = self._column.duplicate()
        self._back = self._unit.duplicate()
        self._known: dict[int, Array] = {}
        self.column_seconds = 0.0

    @property
    def n_columns(self) -> int:
        """Number of back-solves so far."""
        return len(self._known)

    def column(self, c: int) -> Array:
        """Column c of S over retained jumps and supports, shape (n_last,); collective."""
        if c not in self._known:
            start = time.perf_counter()
            self._unit.set(0.0)
            if self._of.comm.rank == 0:
                self._unit.setValue(c, 1.0)
            self._unit.assemble()
            self._coupling.mult(self._unit, self._column)
            self._solver.apply(self._column, self._solution)
            self._coupling.multTranspose(self._solution, self._back)
            self._back.scale(-1.0)
            self._corner.multAdd(self._unit, self._back, self._back)
            out = np.empty(self._of.coordinates.n_last)
            if self._of.comm.rank == 0:
                out[:] = self._back.array_r
            self._of.comm.Bcast(out)
            self._known[c] = out
            self.column_seconds += time.perf_counter() - start
        return self._known[c]

    def respond(self, free: Bools) -> Response:
        """Equilibrium at opening 1 from the columns of the free components.

        Args:
            free: Whether each retained component is free, shape (n_retained,).
        """
        n = self._of.n_retained
        ends = n + np.array([self._of.upper, self._of.lower])
        pull = 0.5 * (self.column(int(ends[0])) - self.column(int(ends[1])))
        rows = np.flatnonzero(free)
        columns = np.array([self.column(int(c)) for c in rows])
        total = pull.copy()
        jump = np.zeros(n)
        if len(rows):
            jump[rows] = np.linalg.solve(columns[:, rows], -pull[rows])
            total += jump[rows] @ columns
        return Response(jump, total[:n], float(total[ends[0]]))

    def destroy(self) -> None:
        """Free the factor; collective."""
        for thing in (
            self._solver, self._block, self._coupling, self._corner,
            self._unit, self._column, self._solution, self._back,
        ):  # fmt: skip
            thing.destroy()


@dataclass(frozen=True)
class Onset:
    """One event of a growth followed by a baseline.

    Attributes:
        length: Crack length.
        opening: Opening of both arms.
        load: Load.
        seconds: Seconds since the event before.
    """

    length: float
    opening: float
    load: float
    seconds: float


class Follower:
    """Grows the crack event by event with a given solver.

    Args:
        matrices: Coordinates and tip geometry.
        scene: Criterion and toughness.
        solver: How equilibria are found.
    """

    def __init__(self, matrices: Matrices, scene: Scene, solver: Solver) -> None:
        self._of = matrices
        self._solver = solver
        pair = matrices.pair
        self.front = Front(pair.surface, pair.bonded, pair.title)
        self._extent = CrackExtent(self.front)
        self._index = matrices.coordinates.index[0]
        self._frames = matrices.coordinates.frames[0]
        criterion = scene.debonds[0].criterion
        if not isinstance(criterion, RateCriterion):
            raise InputError(f"the baseline grows by VCCT, not by {type(criterion).__name__}")
        self._criterion = criterion
        n = pair.surface.n_nodes
        x = pair.surface.x[:, : matrices.gdim]
        self._toughness = self._criterion.toughness_at(x, np.arange(n), n_slave=n)
        self.free = np.zeros(matrices.n_retained, dtype=bool)
        self._free(np.flatnonzero(~self.front.bonded))
        self._opening = 0.0

    def _free(self, nodes: Ints) -> None:
        components = self._index[nodes]
        self.free[components[components >= 0]] = True

    def _vectors(self, nodes: Ints, values: Array) -> Array:
        """Retained values at slave nodes as global vectors, shape (..., 3)."""
        index = self._index[nodes]
        local = np.where(index >= 0, values[np.maximum(index, 0)], 0.0)
        out = np.zeros((*index.shape[:-1], 3))
        out[..., : self._of.gdim] = np.einsum("...ck,...k->...c", self._frames[nodes], local)
        return out

    def _f(self, tips: Tips, response: Response) -> Array:
        """Criterion at the tips at opening 1, shape (n_tips,)."""
        force = self._vectors(tips.force_nodes, -response.force)
        jump = self._vectors(tips.wake_nodes, response.jump)
        jump = np.einsum("nkm,nkmc->nkc", tips.wake_weights, jump)
        rates = energy_release_rates(
            np.einsum("nci,nkc->nki", tips.frame, force),
            np.einsum("nci,nkc->nki", tips.frame, jump),
            tips.d_ahead, tips.d_behind, tips.width,
            normalisation=self._criterion.normalisation,
        )  # fmt: skip
        return self._criterion.ratio(rates, self._toughness[tips.node])

    def onset(self) -> Onset:
        """Load until f = 1 and release the critical nodes; collective."""
        start = time.perf_counter()
        response = self._solver.respond(self.free)
        tips = self.front.tips()
        f = self._f(tips, response)
        # f grows with the square of the opening, which is never reduced
        self._opening = max(self._opening, 1.0 / float(np.sqrt(f.max())))
        length = self._extent.length(tips)
        nodes = np.unique(tips.force_nodes[f >= _SAME_F * f.max()])
        self.front.release(nodes)
        self._free(nodes)
        return Onset(
            length, self._opening, self._opening * response.load, time.perf_counter() - start
        )
