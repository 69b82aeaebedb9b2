"""Sections of a deck: the material of each cell, one entry for all cells that are alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.kinematics import Axisymmetric, Model, PlaneStrain, PlaneStress, Shell, Solid
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.materials import Material
from fxcrack.continuum.ply import Ply
from fxcrack.continuum.section import Section
from fxcrack.deck.cards import Card, DeckError, key
from fxcrack.deck.distributions import distributed, find_distribution, same_values
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.initial_stress import InitialStress, Stress
from fxcrack.deck.materials import Frame, Materials
from fxcrack.deck.numbering import Placed
from fxcrack.deck.orientations import (
    Axes,
    find_orientation,
    global_axes,
    ply_angle,
    read_axes,
    section_direction,
)
from fxcrack.deck.report import Report
from fxcrack.deck.shells import cell_normals, default_direction, surface_section

_MOST_THICKNESSES = 64
"""Different thicknesses of one section of shells: each makes a section of its own."""


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


@dataclass(frozen=True)
class _Kind:
    """What cells that are alike have in common.

    Attributes:
        what: Key of the material, or the card of a section of shells.
        frame: Axes 1 and 2 of the material.
        thickness: Of a plane model; of shells where a distribution gives it, else 0.
        stress: Initial stress.
    """

    what: str | Card
    frame: Frame
    thickness: float
    stress: Stress


@dataclass
class _Group:
    """Cells that are alike: what the first of their section cards says.

    Attributes:
        kind: What they have in common.
        card: The card.
        title: Its element set.
        placed: Its space.
        axes: Axes of its cells.
        titles: Element sets of all its cards.
    """

    kind: _Kind
    card: Card
    title: str
    placed: Placed
    axes: Axes
    titles: list[str]


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
        self._materials = Materials(flat.model.materials, flat.kind, report)
        self._owner = np.full(len(flat.cells), -1, dtype=np.int64)
        self._alike: list[_Group] = []

    def read(self) -> Sections:
        flat, owner = self._flat, self._owner
        for place, placed in flat.placed.items():
            for card in placed.space.sections:
                cells = flat.in_space(place, card, card.text("ELSET"))
                self._check_elements(card, cells, placed)
                title = (f"{placed.space.name}." if place else "") + card.text("ELSET")
                self._take(card, cells, title, placed)
        lost: Ints = np.flatnonzero(owner < 0).astype(np.int64)
        if len(lost):
            self._fail_lost(lost)
        used = [self._alike[i] for i in sorted(set(owner.tolist()))]
        thicknesses = {g.kind.thickness for g in used if isinstance(g.kind.what, str)}
        if len(thicknesses) > 1:
            used[1].card.fail(
                f"the sections have different thicknesses ({', '.join(map(str, thicknesses))}); a "
                "plane model has one"
            )
        damping = {pair for g in used for pair in self._materials.damping(self._keys(g.kind.what))}
        if len(damping) > 1:
            used[1].card.fail(
                "the materials have different *DAMPING; all bodies must have the same"
            )
        materials: dict[str, Material | Section] = {}
        sets: dict[str, list[str]] = {}
        for group in used:
            cells = np.flatnonzero(owner == self._alike.index(group))
            name = self._groups.cells(group.title, cells, words="elements")
            sets[name] = group.titles
            materials[name] = self._made(group, name, cells)
        zeros = self._materials.zeros
        return Sections(
            materials,
            sets,
            self._model(thicknesses.pop() if thicknesses else 1.0),
            next(iter(zeros)) if len(zeros) == 1 else None,
            damping.pop(),
        )

    def _take(self, card: Card, cells: Ints, title: str, placed: Placed) -> None:
        """Give the cells of a section card to groups of cells that are alike."""
        is_shell = card.keyword == "SHELLSECTION"
        what = card if is_shell else self._known(card)
        for axes in self._axes(card, cells, placed):
            first, second = (tuple(float(c) for c in row) for row in axes.rows[:2])
            for thickness, part in self._thicknesses(card, axes.cells, placed):
                for stress, inner in self._stresses.parts(part):
                    frame: Frame = (first, second)  # type: ignore[assignment]
                    self._give(_Kind(what, frame, thickness, stress), card, title, placed, axes,
                               inner)  # fmt: skip

    def _give(
        self, kind: _Kind, card: Card, title: str, placed: Placed, axes: Axes, cells: Ints
    ) -> None:
        owner = self._owner
        i = next((i for i, g in enumerate(self._alike) if g.kind == kind), len(self._alike))
        if i == len(self._alike):
            self._alike.append(_Group(kind, card, title, placed, axes, []))
        if title not in self._alike[i].titles:
            self._alike[i].titles.append(title)
        both = cells[(owner[cells] >= 0) & (owner[cells] != i)]
        if len(both):
            first = self._alike[int(owner[both[0]])].card
            card.fail(
                f"{len(both)} elements of '{card.text('ELSET')}' have another section already "
                f"({first.place}); give every element one"
            )
        owner[cells] = i

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

    def _keys(self, what: str | Card) -> list[str]:
        """Keys of the materials of a section."""
        return [what] if isinstance(what, str) else self._ply_materials(what)

    # -- what differs from cell to cell --------------------------------------------------

    def _axes(self, card: Card, cells: Ints, placed: Placed) -> list[Axes]:
        """Axes of the cells of a section, one entry for all that have the same."""
        found = None
        if card.has("ORIENTATION"):
            found = find_orientation(card, card.text("ORIENTATION"), placed, self._flat)
        what: str | Card = card if card.keyword == "SHELLSECTION" else self._known(card)
        if found is None or not any(self._materials.has_axes(k) for k in self._keys(what)):
            return global_axes(placed, cells)
        return read_axes(found, cells, placed, self._flat)

    def _thicknesses(self, card: Card, cells: Ints, placed: Placed) -> list[tuple[float, Ints]]:
        """Cells of each thickness: of plane models one, of shells 0 unless they differ."""
        if card.keyword != "SHELLSECTION":
            return [(self._thickness(card), cells)]
        if not card.has("SHELL THICKNESS"):
            return [(0.0, cells)]
        source = find_distribution(card, card.text("SHELL THICKNESS"), placed, self._flat)
        found = same_values(distributed(source, cells, 1, placed, self._flat))
        if len(found) > _MOST_THICKNESSES:
            source.fail(
                f"it gives {len(found)} different thicknesses; more than {_MOST_THICKNESSES} are "
                "not available: give elements of about the same thickness one"
            )
        return [(float(value[0]), cells[at]) for at, value in found]

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

    # -- the materials of the scene ------------------------------------------------------

    def _made(self, group: _Group, name: str, cells: Ints) -> Material | Section:
        """The material of cells that are alike."""
        what = group.kind.what
        if isinstance(what, str):
            made = self._materials.make(what, group.kind.frame)
            return self._stresses.of(made, group.kind.stress)
        if what.has("THICKNESS MODULUS"):
            self._report.replace("the stiffness of the thickness is that of the material", what)
        if self._flat.kind.shell:
            return self._surface_section(what, cells, group)
        return self._continuum_shell(what, name, cells, group)

    def _surface_section(self, card: Card, cells: Ints, group: _Group) -> Section:
        """The section of shells on a surface."""
        made = [self._materials.make(m) for m in self._ply_materials(card)]
        normals = cell_normals(self._flat, cells)
        with_axes = any(self._materials.has_axes(m) for m in self._ply_materials(card))
        if card.has("ORIENTATION") and with_axes:
            axis = section_direction(card, group.axes, normals)
        else:
            axis = default_direction(normals, isotropic=not with_axes)
        if card.has("POISSON"):
            self._report.replace(
                "POISSON is left out: the strain of the thickness is computed", card
            )
        own = Axes(group.axes.rows, group.axes.about, cells)
        angles = self._ply_angles(card, own, axis, normals, group.placed)
        direction: tuple[float, float, float] = tuple(axis.tolist())
        return surface_section(card, made, direction, angles, group.kind.thickness or None)

    def _ply_angles(
        self, card: Card, axes: Axes, axis: Array, normals: Array, placed: Placed
    ) -> list[float]:
        """Angles of the plies of a composite section from its axis 1, degrees."""
        if not card.has("COMPOSITE"):
            return []
        return [
            ply_angle(row, axes.cells, axis, normals, placed, self._flat) for row in card.rows()
        ]

    def _check_elements(self, card: Card, cells: Ints, placed: Placed) -> None:
        """Refuse a shell section of solid elements and a solid section of continuum shells."""
        blocks = placed.space.elements.values()
        stacked = [b for b in blocks if b.kind.stacked or b.kind.shell]
        labels = np.concatenate([b.table.labels for b in stacked]) if stacked else np.zeros(0)
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

    def _continuum_shell(self, card: Card, name: str, cells: Ints, group: _Group) -> Material:
        """A continuum shell from the faces S1 of its elements to their faces S2."""
        if card.has("OFFSET", "SYMMETRIC"):
            card.fail("OFFSET and SYMMETRIC are not available in continuum shells; leave them out")
        if card.number("STACK DIRECTION", 3.0) != 3.0:
            card.fail("STACK DIRECTION must be 3: plies lie from face S1 to face S2")
        if card.has("POISSON"):
            card.fail("POISSON is not available: the thickness follows the elements")
        if card.has("SHELL THICKNESS"):
            self._report.replace("the thickness is that of the elements", card)
        sides = {}
        for side, face in (("bottom", 1), ("top", 2)):
            rows = self._flat.outer_side(cells, face)
            if not len(rows):
                card.fail(f"no face S{face} of the elements lies on the outside of the body")
            sides[side] = self._groups.facets(f"{name} {side}", rows)
        made = [self._materials.make(m) for m in self._ply_materials(card)]
        x = self._flat.points[self._flat.cells[cells, :8]]
        normals = x[:, 4:].mean(axis=1) - x[:, :4].mean(axis=1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        axis = group.axes.rows[0]
        if group.axes.about is not None:
            axis = section_direction(card, group.axes, normals)
        section: Laminate | Material = made[0]
        try:
            if card.has("COMPOSITE"):
                angles = self._ply_angles(card, Axes(group.axes.rows, group.axes.about, cells),
                                          axis, normals, group.placed)  # fmt: skip
                plies = [
                    Ply(row.number(0), angle, material)
                    for row, angle, material in zip(card.rows(), angles, made, strict=True)
                ]
                section = Laminate(plies)
            direction: tuple[float, float, float] = tuple(axis.tolist())
            return ContinuumShell(section, sides["bottom"], sides["top"], axis=direction)
        except InputError as error:
            if isinstance(error, DeckError):
                raise
            return card.fail(str(error))


__all__ = ["Sections", "read_sections"]
