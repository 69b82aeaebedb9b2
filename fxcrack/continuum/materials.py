"""Elastic materials as 6 x 6 stiffness matrices in global axes.

Voigt order 11, 22, 33, 23, 13, 12 with engineering shears. A material knows nothing of meshes;
the kinematic model (:mod:`fxcrack.continuum.kinematics`) picks the rows it needs.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    as_float,
    between,
    finite,
    keep,
    keep_floats,
    list_of,
    not_negative,
    number,
    numbers,
    positive,
    shown,
)
from fxcrack.base.errors import InputError

Vector = tuple[float, float, float]
Frame = tuple[Vector, Vector] | float | tuple[str, float]
"""Two directions, or an angle in degrees about z or a named axis."""


class Material(Protocol):
    """What the continuum needs of a material."""

    def stiffness(self) -> Array:
        """Stiffness in global axes, shape (6, 6), force/length^2."""


@dataclass(frozen=True)
class Isotropic:
    """Isotropic linear elasticity.

    Args:
        E: Young's modulus, force/length^2.
        nu: Poisson's ratio, -1 < nu < 0.5.
        expansion: Thermal strain per degree, 1/temperature.
        density: Mass per volume; ``None`` where inertia plays no part.
    """

    E: float
    nu: float
    expansion: float = 0.0
    density: float | None = None

    def __post_init__(self) -> None:
        """Check the constants."""
        name = type(self).__name__
        positive(name, E=self.E)
        between(name, "nu", self.nu, -1.0, 0.5, ends=False)
        finite(name, expansion=self.expansion)
        _check_density(name, self.density)
        keep_floats(self, "E", "nu", "expansion", "density")
        with np.errstate(over="ignore"):
            check_stiffness(f"{name}(E={self.E}, nu={self.nu})", self.stiffness())

    def stiffness(self) -> Array:
        """Stiffness, shape (6, 6), force/length^2."""
        shear = self.E / (2.0 * (1.0 + self.nu))
        lame = self.E * self.nu / ((1.0 + self.nu) * (1.0 - 2.0 * self.nu))
        c = np.zeros((6, 6))
        c[:3, :3] = lame
        c[np.arange(3), np.arange(3)] += 2.0 * shear
        c[np.arange(3, 6), np.arange(3, 6)] = shear
        return c

    def thermal_expansion(self) -> Array:
        """Thermal strain per degree, shape (6,), 1/temperature."""
        return self.expansion * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class Orthotropic:
    """Orthotropic linear elasticity in a material frame.

    Args:
        E: Young's moduli (E1, E2, E3), force/length^2.
        nu: Poisson's ratios (nu12, nu13, nu23); nu_ij/E_i = nu_ji/E_j.
        G: Shear moduli (G12, G13, G23), force/length^2.
        frame: Two global direction vectors, of axis 1 and of one in the plane of axes 1 and 2;
            the default puts axes 1, 2, 3 along x, y, z. Or an angle in degrees by which they are
            turned from there about z, or about another axis, ("y", 45.0), by the right-hand rule.
        expansion: Thermal strains per degree along axes 1, 2, 3, 1/temperature.
        density: Mass per volume; ``None`` where inertia plays no part.
    """

    E: tuple[float, float, float]
    nu: tuple[float, float, float]
    G: tuple[float, float, float]
    frame: Frame = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    expansion: tuple[float, float, float] = (0.0, 0.0, 0.0)
    density: float | None = None

    def __post_init__(self) -> None:
        """Check the constants and the frame."""
        parts = {"E": "E1, E2, E3", "nu": "nu12, nu13, nu23", "G": "G12, G13, G23"}
        for name, needed in parts.items():
            value = list_of(getattr(self, name))
            if value is None or len(value) != 3 or any(as_float(v) is None for v in value):
                raise InputError(
                    f"Orthotropic: {name} = {shown(getattr(self, name))} must be three numbers, "
                    f"({needed}); a ply that is alike across its fibres has E3 = E2, nu13 = nu12, "
                    "G13 = G12"
                )
            entries = dict(zip(needed.split(", "), value, strict=True))
            finite("Orthotropic", **entries) if name == "nu" else positive("Orthotropic", **entries)
            keep(self, **{name: numbers("Orthotropic", name, value, 3)})
        if np.linalg.eigvalsh(self._compliance()).min() <= 0.0:
            raise InputError(
                f"Orthotropic: nu = {self.nu} with E = {self.E} is no stable material "
                "(compliance not positive definite); check the order nu12, nu13, nu23"
            )
        keep(self, frame=directions("Orthotropic", self.frame))
        expansion = numbers("Orthotropic", "expansion", self.expansion, 3, words="one per axis")
        keep(self, expansion=expansion)
        _check_density("Orthotropic", self.density)
        keep_floats(self, "density")
        check_stiffness(f"Orthotropic(E={self.E}, nu={self.nu}, G={self.G})", self.stiffness())

    def _compliance(self) -> Array:
        e1, e2, e3 = self.E
        nu12, nu13, nu23 = self.nu
        g12, g13, g23 = self.G
        s = np.zeros((6, 6))
        s[:3, :3] = [
            [1.0 / e1, -nu12 / e1, -nu13 / e1],
            [-nu12 / e1, 1.0 / e2, -nu23 / e2],
            [-nu13 / e1, -nu23 / e2, 1.0 / e3],
        ]
        s[3, 3], s[4, 4], s[5, 5] = 1.0 / g23, 1.0 / g13, 1.0 / g12
        return s

    def stiffness(self) -> Array:
        """Stiffness in global axes, shape (6, 6), force/length^2."""
        to_local = self._to_local()
        return np.asarray(to_local.T @ np.linalg.inv(self._compliance()) @ to_local)

    def thermal_expansion(self) -> Array:
        """Thermal strain per degree in global axes, shape (6,), 1/temperature."""
        local = np.array([*self.expansion, 0.0, 0.0, 0.0])
        return np.asarray(np.linalg.solve(self._to_local(), local))

    def _to_local(self) -> Array:
        """Takes a strain from global axes to the frame, shape (6, 6)."""
        return strain_rotation(frame_axes("Orthotropic", self.frame))


def frame_axes(name: str, frame: object) -> Array:
    """Unit vectors of material axes from two directions.

    Args:
        name: Whose frame it is, for messages.
        frame: Global directions of axis 1 and of a vector in the plane of axes 1 and 2, or an
            angle.

    Returns:
        Rows are axes 1, 2, 3 in global components, shape (3, 3).

    Raises:
        InputError: They are not two vectors of three numbers, or they are parallel.
    """
    e1, in_plane = (_unit(np.asarray(v)) for v in directions(name, frame))
    e3 = np.cross(e1, in_plane)
    e3 /= np.linalg.norm(e3)
    return np.vstack([e1, np.cross(e3, e1), e3])


def _check_density(name: str, density: object) -> None:
    if density is not None:
        positive(name, density=density)


def directions(owner: str, frame: object) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The two direction vectors that a frame stands for, neither zero nor parallel.

    Args:
        owner: Whose frame it is, for messages.
        frame: Two vectors, an angle in degrees about z, or the name of an axis and an angle.

    Raises:
        InputError: It is none of these.
    """
    rows = list_of(frame)
    named = rows is not None and len(rows) == 2 and isinstance(rows[0], str)
    if as_float(frame) is not None or named:
        axis, angle = ("z", frame) if rows is None else rows
        if axis not in ("x", "y", "z"):
            raise InputError(
                f"{owner}: frame = {shown(frame)}: the axis of the angle must be 'x', 'y' or 'z'"
            )
        finite(f"{owner}: frame", angle=angle)
        turn = np.radians(number(f"{owner}: frame", "angle", angle))
        k = "xyz".index(axis)
        axes = np.eye(3)
        # exact where the angle is a multiple of 90 degrees
        c, s = (round(v) if abs(v - round(v)) < 1e-15 else v for v in (np.cos(turn), np.sin(turn)))
        i, j = (k + 1) % 3, (k + 2) % 3
        turned = axes.copy()
        turned[i], turned[j] = c * axes[i] + s * axes[j], c * axes[j] - s * axes[i]
        return tuple(turned[0].tolist()), tuple(turned[1].tolist())
    if rows is None or len(rows) != 2 or any(len(list_of(row) or ()) != 3 for row in rows):
        raise InputError(
            f"{owner}: frame = {shown(frame)} must be two direction vectors of three components "
            "each, axis 1 and one in the plane of axes 1 and 2, or an angle in degrees, 45.0 "
            "about z or ('y', 45.0)"
        )
    try:
        first, second = (numbers("vector", f"{i}", row, 3) for i, row in enumerate(rows))
    except InputError as error:
        raise InputError(f"{owner}: frame = {frame} must hold finite numbers ({error})") from error
    for i, row in enumerate((first, second)):
        if not any(row):
            raise InputError(f"{owner}: frame[{i}] = {row} is zero; give a direction")
    if np.linalg.norm(np.cross(_unit(np.array(first)), _unit(np.array(second)))) < 1e-8:
        raise InputError(f"{owner}: the two vectors of frame = {frame} are parallel")
    return first, second


