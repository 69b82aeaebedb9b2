"""Materials, orientations and sections of a deck as materials of the scene, one per section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.kinematics import Axisymmetric, Model, PlaneStrain, PlaneStress, Shell, Solid
from fxcrack.continuum.laminate import Laminate, Ply
from fxcrack.continuum.materials import Isotropic, Material, NeoHookean, Orthotropic, Plastic
from fxcrack.continuum.section import Section
from fxcrack.continuum.temperature import ByTemperature
from fxcrack.deck.cards import Card, DeckError, Row, key
from fxcrack.deck.flat import Flat
from fxcrack.deck.generators import axis_rotation
from fxcrack.deck.groups import Groups
from fxcrack.deck.initial_stress import InitialStress, Stress
from fxcrack.deck.model import Family
from fxcrack.deck.report import Report
from fxcrack.deck.shells import cell_normals, is_isotropic, section_axis, surface_section
from fxcrack.deck.spaces import Space

Frame = tuple[tuple[float, float, float], tuple[float, float, float]]
_GLOBAL: Frame = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
_NEARLY_INCOMPRESSIBLE = 0.49


@dataclass(frozen=True)
class Sections:
    """What the cells are made of.

    Attributes:
        materials: Material of each group of cells.
        sets: Element sets of the section cards that give it, of each of these groups.
        model: Kinematic model with its thickness.
        zero: Temperature to which secant expansions tabulated against it refer, None without.
        rayleigh: Damping by mass and stiffness.
    """

    materials: dict[str, Material | Section]
    sets: dict[str, list[str]]
    model: Model | Shell
    zero: float | None
    rayleigh: tuple[float, float]


def read_sections(flat: Flat, groups: Groups, report: Report, stresses: InitialStress) -> Sections:
    """Materials of all cells.

    Args:
        flat: The model.
        groups: Takes the cells of each section.
        report: Takes what is replaced.
        stresses: Initial stress of the cells.

    Raises:
        DeckError: A cell has no section or two different ones, or a section or material is not
            available.
    """
    return _Sections(flat, groups, report, stresses).read()


class _Sections:
    def __init__(self, flat: Flat, groups: Groups, report: Report, stresses: InitialStress) -> None:
        self._flat, self._groups, self._report = flat, groups, report
        self._stresses = stresses
        self._materials = flat.model.materials
        self._zeros: set[float] = set()

    def read(self) -> Sections:
        flat = self._flat
        owner = np.full(len(flat.cells), -1, dtype=np.int64)
        kinds: list[tuple[str | Card, Frame, float, Stress]] = []
        cards: list[tuple[Card, str]] = []
        titles: list[list[str]] = []
        spaces: list[Space] = []
        for place, placed in flat.placed.items():
            for card in placed.space.sections:
                cells = flat.in_space(place, card, card.text("ELSET"))
                self._check_elements(card, cells, placed.space)
                is_shell = card.keyword == "SHELLSECTION"
                what = card if is_shell else self._known(card)
                frame = self._frame(card, placed.space)
                thickness = 1.0 if is_shell else self._thickness(card)
                title = (f"{placed.space.name}." if place else "") + card.text("ELSET")
                for stress, part in self._stresses.parts(cells):
                    kind = what, frame, thickness, stress
                    if kind not in kinds:
                        kinds.append(kind)
                        spaces.append(placed.space)
                        cards.append((card, title))
                        titles.append([])
                    i = kinds.index(kind)
                    titles[i].append(title)
                    both = part[(owner[part] >= 0) & (owner[part] != i)]
                    if len(both):
                        first = cards[int(owner[both[0]])][0]
                        card.fail(
                            f"{len(both)} elements of '{card.text('ELSET')}' have another section "
                            f"already ({first.place}); give every element one"
                        )
                    owner[part] = i
        lost: Ints = np.flatnonzero(owner < 0).astype(np.int64)
        if len(lost):
            self._fail_lost(lost)
        used = sorted(set(owner.tolist()))
        all_of = {kinds[i][2] for i in used}
        if len(all_of) > 1:
            cards[used[1]][0].fail(
                f"the sections have different thicknesses ({', '.join(map(str, all_of))}); a "
                "plane model has one"
            )
        damping = {pair for i in used for pair in self._damping(kinds[i][0])}
        if len(damping) > 1:
            cards[used[1]][0].fail(
                "the materials have different *DAMPING; all bodies must have the same"
            )
        materials: dict[str, Material | Section] = {}
        sets: dict[str, list[str]] = {}
        for i in used:
            name = self._groups.cells(cards[i][1], np.flatnonzero(owner == i), words="elements")
            sets[name] = titles[i]
            what, frame, _, stress = kinds[i]
            if isinstance(what, Card) and flat.kind.shell:
                cells = np.flatnonzero(owner == i)
                materials[name] = self._surface_section(what, cells, spaces[i])
            elif isinstance(what, Card):
                materials[name] = self._shell(what, name, np.flatnonzero(owner == i), frame)
            else:
                made = self._material(self._materials[what], frame)
                materials[name] = self._stresses.of(made, stress)
        return Sections(
            materials,
            sets,
            self._model(all_of.pop()),
            next(iter(self._zeros)) if len(self._zeros) == 1 else None,
            damping.pop(),
        )

    def _fail_lost(self, lost: Ints) -> None:
        for placed in self._flat.placed.values():
            inside = np.flatnonzero(np.isin(placed.cells, lost))
            if len(inside):
                number = int(placed.cell_labels[inside[0]])
                card = next(iter(placed.space.elements.values())).card
                card.fail(
                    f"{len(lost)} elements have no section, the first is element {number}; add "
                    "*SOLID SECTION for them"
                )

    def _known(self, card: Card) -> str:
        name = card.text("MATERIAL")
        if key(name) not in self._materials:
            card.fail(f"there is no material '{name}'; define it by *MATERIAL")
        return key(name)

    def _thickness(self, card: Card) -> float:
        rows = card.rows()
        value = rows[0].number(0, 1.0) if rows else 1.0
        if self._flat.kind.model not in ("plane strain", "plane stress"):
            return 1.0
        if value <= 0.0:
            rows[0].fail(f"the thickness {value:g} must be positive")
        return value

    def _model(self, thickness: float) -> Model | Shell:
        kind = self._flat.kind.model
        if kind == "plane strain":
            return PlaneStrain(thickness)
        if kind == "plane stress":
            return PlaneStress(thickness)
        if kind == "shell":
            return Shell()
        return Axisymmetric() if kind == "axisymmetric" else Solid()

    # -- orientation ---------------------------------------------------------------------

    def _frame(self, section: Card, space: Space) -> Frame:
        """Axes of the material in global components."""
        card = self._orientation(section, space)
        axes = (np.eye(3) if card is None else _axes(card)) @ space.rotation.T
        axes[np.abs(axes) < 1e-15] = 0.0
        first, second = (tuple(float(c) for c in row) for row in axes[:2])
        return first, second  # type: ignore[return-value]

    def _orientation(self, section: Card, space: Space) -> Card | None:
        if not section.has("ORIENTATION"):
            return None
        name = section.text("ORIENTATION")
        root = self._flat.model.root
        card = space.orientations.get(key(name)) or root.orientations.get(key(name))
        if card is None:
            section.fail(f"there is no orientation '{name}'; define it by *ORIENTATION")
        return card

    # -- conventional shells -------------------------------------------------------------

    def _surface_section(self, card: Card, cells: Ints, space: Space) -> Section:
        """The section of shells on a surface."""
        made = [self._material(self._materials[m], _GLOBAL) for m in self._ply_materials(card)]
        given = self._orientation(card, space)
        orientation = None
        if given is not None:
            rows = given.rows()
            about = rows[1].whole(0, 1) - 1 if len(rows) > 1 else 0
            orientation = _axes(given) @ space.rotation.T, about
        normals = cell_normals(self._flat, cells)
        axis = section_axis(card, orientation, normals, isotropic=is_isotropic(made))
        if card.has("POISSON"):
            self._report.replace(
                "POISSON is left out: the strain of the thickness is computed", card
            )
        return surface_section(card, made, axis)

    # -- continuum shells ----------------------------------------------------------------

    def _check_elements(self, card: Card, cells: Ints, space: Space) -> None:
        """Refuse a shell section of solid elements and a solid section of continuum shells."""
        stacked = [b for b in space.elements.values() if b.kind.stacked or b.kind.shell]
        labels = np.concatenate([b.table.labels for b in stacked]) if stacked else np.zeros(0)
        placed = next(p for p in self._flat.placed.values() if p.space is space)
        shells = np.isin(cells, placed.cell_of(labels.astype(np.int64)))
        if card.keyword == "SHELLSECTION" and not shells.all():
            card.fail("it needs shell elements (S4R, SC8R); give *SOLID SECTION to others")
        if card.keyword == "SOLIDSECTION" and shells.any():
            card.fail("shell elements need *SHELL SECTION")

    def _ply_materials(self, card: Card) -> list[str]:
        """Keys of the materials of a shell section's plies, bottom first."""
        if not card.has("COMPOSITE"):
            return [self._known(card)]
        names = []
        for row in card.need_rows("thickness, integration points, material, angle"):
            if key(row.text(2)) not in self._materials:
                row.fail(f"there is no material '{row.text(2)}'; define it by *MATERIAL")
            names.append(key(row.text(2)))
        return names

    def _shell(self, card: Card, name: str, cells: Ints, frame: Frame) -> Material:
        """A continuum shell from the faces S1 of its elements to their faces S2."""
        if card.has("OFFSET", "SYMMETRIC"):
            card.fail("OFFSET and SYMMETRIC are not available in continuum shells; leave them out")
        if card.number("STACK DIRECTION", 3.0) != 3.0:
            card.fail("STACK DIRECTION must be 3: plies lie from face S1 to face S2")
        if card.has("POISSON"):
            card.fail("POISSON is not available: the thickness follows the elements")
        sides = {}
        for side, face in (("bottom", 1), ("top", 2)):
            rows = self._flat.outer_side(cells, face)
            if not len(rows):
                card.fail(f"no face S{face} of the elements lies on the outside of the body")
            sides[side] = self._groups.facets(f"{name} {side}", rows)
        made = [self._material(self._materials[m], _GLOBAL) for m in self._ply_materials(card)]
        section: Laminate | Material = made[0]
        try:
            if card.has("COMPOSITE"):
                plies = [
                    Ply(row.number(0), row.number(3, 0.0, what="the angle of the ply"), material)
                    for row, material in zip(card.rows(), made, strict=True)
                ]
                section = Laminate(plies)
            return ContinuumShell(section, sides["bottom"], sides["top"], axis=frame[0])
        except InputError as error:
            if isinstance(error, DeckError):
                raise
            return card.fail(str(error))

    # -- materials -----------------------------------------------------------------------

    def _damping(self, what: str | Card) -> set[tuple[float, float]]:
        names = [what] if isinstance(what, str) else self._ply_materials(what)
        cards = [self._materials[name].first("DAMPING") for name in names]
        return {
            (0.0, 0.0) if c is None else (c.number("ALPHA", 0.0), c.number("BETA", 0.0))
            for c in cards
        }

    def _material(self, family: Family, frame: Frame) -> Material:
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
        if hyper is not None:
            if elastic is not None or plastic is not None:
                hyper.fail("a hyperelastic material has neither *ELASTIC nor *PLASTIC")
            return self._neo_hookean(hyper, density, expansion)
        if elastic is None:
            family.card.fail(f"material '{family.name}' has no *ELASTIC; add it")
        kind = elastic.word("TYPE", "ISOTROPIC")
        if kind in ("ISO", "ISOTROPIC"):
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
            if "H" in self._flat.kind.name and nu > _NEARLY_INCOMPRESSIBLE:
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
            shell = self._flat.kind.shell
            if self._flat.kind.model != "plane stress" and not shell:
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
            self._zeros.add(card.number("ZERO", 0.0))
        return _Expansion(temperatures, values)


