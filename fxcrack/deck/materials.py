"""Materials of a deck as materials of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base.errors import InputError
from fxcrack.continuum.materials import Isotropic, Material, NeoHookean, Orthotropic, Plastic
from fxcrack.continuum.temperature import ByTemperature
from fxcrack.deck.cards import Card, Row
from fxcrack.deck.elements import ElementType
from fxcrack.deck.model import Family
from fxcrack.deck.report import Report

Frame = tuple[tuple[float, float, float], tuple[float, float, float]]
GLOBAL: Frame = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Axes 1 and 2 of a material along x and y."""
_NEARLY_INCOMPRESSIBLE = 0.49


class Materials:
    """Makes materials of the scene from those of the deck.

    Args:
        families: Cards of each material by its key.
        kind: Elements of the deck.
        report: Takes what is replaced.

    Attributes:
        zeros: Temperatures to which expansions tabulated against temperature refer.
    """

    def __init__(self, families: Mapping[str, Family], kind: ElementType, report: Report) -> None:
        self._families, self._kind, self._report = families, kind, report
        self.zeros: set[float] = set()

    def __contains__(self, name: str) -> bool:
        """Whether there is a material of a key."""
        return name in self._families

    def has_axes(self, name: str) -> bool:
        """Whether a material differs along its axes."""
        family = self._families[name]
        elastic, expansion = family.first("ELASTIC"), family.first("EXPANSION")
        isotropic = elastic is None or elastic.word("TYPE", "ISO") in ("ISO", "ISOTROPIC")
        return not isotropic or (expansion is not None and expansion.word("TYPE") == "ORTHO")

    def damping(self, names: Sequence[str]) -> set[tuple[float, float]]:
        """Pairs of damping by mass and by stiffness of some materials."""
        cards = [self._families[name].first("DAMPING") for name in names]
        return {
            (0.0, 0.0) if c is None else (c.number("ALPHA", 0.0), c.number("BETA", 0.0))
            for c in cards
        }

    def make(self, name: str, frame: Frame = GLOBAL) -> Material:
        """The material of a key with its axes 1 and 2 along two directions.

        Raises:
            DeckError: A card is missing, or is not available.
        """
        family = self._families[name]
        try:
            return self._make(family, frame)
        except InputError as error:
            if type(error) is not InputError:
                raise
            return family.card.fail(f"'{family.name}': {error}")

    def _make(self, family: Family, frame: Frame) -> Material:
        elastic, hyper = family.first("ELASTIC"), family.first("HYPERELASTIC")
        plastic = family.first("PLASTIC")
        density = _density(family.first("DENSITY"))
        expansion = self._expansion(family.first("EXPANSION"))
        if expansion.differs and (hyper is not None or plastic is not None):
            family.card.fail(
                "thermal strains that differ along axes are not available in bodies that yield or "
                "are hyperelastic"
            )
        if hyper is not None:
            if elastic is not None or plastic is not None:
                hyper.fail("a hyperelastic material has neither *ELASTIC nor *PLASTIC")
            return self._neo_hookean(hyper, density, expansion)
        if elastic is None:
            family.card.fail(f"material '{family.name}' has no *ELASTIC; add it")
        kind = elastic.word("TYPE", "ISOTROPIC")
        if kind in ("ISO", "ISOTROPIC"):
            if expansion.differs and plastic is None:
                return self._orthotropic(elastic, kind, density, expansion, frame)
            return self._isotropic(elastic, plastic, density, expansion)
        if plastic is not None:
            plastic.fail("plasticity needs an isotropic *ELASTIC")
        return self._orthotropic(elastic, kind, density, expansion, frame)

    def _isotropic(
        self,
        card: Card,
        plastic: Card | None,
        density: float | None,
        expansion: _Expansion,
    ) -> Material:
        rows = card.need_rows("Young's modulus, Poisson's ratio")
        table = [(r.number(0), r.number(1, 0.0), r.number(2, 0.0)) for r in rows]
        for row, (_, nu, _) in zip(rows, table, strict=True):
            if "H" in self._kind.name and nu > _NEARLY_INCOMPRESSIBLE:
                row.fail(
                    f"nu = {nu} on hybrid elements, which are replaced by displacements alone and "
                    "would lock; nearly incompressible bodies are not available"
                )
        if plastic is not None:
            if len(table) > 1 or len(expansion.temperatures) > 1:
                plastic.fail("a plastic material cannot be tabulated against temperature")
            e, nu, _ = table[0]
            return Plastic(e, nu, expansion.one()[0], density, hardening=_hardening(plastic))
        temperatures = _merged(card, [t for _, _, t in table], expansion)
        if not temperatures:
            return Isotropic(table[0][0], table[0][1], expansion.one()[0], density)
        knots = [t for _, _, t in table]
        return ByTemperature(
            {
                t: Isotropic(
                    _at(t, knots, [e for e, _, _ in table]),
                    _at(t, knots, [n for _, n, _ in table]),
                    expansion.at(t)[0],
                    density,
                )
                for t in temperatures
            }
        )

    def _orthotropic(
        self,
        card: Card,
        kind: str,
        density: float | None,
        expansion: _Expansion,
        frame: Frame,
    ) -> Material:
        constants: list[tuple[float, ...]] = []
        knots: list[float] = []
        if kind == "LAMINA":
            shell = self._kind.shell
            if self._kind.model != "plane stress" and not shell:
                card.fail(
                    "TYPE=LAMINA is for plane stress and shells; give ENGINEERING CONSTANTS for "
                    "these elements"
                )
            for row in card.need_rows("E1, E2, nu12, G12, G13, G23"):
                e1, e2, nu, g12 = (row.number(i) for i in range(4))
                g13, g23 = row.number(4, g12), row.number(5, g12)
                # without nu13 and nu23 the thickness strain of a shell leaves the plies alone
                constants.append((e1, e2, e2, nu, 0.0 if shell else nu, 0.0, g12, g13, g23))
                knots.append(row.number(6, 0.0))
        elif kind in ("ISO", "ISOTROPIC"):
            for row in card.need_rows("Young's modulus, Poisson's ratio"):
                e, nu = row.number(0), row.number(1, 0.0)
                shear = e / (2.0 * (1.0 + nu))
                constants.append((e, e, e, nu, nu, nu, shear, shear, shear))
                knots.append(row.number(2, 0.0))
        elif kind in ("ENGINEERINGCONSTANTS", "ORTHOTROPIC"):
            flat = [x for row in card.need_rows("nine constants") for x in _padded(row)]
            for start in range(0, len(flat), 16):
                part = flat[start : start + 16]
                if len(part) < 9:
                    card.fail(f"TYPE={kind} needs nine constants, eight of them on the first line")
                nine, t = part[:9], part[9] if len(part) > 9 else 0.0
                constants.append(tuple(nine) if kind[0] == "E" else _engineering(card, nine))
                knots.append(t)
        else:
            card.fail(
                f"TYPE={card.text('TYPE')} is not available; ISOTROPIC, ENGINEERING CONSTANTS, "
                "ORTHOTROPIC and (in plane stress) LAMINA are"
            )
        temperatures = _merged(card, knots, expansion)

        def made(nine: tuple[float, ...], strains: tuple[float, ...]) -> Orthotropic:
            e1, e2, e3, nu12, nu13, nu23, g12, g13, g23 = nine
            return Orthotropic(
                (e1, e2, e3), (nu12, nu13, nu23), (g12, g13, g23), frame,
                (strains[0], strains[1], strains[2]), density,
            )  # fmt: skip

        if not temperatures:
            return made(constants[0], expansion.one())
        columns = list(zip(*constants, strict=True))
        return ByTemperature(
            {
                t: made(tuple(_at(t, knots, c) for c in columns), expansion.at(t))
                for t in temperatures
            }
        )

    def _neo_hookean(self, card: Card, density: float | None, expansion: _Expansion) -> Material:
        if not card.has("NEO HOOKE"):
            card.fail("only *HYPERELASTIC, NEO HOOKE is available")
        row = card.need_rows("C10, D1")[0]
        if len(card.lines) > 1 or len(expansion.temperatures) > 1:
            card.fail("a neo-Hookean material cannot be tabulated against temperature")
        c10, d1 = row.number(0), row.number(1, 0.0)
        if not (c10 > 0.0 and d1 > 0.0):
            row.fail(
                "C10 and D1 must be positive; incompressible bodies (D1 = 0) are not available"
            )
        mu, bulk = 2.0 * c10, 2.0 / d1
        self._report.replace(
            "the volumetric part is lambda/2 (ln J)^2 with the same moduli at zero strain", card
        )
        e = 9.0 * bulk * mu / (3.0 * bulk + mu)
        nu = (3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu))
        return NeoHookean(e, nu, expansion.one()[0], density)

    def _expansion(self, card: Card | None) -> _Expansion:
        if card is None:
            return _Expansion([0.0], [(0.0, 0.0, 0.0)])
        kind = card.choose("TYPE", ("ISO", "ORTHO"), "ISO")
        n = 1 if kind == "ISO" else 3
        temperatures, values = [], []
        for row in card.need_rows("thermal strain per degree"):
            given = [row.number(i) for i in range(n)]
            values.append((given[0],) * 3 if n == 1 else (given[0], given[1], given[2]))
            temperatures.append(row.number(n, 0.0))
        if len(values) > 1:
            self.zeros.add(card.number("ZERO", 0.0))
        return _Expansion(temperatures, values)


