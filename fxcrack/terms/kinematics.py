"""Strain measures of finite deformation, for every kinematic model, as UFL expressions."""

from __future__ import annotations

from typing import Any

import ufl

from fxcrack.models import Axisymmetric, Model


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


def deformation_gradient(model: Model, u: Any, x: Any) -> Any:
    """F = 1 + grad u, shape (3, 3); out of the plane the stretch is 1, in a ring 1 + u_r/r."""
    f = ufl.Identity(model.gdim) + ufl.grad(u)
    if model.gdim == 3:
        return f
    out = 1 + u[0] / x[0] if isinstance(model, Axisymmetric) else 1
    return ufl.as_matrix([[f[0, 0], f[0, 1], 0], [f[1, 0], f[1, 1], 0], [0, 0, out]])


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
