"""Continuum shells: thin hexahedra with displacements alone and a laminate across them.

User input; :mod:`fxcrack.continuum.shell_cells` puts it on the cells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import keep, numbers, shown
from fxcrack.base.errors import InputError
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.materials import Material
from fxcrack.continuum.ply import Ply

Axis = tuple[float, float, float] | Callable[[Array], Array]
"""A global direction, or a function of positions, shape (3, n) to directions of that shape."""


@dataclass(frozen=True, eq=False)
class ContinuumShell:
    """Material of thin hexahedra, one or more across the thickness.

    The cells may be thin and curved without locking, for small strain and for
    :class:`fxcrack.FiniteStrain`. Of second order (27 nodes) they are integrated with reduced
    points (:mod:`fxcrack.continuum.reduced_integration`), of first order (8 nodes) their strains
    are tied and enhanced (:mod:`fxcrack.continuum.tied_cells`): as with solids the order is that of
    the mesh, or ``Scene(order=...)``. Take second order where accuracy counts, first order in
    explicit dynamics, which has no other, and with much contact. Any number of plies may lie in
    one cell: the stiffness over the thickness is the polynomial with the moments of the plies. The
    faces of the cells are ordinary faces: interfaces, loads and supports take them by name.

    Args:
        section: A laminate over the whole thickness, or one material.
        bottom: Facet group below the cells, where the first ply is.
        top: Facet group above the cells.
        axis: Direction from which the angles of the plies are measured: a vector or a function of
            position, projected into the plane of the cell. Needed unless every ply is isotropic
            in its plane.
        shear_factors: Factors (k13, k23) of the transverse shear moduli; those of equilibrium
            by default where there is one cell across the thickness
            (:meth:`fxcrack.Laminate.shear_factors`), 1 where there are more.

    Raises:
        InputError: An argument is of the wrong kind, or an axis is missing.
    """

    section: Laminate | Material
    bottom: str
    top: str
    axis: Axis | None = None
    shear_factors: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check the arguments."""
        laminate = self.laminate
        for name in ("bottom", "top"):
            given = getattr(self, name)
            if not isinstance(given, str):
                raise InputError(
                    f"ContinuumShell: {name} = {shown(given)} must be the name of a group of faces"
                )
        if self.bottom == self.top:
            raise InputError(
                f"ContinuumShell: bottom and top are both '{self.bottom}'; name the faces on "
                "either side of the cells"
            )
        if self.axis is None and not laminate.is_isotropic_in_plane:
            raise InputError(
                "ContinuumShell: angles of plies need the direction they are measured from; give "
                "e.g. axis=(1, 0, 0)"
            )
        if self.axis is not None and not callable(self.axis):
            axis = numbers("ContinuumShell", "axis", self.axis, 3)
            keep(self, axis=axis)
            if not any(axis):
                raise InputError("ContinuumShell: axis = (0, 0, 0) has no direction")
        if self.shear_factors is not None:
            k = numbers("ContinuumShell", "shear_factors", self.shear_factors, 2, words="k13, k23")
            if not all(0.0 < value <= 1.0 for value in k):
                raise InputError(
                    f"ContinuumShell: shear_factors = {k} must be two numbers (k13, k23), above 0 "
                    "and at most 1"
                )
            keep(self, shear_factors=k)

    @property
    def laminate(self) -> Laminate:
        """The section as a laminate; its thickness is 1 for a section of one material."""
        if isinstance(self.section, Laminate):
            return self.section
        return Laminate([Ply(1.0)], material=self.section)

    @property
    def density(self) -> float | None:
        """Mass per volume; ``None`` where a ply has none."""
        return self.laminate.density

    def thermal_expansion(self) -> Array:
        """Mean thermal strain per degree in laminate axes, shape (6,), 1/temperature."""
        plies = self.laminate.plies
        return np.asarray(sum(p.thickness * p.thermal_expansion() for p in plies)) / (
            self.laminate.thickness
        )

    def stiffness(self) -> Array:
        """Refuse: the stiffness, shape (6, 6), is that of a place in a cell.

        Raises:
            InputError: Always: something treats the cells as those of a solid material.
        """
        raise InputError(
            "ContinuumShell: this analysis knows solid materials only; give the laminate itself "
            "as the material (the homogeneous body), or cells for each ply (laminate.layers)"
        )


__all__ = ["ContinuumShell"]
