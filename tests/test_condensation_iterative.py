"""Condensation without a factorisation: columns of S by block conjugate gradients."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from petsc4py import PETSc
from specimens import STEEL, assert_same, bond, dcb, gathered_vector, grow_to, specimen

import fxcrack as fx
from fxcrack.base.errors import ConvergenceError, InputError, SolverError
from fxcrack.condensation import columns as column_space
from fxcrack.condensation.block_cg import block_cg
from fxcrack.condensation.block_matrix import BlockMatrix, inner_products
from fxcrack.condensation.multigrid import Multigrid
from fxcrack.condensation.retained import ColumnCost
from fxcrack.condensation.rigid_motions import rigid_motions
from fxcrack.continuum.continuum import Continuum
from fxcrack.effects import FiniteStrain
from fxcrack.mesh import Mesh
from fxcrack.meshes.dcb import dcb_2d, dcb_3d

Array = npt.NDArray[np.float64]

ITERATIVE = fx.CondensedOptions(method="iterative")
# the error of S is the square of rtol = 1e-6 times a condition number of the open part below 1e6
HISTORY = 1e-6


def distributed(comm: MPI.Intracomm, whole: sp.csr_matrix) -> PETSc.Mat:
    """A scipy matrix that every rank has, as a PETSc matrix."""
    out = PETSc.Mat().createAIJ(whole.shape, comm=comm)
    out.setUp()
    first, end = out.getOwnershipRange()
    mine = whole[first:end].tocsr()
    for i in range(first, end):
        row = mine[i - first]
        out.setValues(i, row.indices.astype(PETSc.IntType), row.data)
    out.assemble()
    return out


def owned(matrix: PETSc.Mat, whole: Array) -> Array:
    """The rows of an array that belong to this rank's columns of a matrix."""
    first, end = matrix.getOwnershipRangeColumn()
    return np.ascontiguousarray(whole[first:end])


def grid(n: int) -> sp.csr_matrix:
    line = sp.diags([-1.0, 2.05, -1.0], [-1, 0, 1], shape=(n, n))
    return sp.csr_matrix(sp.kron(line, sp.eye(n)) + sp.kron(sp.eye(n), line))


# -- matrices and blocks ---------------------------------------------------------------------------


@pytest.mark.mpi
def test_products_with_blocks(comm: MPI.Intracomm) -> None:
    rng = np.random.default_rng(0)
    whole = sp.csr_matrix(sp.random(40, 23, density=0.2, random_state=rng))
    matrix = distributed(comm, whole)
    block = BlockMatrix.from_petsc(matrix)
    x, y = rng.standard_normal((23, 5)), rng.standard_normal((40, 5))
    first, end = matrix.getOwnershipRange()
    assert block @ owned(matrix, x) == pytest.approx((whole @ x)[first:end], abs=1e-13)
    back = block.transposed_times(np.ascontiguousarray(y[first:end]))
    assert back == pytest.approx(owned(matrix, whole.T @ y), abs=1e-13)
    single = block.rounded() @ owned(matrix, x).astype(np.float32)
    assert single.dtype == np.float32
    assert single == pytest.approx((whole @ x)[first:end], abs=1e-5)  # single precision
    assert inner_products(comm, (y[first:end], y[first:end]))[0] == pytest.approx(y.T @ y)
    matrix.destroy()


@pytest.mark.mpi
def test_block_cg_with_dependent_and_empty_columns(comm: MPI.Intracomm) -> None:
    """Two equal columns, one that is their multiple, and one of zeros."""
    whole = grid(15)
    matrix = distributed(comm, whole)
    right = np.random.default_rng(1).standard_normal((225, 6))
    right[:, 3], right[:, 4], right[:, 5] = right[:, 2], -1e6 * right[:, 2], 0.0
    x, residual, iterations = block_cg(
        BlockMatrix.from_petsc(matrix),
        lambda r: r,
        owned(matrix, right),
        lambda energy: 1e-20 * np.maximum(energy, 1e-300),
    )
    exact = np.linalg.solve(whole.toarray(), right)
    # 1e-10 in the energy norm, condition number about 100
    scale = np.maximum(np.abs(exact).max(axis=0), 1e-300)
    assert np.abs((x - owned(matrix, exact)) / scale).max(initial=0.0) < 1e-8
    assert np.abs(residual).max(initial=0.0) < 1e-2
    assert 5 < iterations < 60
    # from the solution itself there is nothing to do
    _, _, again = block_cg(
        BlockMatrix.from_petsc(matrix), lambda r: r, owned(matrix, right),
        lambda energy: 1e-16 * np.maximum(energy, 1e-300), start=x,
    )  # fmt: skip
    assert again == 0
    matrix.destroy()


