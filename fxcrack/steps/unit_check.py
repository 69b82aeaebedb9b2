"""Units that do not belong together, told by a number without units.

fxcrack has no units: lengths, forces and what follows from them must be of one system. Moduli in Pa
beside lengths in mm make bodies a million times too stiff and loads of growth a thousand times too
large, without any other sign. At growth the strain beside a crack tip is about the square root of
G_c/(E l), l the length of an element there: 1e-3 to 1e-1 in what breaks by delamination. E is that
of the softest body, as a tool or a substrate may be made as stiff as one likes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base import log
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.materials import Isotropic, Orthotropic
from fxcrack.continuum.temperature_field import entries
from fxcrack.steps.crack import Crack

_TOO_SMALL = 1e-10
"""G_c/(E l) that no bond has: 2e-6 for 0.2 N/mm, 70 GPa and 1.5 mm, a millionth of that with Pa."""


def warn_of_units(cracks: Sequence[Crack], continuum: Continuum, said: set[str]) -> None:
    """Warn, once, of a toughness that is far too small for the moduli and the mesh.

    Args:
        cracks: The cracks that may grow.
        continuum: The bodies; solids of isotropic and orthotropic materials are looked at.
        said: What was warned of before; "units" is added.
    """
    every = [m for part in continuum.part_materials for m in entries(part)]
    # other materials have no stiffness of their own, or one of another meaning
    elastic = [m for m in every if isinstance(m, Isotropic | Orthotropic)]
    moduli = [float(np.diag(m.stiffness()).max()) for m in elastic]
    if "units" in said or not moduli:
        return
    for g in cracks:
        # an evaluator of the user's own may have none, or one of another shape
        toughness = getattr(g.evaluator, "toughness", None)
        if toughness is None or np.ndim(toughness) != 2 or not np.any(toughness[:, 0] > 0.0):
            continue
        given = float(toughness[:, 0].max())
        size = float(g.front.surface.facet_size)
        ratio = given / (min(moduli) * size)
        if ratio < _TOO_SMALL:
            said.add("units")
            log.warn(
                "interface '%s': toughness %.3g, moduli from %.3g on and elements %.3g long let "
                "the bodies strain by about %.1g at growth, far less than any material; are they "
                "of one system of units? With lengths in mm and forces in N moduli are in MPa and "
                "toughness is in N/mm; with m and N in Pa and J/m^2",
                g.title,
                given,
                min(moduli),
                size,
                np.sqrt(ratio),
            )
            return


__all__ = ["warn_of_units"]
