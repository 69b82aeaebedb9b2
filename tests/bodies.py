"""What tests of form terms share: small bodies, Taylor tests, a plain Newton iteration."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import dolfinx.fem
import dolfinx.mesh
import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

import fxcrack as fx
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.mesh import Group, Mesh

Array = npt.NDArray[np.float64]

MODELS = {
    "plane strain": fx.PlaneStrain(thickness=2.0),
    "plane stress": fx.PlaneStress(thickness=2.0),
    "ring": fx.Axisymmetric(),
    "solid": fx.Solid(),
}


def box(
    comm: MPI.Intracomm,
    model: str,
    *,
    n: Sequence[int] = (3, 2, 2),
    size: Sequence[float] = (1.5, 1.0, 0.8),
    simplex: bool = False,
    inner: float = 1.0,
) -> Mesh:
    """A block with its sides as groups x0, x1, y0, y1, z0, z1 and halves "left" and "right".

    A ring begins at the inner radius; its block is ``size`` long in radius and axis.
    """
    solid = model == "solid"
    first = np.array([inner if model == "ring" else 0.0, 0.0, 0.0])
    last = first + np.array(size)
    ghosts = dolfinx.mesh.GhostMode.shared_facet
    if solid:
        cell = dolfinx.mesh.CellType.tetrahedron if simplex else dolfinx.mesh.CellType.hexahedron
        domain = dolfinx.mesh.create_box(comm, [first, last], list(n), cell, ghost_mode=ghosts)
    else:
        cell = dolfinx.mesh.CellType.triangle if simplex else dolfinx.mesh.CellType.quadrilateral
        domain = dolfinx.mesh.create_rectangle(
            comm, [first[:2], last[:2]], list(n[:2]), cell, ghost_mode=ghosts
        )
    dim, eps = domain.topology.dim, 1e-9
    groups = {}
    for axis in range(dim):
        for end, value in enumerate((first[axis], last[axis])):
            facets = dolfinx.mesh.locate_entities(
                domain, dim - 1, lambda x, a=axis, v=value: np.abs(x[a] - v) < eps
            )
            groups[f"{'xyz'[axis]}{end}"] = Group(dim - 1, np.sort(facets))
    middle = first[0] + size[0] * (n[0] // 2) / n[0]
    for name, side in (("left", 1.0), ("right", -1.0)):
        cells = dolfinx.mesh.locate_entities(
            domain, dim, lambda x, s=side: s * (x[0] - middle) < eps
        )
        groups[name] = Group(dim, np.sort(cells))
    return Mesh(domain, groups, name="block")


def wavy(continuum: Continuum, size: float, seed: int) -> dolfinx.fem.Function:
    """A smooth displacement without symmetry, the same on any number of ranks."""
    rng = np.random.default_rng(seed)
    a = rng.uniform(-1.0, 1.0, (continuum.gdim, 4))
    out = dolfinx.fem.Function(continuum.space)
    out.interpolate(
        lambda x: (
            size
            * np.stack(
                [
                    r[0] * np.sin(x[0] + r[1]) + r[2] * np.cos(2 * x[1] + r[3] + 0.5 * x[2])
                    for r in a
                ]
            )
        )
    )
    return out


def place(bodies: WeakForm, values: Array) -> None:
    """Set the trial displacement from the owned dofs of this rank."""
    vector = PETSc.Vec().createWithArray(values.copy(), comm=bodies.continuum.comm)
    bodies.set(vector)
    vector.destroy()


def internal(bodies: WeakForm, values: Array) -> Array:
    """Residual at a displacement, owned dofs."""
    place(bodies, values)
    r = bodies.residual()
    out = r.array[: bodies.continuum.n_local].copy()
    r.destroy()
    return out


def total(bodies: WeakForm, values: Array) -> float:
    """Sum of all stored energies at a displacement."""
    place(bodies, values)
    return sum(bodies.stored().values())


def times(bodies: WeakForm, direction: Array) -> Array:
    """Product of the present tangent with a direction, owned dofs."""
    matrix = bodies.tangent()
    x, y = matrix.createVecs()
    x.array[:] = direction
    matrix.mult(x, y)
    out = y.array.copy()
    x.destroy()
    y.destroy()
    return out


def norm(continuum: Continuum, x: Array) -> float:
    """Euclidean norm over all ranks."""
    return float(np.sqrt(continuum.comm.allreduce(float(x @ x))))


def dot(continuum: Continuum, x: Array, y: Array) -> float:
    """Inner product over all ranks."""
    return float(continuum.comm.allreduce(float(x @ y)))


def taylor_rates(
    bodies: WeakForm, at: Array, along: Array, steps: Sequence[float], *, energy: bool = True
) -> tuple[Array, Array]:
    """Rates of the second-order remainders of energy and residual as steps shrink.

    The remainders are W(u + h d) - W(u) - h r.d and |r(u + h d) - r(u) - h K d|; both are of
    second order in h if r is the derivative of W, and K that of r.
    """
    c = bodies.continuum
    r0 = internal(bodies, at)
    w0 = sum(bodies.stored().values()) if energy else 0.0
    kd = times(bodies, along)
    slope = dot(c, r0, along)
    w, r = [], []
    for h in steps:
        rh = internal(bodies, at + h * along)
        r.append(norm(c, rh - r0 - h * kd))
        if energy:
            w.append(abs(sum(bodies.stored().values()) - w0 - h * slope))
    place(bodies, at)
    scale = np.log(np.asarray(steps[1:]) / np.asarray(steps[:-1]))
    return (
        np.diff(np.log(w)) / scale if energy else np.array([]),
        np.diff(np.log(r)) / scale,
    )


def held_dofs(continuum: Continuum, held: Sequence[tuple[str, int]]) -> npt.NDArray[np.int32]:
    """Owned dofs (local indices) of components of groups."""
    out = [continuum.gdim * continuum.owned_nodes(name) + i for name, i in held]
    return np.unique(np.concatenate(out)) if out else np.zeros(0, np.int32)


def solve(
    bodies: WeakForm,
    held: Sequence[tuple[str, int]],
    *,
    values: Callable[[Array], Array] | None = None,
    load: Array | None = None,
    tolerance: float = 1e-11,
    most: int = 25,
) -> list[float]:
    """Newton iteration from the present displacement to r(u) = load; returns residual norms.

    Args:
        bodies: What is in equilibrium; holds the solution afterwards.
        held: (group, component) that are prescribed.
        values: Prescribed displacement at positions (n, 3), shape (n, gdim); zero by default.
        load: Forces on owned dofs.
        tolerance: Of the residual relative to the first.
        most: Most iterations.
    """
    c = bodies.continuum
    dofs = held_dofs(c, held)
    u = bodies.u.x.array[: c.n_local].copy()
    want = np.zeros(c.n_local)
    if values is not None:
        want = values(c.positions()[: c.n_local // c.gdim])[:, : c.gdim].ravel()
    step = np.zeros(c.n_local)
    step[dofs] = want[dofs] - u[dofs]
    force = np.zeros(c.n_local) if load is None else load
    norms: list[float] = []
    first = 0.0
    for _ in range(most):
        r = internal(bodies, u) - force
        free = r.copy()
        free[dofs] = 0.0
        norms.append(norm(c, free) + norm(c, step))
        first = max(first, norm(c, r), norm(c, force))
        if len(norms) > 1 and norms[-1] <= tolerance * first:
            return norms
        a = bodies.tangent().copy()
        x, b = a.createVecs()
        x.array[:] = step
        b.array[:] = -r
        a.zeroRowsColumns((c.offset + dofs).astype(np.int32), diag=abs(a.getDiagonal().max()[1]),
                          x=x, b=b)  # fmt: skip
        ksp = PETSc.KSP().create(c.comm)
        ksp.setOperators(a)
        ksp.setType("preonly")
        ksp.getPC().setType("lu")
        ksp.getPC().setFactorSolverType("mumps")
        ksp.solve(b, x)
        u += x.array
        step[:] = 0.0
        for o in (ksp, a, x, b):
            o.destroy()
    raise AssertionError(f"no convergence: {norms}")


def uniform(gradient: npt.ArrayLike) -> Callable[[Array], Array]:
    """Displacement G x of a uniform gradient, for :func:`solve`."""
    g = np.asarray(gradient, dtype=float)
    return lambda x: x[:, : len(g)] @ g.T


def newton_order(norms: Sequence[float]) -> float:
    """Order of convergence at the end of an iteration, above round-off."""
    seen = np.log([n for n in norms if n > 1e-13 * max(norms)])
    orders = (seen[2:] - seen[1:-1]) / (seen[1:-1] - seen[:-2])
    return float(orders[-2:].max())
