"""``*INITIAL CONDITIONS, TYPE=STRESS``: stress of the bodies before the first step.

A body under a stress s0 that is elastic about it is one that is free of stress at the strain
e0 = -C^-1 s0. It is computed as a thermal strain whose factor stays 1 after the first step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.materials import Isotropic, Material, Orthotropic
from fxcrack.continuum.temperature import ByTemperature, Temperature
from fxcrack.deck.cards import Card
from fxcrack.deck.flat import Flat
from fxcrack.deck.procedures import Procedure
from fxcrack.deck.report import Report

_TINY = 1e-12
Stress = tuple[float, ...]
"""Components 11, 22, 33, 12, 13, 23."""
NONE: Stress = (0.0,) * 6


class InitialStress:
    """Initial stress of all cells.

    Args:
        cards: The cards.
        flat: The model.

    Attributes:
        card: The first card, None without.

    Raises:
        DeckError: A card cannot be read, or the elements or steps have no initial stress here.
    """

    def __init__(self, cards: Sequence[Card], flat: Flat) -> None:
        self.card = cards[0] if cards else None
        self._plane = flat.kind.gdim == 2
        self._thin = flat.kind.model == "plane stress"
        self._values = np.zeros((len(flat.cells), 6))
        for card in cards:
            if flat.kind.shell or flat.kind.stacked:
                card.fail("initial stresses of shells are not available; take solids")
            for row in card.need_rows("element or set, stress components"):
                cells = flat.elements(card, row.text(0), row.index)
                n = 4 if self._plane else 6
                found = [row.number(1 + i, 0.0) for i in range(n)]
                if any(row.text(i) for i in range(n + 1, len(row))):
                    row.fail(f"there are {len(row) - 1} components; these elements have {n}")
                if self._thin and found[2]:
                    row.fail("the third component is normal to the plane, where it is 0")
                self._values[cells, :n] = found

    def parts(self, cells: Ints) -> list[tuple[Stress, Ints]]:
        """Cells of each stress among some cells."""
        if self.card is None:
            return [(NONE, cells)]
        rows, which = np.unique(self._values[cells], axis=0, return_inverse=True)
        return [
            (tuple(float(v) for v in row), cells[which.ravel() == i]) for i, row in enumerate(rows)
        ]

    def of(self, material: Material, stress: Stress) -> Material:
        """A material with an initial stress, free of stress at another strain.

        Raises:
            DeckError: It is of another kind, or the stress is not along its axes.
        """
        if self.card is None or not self._values.any():
            return material
        if isinstance(material, ByTemperature):
            self.card.fail("initial stresses beside tables against temperature are not available")
        if not any(stress):
            # the deck has no temperatures, in which an expansion could act
            return replace(material, expansion=0.0)  # type: ignore[type-var]
        if type(material) not in (Isotropic, Orthotropic):  # bodies that yield are no such
            self.card.fail("initial stresses need linear elastic materials")
        assert isinstance(material, Isotropic | Orthotropic)
        s = np.array(stress)
        if isinstance(material, Orthotropic):
            if np.abs(s[3:]).max() > _TINY * np.abs(s).max():
                self.card.fail("an orthotropic material has normal initial stresses along its axes")
            return replace(material, expansion=_strain(material.E, material.nu, s[:3]))
        e, nu = material.E, material.nu
        tensor = np.array([[s[0], s[3], s[4]], [s[3], s[1], s[5]], [s[4], s[5], s[2]]])
        axes = np.eye(3)
        if self._plane and s[3]:
            axes[:2, :2] = np.linalg.eigh(tensor[:2, :2])[1].T
        elif np.any(s[3:]):
            axes = np.linalg.eigh(tensor)[1].T
        if np.linalg.det(axes) < 0.0:
            axes[0] = -axes[0]
        principal = np.einsum("ij,jk,ik->i", axes, tensor, axes)
        strain = _strain((e,) * 3, (nu,) * 3, principal)
        one, two = axes[:2].tolist()
        shear = e / (2.0 * (1.0 + nu))
        return Orthotropic(
            (e, e, e), (nu, nu, nu), (shear, shear, shear),
            ((one[0], one[1], one[2]), (two[0], two[1], two[2])), strain, material.density,
        )  # fmt: skip

    def effects(self, procedures: Sequence[Procedure], report: Report) -> list[Temperature]:
        """The effect that brings the strain, none without initial stress.

        Raises:
            DeckError: The first step is dynamic.
        """
        if self.card is None or not self._values.any():
            return []
        first = procedures[0] if procedures else None
        if first is not None and first.inertia is not None:
            self.card.fail("initial stresses need a *STATIC first step, in which they find balance")
        how = self.card.choose("UNBALANCED STRESS", ("RAMP", "STEP"), "RAMP")
        if first is None or how == "STEP":
            return [Temperature([(0.0, 1.0)], 0.0)]
        report.replace(
            "the initial stress comes in over the first step, in proportion to time", self.card
        )
        return [Temperature([(0.0, 0.0), (first.period.end, 1.0)], 0.0)]


def _strain(e: Sequence[float], nu: Sequence[float], s: Array) -> tuple[float, float, float]:
    """Minus the strain of normal stresses along the axes of a material."""
    nu12, nu13, nu23 = nu
    compliance = np.array(
        [
            [1.0 / e[0], -nu12 / e[0], -nu13 / e[0]],
            [-nu12 / e[0], 1.0 / e[1], -nu23 / e[1]],
            [-nu13 / e[0], -nu23 / e[1], 1.0 / e[2]],
        ]
    )
    a, b, c = (-compliance @ s).tolist()
    return a, b, c


__all__ = ["NONE", "InitialStress", "Stress"]
