"""Critical stress at a distance ahead of the tip, measured along the slave surface.

    f = sqrt((s_n/s_f)^2 + (t_1/t1_f)^2 + (t_2/t2_f)^2),    s_n = max(normal stress, 0)

Typical for brittle materials. A shear strength not given has no effect.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array, not_negative, number, positive
from fxcrack.criteria.toughness import Tabulated
from fxcrack.errors import InputError


@dataclass(frozen=True)
class CriticalStress:
    """Growth when the stress at a distance ahead of the tip reaches the strength.

    Attributes:
        sigma_f: Normal strength [stress], a number or a table against temperature.
        tau1_f: Shear strength in the growth direction [stress], likewise; None or 0: no effect.
        tau2_f: Shear strength along the front [stress], likewise; None or 0: no effect; 3-D only.
        distance: Distance ahead of the tip along the slave surface [length].
        tolerance: f_tol; growth is accepted while 1 - f_tol <= f <= 1 + f_tol.
    """

    sigma_f: float | Tabulated
    tau1_f: float | Tabulated | None = None
    tau2_f: float | Tabulated | None = None
    distance: float = field(kw_only=True)
    tolerance: float = field(default=0.1, kw_only=True)

    allows_normal_only: ClassVar[bool] = True
    """Whether a bond in the normal direction only is possible."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        owner = "CriticalStress"
        not_negative(owner, distance=self.distance, tolerance=self.tolerance)
        if not isinstance(self.sigma_f, Tabulated):
            positive(owner, sigma_f=self.sigma_f)
        for name, value in (("tau1_f", self.tau1_f), ("tau2_f", self.tau2_f)):
            if value is None or isinstance(value, Tabulated):
                continue
            if number(owner, name, value) < 0.0:
                raise InputError(
                    f"{owner}: {name} = {value} must be positive; None or 0 for no effect"
                )

    @property
    def window(self) -> tuple[float, float]:
        """Lower and upper limit of f at which a node may debond."""
        return 1.0 - self.tolerance, 1.0 + self.tolerance

    def strength(self, temperature: npt.ArrayLike | None = None) -> Array:
        """Strengths (normal, along growth, along the front), infinite where there is no effect.

        Args:
            temperature: Temperature at the front nodes, shape (n,) or one number; None without.

        Returns:
            Strengths, shape (3,), or (n, 3) with n temperatures [stress].

        Raises:
            InputError: A strength depends on temperature and none is given.
        """
        columns = []
        for name in ("sigma_f", "tau1_f", "tau2_f"):
            value = getattr(self, name)
            if isinstance(value, Tabulated):
                if temperature is None:
                    raise InputError(
                        f"CriticalStress: {name} depends on temperature, but the debond has none; "
                        "give Debond(temperature=...), or the strength as a number"
                    )
                columns.append(value.at(temperature))
            else:
                columns.append(np.asarray(value if value else np.inf, dtype=np.float64))
        return np.stack(np.broadcast_arrays(*columns), axis=-1)

    def value(self, traction: npt.ArrayLike, temperature: npt.ArrayLike | None = None) -> Array:
        """Value f of the criterion.

        Args:
            traction: Bond traction at the distance ahead of the tip, tension positive, as (normal,
                growth direction, front tangent), shape (n, 3) [stress].
            temperature: Temperature there, shape (n,) or one number; None without temperatures.

        Returns:
            Values, shape (n,). Compression does not count.

        Raises:
            InputError: A strength depends on temperature and none is given.
        """
        t = np.array(traction, dtype=np.float64)
        t[..., 0] = np.maximum(t[..., 0], 0.0)
        relative = t / self.strength(temperature)
        return np.asarray(np.hypot(np.hypot(relative[..., 0], relative[..., 1]), relative[..., 2]))
