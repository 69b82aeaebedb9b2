"""The Schur complement out of MUMPS, on any number of ranks, against dense algebra."""

from __future__ import annotations

import gc

import numpy as np
import numpy.typing as npt
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg
from mpi4py import MPI
from petsc4py import PETSc
from specimens import CLAMPED_3D, PINS, dcb, gathered, gathered_vector, specimen

import fxcrack as fx
from fxcrack.base.errors import SolverError
from fxcrack.condensation import direct as condensation
from fxcrack.condensation import mumps_schur as petsc_schur
from fxcrack.condensation.mumps_schur import (
    SchurFactor,
    check_factor,
    mirror_lower,
    mumps_message,
)
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.dcb import dcb_2d, dcb_3d

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12  # the condition number of the grids is below 1e4


def grid_matrix(comm: MPI.Intracomm, n: int, last: Array) -> tuple[PETSc.Mat, sp.csr_matrix, Array]:
    """Five-point matrix of an n x n grid, its unknowns in an order with ``last`` last on rank 0.

    Returns:
        The PETSc matrix, the same in scipy, and the numbers of the Schur rows in both.
    """
    line = sp.diags([-1.0, 2.05, -1.0], [-1, 0, 1], shape=(n, n))
    whole = sp.csr_matrix(sp.kron(line, sp.eye(n)) + sp.kron(sp.eye(n), line))
    share = [n * n // comm.size + (r < n * n % comm.size) for r in range(comm.size)]
    before = share[0] - len(last)
    assert before >= 0
    rest = np.setdiff1d(np.arange(n * n), last)
    order = np.concatenate([rest[:before], last, rest[before:]])
    whole = whole[order][:, order].tocsr()
    start = sum(share[: comm.rank])
    mine = whole[start : start + share[comm.rank]]
    matrix = PETSc.Mat().createAIJ(
        ((share[comm.rank], n * n), (share[comm.rank], n * n)),
        csr=(mine.indptr, mine.indices, mine.data),
        comm=comm,
    )
    matrix.assemble()
    return matrix, whole, np.arange(before, share[0])


def exact_schur(matrix: sp.csr_matrix, rows: Array) -> Array:
    inner = np.setdiff1d(np.arange(matrix.shape[0]), rows)
    coupling = matrix[inner][:, rows].toarray()
    solved = scipy.sparse.linalg.splu(matrix[inner][:, inner].tocsc()).solve(coupling)
    return matrix[rows][:, rows].toarray() - coupling.T @ solved


# Lines of the grid that make up the Schur rows. Four of them leave remains of the elimination in
# the triangle that is not filled on two and on three ranks, and each order of rows other remains:
# in the second the remains have more entries in their first row and last column.
CASES = {
    "one line": (30, range(15, 16), None),
    "a quarter": (8, range(2), None),
    "four lines": (100, range(50, 54), None),
    "four lines, shuffled": (100, range(50, 54), 2),
}


@pytest.mark.three
@pytest.mark.quick("a quarter", "one line")
@pytest.mark.mpi
@pytest.mark.parametrize("case", CASES)
def test_schur_complement(comm: MPI.Intracomm, case: str) -> None:
    n, lines, shuffle = CASES[case]
    last = np.concatenate([np.arange(n) * n + k for k in lines])
    if shuffle is not None:
        last = np.random.default_rng(shuffle).permutation(last)
    matrix, whole, rows = grid_matrix(comm, n, last)
    factor = SchurFactor(matrix, len(last))
    assert factor.schur == pytest.approx(exact_schur(whole, rows), abs=ROUND_OFF)
    assert np.array_equal(factor.schur, factor.schur.T)
    assert all(np.array_equal(s, factor.schur) for s in comm.allgather(factor.schur))
    factor.destroy()
    factor.destroy()  # a second time does nothing
    matrix.destroy()


@pytest.mark.mpi
def test_remains_in_the_other_triangle(
    comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The case above with four lines is the one meant: on several ranks both triangles are filled.

    Should another MUMPS leave none, a case that does must take its place.
    """
    filled = []

    def look(square: Array) -> None:
        filled.append([np.count_nonzero(np.tril(square, -1)), np.count_nonzero(np.triu(square, 1))])
        mirror_lower(square)

    monkeypatch.setattr(petsc_schur, "mirror_lower", look)
    last = np.concatenate([np.arange(100) * 100 + k for k in CASES["four lines"][1]])
    matrix, _, _ = grid_matrix(comm, 100, last)
    factor = SchurFactor(matrix, len(last))
    factor.destroy()
    matrix.destroy()
    if comm.rank == 0:
        ((used, other),) = filled
        assert used > 0 and (other > 0) == (comm.size > 1)


def test_solving_with_the_factor() -> None:
    """One rank: A_11^-1 b_1, with nothing in the last rows."""
    last = np.arange(20) * 20 + 7
    matrix, whole, rows = grid_matrix(MPI.COMM_SELF, 20, last)
    factor = SchurFactor(matrix, 20)
    assert factor.solves
    right, solution = matrix.createVecs()
    inner = np.setdiff1d(np.arange(400), rows)
    right.array[inner] = np.random.default_rng(0).standard_normal(380)
    factor.solve_inner(right, solution)
    expected = scipy.sparse.linalg.spsolve(whole[inner][:, inner].tocsc(), right.array[inner])
    assert solution.array[inner] == pytest.approx(expected, abs=ROUND_OFF * 10)
    factor.destroy()


@pytest.mark.mpi
@pytest.mark.three
def test_what_is_not_renewed_keeps_no_copy(comm: MPI.Intracomm) -> None:
    """S where PETSc has put it is the same, to the last bit, and outlives the factor."""
    last = np.arange(30) * 30 + 7
    matrix, _, _ = grid_matrix(comm, 30, last)
    copied, in_place = (SchurFactor(matrix, 30, renewable=r) for r in (True, False))
    expected, found = copied.schur.copy(), in_place.schur
    assert found.flags.c_contiguous and np.array_equal(found, expected)
    assert found.flags.owndata == (comm.size > 1)
    copied.destroy()
    in_place.destroy()
    del copied, in_place
    gc.collect()
    another = SchurFactor(matrix, 30)  # would take the memory if it were free
    assert np.array_equal(found, expected)
    another.destroy()
    matrix.destroy()


@pytest.mark.parametrize("n", [1, 2, 255, 256, 257, 600])
def test_mirror(n: int) -> None:
    square = np.random.default_rng(n).standard_normal((n, n))
    expected = np.tril(square) + np.tril(square, -1).T
    mirror_lower(square)
    assert np.array_equal(square, expected)


# -- condensation ----------------------------------------------------------------------------------

MESHES = {
    "2-D": lambda comm: dcb_2d(comm, length=20.0, dx=1.0, ny=2, nx_lower=13),
    "2-D, second order": lambda comm: dcb_2d(comm, length=20.0, dx=2.0, ny=1, order=2),
    "3-D": lambda comm: dcb_3d(comm, length=16.0, width=6.0, dx=2.0, dy=2.0, ny=1, nx_lower=5),
}


@pytest.mark.quick("2-D")
@pytest.mark.mpi
@pytest.mark.parametrize("name", MESHES)
def test_columns_give_the_same(comm: MPI.Intracomm, name: str) -> None:
    """Both ways to S, and both ways back to displacements."""
    mesh: Mesh = MESHES[name](comm)
    found = []
    for method in ("schur", "columns"):
        scene = specimen(
            mesh,
            a0=8.0,
            loads=[fx.Traction("top", (0.1, 0.3) if mesh.gdim == 2 else (0.1, 0.3, 0.2))],
            monitors=[fx.Monitor("far_upper", (0.0, 1.0, 0.0)[: mesh.gdim])],
            options=fx.CondensedOptions(method=method),
        )
        scene.run(fx.Static(until=fx.Releases(2)))
        u = scene.solver.displacement()
        found.append((scene.solver.system.schur, gathered_vector(u)))
        u.destroy()
        scene.close()
    (s, u), (s_columns, u_columns) = found
    # two eliminations of a matrix with condition number 1e6
    assert np.abs(s - s_columns).max() < 1e-9 * np.abs(s).max()
    assert np.abs(u - u_columns).max() < 1e-9 * np.abs(u).max()


@pytest.mark.mpi
def test_support_whose_nodes_are_all_held_already(comm: MPI.Intracomm) -> None:
    """Its column of T is empty: an empty row of S, and the rest as without it."""
    mesh = dcb_2d(comm, length=20.0, dx=1.0, ny=2)
    again = fx.Displacement("pin_bottom", x=0.0, name="again")
    one = specimen(mesh, a0=8.0, supports=[*PINS, again])
    other = specimen(mesh, a0=8.0)
    rows = [s.run(fx.Static(until=fx.Releases(2))).rows[-1] for s in (one, other)]
    assert rows[0]["R[again.x]"] == 0.0
    assert rows[0]["R[pin_top.y]"] == pytest.approx(rows[1]["R[pin_top.y]"], rel=1e-9)
    one.close()
    other.close()


# -- what MUMPS reports ----------------------------------------------------------------------------


@pytest.mark.quick("slides-schur", "3-D-columns")
@pytest.mark.mpi
@pytest.mark.parametrize("method", ["schur", "columns"])
@pytest.mark.parametrize(
    ("dim", "supports"),
    [
        (2, PINS[:1]),  # turns about the pin
        (2, [fx.Displacement("pin_top", y=1.0), fx.Displacement("pin_bottom", y=-1.0)]),
        (3, [s for s in CLAMPED_3D if "end" in s.where]),
    ],
    ids=["turns", "slides", "3-D"],
)
def test_body_that_is_not_held(
    comm: MPI.Intracomm, method: str, dim: int, supports: list[fx.Displacement]
) -> None:
    """Said, not computed with: round-off hides the missing support from MUMPS."""
    mesh = dcb_2d(comm, dx=1.0, ny=2) if dim == 2 else dcb_3d(comm, dx=5.0, dy=5.0, ny=1)
    scene = specimen(mesh, supports=supports, options=fx.CondensedOptions(method=method))
    with pytest.raises(SolverError, match=r"singular: some body .* hold it by supports"):
        scene.run(fx.Static(until=fx.Releases(1)))


@pytest.mark.mpi
def test_soft_structure_is_no_mechanism(comm: MPI.Intracomm) -> None:
    """Arms 400 times as long as high, one of them of a thousandth of the other's modulus."""
    mesh = dcb_2d(comm, length=400.0, height=1.0, dx=4.0, ny=2)
    soft = specimen(mesh, a0=200.0, materials={"upper": fx.Isotropic(70.0, 0.3),
                                               "lower": fx.Isotropic(70e3, 0.3)})  # fmt: skip
    assert soft.run(fx.Static(until=fx.Releases(1))).reason == "1 node released"
    soft.close()


@pytest.mark.slow
@pytest.mark.mpi
def test_workspace_grows_until_it_is_enough(
    comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MUMPS' estimate can be too small in parallel: both factorisations try again with more."""
    results = []
    for workspace in ((100,), (-90, 300)):
        for module in (petsc_schur, condensation):
            monkeypatch.setattr(module, "WORKSPACE", workspace)
        scene = dcb(comm, dx=1.0, ny=2)
        scene.run(fx.Static(until=fx.Releases(1)))
        u = scene.solver.displacement()
        results.append(gathered_vector(u))
        u.destroy()
        scene.close()
    assert results[0] == pytest.approx(results[1], rel=1e-8)
    monkeypatch.setattr(petsc_schur, "WORKSPACE", (-90,))
    with pytest.raises(SolverError, match=r"MUMPS ran out of memory \(INFOG\(1\) = -9"):
        dcb(comm, dx=1.0, ny=2).run(fx.Static(until=fx.Releases(1)))


def test_messages() -> None:
    good = {1: 0, 2: 0, 12: 0}.__getitem__
    check_factor(good, {19: 1.0, 21: 1e6}.__getitem__)
    # a MUMPS that does not tell pivots
    check_factor(good, {19: 0.0, 21: 0.0}.__getitem__)
    asked: list[float] = []
    small = good, {19: 1e-12, 21: 1.0}.__getitem__
    check_factor(*small, doubt=asked.append)
    check_factor({1: 0, 12: 1}.__getitem__, {}.__getitem__, doubt=asked.append)
    check_factor(*small, definite=False)
    assert asked == [1e-12, 0.0]
    for infog, pivots in (
        ({1: 0, 12: 1}, {19: 1.0, 21: 1.0}),
        ({1: 0, 12: 0}, {19: 1e-12, 21: 1.0}),
        ({1: -10, 2: 3, 12: 0}, {}),
    ):
        with pytest.raises(SolverError, match="singular"):
            check_factor(infog.__getitem__, pivots.__getitem__)
    assert "out of memory" in mumps_message(-13, 0)
    assert "INFOG(1) = -5, INFOG(2) = 7" in mumps_message(-5, 7)


def test_no_mumps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without PETSc's C interface S is built by columns, unless MUMPS' was asked for."""
    for module in (petsc_schur, condensation):
        monkeypatch.setattr(module, "library", lambda: None)
    history = dcb(MPI.COMM_SELF, dx=1.0, ny=2).run(fx.Static(until=fx.Releases(1)))
    assert history.details["seconds"]["factor_inner"] > 0.0
    asked = dcb(MPI.COMM_SELF, dx=1.0, ny=2, options=fx.CondensedOptions(method="schur"))
    with pytest.raises(SolverError, match=r"method='columns'"):
        asked.run(fx.Static(until=fx.Releases(1)))


def test_gathered_matrix() -> None:
    """The helper the oracles rest on."""
    matrix, whole, _ = grid_matrix(MPI.COMM_SELF, 5, np.arange(3))
    assert (gathered(matrix) != whole).nnz == 0


@pytest.mark.three
@pytest.mark.mpi
@pytest.mark.parametrize("solver", ["linear", "newton"])
def test_no_displacement_is_left_to_eliminate(comm: MPI.Intracomm, solver: str) -> None:
    """Supports hold all of one body, and jumps are all there is of the other."""
    model, _, lower = two_bodies(
        (np.linspace(0.0, 4.0, 5), np.linspace(0.0, 4.0, 5)),
        (np.linspace(0.0, 1.0, 2), np.linspace(-1.0, 0.0, 2)),
        cell="quadrilateral",
        order=1,
    )
    model.group("base", lower.part(y=-1.0))
    bond = fx.Interface("upper_face", "lower_face", bonded=lambda x: x[0] >= 2.0, contact=True)
    still = {"x": 0.0, "y": 0.0}
    scene = fx.Scene(
        build(comm, "held", lambda: model),
        materials=fx.Isotropic(E=50.0, nu=0.0),
        model=fx.PlaneStrain(),
        supports=[
            *(fx.Displacement(name, **still) for name in ("base", "lower_face")),
            fx.Displacement("top", x=0.0, y=-0.1),
        ],
        bonds=[bond],
        solver=solver,
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
    assert scene.solver.system.n_retained > 0
    # uniform compression by a tenth, without a strain across it
    assert row["R[top.y]"] == pytest.approx(-50.0 * 0.1 * 4.0, rel=1e-12)
    assert row["strain_energy"] == pytest.approx(0.5 * 50.0 * 0.1**2 * 4.0, rel=1e-12)
