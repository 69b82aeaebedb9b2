"""Materials whose stress is no linear function of the small strain.

Constants only; the forms are in :mod:`fxcrack.terms`. Each has the stiffness of its unstrained
state, so that it may also stand in a linear scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fxcrack.materials import Isotropic


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
