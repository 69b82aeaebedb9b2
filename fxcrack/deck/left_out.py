"""What of a deck plays no part in what is computed: it is left out and said so.

* Materials and interactions that nothing names, whatever they hold.
* Steps of perturbation (frequencies, buckling loads) beside general ones: the other steps begin and
  end as if they were not there.
* Field variables on which nothing depends, and the state variables of user subroutines.
* Point masses in a static deck without gravity.
"""

from __future__ import annotations

from collections.abc import Sequence

from fxcrack.deck.cards import Card, key, squeeze
from fxcrack.deck.keywords import KEYWORDS
from fxcrack.deck.report import Report

OF_MATERIALS = ("ELASTIC", "PLASTIC", "EXPANSION", "DENSITY", "HYPERELASTIC", "DAMPING")
OF_INTERACTIONS = ("FRICTION", "SURFACEBEHAVIOR", "COHESIVEBEHAVIOR", "FRACTURECRITERION")
_DAMAGE = ("DAMAGEINITIATION", "DAMAGEEVOLUTION", "DAMAGESTABILIZATION")
_REFUSED_OF = {
    "MATERIAL": (
        *_DAMAGE,
        *("USERMATERIAL", "DEPVAR", "USERDEFINEDFIELD", "CREEP", "VISCOELASTIC", "RATEDEPENDENT"),
        *("DRUCKERPRAGER", "CONCRETE", "POTENTIAL", "CYCLICHARDENING", "DEFORMATIONPLASTICITY"),
        *("HYPERFOAM", "INELASTICHEATFRACTION"),
    ),
    "SURFACEINTERACTION": (*_DAMAGE, "CONTACTDAMPING"),
}
"""Words that belong to a material or an interaction and are refused where it is used."""
_PERTURBATIONS = frozenset(
    (
        *("FREQUENCY", "BUCKLE", "COMPLEXFREQUENCY", "STEADYSTATEDYNAMICS", "MODALDYNAMIC"),
        *("RANDOMRESPONSE", "RESPONSESPECTRUM", "SUBSTRUCTUREGENERATE"),
    )
)
_GENERAL = frozenset(("STATIC", "VISCO", "DYNAMIC", "DIRECTCYCLIC", "FATIGUE"))
_POINT_MASSES = ("MASS", "ROTARYI", "ROTARYINERTIA")


def without_unused(cards: Sequence[Card], report: Report) -> list[Card]:
    """The cards of a deck without those that play no part.

    Args:
        cards: In order.
        report: Takes what is left out.
    """
    kept = _families(cards, report, "MATERIAL", OF_MATERIALS, _named_materials(cards))
    kept = _families(
        kept, report, "SURFACEINTERACTION", OF_INTERACTIONS, _named_interactions(cards)
    )
    return _point_masses(_perturbations(_fields(kept, report), report), report)


def _named_materials(cards: Sequence[Card]) -> set[str]:
    """Keys of the materials that sections name."""
    found = {key(card.options["MATERIAL"] or "") for card in cards if card.has("MATERIAL")}
    for card in cards:
        if card.has("COMPOSITE"):
            found |= {key(row.text(2)) for row in card.rows()}
    return found


def _named_interactions(cards: Sequence[Card]) -> set[str]:
    """Keys of the interactions that pairs name."""
    found = {key(card.options["INTERACTION"] or "") for card in cards if card.has("INTERACTION")}
    for card in cards:
        if card.keyword == "CONTACTPROPERTYASSIGNMENT":
            found |= {key(row.text(2)) for row in card.rows()}
    return found


def _families(
    cards: Sequence[Card], report: Report, head: str, members: Sequence[str], named: set[str]
) -> list[Card]:
    """The cards without the families of a head that nothing names.

    To a family belong its members, those that are refused elsewhere, and what fxcrack does not
    know, of which each is named. Material data without effect on stresses may stand among them.
    """
    kept: list[Card] = []
    what = "material" if head == "MATERIAL" else "surface interaction"
    inside, seen, name = False, set(), ""
    for card in cards:
        if card.keyword == head:
            name = key(card.options.get("NAME") or "")
            inside = bool(name) and name not in named and name not in seen
            seen.add(name)
            if inside:
                report.leave(f"{what} '{card.text('NAME')}', which nothing in the deck names")
        elif inside:
            known = KEYWORDS.get(card.keyword)
            if known is None:
                report.leave(f"{card.title}, taken for data of the {what} '{name}'")
            elif known.kind == "output":
                kept.append(card)
                continue
            else:
                inside = card.keyword in (*members, *_REFUSED_OF[head])
        if not inside:
            kept.append(card)
    return kept