def _unit(vector: Array) -> Array:
    """A direction of length 1, without overflow on the way."""
    scaled = vector / np.abs(vector).max()
    return np.asarray(scaled / np.linalg.norm(scaled))


def stiffness_of(material: Material) -> Array:
    """Stiffness of a material, a user's own perhaps, shape (6, 6), force/length^2.

    Raises:
        InputError: It fails, or gives what belongs to no stable material.
    """
    try:
        found = material.stiffness()
    except InputError:
        raise
    except Exception as error:  # whatever the user's method may raise
        raise InputError(
            f"{type(material).__name__}: stiffness() fails: {type(error).__name__}: {error}; it "
            "must return the stiffness in global axes, shape (6, 6)"
        ) from error
    return check_stiffness(type(material).__name__, found)


def check_stiffness(owner: str, stiffness: object) -> Array:
    """Return a stiffness as an array, if it belongs to a stable material.

    Args:
        owner: The material, for the message.
        stiffness: What its method ``stiffness`` gave, shape (6, 6), force/length^2.

    Raises:
        InputError: It has another shape, is not finite, not symmetric or not positive definite.
    """
    try:
        c = np.asarray(stiffness)
        c = c.astype(np.float64) if c.dtype.kind in "fiu" else np.full(c.shape, np.nan)
    except (TypeError, ValueError):
        c = np.zeros(0)
    if c.shape != (6, 6):
        raise InputError(
            f"{owner}: the stiffness has shape {c.shape}; it must be (6, 6), in the order 11, 22, "
            "33, 23, 13, 12"
        )
    if not np.all(np.isfinite(c)):
        raise InputError(
            f"{owner}: the stiffness holds entries that are no finite numbers; its moduli are too "
            "large or not given as numbers"
        )
    size = float(np.abs(c).max())
    if not size > 0.0 or float(np.abs(c - c.T).max()) > 1e-8 * size:
        raise InputError(f"{owner}: the stiffness is zero or not symmetric; no material has such")
    scaled = 0.5 * (c / size + c.T / size)
    if np.linalg.eigvalsh(scaled).min() <= 0.0:
        raise InputError(
            f"{owner}: the stiffness is not positive definite (smallest eigenvalue "
            f"{size * np.linalg.eigvalsh(scaled).min():.3g}); some strain would set energy free: "
            "check the moduli and Poisson's ratios"
        )
    return np.asarray(c)


