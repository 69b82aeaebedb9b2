"""Rigid masters of a scene as analytical rigid surfaces of a deck, held at a reference node."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.continuum.kinematics import Axisymmetric
from fxcrack.deck.lines import number
from fxcrack.deck.write_steps import refuse
from fxcrack.interface.pair import Pair
from fxcrack.interface.rigid import RigidCylinder, RigidPlane, RigidSphere

_NEAR = 0.1
"""Distance, over the size of the slave's facets, up to which gaps count as zero in a deck."""


def rigid_lines(pair: Pair, name: str, node: int, gdim: int, model: object) -> list[str]:
    """Cards of the rigid master of a pair, its body and its support.

    Args:
        pair: The pair.
        name: Of the surface in the deck.
        node: Number of the reference node.
        gdim: Dimension of space.
        model: Kinematic model.

    Raises:
        InputError: A deck has no word for it.
    """
    interface, surface = pair.interface, pair.rigid
    title = interface.title
    if interface.symmetry:
        refuse(
            f"interface '{title}': symmetry=True, where rates are those of the whole body; leave "
            "it out, with normal_only=True and half of the critical rates"
        )
    x = pair.surface.x
    assert isinstance(surface, RigidPlane | RigidCylinder | RigidSphere)
    gaps = np.abs(surface.measure(x)[0])
    far = gaps > _NEAR * pair.surface.facet_size
    if np.any(far & ~pair.paired) or (interface.gap == "adjust" and np.any(far)):
        refuse(
            f"interface '{title}': {int(far.sum())} slave nodes away from the rigid surface, with "
            f"gap='{interface.gap}' and tolerance={interface.tolerance}; give gap='keep' and a "
            "tolerance that reaches all of them, as decks have it"
        )
    size = 2.0 * float(np.ptp(x, axis=0).max()) + float(gaps.max())
    if gdim == 2:
        kind, lines = "SEGMENTS", _in_plane(surface, x, size, isinstance(model, Axisymmetric))
    else:
        kind, lines = _in_space(surface, x, size)
    point = ", ".join(number(c) for c in surface.point[:gdim])
    return [
        "*NODE",
        f"{node}, {point}",
        f'*SURFACE, TYPE={kind}, NAME="{name}"',
        *lines,
        f'*RIGID BODY, REF NODE={node}, ANALYTICAL SURFACE="{name}"',
        "*BOUNDARY",
        f"{node}, ENCASTRE",
    ]


def _numbers(*values: float) -> str:
    return ", ".join(number(float(v)) for v in values)


def _line(point: Array, along: Array, size: float) -> list[str]:
    """A line through a point in a plane, the bodies on its left."""
    a, b = point - size * along, point + size * along
    return [f"START, {_numbers(*a)}", f"LINE, {_numbers(*b)}"]


def _circle(x: float, y: float, radius: float, *, inside: bool, half: bool = False) -> list[str]:
    """A circle, or its half at larger x, clockwise with the bodies around it."""
    at = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)]
    at = at[:3] if half else at
    if inside:
        at.reverse()
    points = [(x + radius * c, y + radius * s) for c, s in at]
    return [
        f"START, {_numbers(*points[0])}",
        *(f"CIRCL, {_numbers(*p, x, y)}" for p in points[1:]),
    ]


def _in_plane(
    surface: RigidPlane | RigidCylinder | RigidSphere, x: Array, size: float, rings: bool
) -> list[str]:
    """Profile in two dimensions."""
    px, py = surface.point[:2]
    if isinstance(surface, RigidPlane):
        n = np.array(surface.normal[:2])
        point = np.array([px, py])
        along = np.array([n[1], -n[0]])
        middle = point + ((x[:, :2].mean(axis=0) - point) @ along) * along
        return _line(middle, along, size)
    if isinstance(surface, RigidCylinder) and rings:
        along = np.array([0.0, 1.0 if surface.inside else -1.0])
        return _line(np.array([surface.radius, x[:, 1].mean()]), along, size)
    return _circle(px, py, surface.radius, inside=surface.inside, half=rings)


def _in_space(
    surface: RigidPlane | RigidCylinder | RigidSphere, x: Array, size: float
) -> tuple[str, list[str]]:
    """Type and data lines in space: the profile and where its plane lies."""
    point = np.array(surface.point)
    if isinstance(surface, RigidSphere):
        top = _numbers(*point, *(point + np.eye(3)[2]))
        return "REVOLUTION", [
            top, *_circle(0.0, 0.0, surface.radius, inside=surface.inside, half=True)
        ]  # fmt: skip
    fixed = np.array(surface.normal if isinstance(surface, RigidPlane) else surface.axis)
    one = np.cross(fixed, np.eye(3)[int(np.argmin(np.abs(fixed)))])
    one /= np.linalg.norm(one)
    if isinstance(surface, RigidPlane):
        # the second axis of the profile, along x generator, is the normal
        generator = np.cross(fixed, one)
        point = point + ((x.mean(axis=0) - point) @ one) * one
        profile = _line(np.zeros(2), np.array([1.0, 0.0]), size)
    else:
        generator = fixed
        profile = _circle(0.0, 0.0, surface.radius, inside=surface.inside)
    return "CYLINDER", [
        _numbers(*point, *(point + one)), _numbers(*(point + generator)), *profile
    ]  # fmt: skip


__all__ = ["rigid_lines"]
