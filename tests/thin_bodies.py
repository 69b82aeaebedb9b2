"""Thin bodies for tests of shells: hexahedra over a mapped rectangle, and their solutions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.interpolate import RegularGridInterpolator
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

import fxcrack as fx
from fxcrack.continuum.continuum import Continuum
from fxcrack.meshes.blocks import Blocks, build

Array = npt.NDArray[np.float64]
Map = Callable[[Array, Array], Sequence[Array]]


def flat(a: Array, b: Array) -> Sequence[Array]:
    return a, b, 0.0 * a


def _normals(fmap: Map, a: Array, b: Array) -> Array:
    """Unit normals of a mapped surface by central differences of its map."""
    h = 1e-5
    first = np.array(fmap(a + h, b)) - np.array(fmap(a - h, b))
    second = np.array(fmap(a, b + h)) - np.array(fmap(a, b - h))
    n = np.cross(first.T, second.T)
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def thin_body(
    n: tuple[int, int],
    size: tuple[float, float],
    thickness: float,
    fmap: Map = flat,
    *,
    normals: Callable[[Array], Array] | None = None,
    layers: int = 1,
    distort: float = 0.0,
    order: int = 2,
    comm: MPI.Intracomm = MPI.COMM_SELF,
) -> fx.Mesh:
    """Hexahedra over the rectangle (0, size) mapped to a surface, of one thickness about it.

    Groups: cells "body"; faces "inner", "outer", and "a0", "a1", "b0", "b1" at the ends of the
    parameters; the node "corner" of inner, a0 and b0; the nodes "line0"
    and "line1" across the body at b0 and a0 or a1. ``distort`` moves inner corners by
    up to this part of a cell.
    """
    a, b = (np.linspace(0.0, s, k + 1) for s, k in zip(size, n, strict=True))
    z = np.linspace(-0.5, 0.5, layers + 1) * thickness

    def make() -> Blocks:
        model = Blocks()
        block = model.add("body", (a, b, z), "hexahedron", order)
        for name, at in (
            *(("a0", {"x": 0.0}), ("a1", {"x": size[0]})),
            *(("b0", {"y": 0.0}), ("b1", {"y": size[1]})),
            *(("inner", {"z": z[0]}), ("outer", {"z": z[-1]})),
            ("corner", {"x": 0.0, "y": 0.0, "z": z[0]}),
            ("line0", {"x": 0.0, "y": 0.0}),
            ("line1", {"x": size[0], "y": 0.0}),
        ):
            model.group(name, block.part(**at))
        return model

    mesh = build(comm, "thin", make)
    x = mesh.domain.geometry.x
    pa, pb, pz = x[:, 0].copy(), x[:, 1].copy(), x[:, 2].copy()
    if distort:
        rng = np.random.default_rng(1)
        moves = rng.uniform(-distort, distort, (n[0] + 1, n[1] + 1, 2))
        moves *= np.array([size[0] / n[0], size[1] / n[1]])
        moves[[0, -1]] = 0.0
        moves[:, [0, -1]] = 0.0
        shift = RegularGridInterpolator((a, b), moves)(np.column_stack([pa, pb]))
        pa, pb = pa + shift[:, 0], pb + shift[:, 1]
    middle = np.array(fmap(pa, pb)).T
    e3 = _normals(fmap, pa, pb) if normals is None else normals(middle)
    x[:] = middle + pz[:, None] * e3
    return mesh


class Solution:
    """The linear system of a continuum on one rank: supports, forces, displacements."""

    def __init__(self, continuum: Continuum) -> None:
        matrix = continuum.stiffness()
        ai, aj, av = matrix.getValuesCSR()
        self.k = csr_array((av, aj, ai))
        matrix.destroy()
        self.continuum = continuum
        self.x = continuum.positions()
        self.u = np.zeros_like(self.x)
        self.force = np.zeros_like(self.x)
        self.fixed = np.zeros(self.x.shape, dtype=bool)

    def on(self, group: str) -> npt.NDArray[np.int32]:
        return self.continuum.owned_nodes(group)

    def fix(self, nodes: Any, axes: Sequence[int], values: Any = 0.0) -> None:
        for k in axes:
            self.fixed[nodes, k] = True
            self.u[nodes, k] = values

    def near(self, point: Sequence[float], n: int) -> Any:
        return np.argsort(np.linalg.norm(self.x - np.asarray(point), axis=1), kind="stable")[:n]

    def solve(self) -> Array:
        free = np.flatnonzero(~self.fixed.ravel())
        u = np.where(self.fixed, self.u, 0.0).ravel()
        right = self.force.ravel() - self.k @ u
        lu = splu(
            self.k[free][:, free].tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        u[free] = lu.solve(right[free])
        self.u = u.reshape(self.x.shape)
        return self.u


__all__ = ["Map", "Solution", "flat", "thin_body"]
