"""Plots of histories, fronts and deformed meshes.

Importing this package loads matplotlib, so the package ``fxcrack`` imports it on first use only.
"""

from fxcrack.output.plots.curves import (
    growth_rows,
    load_curve,
    load_opening,
    r_curve,
    resistance,
)
from fxcrack.output.plots.deformed import deformed
from fxcrack.output.plots.energies import energies
from fxcrack.output.plots.fatigue import paris, tip_growth
from fxcrack.output.plots.front_advance import front_advance

__all__ = [
    "deformed",
    "energies",
    "front_advance",
    "growth_rows",
    "load_curve",
    "load_opening",
    "paris",
    "r_curve",
    "resistance",
    "tip_growth",
]