@pytest.mark.mpi
def test_block_cg_says_why_it_stopped(comm: MPI.Intracomm) -> None:
    matrix = distributed(comm, grid(10))
    right = owned(matrix, np.random.default_rng(2).standard_normal((100, 2)))
    block = BlockMatrix.from_petsc(matrix)
    with pytest.raises(ConvergenceError, match=r"stopped after 3 iterations .* method='schur'"):
        block_cg(block, lambda r: r, right, lambda e: 0.0 * e, max_iterations=3)
    indefinite = distributed(comm, grid(10) - 4.0 * sp.eye(100, format="csr"))
    with pytest.raises(SolverError, match="singular: some body"):
        block_cg(BlockMatrix.from_petsc(indefinite), lambda r: r, right, lambda e: 0.0 * e)
    matrix.destroy()
    indefinite.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_multigrid_is_symmetric_and_needs_few_cycles(comm: MPI.Intracomm) -> None:
    """A cube on springs; and without them its rigid motions are found on the coarsest level."""
    mesh = dcb_3d(comm, length=8.0, width=8.0, height=4.0, dx=1.0, dy=1.0, ny=4)
    continuum = Continuum(mesh, STEEL, fx.Solid())
    matrix = continuum.stiffness()
    motions = rigid_motions(continuum)
    with pytest.raises(SolverError, match="singular: some body"):
        Multigrid(matrix, BlockMatrix.from_petsc(matrix), motions)
    matrix.shift(100.0)
    fine = BlockMatrix.from_petsc(matrix)
    cycle = Multigrid(matrix, fine, motions)
    assert cycle.sizes[-1] == continuum.n_global > 5 * cycle.sizes[0]
    x, y = np.random.default_rng(comm.rank).standard_normal((2, continuum.n_local, 3))
    one, other = inner_products(comm, (x, cycle(y)), (cycle(x), y))
    assert one == pytest.approx(other, abs=1e-5 * np.abs(one).max())  # single precision
    _, _, iterations = block_cg(fine, cycle, x, lambda e: 1e-16 * e)
    assert iterations < 40
    matrix.destroy()


# -- S and fields ----------------------------------------------------------------------------------

MESHES = {
    "2-D": lambda comm: dcb_2d(comm, length=20.0, dx=1.0, ny=2, nx_lower=13),
    "2-D, second order": lambda comm: dcb_2d(comm, length=20.0, dx=2.0, ny=1, order=2),
    "3-D": lambda comm: dcb_3d(comm, length=16.0, width=6.0, dx=2.0, dy=2.0, ny=1, nx_lower=5),
}


def solved(mesh: Mesh, options: fx.CondensedOptions, **more: Any) -> tuple[Array, Array]:
    """S and displacements after two releases, under supports, a load, and a monitor."""
    scene = specimen(
        mesh,
        a0=8.0,
        loads=[fx.Traction("top", (0.1, 0.3) if mesh.gdim == 2 else (0.1, 0.3, 0.2))],
        monitors=[fx.Monitor("far_upper", (0.0, 1.0, 0.0)[: mesh.gdim])],
        options=options,
        **more,
    )
    scene.run(fx.Static(until=fx.Releases(2)), progress=False)
    u = scene.solver.displacement()
    out = scene.solver.system.schur.copy(), gathered_vector(u)
    u.destroy()
    scene.close()
    return out


@pytest.mark.quick("2-D-0.001")
@pytest.mark.mpi
@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
@pytest.mark.parametrize("name", MESHES)
def test_schur_complement_and_fields(comm: MPI.Intracomm, name: str, rtol: float) -> None:
    mesh: Mesh = MESHES[name](comm)
    exact, u_exact = solved(mesh, fx.CondensedOptions(method="schur", rows=20.0))
    s, u = solved(mesh, fx.CondensedOptions(method="iterative", rtol=rtol, rows=20.0))
    n = len(s) - 2 - (4 if mesh.gdim == 2 else 8)  # jumps
    assert s.shape == exact.shape
    assert np.array_equal(s, s.T)
    # arms that have come apart can turn: two eigenvalues of the 2-D models are zero
    values = np.linalg.eigvalsh(s[:n, :n])
    assert values[0] > -1e-13 * values[-1]
    size = np.sqrt(np.abs(np.diagonal(exact)[:n]))
    error = ((s - exact)[:n, :n] / size) / size[:, None]
    # the square of rtol; its estimate by the multigrid cycle may be short by the condition number
    # of the preconditioned matrix, below 30; the rest is round-off
    assert np.abs(error).max() < 30.0 * rtol**2 + 1e-12
    # never softer than the exact one, but for the single precision of stored columns, times rtol
    assert np.linalg.eigvalsh(error)[0] > -(1e-6 * rtol + 1e-12)
    assert np.abs(s - exact).max() < (30.0 * rtol**2 + 1e-12) * np.abs(exact).max()
    assert np.abs(u - u_exact).max() < rtol * np.abs(u_exact).max()


@pytest.mark.three
@pytest.mark.quick("open")
@pytest.mark.mpi
@pytest.mark.parametrize("contact", [False, True], ids=["open", "contact"])
def test_history_is_that_of_the_direct_solver(comm: MPI.Intracomm, contact: bool) -> None:
    histories = []
    for options in (fx.CondensedOptions(), ITERATIVE):
        scene = dcb(comm, dx=1.0, ny=2, contact=contact, options=options)
        histories.append(grow_to(scene, 40.0))
        assert (histories[-1].details["factorizations"] == 0) == (options is ITERATIVE)
        scene.close()
    assert_same(*histories, HISTORY)