@dataclass(frozen=True)
class _Expansion:
    """Thermal strains per degree along three axes, against temperature."""

    temperatures: list[float]
    values: list[tuple[float, float, float]]

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


def _axes(card: Card) -> Array:
    """Axes of an orientation, rows in global components, shape (3, 3)."""
    system = card.choose("SYSTEM", ("RECTANGULAR", "Z RECTANGULAR"), "RECTANGULAR")
    card.choose("DEFINITION", ("COORDINATES",), "COORDINATES")
    rows = card.need_rows("two points")
    a = np.array([rows[0].number(i, 0.0) for i in range(3)])
    b = np.array([rows[0].number(i, 0.0) for i in range(3, 6)])
    c = np.array([rows[0].number(i, 0.0) for i in range(6, 9)])
    a, b = a - c, b - c
    normal = np.cross(a, b)
    if np.linalg.norm(normal) <= 1e-10 * np.linalg.norm(a) * np.linalg.norm(b):
        card.fail("the two points and the origin lie on a line; give others")
    if system == "RECTANGULAR":
        first, third = a / np.linalg.norm(a), normal / np.linalg.norm(normal)
        axes = np.array([first, np.cross(third, first), third])
    else:
        third, second = a / np.linalg.norm(a), normal / np.linalg.norm(normal)
        axes = np.array([np.cross(second, third), second, third])
    if len(rows) > 1:
        axis, angle = rows[1].whole(0, 1), rows[1].number(1, 0.0)
        if not 1 <= axis <= 3:
            rows[1].fail(f"there is no axis {axis}; 1, 2 and 3 are")
        axes = axes @ axis_rotation(np.zeros(3), axes[axis - 1], angle).T
    return axes