def strain_rotation(axes: Array) -> Array:
    """Matrix that takes a Voigt strain from global to local axes.

    Args:
        axes: Rows are the local unit vectors in global components, shape (3, 3).

    Returns:
        Shape (6, 6); engineering shears on both sides.
    """
    pairs = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
    out = np.zeros((6, 6))
    for j, (k, m) in enumerate(pairs):
        unit = np.zeros((3, 3))
        unit[k, m] = unit[m, k] = 1.0 if k == m else 0.5
        local = axes @ unit @ axes.T
        out[:, j] = [local[a, b] * (1.0 if a == b else 2.0) for a, b in pairs]
    return out


@dataclass(frozen=True)
class NeoHookean(Isotropic):
    """Compressible neo-Hookean material; finite strain.

        W = mu/2 (tr F^t F - 3 - 2 ln J) + lambda/2 (ln J)^2

    (Bonet and Wood 2008, eq. 6.28), with mu and lambda those of E and nu at zero strain. Energy and
    stress grow without bound when a volume shrinks to nothing.

    Args:
        E: Young's modulus at zero strain, force/length^2.
        nu: Poisson's ratio at zero strain, -1 < nu < 0.5.
        expansion: Stretch per degree less one, 1/temperature.
        density: Mass per undeformed volume.
    """

    form: ClassVar[str] = "neo_hookean"


