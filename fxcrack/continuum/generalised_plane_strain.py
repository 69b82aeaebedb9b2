"""Generalised plane strain: a section whose displacement does not vary along the third direction.

A slice of a body that is long in z, without end effects (Lekhnitskii 1963; Pipes and Pagano 1970,
J. Compos. Mater. 4, 538-548):

    u = u(x, y),  v = v(x, y),  w = w(x, y) + z (e + kappa_x x + kappa_y y)

with the three components u, v, w at the nodes and one strain e and two curvatures kappa for the
whole section, so that

    e_zz = e + kappa_x x + kappa_y y,    gamma_xz = dw/dx,    gamma_yz = dw/dy

(u and v have terms with z^2 that bend the slice, which strain nothing at the section z = 0). The
resultants that do work on e and kappa over a thickness t are

    N = int s_zz dA,    M_x = int s_zz x dA,    M_y = int s_zz y dA

A free strain is that at which N has its given value, zero for a strip with free edges. The numbers
are unknowns of their own, the same at all nodes (:attr:`DofLayout.shared`): q = e t, a length like
the displacements, and kappa t^2, so that no result depends on units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import ufl

from fxcrack.base.arrays import Array
from fxcrack.base.checks import check_amplitudes, finite, keep, number
from fxcrack.base.errors import InputError
from fxcrack.continuum.amplitudes import AmplitudeLike, Ramp

_RAMP = Ramp()
_COMPONENTS = 3


@dataclass(frozen=True)
class SharedUnknown:
    """One number of the whole section that is an unknown of all its nodes.

    Attributes:
        title: Its name in the history.
        answer: Name of its resultant there.
        unknown: Which unknown of a node it is.
        per_unknown: The number per unit of the unknown: 1/t, 1/t^2.
        per_reaction: Resultant per unit of the force on the unknown: 1, t.
        factor: What it is multiplied with in e_zz: ``None`` for 1, else the coordinate x (0) or
            y (1).
        prescribed: Its value at amplitude 1; ``None`` where it is free.
        load: Its resultant at amplitude 1, where it is free.
        amplitude: Factor in time of value or resultant.
    """

    title: str
    answer: str
    unknown: int
    per_unknown: float
    per_reaction: float
    factor: int | None
    prescribed: float | None
    load: float
    amplitude: AmplitudeLike


@dataclass(frozen=True)
class GeneralisedPlaneStrain:
    """Generalised plane strain of a slice: one strain out of the plane, and out-of-plane shears.

    Nodes have three displacement components, so that off-axis plies shear as they do in laminates
    (a strip of 45 degree plies is as compliant as 1/S11 of the turned ply, where plane strain
    holds it), and crack faces have a mode III. Supports must hold the slice along z as well,
    ``Displacement("end", z=0.0)``; loads and monitors with two components have none along z.

    One strain and one pair of curvatures serve the whole section: all bodies of a scene along their
    whole length, also arms that have come apart. Two arms that bend in opposite directions would
    contract in opposite senses; their common strain is nearly zero, that of plane strain. Arms
    that each contract for themselves need a 3-D model.

    The history holds ``strain_zz`` (dimensionless) and ``force_zz`` (force, the resultant of s_zz
    over the section), and where curvatures are free or move ``curvature_x`` (1/length),
    ``moment_x`` (force x length) and likewise y.

    Args:
        thickness: Length of the slice along z (length).
        strain_zz: Prescribed strain at the origin at amplitude 1; ``None`` for free, where the
            resultant is ``force_zz``.
        curvature_x: Prescribed change of e_zz with x (1/length) at amplitude 1; 0 by default;
            ``None`` for free, where the moment int s_zz x dA is zero.
        curvature_y: Likewise with y: the anticlastic curvature of a laminate stacked along y.
        force_zz: Resultant of s_zz at amplitude 1 where the strain is free (force).
        amplitude: Factor in time of what is prescribed.

    Raises:
        InputError: A number is not finite, the thickness not positive, or a force is given beside
            a prescribed strain.
    """

    thickness: float = 1.0
    strain_zz: float | None = None
    curvature_x: float | None = 0.0
    curvature_y: float | None = 0.0
    force_zz: float = 0.0
    amplitude: AmplitudeLike = _RAMP
    gdim: ClassVar[int] = _COMPONENTS
    mesh_gdim: ClassVar[int] = 2
    tdim: ClassVar[int] = 2
    title: ClassVar[str] = "amplitude of strain_zz"
    labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "zz", "yz", "xz", "xy")
    stress_labels: ClassVar[tuple[str, ...]] = labels

    def __post_init__(self) -> None:
        """Check the numbers."""
        name = type(self).__name__
        thickness = number(name, "thickness", self.thickness)
        if not 0.0 < thickness < np.inf:
            raise InputError(f"{name}: thickness = {thickness} is not positive and finite")
        given = {k: getattr(self, k) for k in ("strain_zz", "curvature_x", "curvature_y")}
        values = {k: None if v is None else number(name, k, v) for k, v in given.items()}
        force = number(name, "force_zz", self.force_zz)
        finite(name, force_zz=force, **{k: v for k, v in values.items() if v is not None})
        check_amplitudes([self])
        if force and self.strain_zz is not None:
            raise InputError(
                f"{name}: force_zz = {force} beside strain_zz = {self.strain_zz}: the resultant "
                "follows from a prescribed strain; leave one of them out"
            )
        keep(self, thickness=thickness, force_zz=force, **values)

    @property
    def shared(self) -> tuple[SharedUnknown, ...]:
        """The strain, and the curvatures that are not held at zero."""
        t, given = self.thickness, self.amplitude
        out = [
            SharedUnknown(
                title="strain_zz",
                answer="force_zz",
                unknown=_COMPONENTS,
                per_unknown=1.0 / t,
                per_reaction=1.0,
                factor=None,
                prescribed=self.strain_zz,
                load=self.force_zz,
                amplitude=given,
            )
        ]
        for axis, value in enumerate((self.curvature_x, self.curvature_y)):
            if value is None or value != 0.0:
                out.append(
                    SharedUnknown(
                        title=f"curvature_{'xy'[axis]}",
                        answer=f"moment_{'xy'[axis]}",
                        unknown=_COMPONENTS + len(out),
                        per_unknown=1.0 / t**2,
                        per_reaction=t,
                        factor=axis,
                        prescribed=value,
                        load=0.0,
                        amplitude=given,
                    )
                )
        return tuple(out)

    @property
    def n_unknowns(self) -> int:
        """Unknowns of a node: displacement, then the numbers it shares with all others."""
        return _COMPONENTS + len(self.shared)

    def strain(self, u: Any, x: Any) -> Any:
        """Voigt strain (xx, yy, zz, yz, xz, xy) of the UFL unknowns."""
        out = 0
        for one in self.shared:
            factor = one.per_unknown if one.factor is None else one.per_unknown * x[one.factor]
            out += factor * u[one.unknown]
        return ufl.as_vector(
            [
                u[0].dx(0),
                u[1].dx(1),
                out,
                u[2].dx(1),
                u[2].dx(0),
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
        """Factor of the area element: the thickness, length."""
        return self.thickness

    def breadth(self, x: Array) -> Array:
        """Out-of-plane extent of the interface at points x, shape (n, 3) to (n,), length."""
        return np.full(len(x), self.thickness)


def shared_unknowns(model: Any) -> tuple[SharedUnknown, ...]:
    """The numbers that all nodes of a model share; none in most models."""
    return model.shared if isinstance(model, GeneralisedPlaneStrain) else ()


__all__ = ["GeneralisedPlaneStrain", "SharedUnknown", "shared_unknowns"]
