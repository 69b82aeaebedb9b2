"""Critical crack opening displacement at a distance behind the tip.

    f = d/d_c

d is the normal distance between the two faces, between the points of slave and master surface
that lie on a circle of the given radius around the current tip. Typical for ductile materials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array, not_negative, positive, table
from fxcrack.criteria.path import locate
from fxcrack.errors import InputError


@dataclass(frozen=True)
class CrackOpening:
    """Growth when the opening at a distance behind the tip reaches a critical one.

    Attributes:
        critical: Critical opening [length]: a number, or a table (lengths, values) against the
            cumulative crack length, linear between entries and not extrapolated: before the first
            and beyond the last length the value there holds.
        distance: Straight-line distance behind the current tip [length].
        symmetry: The faces lie on a symmetry plane: half the critical opening is used. Needs a
            bond in the normal direction only.
        tolerance: f_tol; growth is accepted while 1 - f_tol <= f <= 1 + f_tol.
    """

    critical: float | tuple[Sequence[float], Sequence[float]]
    distance: float = field(kw_only=True)
    symmetry: bool = field(default=False, kw_only=True)
    tolerance: float = field(default=0.1, kw_only=True)

    allows_normal_only: ClassVar[bool] = True
    """Whether a bond in the normal direction only is possible."""

    def __post_init__(self) -> None:
        """Check the numbers and the table."""
        owner = "CrackOpening"
        positive(owner, distance=self.distance)
        not_negative(owner, tolerance=self.tolerance)
        if not isinstance(self.critical, tuple):
            positive(owner, critical=self.critical)
            return
        if len(self.critical) != 2:
            raise InputError(
                f"{owner}: critical has {len(self.critical)} parts; give one number, or a table as "
                "(crack lengths, critical openings)"
            )
        lengths, values = table(owner, ("crack lengths", "critical openings"), *self.critical)
        for i, value in enumerate(values):
            positive(owner, **{f"critical openings[{i}]": value})
        object.__setattr__(self, "critical", (lengths, values))

    @property
    def window(self) -> tuple[float, float]:
        """Lower and upper limit of f at which a node may debond."""
        return 1.0 - self.tolerance, 1.0 + self.tolerance

    def check_bond(self, *, normal_only: bool) -> None:
        """Check the criterion against the bond it is used on.

        Args:
            normal_only: Whether the bond holds in the normal direction only.

        Raises:
            InputError: Symmetry with a bond in all directions.
        """
        if self.symmetry and not normal_only:
            raise InputError(
                "CrackOpening: symmetry needs a bond in the normal direction only; bond the "
                "interface so, or model both halves and leave symmetry out"
            )

    def critical_at(self, crack_length: npt.ArrayLike) -> Array:
        """Critical opening, halved for symmetry, of the shape of ``crack_length`` [length].

        Args:
            crack_length: Length along the slave surface from initial to current tip [length].
        """
        grown = np.asarray(crack_length, dtype=np.float64)
        if isinstance(self.critical, tuple):
            values = np.interp(grown, *self.critical)
        else:
            values = np.full(grown.shape, self.critical)
        return np.asarray(values / 2.0 if self.symmetry else values)

    def value(self, opening: npt.ArrayLike, crack_length: npt.ArrayLike = 0.0) -> Array:
        """Value f of the criterion.

        Args:
            opening: Opening at the distance behind each tip, shape (n,) [length].
            crack_length: Length along the slave surface from initial to current tip, shape (n,)
                or one number [length].

        Returns:
            Values, shape (n,). Closed faces (negative openings) give 0.
        """
        return np.asarray(np.maximum(opening, 0.0) / self.critical_at(crack_length))


def opening_behind(
    slave: npt.ArrayLike,
    master: npt.ArrayLike,
    normal: npt.ArrayLike,
    distance: float,
    *,
    order: int,
) -> float:
    """Opening of the faces at a straight-line distance behind the tip.

    Args:
        slave: Current positions of the slave nodes along the wake, the tip first, shape
            (m, dim) [length]; for second order corner, midside, corner, ...
        master: Current positions of the master points, the tip first, shape (k, dim) [length].
        normal: Direction from master to slave, of any length, shape (dim,).
        distance: Distance from the tip [length].
        order: Order of the faces, 1 or 2.

    Returns:
        Distance between the two points along the normal [length]; negative where faces overlap.

    Raises:
        InputError: The distance lies outside the end points of a surface.
    """
    points = []
    for name, nodes in (("slave", slave), ("master", master)):
        x = np.asarray(nodes, dtype=np.float64)
        rows, weights = locate(f"CrackOpening, {name} surface", x, distance, order)
        points.append(weights @ x[rows])
    n = np.asarray(normal, dtype=np.float64)
    length = float(np.linalg.norm(n))
    if not 0.0 < length < np.inf:
        raise InputError(f"CrackOpening: the normal {n.tolist()} has no direction")
    return float((points[0] - points[1]) @ n / length)