@dataclass(frozen=True)
class _Expansion:
    """Thermal strains per degree along three axes, against temperature."""

    temperatures: list[float]
    values: list[tuple[float, float, float]]

    @property
    def differs(self) -> bool:
        """Whether it is not the same along all axes."""
        return any(len(set(row)) > 1 for row in self.values)

    def one(self) -> tuple[float, float, float]:
        return self.values[0]

    def at(self, t: float) -> tuple[float, float, float]:
        a, b, c = (_at(t, self.temperatures, column) for column in zip(*self.values, strict=True))
        return a, b, c


def _padded(row: Row) -> list[float]:
    numbers = row.numbers()
    return numbers + [0.0] * (8 - len(numbers)) if row.index % 2 == 0 else (numbers + [0.0] * 8)[:8]


def _engineering(card: Card, d: list[float]) -> tuple[float, ...]:
    """Engineering constants from D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, D2323."""
    stiffness = np.array([[d[0], d[1], d[3]], [d[1], d[2], d[4]], [d[3], d[4], d[5]]])
    try:
        s = np.linalg.inv(stiffness)
    except np.linalg.LinAlgError:
        card.fail("the stiffness is singular; look at the order of the constants")
    e = 1.0 / np.diag(s)
    return (*e, -s[0, 1] * e[0], -s[0, 2] * e[0], -s[1, 2] * e[1], d[6], d[7], d[8])