@pytest.mark.mpi
@pytest.mark.slow
@pytest.mark.parametrize(
    "release", [fx.StepRelease(), fx.ProgressiveRelease()], ids=["step", "progressive"]
)
def test_history_in_3d(comm: MPI.Intracomm, release: Any) -> None:
    """One side is opened more: which of two equal front nodes goes first is up to round-off."""
    ends = [fx.Displacement(f"far_{k}", x=0.0, y=0.0, z=0.0) for k in ("upper", "lower")]
    ends += [
        fx.Displacement("end_upper", y=lambda x: 0.5 + 0.01 * x[2]),
        fx.Displacement("end_lower", y=-0.5),
    ]
    mesh = dcb_3d(comm, length=50.0, width=6.0, dx=2.0, dy=2.0, ny=1)
    histories = []
    for options in (fx.CondensedOptions(), ITERATIVE):
        bonded = fx.Debond(bond(30.0), fx.VCCT(GIc=0.2), release=release)
        scene = fx.Scene(
            mesh, materials=STEEL, model=fx.Solid(), supports=ends, debonds=[bonded],
            options=options,
        )  # fmt: skip
        histories.append(scene.run(fx.Static(until=fx.Releases(10)), progress=False))
        scene.close()
    assert_same(*histories, HISTORY)


@pytest.mark.slow
@pytest.mark.mpi
def test_columns_are_computed_once(comm: MPI.Intracomm) -> None:
    """Small sets, each of which needs only what lies farther ahead."""
    options = fx.CondensedOptions(method="iterative", rows=0.0)
    scene = dcb(comm, dx=1.0, ny=2, options=options)
    history = grow_to(scene, 40.0)
    assert scene.solver.rebases >= 3
    store = scene.solver.columns
    assert store is not None and store.space is not None
    known = store.space.known
    assert len(np.unique(known)) == len(known) < 2 * (10 + 8) + 4
    assert scene.solver.system.n_retained < len(known) - 4
    one = dcb(comm, dx=1.0, ny=2)
    assert_same(grow_to(one, 40.0), history, HISTORY)
    one.close()
    scene.close()


@pytest.mark.slow
@pytest.mark.mpi
def test_old_columns_are_dropped_where_memory_is_short(
    comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    class Counted(column_space.SchurColumns):
        def __init__(self, *args: Any, **options: Any) -> None:
            made.append(1)
            super().__init__(*args, **options)

    monkeypatch.setattr("fxcrack.condensation.iterative.SchurColumns", Counted)
    monkeypatch.setattr("fxcrack.condensation.iterative._MANY", 1)
    options = fx.CondensedOptions(method="iterative", rows=0.0, retained_mb=0.03)
    scene = dcb(comm, dx=1.0, ny=2, options=options)
    history = grow_to(scene, 40.0)
    assert len(made) >= 2
    scene.close()
    one = dcb(comm, dx=1.0, ny=2)
    assert_same(grow_to(one, 40.0), history, HISTORY)
    one.close()


@pytest.mark.mpi
def test_failure_is_said_on_all_ranks(comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(column_space, "block_cg", functools.partial(block_cg, max_iterations=2))
    scene = dcb(comm, dx=1.0, ny=2, options=ITERATIVE)
    with pytest.raises(SolverError, match="iterative solver stopped after 2 iterations"):
        grow_to(scene, 31.0)
    scene.close()


def test_options_are_checked() -> None:
    with pytest.raises(InputError, match="choose one of 'auto', 'schur', 'columns', 'iterative'"):
        fx.CondensedOptions(method="magic")
    with pytest.raises(InputError, match="rtol = 0"):
        fx.CondensedOptions(rtol=0.0)


@given(
    st.floats(1e-4, 10.0),
    st.floats(1e-4, 10.0),
    st.lists(st.integers(1, 6), min_size=1, max_size=40),
)
def test_reach_of_retained_columns(column: float, condensing: float, steps: list[int]) -> None:
    """Cheap condensations reach little, cheap columns make them reach far."""
    counts = 10 + np.cumsum(steps)
    n = ColumnCost(column, condensing).reach(counts)
    assert 1 <= n <= len(counts)
    assert ColumnCost(column, 4.0 * condensing).reach(counts) >= n
    assert ColumnCost(4.0 * column, condensing).reach(counts) <= n
    assert ColumnCost(0.0, condensing).reach(counts) == len(counts)
    assert ColumnCost(column, condensing).reach(counts[:0]) == 0
    cost = ColumnCost.guess(1000)
    cost.observe(10, 2.0, 2.5)
    assert (cost.column, cost.per_set) == (0.2, 0.5)


@pytest.mark.mpi
def test_nonlinear_bodies_are_factored(comm: MPI.Intracomm) -> None:
    with pytest.raises(InputError, match="needs linear bodies; use method='auto'"):
        dcb(comm, dx=2.0, ny=1, options=ITERATIVE, effects=[FiniteStrain()])
