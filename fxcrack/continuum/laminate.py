"""Laminates: plies of one or several materials, stacked from the bottom to the top.

Voigt order 11, 22, 33, 23, 13, 12 with engineering shears, as everywhere. Laminate axes: 1 and 2 in
the plane, angles are measured from 1 towards 2, and 3 across the plies from the bottom to the top.
z is measured along 3 from the middle of the stack.

    moments          M_k = int z^k C dz                                 C: stiffness, (6, 6)
    classical theory [N, M] = [A B; B D] [e0, kappa]                    plane stress in each ply
    shear            Q = K A_s gamma        with the factors k of equilibrium

One vocabulary serves solids, continuum shells and shells: a laminate used as the material of solid
cells is the homogeneous body with the same averages (:meth:`Laminate.stiffness`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import as_float, number, shown
from fxcrack.base.errors import InputError
from fxcrack.continuum.lay_up import angles_of
from fxcrack.continuum.materials import Frame, Material, directions, frame_axes, strain_rotation
from fxcrack.continuum.ply import Ply, square_strain
from fxcrack.continuum.temperature import ByTemperature

_IN, _OUT = [0, 1, 5], [2, 3, 4]
"""Components in the plane of the plies and those across it."""
_ODD_ANGLE = 37.0
"""Degrees; no layer of fibres is symmetric about it."""
_ROUND_OFF = 1e-10
_SLIVER = 1e-9
"""Part of the thickness that a ply must have."""


@dataclass(frozen=True, init=False)
class Laminate:
    """A stack of plies, bottom first.

    Args:
        plies: Plies, or angles in degrees of plies of one ``thickness``, or a lay-up as text, e.g.
            "[0/45/-45/90]2s" (see :mod:`fxcrack.continuum.lay_up`).
        material: Elastic material of the plies that name none.
        thickness: Thickness of a ply that is given by its angle alone, length.
        frame: Used as the material of solid cells: two global direction vectors, of axis 1 of the
            laminate and of one in the plane of axes 1 and 2; plies are stacked along their cross
            product. By default axes 1, 2, 3 are x, y, z; ("x", -90.0) turns them about x, so that
            plies are stacked along y. Shells and continuum shells have their own axes and take
            no notice of it.

    Attributes:
        plies: The plies, each with its material, bottom first.
        frame: The directions.

    Raises:
        InputError: There is no ply, a ply without material or thickness, or a material that is not
            linear elastic.

    Example:
        ``Laminate([Ply(0.125, a) for a in (45, -45, 0, 90)], material=cfrp).symmetric()``
    """

    plies: tuple[Ply, ...]
    frame: Frame

    def __init__(
        self,
        plies: str | Iterable[Ply | float],
        material: Material | None = None,
        thickness: float | None = None,
        *,
        frame: Frame = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ) -> None:
        given: list[Ply | float]
        if isinstance(plies, str):
            given = list(angles_of(plies))
        elif isinstance(plies, Ply | bytes) or not _lists(plies):
            raise InputError(
                f"Laminate: plies = {shown(plies)} must be a list of plies or angles, bottom "
                "first, or a lay-up such as '[0/90]s'"
            )
        else:
            given = list(plies)
        if not given:
            raise InputError("Laminate: there is no ply; give one or more, bottom first")
        stack = tuple(_as_ply(i, p, material, thickness) for i, p in enumerate(given))
        object.__setattr__(self, "plies", stack)
        object.__setattr__(self, "frame", directions("Laminate", frame))

    # -- the stack --------------------------------------------------------------------------------

    @property
    def thickness(self) -> float:
        """Thickness of the whole stack, length."""
        return float(sum(p.thickness for p in self.plies))

    @property
    def thicknesses(self) -> tuple[float, ...]:
        """Thicknesses of the plies, bottom first, length."""
        return tuple(p.thickness for p in self.plies)

    @property
    def angles(self) -> tuple[float, ...]:
        """Angles of the plies, degrees, bottom first."""
        return tuple(p.angle for p in self.plies)

    def symmetric(self) -> Laminate:
        """The laminate with its mirror image on top of it: [0/90] becomes [0/90/90/0]."""
        return self._stacked(self.plies + self.plies[::-1])

    def repeated(self, times: int) -> Laminate:
        """The laminate several times, one above the other: [0/90] becomes [0/90/0/90].

        Raises:
            InputError: ``times`` is no positive integer.
        """
        return self._stacked(self.plies * _count("repeated", times))

    def clustered(self, times: int) -> Laminate:
        """Each ply several times, side by side: [0/90] becomes [0/0/90/90].

        Raises:
            InputError: ``times`` is no positive integer.
        """
        n = _count("clustered", times)
        return self._stacked(tuple(p for ply in self.plies for p in (ply,) * n))

    def turned(self, angle: float) -> Laminate:
        """The laminate turned in its plane by an angle in degrees, from axis 1 towards axis 2."""
        return self._stacked(tuple(replace(p, angle=p.angle + angle) for p in self.plies))

    def layers(self, name: str) -> dict[str, Laminate]:
        """Each ply as the material of cells of its own, for laminates meshed ply by ply.

        Args:
            name: Cell groups are called ``name_1``, ``name_2``, ..., from the bottom.

        Returns:
            Materials by group, for ``Scene(materials=...)``.
        """
        return {f"{name}_{i}": self._stacked((p,)) for i, p in enumerate(self.plies, 1)}

    def interfaces(self, offset: float = 0.0) -> Array:
        """Positions of the faces of the plies, bottom first, shape (n_plies + 1,), length.

        Args:
            offset: Position of the middle of the stack above the reference surface, length.
        """
        height = np.concatenate([[0.0], np.cumsum([p.thickness for p in self.plies])])
        return np.asarray(height - 0.5 * height[-1] + offset)

    def part(self, low: float, high: float) -> Laminate:
        """The plies, whole or cut, between two fractions of the thickness from the bottom.

        What is thinner than round-off is left out.

        Args:
            low: Where the part begins, 0 at the bottom.
            high: Where it ends, 1 at the top.
        """
        z = self.interfaces() / self.thickness + 0.5
        cut = np.diff(np.clip(z, low, high)) * self.thickness
        return self._stacked(
            tuple(
                replace(p, thickness=t)
                for p, t in zip(self.plies, cut, strict=True)
                if t > _SLIVER * self.thickness
            )
        )

    def plies_below(self, fraction: float) -> int:
        """Number of plies that end below a fraction of the thickness from the bottom."""
        ends = self.interfaces()[1:] / self.thickness + 0.5
        return int(np.sum(ends <= fraction + _SLIVER))

    @property
    def is_isotropic_in_plane(self) -> bool:
        """Whether every ply stays the same when it is turned in its plane."""
        pairs = zip(self.plies, self.turned(_ODD_ANGLE).plies, strict=True)
        stiffnesses = [(p.stiffness(), q.stiffness()) for p, q in pairs]
        return all(np.abs(c - d).max() <= 1e-10 * np.abs(c).max() for c, d in stiffnesses)

    def _stacked(self, plies: tuple[Ply, ...]) -> Laminate:
        return Laminate(plies, frame=self.frame)

    # -- moments and classical laminate theory ----------------------------------------------------

    def moments(self, degree: int, offset: float = 0.0) -> Array:
        """Moments int z^k C dz of the stiffness, k from 0 to ``degree``.

        Args:
            degree: Highest power of z.
            offset: Position of the middle above the reference surface z = 0, length.

        Returns:
            Laminate axes, shape (degree + 1, 6, 6), force/length^2 x length^(k + 1).
        """
        return self._integrals([p.stiffness() for p in self.plies], degree, offset)

    def thermal_moments(self, degree: int, offset: float = 0.0) -> Array:
        """Moments int z^k C expansion dz of the stress that holds the plies, per degree.

        Args:
            degree: Highest power of z.
            offset: Position of the middle above the reference surface z = 0, length.

        Returns:
            Laminate axes, shape (degree + 1, 6), force/length^2 x length^(k + 1)/temperature.
        """
        stress = [p.stiffness() @ p.thermal_expansion() for p in self.plies]
        return self._integrals(stress, degree, offset)

    def abd(self, offset: float = 0.0) -> Array:
        """Matrix [A B; B D] of classical laminate theory: plane stress in each ply.

        Args:
            offset: Position of the middle above the reference surface z = 0, length.

        Returns:
            Shape (6, 6), between (e11, e22, g12, k11, k22, k12), k12 the twist 2 w,12, and forces
            and moments per width (N11, N22, N12, M11, M22, M12).
        """
        a, b, d = self._integrals([_plane_stress(p.stiffness()) for p in self.plies], 2, offset)
        return np.block([[a, b], [b, d]])

    def thermal_forces(self, offset: float = 0.0) -> Array:
        """Forces and moments per width and degree that hold a laminate flat, order of :meth:`abd`.

        Args:
            offset: Position of the middle above the reference surface z = 0, length.

        Returns:
            Shape (6,).
        """
        stress = [_plane_stress(p.stiffness()) @ p.thermal_expansion()[_IN] for p in self.plies]
        return self._integrals(stress, 1, offset).ravel()

    def shear_factors(self) -> tuple[float, float]:
        """Factors of the transverse shear stiffnesses int G13 dz and int G23 dz.

        From the energy of the shear stress that equilibrium requires in cylindrical bending about
        the neutral axis z_n of a strip (plane stress across the thickness):

            s(z) = -int Q11 (z - z_n) dz,    k = D^2/(int s^2/G13 dz int G13 dz)

        5/6 for one ply.
        """
        z = self.interfaces()
        stiffness = [p.stiffness() for p in self.plies]
        factors = []
        for axis, shear in ((0, 4), (1, 3)):
            q = np.array([c[axis, axis] - c[axis, 2] ** 2 / c[2, 2] for c in stiffness])
            g = np.array([c[shear, shear] for c in stiffness])
            z_n = q @ np.diff(z**2) / (2.0 * q @ np.diff(z))
            bending = q @ np.diff((z - z_n) ** 3) / 3.0
            gauss, weights = np.polynomial.legendre.leggauss(3)  # s^2 is of degree 4 in z
            below, energy = 0.0, 0.0
            for (low, high), q_ply, g_ply in zip(pairwise(z - z_n), q, g, strict=True):
                points = 0.5 * (low + high) + 0.5 * (high - low) * gauss
                stress = below - 0.5 * q_ply * (points**2 - low**2)
                energy += 0.5 * (high - low) * float(weights @ stress**2) / g_ply
                below -= 0.5 * q_ply * (high**2 - low**2)
            factors.append(float(bending**2 / (energy * (g @ np.diff(z)))))
        return factors[0], factors[1]

    def shear_stiffness(self) -> Array:
        """Transverse shear stiffness with :meth:`shear_factors`, force/length.

        Returns:
            Shape (2, 2), between the shears (g23, g13) and the shear forces per width.
        """
        root = np.sqrt(np.array(self.shear_factors()[::-1]))
        return np.asarray(self.moments(0)[0][3:5, 3:5] * np.outer(root, root))

    def _integrals(self, values: list[Array], degree: int, offset: float) -> Array:
        z = self.interfaces(offset)
        powers = [np.diff(z ** (k + 1)) / (k + 1) for k in range(degree + 1)]
        return np.tensordot(np.array(powers), np.array(values), axes=1)

    def polynomial(self, degree: int) -> Array:
        """Stiffness over the thickness as the polynomial that has the laminate's moments.

            C(zeta) = sum_i c_i zeta^i,   int zeta^k C dzeta that of the plies for k <= degree

        with zeta = z/thickness. The energy of strains that are polynomials in zeta of half the
        degree is exact, for any number of plies.

        Args:
            degree: Highest power of zeta.

        Returns:
            c_i in laminate axes, shape (degree + 1, 6, 6), force/length^2; exactly 0 where
            round-off alone remains.
        """
        return self._fitted([p.stiffness() for p in self.plies], degree)

    def thermal_polynomials(self, degree: int) -> tuple[Array, Array, Array]:
        """What thermal strain adds to the energy over the thickness, as such polynomials.

            e_th = a rise + A rise^2/2,      a: expansion, A: the square of its tensor

        Args:
            degree: Highest power of zeta.

        Returns:
            C a and C A in laminate axes, shapes (degree + 1, 6), force/length^2/temperature (and
            its square), and (a C a, a C A, A C A), shape (degree + 1, 3).
        """
        first, second, products = [], [], []
        for ply in self.plies:
            c, a = ply.stiffness(), ply.thermal_expansion()
            square = square_strain(a)
            first.append(c @ a)
            second.append(c @ square)
            products.append(np.array([a @ c @ a, a @ c @ square, square @ c @ square]))
        found = [self._fitted(values, degree) for values in (first, second, products)]
        return found[0], found[1], found[2]

    def _fitted(self, values: list[Array], degree: int) -> Array:
        """Polynomial over the thickness with the moments of values that are even in each ply.

        Args:
            values: One array per ply, all of one shape.
            degree: Highest power of zeta.

        Returns:
            Shape (degree + 1, ...); exactly 0 where round-off alone remains.
        """
        powers = np.arange(degree + 1)
        moments = self._integrals(values, degree, 0.0)
        scale = self.thickness ** (powers + 1)
        moments /= scale.reshape(-1, *[1] * np.ndim(values[0]))
        k = powers[:, None] + powers[None] + 1
        gram = (0.5**k - (-0.5) ** k) / k
        c = np.tensordot(np.linalg.inv(gram), moments, axes=1)
        c[np.abs(c) <= _ROUND_OFF * np.abs(c).max()] = 0.0
        first, *others = values
        if all(np.abs(o - first).max() <= _ROUND_OFF * np.abs(first).max() for o in others):
            c[1:] = 0.0
        return c

    # -- as the material of solid cells -----------------------------------------------------------

    def stiffness(self) -> Array:
        """Stiffness of the homogeneous body with the same averages, global axes, shape (6, 6).

        Strains in the plane and stresses across it are the same in all plies, the others are
        averaged over the thickness (Sun and Li 1988, J. Compos. Mater. 22, 629-639): exact for a
        body that is thick compared with its plies and strains that are even over a stack. In plane
        stress it is A/thickness of classical laminate theory; the bending stiffness of the lay-up
        is that of a homogeneous plate.
        """
        to_local = self._to_local()
        return np.asarray(to_local.T @ self._averages()[0] @ to_local)

    def thermal_expansion(self) -> Array:
        """Thermal strain per degree of that body, global axes, shape (6,), 1/temperature."""
        return np.asarray(np.linalg.solve(self._to_local(), self._averages()[1]))

    @property
    def density(self) -> float | None:
        """Mass per volume, averaged; ``None`` where a ply has none."""
        found = [getattr(p.material, "density", None) for p in self.plies]
        if any(d is None for d in found):
            return None
        masses = [d * p.thickness for d, p in zip(found, self.plies, strict=True) if d is not None]
        return float(sum(masses)) / self.thickness

    def _averages(self) -> tuple[Array, Array]:
        """Averaged stiffness, shape (6, 6), and thermal expansion, (6,), in laminate axes."""
        parts = []
        for ply in self.plies:
            c, a = ply.stiffness(), ply.thermal_expansion()
            soft = np.linalg.inv(c[np.ix_(_OUT, _OUT)])
            across = soft @ c[np.ix_(_OUT, _IN)]
            q = _plane_stress(c)
            parts.append((q, soft, across, q @ a[_IN], across @ a[_IN] + a[_OUT]))
        share = np.array([p.thickness for p in self.plies]) / self.thickness
        q, soft, across, held, free = (
            np.tensordot(share, np.array([p[i] for p in parts]), axes=1) for i in range(5)
        )
        out = np.linalg.inv(soft)
        c = np.zeros((6, 6))
        c[np.ix_(_IN, _IN)] = q + across.T @ out @ across
        c[np.ix_(_OUT, _IN)] = out @ across
        c[np.ix_(_IN, _OUT)] = across.T @ out
        c[np.ix_(_OUT, _OUT)] = out
        a = np.zeros(6)
        a[_IN] = np.linalg.solve(q, held)
        a[_OUT] = free - across @ a[_IN]
        return c, a

    def _to_local(self) -> Array:
        return strain_rotation(frame_axes("Laminate", self.frame))


def _lists(plies: object) -> bool:
    """Whether something lists plies; an array of numpy without a dimension does not."""
    return isinstance(plies, Iterable) and not (isinstance(plies, np.ndarray) and plies.ndim == 0)


def _as_ply(i: int, given: Ply | float, material: Material | None, thickness: float | None) -> Ply:
    """A ply with its material."""
    if isinstance(given, Ply):
        ply = given if given.material is not None else replace(given, material=material)
    elif as_float(given) is None:
        raise InputError(
            f"Laminate: plies[{i}] = {shown(given)} is neither a Ply nor an angle in degrees"
        )
    elif thickness is None:
        raise InputError(
            f"Laminate: plies[{i}] = {given} is an angle; give thickness=, that of one ply, "
            "or Ply(thickness, angle)"
        )
    else:
        ply = Ply(thickness, number("Laminate", f"plies[{i}]", given), material)
    if ply.material is None:
        raise InputError(
            f"Laminate: plies[{i}] has no material; give material= to the ply or to the laminate"
        )
    if isinstance(ply.material, type) or not hasattr(ply.material, "stiffness"):
        raise InputError(
            f"Laminate: the material of plies[{i}], {shown(ply.material)}, is not a material; "
            "give e.g. Orthotropic(E=..., nu=..., G=...)"
        )
    if hasattr(ply.material, "form") or isinstance(ply.material, ByTemperature | Laminate):
        raise InputError(
            f"Laminate: plies[{i}] is of {type(ply.material).__name__}; plies are linear elastic, "
            "Isotropic or Orthotropic"
        )
    return ply


def _plane_stress(c: Array) -> Array:
    """Stiffness of (11, 22, 12) with the stresses across the plane zero, shape (3, 3)."""
    cross = c[np.ix_(_IN, _OUT)]
    inner = np.linalg.solve(c[np.ix_(_OUT, _OUT)], cross.T)
    return np.asarray(c[np.ix_(_IN, _IN)] - cross @ inner)


def _count(name: str, times: int) -> int:
    if isinstance(times, bool) or not isinstance(times, int | np.integer) or times < 1:
        raise InputError(f"Laminate.{name}: {times!r} is no positive number of times")
    return int(times)


__all__ = ["Laminate"]