def _at(t: float, knots: list[float], values: object) -> float:
    order = np.argsort(knots)
    return float(np.interp(t, np.asarray(knots)[order], np.asarray(values)[order]))


def _merged(card: Card, knots: list[float], expansion: _Expansion) -> list[float]:
    """Temperatures at which stiffness or expansion are given; none where neither depends on it."""
    found: set[float] = set()
    for given in (knots, expansion.temperatures):
        if len(given) > 1:
            if len(set(given)) < len(given):
                card.fail("a temperature is given twice in a table; give each once")
            found |= set(given)
    return sorted(found)


def _density(card: Card | None) -> float | None:
    if card is None:
        return None
    if len(card.lines) > 1:
        card.fail("a density that depends on temperature is not available; give one number")
    return card.need_rows("mass per volume")[0].number(0)


def _hardening(card: Card) -> tuple[tuple[float, float], ...]:
    card.choose("HARDENING", ("ISOTROPIC",), "ISOTROPIC")
    rows = card.need_rows("yield stress, plastic strain")
    if any(row.text(2) for row in rows) and len({row.text(2) for row in rows}) > 1:
        card.fail("yield stresses that depend on temperature are not available")
    return tuple((row.number(1, 0.0), row.number(0)) for row in rows)


__all__ = ["GLOBAL", "Frame", "Materials"]
