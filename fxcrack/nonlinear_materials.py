"""Materials whose stress is no linear function of the small strain.

Constants only; the forms are in :mod:`fxcrack.terms`. Each has the stiffness of its unstrained
state, so that it may also stand in a linear scene.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.errors import InputError
from fxcrack.materials import Isotropic

Array = npt.NDArray[np.float64]


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
        if isinstance(self.hardening, int | float):
            if self.yield_stress is None or not (
                np.isfinite(self.yield_stress) and self.yield_stress > 0.0
            ):
                raise InputError(f"Plastic: yield_stress = {self.yield_stress} must be positive")
            if not (np.isfinite(self.hardening) and self.hardening >= 0.0):
                raise InputError(
                    f"Plastic: hardening = {self.hardening} must not be negative (no softening)"
                )
            return
        table = np.asarray(self.hardening, dtype=np.float64)
        if table.ndim != 2 or table.shape[1] != 2 or not np.all(np.isfinite(table)):
            raise InputError(
                "Plastic: hardening must be a number or pairs (equivalent plastic strain, stress)"
            )
        if table[0, 0] != 0.0 or table[0, 1] <= 0.0 or np.any(np.diff(table[:, 0]) <= 0.0):
            raise InputError(
                f"Plastic: plastic strains {table[:, 0]} must start at 0 and increase, and the "
                f"first stress {table[0, 1]} must be positive"
            )
        if np.any(np.diff(table[:, 1]) < 0.0):
            raise InputError(f"Plastic: yield stresses {table[:, 1]} must not fall (no softening)")
        if self.yield_stress is not None and self.yield_stress != table[0, 1]:
            raise InputError(
                f"Plastic: yield_stress = {self.yield_stress} contradicts the first entry "
                f"{table[0, 1]} of the table; leave it out"
            )

    def curve(self) -> tuple[Array, Array, Array]:
        """Knots of the plastic strain, yield stress there and slope after each."""
        if isinstance(self.hardening, int | float):
            assert self.yield_stress is not None
            first, slope = float(self.yield_stress), float(self.hardening)
            return np.zeros(1), np.array([first]), np.array([slope])
        strain, stress = np.asarray(self.hardening, dtype=np.float64).T
        return strain, stress, np.append(np.diff(stress) / np.diff(strain), 0.0)
