"""From the model of a deck to the scene and its steps, as data on one rank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fxcrack.continuum.kinematics import PlaneStress
from fxcrack.continuum.loads import Monitor
from fxcrack.deck.cards import Card, DeckError, key, label, squeeze
from fxcrack.deck.constraints import read_constraints
from fxcrack.deck.contact import Contacts
from fxcrack.deck.explicit import bulk_viscosity
from fxcrack.deck.flat import Flat
from fxcrack.deck.general_contact import GENERAL
from fxcrack.deck.groups import Groups
from fxcrack.deck.initial_stress import InitialStress
from fxcrack.deck.loads import Loads
from fxcrack.deck.locking import raised_to_bend, warn_of_locking
from fxcrack.deck.model import Family, Model
from fxcrack.deck.procedures import DeckStep, Procedure, read_procedures
from fxcrack.deck.properties import Sections, read_sections
from fxcrack.deck.report import Report
from fxcrack.deck.rules import (
    check_constraints,
    check_density,
    check_explicit,
    check_shells,
    density_of,
    no_bulk_viscosity,
)
from fxcrack.deck.shells import check_normals
from fxcrack.deck.supports import Boundary
from fxcrack.deck.thermal import Temperatures
from fxcrack.deck.tips import NodeNames
from fxcrack.deck.tracks import Amplitudes
from fxcrack.deck.transforms import read_transforms, turn_boundary
from fxcrack.deck.velocity import StartingVelocity, starting_velocity
from fxcrack.effects import FiniteStrain
from fxcrack.mesh.raw import RawMesh
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.explicit import Explicit

_IN_STEPS = frozenset(
    (
        *("STATIC", "VISCO", "DYNAMIC", "DIRECTCYCLIC", "FATIGUE", "CONTROLS", "BOUNDARY"),
        *("CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "DEBOND", "FRACTURECRITERION"),
        *("BULKVISCOSITY", "FIXEDMASSSCALING", "VARIABLEMASSSCALING", *GENERAL),
    )
)
_IN_MODEL = frozenset(
    (
        *("BOUNDARY", "INITIALCONDITIONS", "CONTACTPAIR", "TIE", "COUPLING", "KINEMATIC"),
        *("DISTRIBUTING", "TRANSFORM"),
        *(
            "EQUATION",
            "MPC",
            "KINEMATICCOUPLING",
            "RIGIDBODY",
            "CLEARANCE",
            "NODALENERGYRATE",
            "CONTROLS",
            *GENERAL,
        ),
    )
)


@dataclass(frozen=True)
class Translated:
    """A deck in the words of a scene.

    Attributes:
        arguments: Those of :class:`fxcrack.Scene` but the mesh.
        steps: The steps.
        report: What was read and replaced.
        raw: The mesh.
        nodes: Names of the slave nodes of interfaces that may come apart, by title.
    """

    arguments: dict[str, Any]
    steps: list[DeckStep]
    report: Report
    raw: RawMesh
    nodes: dict[str, NodeNames]


def translate(model: Model, report: Report, order: int | None = None) -> Translated:
    """Translate a model.

    Args:
        model: What the deck describes.
        report: Takes what is read and replaced.
        order: Order the elements are raised to; their own by default.

    Raises:
        DeckError: Something is missing, contradicts itself or has no word here.
    """
    procedures = read_procedures(model.steps, report)
    explicit = bool(procedures) and isinstance(procedures[0].step, Explicit)
    flat = Flat(model, _order(model, report, order, explicit=explicit))
    if order is None and not explicit and raised_to_bend(flat, report):
        flat = Flat(model, 2)
    if flat.kind.shell:
        check_normals(flat)
    groups = Groups(flat)
    cards = _model_cards(flat)
    _check_steps(model.steps, explicit=explicit)
    finite = _finite(model, procedures, report)
    periods = [p.period for p in procedures]
    cycles = [p.period.end - p.period.start for p in procedures if isinstance(p.step, Cycles)]
    amplitudes = Amplitudes(model, report, periods[-1].end if periods else 1.0, cycles)
    boundary = Boundary(flat, periods)
    boundary.take([c for c in cards if c.keyword == "BOUNDARY"], amplitudes)
    constraints = read_constraints(cards, flat)
    transforms = read_transforms(cards, flat)
    loads = Loads(
        flat, amplitudes, report,
        finite=finite, carriers=constraints.carriers, transforms=transforms,
    )  # fmt: skip
    temperatures = Temperatures(flat, report)
    temperatures.start(_initial(cards, "TEMPERATURE"))
    contacts = Contacts(
        cards + _contact_of_steps(model.steps, explicit=explicit), flat, groups, report,
        finite=finite, explicit=explicit,
    )  # fmt: skip
    steps = []
    for number, (family, procedure) in enumerate(zip(model.steps, procedures, strict=True)):
        of_step = family.cards
        boundary.take([c for c in of_step if c.keyword == "BOUNDARY"], amplitudes)
        boundary.end_step()
        loads.take(of_step, procedure.period)
        thermal = [c for c in of_step if c.keyword == "TEMPERATURE"]
        temperatures.take(thermal, amplitudes, procedure.period)
        grow = contacts.take(number, of_step)
        steps.append(DeckStep(family.name, procedure.step, tuple(grow), grow))
    warn_of_locking(flat, report, explicit=explicit, bonded=contacts.bonds_bodies)
    stresses = InitialStress(_initial(cards, "STRESS"), flat)
    if stresses.card is not None and temperatures.first is not None:
        stresses.card.fail("initial stresses beside temperatures are not available; leave one out")
    sections = read_sections(flat, groups, report, stresses)
    if flat.kind.shell:
        check_shells(loads)
    moving = [p for p in procedures if p.inertia is not None]
    if moving:
        check_density(moving[0], sections, model)
    if explicit:
        check_explicit(moving[0], flat, sections, boundary)
    turned = turn_boundary(boundary, transforms, groups)
    constraints.check_axes(transforms)
    if not explicit:
        contacts.share_supports(boundary)
    constrained = turned + constraints.supports(boundary, groups)
    if explicit:
        check_constraints(constrained, cards, flat)
    supports = boundary.displacements(groups) + constrained
    held = np.unique(
        np.concatenate(
            [np.zeros(0, dtype=np.int64), *(n for d in range(3) for _, n in boundary.histories(d))]
        )
    )
    debonds, bonds = contacts.build(model.interactions, held, boundary)
    if explicit:
        titles = [d.interface.title for d in debonds]
        without = no_bulk_viscosity(flat, sections, finite=finite)
        quadratic = not isinstance(sections.model, PlaneStress)
        for place, (family, procedure) in enumerate(zip(model.steps, procedures, strict=True)):
            assert isinstance(procedure.step, Explicit)
            bulk = bulk_viscosity(
                procedure.card, family, report, quadratic=quadratic, without=without
            )
            step = replace(procedure.step, bulk=bulk)
            frequency = dict.fromkeys(titles, step.rows)
            steps[place] = DeckStep(family.name, step, tuple(titles), frequency)
    densities = {n: density_of(m) for n, m in sections.materials.items()}
    arguments: dict[str, Any] = {
        "materials": sections.materials,
        "model": sections.model,
        "supports": supports,
        "loads": loads.loads(groups, densities),
        "debonds": debonds,
        "bonds": bonds,
        "monitors": _monitors(model.steps, flat, groups, report),
        "effects": _effects(
            procedures,
            sections,
            temperatures,
            starting_velocity(_initial(cards, "VELOCITY"), flat),
            finite=finite,
        )
        + stresses.effects(procedures, report),
    }
    raw = groups.raw_mesh()
    _tell(report, flat, sections.sets, arguments, steps)
    nodes = {
        title: NodeNames(flat.points[found], flat.node_names(found))
        for title, found in contacts.slave_nodes().items()
    }
    return Translated(arguments, steps, report, raw, nodes)


def _order(model: Model, report: Report, order: int | None, *, explicit: bool) -> int | None:
    """Order of the elements: where there are continuum shells, 2 unless another is asked for."""
    spaces = [model.root, *model.instances.values()]
    blocks = [block for space in spaces for block in space.elements.values() if block.kind.stacked]
    if not blocks or order is not None:
        return order
    if explicit:
        report.replace(
            "the continuum shell is replaced by one of first order with tied and enhanced strains "
            "and full integration",
            blocks[0].card,
        )
        return None
    report.replace(
        "the continuum shell is replaced by one of second order with 27 nodes; all elements of the "
        "deck are raised to the second order (read_deck(..., order=1) or --order 1: 8 nodes)",
        blocks[0].card,
    )
    return 2


def _model_cards(flat: Flat) -> list[Card]:
    """Model data; those of a part once for each of its instances, with the names of that."""
    inside = [
        replace(card, home=place)
        for place, placed in flat.placed.items()
        if placed.space is not flat.model.root
        for card in placed.space.others
    ]
    for card in (*flat.model.cards, *inside):
        if card.keyword in _IN_STEPS and card.keyword not in _IN_MODEL:
            card.fail("it belongs into a *STEP")
    return [*inside, *flat.model.cards]


def _check_steps(steps: Sequence[Family], *, explicit: bool) -> None:
    for family in steps:
        for card in family.cards:
            pair = explicit and card.keyword == "CONTACTPAIR"
            if card.keyword in _IN_MODEL and card.keyword not in _IN_STEPS and not pair:
                card.fail("it is model data; move it before the first *STEP")


def _contact_of_steps(steps: Sequence[Family], *, explicit: bool) -> list[Card]:
    """Contact that the first step defines; explicit decks may give it there."""
    kinds = (*GENERAL, "CONTACTPAIR") if explicit else GENERAL
    for family in steps[1:]:
        for card in family.cards:
            if card.keyword in kinds:
                card.fail("contact stays what it is in all steps; define it once, in the first")
    return [c for family in steps[:1] for c in family.cards if c.keyword in kinds]


def _initial(cards: Sequence[Card], kind: str) -> list[Card]:
    """Initial conditions of a kind; others are refused."""
    found = []
    for card in cards:
        if card.keyword == "INITIALCONDITIONS":
            given = card.choose(
                "TYPE", ("CONTACT", "STRESS", "TEMPERATURE", "VELOCITY"), card.text("TYPE")
            )
            if given == kind:
                found.append(card)
    return found


def _finite(model: Model, procedures: Sequence[Procedure], report: Report) -> bool:
    """Whether bodies turn far; in all steps if in one, and not where they yield.

    Raises:
        DeckError: Bodies that yield stand beside others that are made for large strain.
    """
    finite = [p.finite for p in procedures]
    if not any(finite):
        return False
    yielding = next((c for m in model.materials.values() if (c := m.first("PLASTIC"))), None)
    if yielding is not None:
        if any(m.first("HYPERELASTIC") for m in model.materials.values()):
            yielding.fail(
                "plasticity is for small strain and cannot stand beside *HYPERELASTIC with NLGEOM; "
                "leave one of them out"
            )
        report.replace(
            "plasticity is for small strain: the deck is computed as with NLGEOM=NO; rotations and "
            "strains that are not small are warned of at the end of each step",
            yielding,
        )
        return False
    if not all(finite):
        report.replace(
            "NLGEOM counts from the first step on: all steps have large rotations, or none",
            model.steps[finite.index(True)].card,
        )
    return True


def _effects(
    procedures: Sequence[Procedure],
    sections: Sections,
    temperatures: Temperatures,
    velocity: StartingVelocity | None,
    *,
    finite: bool,
) -> list[Any]:
    effects: list[Any] = []
    if finite:
        effects.append(FiniteStrain())
    effects += temperatures.effect(sections.zero)
    inertia = next((p.inertia for p in procedures if p.inertia is not None), None)
    if velocity is not None and inertia is None:
        velocity.card.fail(
            "bodies have a velocity in dynamic steps only; add *DYNAMIC, or leave it out"
        )
    if inertia is not None:
        start = None if velocity is None else velocity.components
        effects.append(replace(inertia, rayleigh=sections.rayleigh, velocity=start))
    return effects


def _monitors(steps: Sequence[Family], flat: Flat, groups: Groups, report: Report) -> list[Monitor]:
    """Displacements that history output and printed tables ask for, as means over the set."""
    out: dict[str, Monitor] = {}
    for family in steps:
        history = False
        for card in family.cards:
            if card.keyword == "OUTPUT":
                history = card.has("HISTORY")
            asked = card.keyword == "NODEPRINT" or (card.keyword == "NODEOUTPUT" and history)
            if not asked or not card.has("NSET"):
                continue
            name = card.text("NSET")
            words = {squeeze(text) for row in card.rows() for text in row.fields}
            try:
                nodes = flat.nodes(card, name)
            except DeckError:
                continue  # an output request must not stop a deck
            nodes = nodes[flat.used[nodes]]
            if not len(nodes):
                continue
            axes = [i for i in range(flat.kind.gdim) if words & {"U", f"U{i + 1}"}]
            if axes:
                report.answer(card)
            for i in axes:
                title = f"U{i + 1} {label(name)}"
                direction = tuple(float(i == j) for j in range(flat.kind.gdim))
                where = groups.support(card, name, nodes)
                out.setdefault(key(title), Monitor(where, direction, title))
    return list(out.values())


def _tell(
    report: Report,
    flat: Flat,
    sets: Mapping[str, Sequence[str]],
    arguments: dict[str, Any],
    steps: Sequence[DeckStep],
) -> None:
    """Say what was read."""
    kind = flat.kind
    report.read.append(
        f"{int(flat.used[: flat.n_given].sum())} nodes, {len(flat.cells)} elements {kind.name} "
        f"({kind.model}, {kind.cell} of order {kind.order})"
        + (f", {len(flat.parents)} nodes added to the elements" if len(flat.parents) else "")
    )
    for name, material in arguments["materials"].items():
        of = ", ".join(f"'{title}'" for title in dict.fromkeys(sets[name]))
        report.read.append(f"material of {of}: {material}")
    report.read.append(f"model: {arguments['model']}")
    report.read += [f"support: {s}" for s in arguments["supports"]]
    report.read += [f"load: {x}" for x in arguments["loads"]]
    for debond in arguments["debonds"]:
        interface = debond.interface
        report.read.append(
            f"debond: slave '{interface.slave}', master '{interface.master}', bonded "
            f"'{interface.bonded}': {debond.criterion}"
            + (f", {debond.release}" if debond.release_chosen else "")
        )
    for interface in arguments["bonds"]:
        report.read.append(f"interface: slave '{interface.slave}', master '{interface.master}'")
    report.read += [f"effect: {e}" for e in arguments["effects"]]
    report.read += [f"column of the history: m[{m.title}]" for m in arguments["monitors"]]
    for step in steps:
        if isinstance(step.step, Cycles):
            words = f"cycles of period {step.step.period}, {step.step.n_max:g} of them"
        else:
            words = f"{type(step.step).__name__} until time {step.step.ends[0].time:g}"  # type: ignore[union-attr]
        grows = f", grows: {', '.join(step.grow)}" if step.grow else ""
        report.read.append(f"step '{step.name}': {words}{grows}")