def _fields(cards: Sequence[Card], report: Report) -> list[Card]:
    """The cards without field variables, where no property depends on them."""
    if any(card.has("DEPENDENCIES") for card in cards):
        return list(cards)
    kept = []
    for card in cards:
        initial = card.keyword == "INITIALCONDITIONS" and card.word("TYPE") in ("FIELD", "SOLUTION")
        if card.keyword == "FIELD" or initial:
            report.leave(f"{card.title} of fields or states on which nothing depends")
        else:
            kept.append(card)
    return kept


def _perturbations(cards: Sequence[Card], report: Report) -> list[Card]:
    """The cards without steps of perturbation, if there are general steps beside them."""
    steps: list[list[Card]] = []
    for card in cards:
        if card.keyword == "STEP":
            steps.append([])
        if steps:
            steps[-1].append(card)
    perturbing = [
        step
        for step in steps
        if any(c.keyword in _PERTURBATIONS for c in step)
        or (step[0].has("PERTURBATION") and any(c.keyword in _GENERAL for c in step))
    ]
    if not perturbing or len(perturbing) == len(steps):
        return list(cards)
    for step in perturbing:
        name = step[0].options.get("NAME") or f"step {1 + steps.index(step)}"
        report.replace(
            f"the linear perturbation step '{name}' is left out: it changes nothing of the other "
            "steps",
            step[0],
        )
    out = {id(card) for step in perturbing for card in step}
    return [card for card in cards if id(card) not in out]


def _point_masses(cards: Sequence[Card], report: Report) -> list[Card]:
    """The cards without point masses, where nothing accelerates them."""

    def accelerates(card: Card) -> bool:
        loads = ("GRAV", "CENTRIF", "CENT", "ROTA")
        return card.keyword == "DYNAMIC" or (
            card.keyword == "DLOAD" and any(squeeze(row.text(1)) in loads for row in card.rows())
        )

    counts = any(accelerates(card) for card in cards)
    kept: list[Card] = []
    for card in cards:
        if card.keyword in _POINT_MASSES and counts:
            report.refused.append(_refusal(card, cards))
        elif card.keyword in _POINT_MASSES:
            report.replace(
                "point masses play no part in static steps without gravity; left out", card
            )
        elif card.keyword == "ELEMENT" and card.word("TYPE") in _POINT_MASSES:
            if card.has("ELSET"):  # other cards may name the set
                name = {"ELSET": card.options["ELSET"]}
                kept.append(Card("ELSET", "*ELSET", name, card.file, card.line))
        else:
            kept.append(card)
    return kept


def _refusal(card: Card, cards: Sequence[Card]) -> str:
    """Why a point mass is refused: how large it is, and where."""
    size = card.rows()[0].number(0, 0.0) if card.rows() else 0.0
    name = key(card.options.get("ELSET") or "")
    nodes = [
        row.text(1)
        for other in cards
        if other.keyword == "ELEMENT"
        and other.word("TYPE") in _POINT_MASSES
        and key(other.options.get("ELSET") or "") == name
        for row in other.rows()
    ]
    what = "a point mass" if card.keyword == "MASS" else "a rotary inertia"
    where = f" at each of {len(nodes)} nodes" if len(nodes) > 1 else "".join(
        f" at node {node}" for node in nodes
    )  # fmt: skip
    return (
        f"{card.place}: {card.title} is refused: {what} of {size:g}{where} is not available, and "
        "the bodies would move without it; give it to elements beside the node by *DENSITY. Where "
        "the node is held, or its motion prescribed, it changes the reaction of the node alone: "
        "take the card and its element out"
    )


__all__ = ["OF_INTERACTIONS", "OF_MATERIALS", "without_unused"]
