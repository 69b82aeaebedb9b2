"""Kinematic models: which strains a body has, and what an element of area stands for.

Each model turns a displacement into a Voigt strain vector (engineering shears), reduces the
6 x 6 stiffness to it, recovers the stresses out of its plane with the others, and names the weight
of the volume and surface integrals: thickness in plane models, 2 pi r for a full ring, 1 in three
dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import ufl

from fxcrack.base.arrays import Array
from fxcrack.base.checks import keep, number
from fxcrack.base.errors import InputError
from fxcrack.continuum.generalised_plane_strain import GeneralisedPlaneStrain


@dataclass(frozen=True)
class _Plane:
    thickness: float = 1.0
    gdim: ClassVar[int] = 2
    mesh_gdim: ClassVar[int] = 2
    tdim: ClassVar[int] = 2
    n_unknowns: ClassVar[int] = 2
    labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "xy")
    stress_labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "zz", "xy")

    def __post_init__(self) -> None:
        name = type(self).__name__
        thickness = number(name, "thickness", self.thickness)
        if not 0.0 < thickness < np.inf:
            raise InputError(f"{name}: thickness = {thickness} is not positive and finite")
        keep(self, thickness=thickness)

    def strain(self, u: Any, x: Any) -> Any:
        """Voigt strain (xx, yy, xy) of a UFL displacement."""
        return ufl.as_vector([u[0].dx(0), u[1].dx(1), u[0].dx(1) + u[1].dx(0)])

    def weight(self, x: Any) -> Any:
        """Factor of the area element: the thickness, length."""
        return self.thickness

    def breadth(self, x: Array) -> Array:
        """Out-of-plane extent of the interface at points x, shape (n, 3) to (n,), length."""
        return np.full(len(x), self.thickness)


@dataclass(frozen=True)
class PlaneStrain(_Plane):
    """Plane strain of a slice of the given thickness (length)."""

    def reduce(self, c: Array) -> Array:
        """Stiffness of (xx, yy, xy), shape (3, 3)."""
        keep = [0, 1, 5]
        return c[np.ix_(keep, keep)]

    def recover(self, c: Array) -> Array:
        """Stress (xx, yy, zz, xy) per unit strain, shape (4, 3); zz keeps the slice flat."""
        return c[np.ix_([0, 1, 2, 5], [0, 1, 5])]


@dataclass(frozen=True)
class PlaneStress(_Plane):
    """Plane stress of a sheet of the given thickness (length)."""

    def reduce(self, c: Array) -> Array:
        """Stiffness of (xx, yy, xy) with the three out-of-plane stresses zero, shape (3, 3)."""
        keep, drop = [0, 1, 5], [2, 3, 4]
        inner = np.linalg.solve(c[np.ix_(drop, drop)], c[np.ix_(drop, keep)])
        return np.asarray(c[np.ix_(keep, keep)] - c[np.ix_(keep, drop)] @ inner)

    def recover(self, c: Array) -> Array:
        """Stress (xx, yy, zz, xy) per unit strain, shape (4, 3); zz is zero."""
        return np.insert(self.reduce(c), 2, 0.0, axis=0)


@dataclass(frozen=True)
class Axisymmetric:
    """Axisymmetric body, x = radius and y = axis; forces are those of the full ring.

    Material axes 1, 2, 3 are radius, axis, hoop.
    """

    gdim: ClassVar[int] = 2
    mesh_gdim: ClassVar[int] = 2
    tdim: ClassVar[int] = 2
    n_unknowns: ClassVar[int] = 2
    labels: ClassVar[tuple[str, ...]] = ("rr", "zz", "tt", "rz")
    stress_labels: ClassVar[tuple[str, ...]] = labels

    def strain(self, u: Any, x: Any) -> Any:
        """Voigt strain (rr, zz, hoop, rz) of a UFL displacement."""
        return ufl.as_vector([u[0].dx(0), u[1].dx(1), u[0] / x[0], u[0].dx(1) + u[1].dx(0)])

    def reduce(self, c: Array) -> Array:
        """Stiffness of (rr, zz, hoop, rz), shape (4, 4)."""
        keep = [0, 1, 2, 5]
        return c[np.ix_(keep, keep)]

    def recover(self, c: Array) -> Array:
        """Stress (rr, zz, hoop, rz) per unit strain, shape (4, 4)."""
        return self.reduce(c)

    def weight(self, x: Any) -> Any:
        """Factor of the area element: 2 pi r, length."""
        return 2.0 * np.pi * x[0]

    def breadth(self, x: Array) -> Array:
        """Circumference 2 pi r at points x, shape (n, 3) to (n,), length."""
        return np.asarray(2.0 * np.pi * x[:, 0])


@dataclass(frozen=True)
class Solid:
    """Three-dimensional body."""

    gdim: ClassVar[int] = 3
    mesh_gdim: ClassVar[int] = 3
    tdim: ClassVar[int] = 3
    n_unknowns: ClassVar[int] = 3
    labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "zz", "yz", "xz", "xy")
    stress_labels: ClassVar[tuple[str, ...]] = labels

    def strain(self, u: Any, x: Any) -> Any:
        """Voigt strain (xx, yy, zz, yz, xz, xy) of a UFL displacement."""
        return ufl.as_vector(
            [
                u[0].dx(0),
                u[1].dx(1),
                u[2].dx(2),
                u[1].dx(2) + u[2].dx(1),
                u[0].dx(2) + u[2].dx(0),
                u[0].dx(1) + u[1].dx(0),
            ]
        )

    def reduce(self, c: Array) -> Array:
        """The whole stiffness, shape (6, 6)."""
        return c

    def recover(self, c: Array) -> Array:
        """Stress per unit strain: the stiffness, shape (6, 6)."""
        return c

    def weight(self, x: Any) -> Any:
        """One: the volume element needs no factor."""
        return 1.0

    def breadth(self, x: Array) -> Array:
        """One: the interface of a solid has its own width, shape (n,)."""
        return np.ones(len(x))


@dataclass(frozen=True)
class Shell:
    """Shells on a surface mesh in space, each cell group with its :class:`fxcrack.Section`.

    Unknowns of a node are the displacement u of the reference surface and the change w of the
    director (the unit normal D): a point at the distance z moves to X + z D + u + z w, exactly and
    at any rotation. A linear thickness strain is condensed in every cell (seven parameters). Its
    strains are in :mod:`fxcrack.continuum.shell_strains`.

    Args:
        enhanced_membrane: Enhance the membrane strains of first-order quadrilaterals by five terms
            (Simo and Rifai 1990), for webs that bend in their plane.
    """

    enhanced_membrane: bool = False
    gdim: ClassVar[int] = 3
    mesh_gdim: ClassVar[int] = 3
    tdim: ClassVar[int] = 2
    n_unknowns: ClassVar[int] = 6
    stress_labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "zz", "yz", "xz", "xy")

    def weight(self, x: Any) -> Any:
        """One: thickness is part of the section."""
        return 1.0

    def breadth(self, x: Array) -> Array:
        """One: the faces of a shell have their own width, shape (n,)."""
        return np.ones(len(x))


Model = PlaneStrain | PlaneStress | GeneralisedPlaneStrain | Axisymmetric | Solid
"""Models whose strains are functions of the gradient of the displacement."""


def green_lagrange(model: Model, u: Any, x: Any) -> Any:
    """Voigt Green-Lagrange strain of a model, engineering shears, components as its small strain.

    E = 1/2 (grad u + grad u^t + grad u^t grad u),   hoop: u_r/r + 1/2 (u_r/r)^2
    """
    g = ufl.grad(u)
    square = g.T * g
    n = model.gdim
    quadratic = [0.5 * square[i, i] for i in range(n)]
    if isinstance(model, Axisymmetric):
        quadratic.append(0.5 * (u[0] / x[0]) ** 2)
    shears = [(1, 2), (0, 2), (0, 1)] if n == 3 else [(0, 1)]
    quadratic += [square[i, j] for i, j in shears]
    return model.strain(u, x) + ufl.as_vector(quadratic)


def green_lagrange_change(model: Model, u: Any, v: Any, x: Any) -> Any:
    """Change of :func:`green_lagrange` at u per unit of a displacement v, linear in v.

    Halfway between two displacements, with their difference for v, it is the difference of their
    strains, as strains are quadratic.
    """
    g, h = ufl.grad(u), ufl.grad(v)
    square = g.T * h
    n = model.gdim
    quadratic = [square[i, i] for i in range(n)]
    if isinstance(model, Axisymmetric):
        quadratic.append(u[0] * v[0] / x[0] ** 2)
    shears = [(1, 2), (0, 2), (0, 1)] if n == 3 else [(0, 1)]
    quadratic += [square[i, j] + square[j, i] for i, j in shears]
    return model.strain(v, x) + ufl.as_vector(quadratic)


def deformation_gradient(model: Model, u: Any, x: Any) -> Any:
    """F = 1 + grad u, shape (3, 3); out of the plane the stretch is 1, in a ring 1 + u_r/r."""
    f = ufl.Identity(model.gdim) + ufl.grad(u)
    if model.gdim == 3:
        return f
    out = 1 + u[0] / x[0] if isinstance(model, Axisymmetric) else 1
    return ufl.as_matrix([[f[0, 0], f[0, 1], 0], [f[1, 0], f[1, 1], 0], [0, 0, out]])


def displacement_gradient(model: Model, u: Any, x: Any) -> Any:
    """F - 1, linear in u, shape (3, 3)."""
    g = ufl.grad(u)
    if model.gdim == 3:
        return g
    out = u[0] / x[0] if isinstance(model, Axisymmetric) else 0
    return ufl.as_matrix([[g[0, 0], g[0, 1], 0], [g[1, 0], g[1, 1], 0], [0, 0, out]])


def cofactor(f: Any) -> Any:
    """J F^-t of a gradient of shape (2, 2) or (3, 3), without division."""
    if f.ufl_shape == (2, 2):
        return ufl.as_matrix([[f[1, 1], -f[1, 0]], [-f[0, 1], f[0, 0]]])
    a, b, c = (ufl.as_vector([f[i, j] for i in range(3)]) for j in range(3))
    columns = ufl.cross(b, c), ufl.cross(c, a), ufl.cross(a, b)
    return ufl.as_matrix([[columns[j][i] for j in range(3)] for i in range(3)])


def labelled(model: Model, tensor: Any) -> Any:
    """Components of a stress of shape (3, 3) in the order of ``model.stress_labels``.

    The third axis of a plane or a ring is the one out of it.
    """
    shears = [(1, 2), (0, 2), (0, 1)] if model.gdim == 3 else [(0, 1)]
    return ufl.as_vector([tensor[i, j] for i, j in [(0, 0), (1, 1), (2, 2), *shears]])


def tensor(model: Model, stress: Any) -> Any:
    """The stress of shape (3, 3) with given ``model.stress_labels``."""
    s = stress
    if model.gdim == 3:
        return ufl.as_matrix([[s[0], s[5], s[4]], [s[5], s[1], s[3]], [s[4], s[3], s[2]]])
    return ufl.as_matrix([[s[0], s[3], 0], [s[3], s[1], 0], [0, 0, s[2]]])