@dataclass(frozen=True)
class Plastic(Isotropic):
    """J2 plasticity with isotropic hardening; small strain.

    Args:
        E: Young's modulus, force/length^2.
        nu: Poisson's ratio, -1 < nu < 0.5.
        expansion: Thermal strain per degree, 1/temperature.
        density: Mass per volume.
        yield_stress: Stress at first yield, force/length^2; from the table where there is one.
        hardening: Slope of the yield stress against the equivalent plastic strain, or a table of
            (equivalent plastic strain, yield stress) that starts at strain 0, linear between
            entries and constant after the last.

    Raises:
        InputError: A constant is out of range, or the yield stress falls.
    """

    form: ClassVar[str] = "plastic"
    yield_stress: float | None = field(default=None, kw_only=True)
    hardening: float | tuple[tuple[float, float], ...] = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check the constants and the table."""
        super().__post_init__()
        rows = list_of(self.hardening)
        if rows is None:
            if self.yield_stress is None:
                raise InputError("Plastic: yield_stress = None must be positive")
            positive("Plastic", yield_stress=self.yield_stress)
            not_negative("Plastic (no softening)", hardening=self.hardening)
            keep_floats(self, "yield_stress", "hardening")
            return
        pairs = [list_of(row) for row in rows]
        if not rows or any(pair is None or len(pair) != 2 for pair in pairs):
            raise InputError(
                "Plastic: hardening must be a number or pairs (equivalent plastic strain, stress)"
            )
        kept = tuple(numbers("Plastic", f"hardening[{i}]", pair, 2) for i, pair in enumerate(pairs))
        table = np.array(kept)
        keep(self, hardening=kept)
        if table[0, 0] != 0.0 or table[0, 1] <= 0.0 or np.any(np.diff(table[:, 0]) <= 0.0):
            raise InputError(
                f"Plastic: plastic strains {table[:, 0]} must start at 0 and increase, and the "
                f"first stress {table[0, 1]} must be positive"
            )
        if np.any(np.diff(table[:, 1]) < 0.0):
            raise InputError(f"Plastic: yield stresses {table[:, 1]} must not fall (no softening)")
        if self.yield_stress is None:
            return
        positive("Plastic", yield_stress=self.yield_stress)
        keep_floats(self, "yield_stress")
        if self.yield_stress != table[0, 1]:
            raise InputError(
                f"Plastic: yield_stress = {self.yield_stress} contradicts the first entry "
                f"{table[0, 1]} of the table; leave it out"
            )

    def curve(self) -> tuple[Array, Array, Array]:
        """Hardening curve, piecewise linear.

        Returns:
            Equivalent plastic strain at the knots, yield stress there and slope after each
            (both force/length^2), each of shape (n_knots,).
        """
        if isinstance(self.hardening, int | float):
            assert self.yield_stress is not None
            first, slope = float(self.yield_stress), float(self.hardening)
            return np.zeros(1), np.array([first]), np.array([slope])
        strain, stress = np.asarray(self.hardening, dtype=np.float64).T
        return strain, stress, np.append(np.diff(stress) / np.diff(strain), 0.0)
