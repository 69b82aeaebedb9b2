"""Interfaces of explicit dynamics as general contact of a deck."""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.criteria import VCCT, Criterion, EnhancedVCCT, ProgressiveRelease, ReleaseLaw
from fxcrack.deck.lines import number
from fxcrack.deck.write_properties import criterion_lines
from fxcrack.deck.write_steps import refuse
from fxcrack.interface.definition import Interface


@dataclass(frozen=True)
class ContactLines:
    """Lines of an interface.

    Attributes:
        in_model: Model data.
        in_step: History data of the first step.
    """

    in_model: list[str]
    in_step: list[str]


def explicit_interface(
    interface: Interface,
    criterion: Criterion | None,
    release: ReleaseLaw | None,
    *,
    bonded: bool,
    nodal: bool,
    thickness: float,
) -> ContactLines:
    """An interface as a pair of general contact.

    Its surfaces are named by the title and "title master", its bonded nodes "title bonded".

    Args:
        interface: The interface.
        criterion: Its criterion, ``None`` if it cannot grow.
        release: Its release law, ``None`` where none was chosen.
        bonded: Whether a part of it is bonded.
        nodal: Whether the toughness is given at the slave nodes.
        thickness: Of the bodies of a plane model, 0 for others, length.

    Raises:
        InputError: A deck has no word for it.
    """
    title = interface.title
    if bonded and criterion is None:
        refuse(f"interface '{title}', bonded in part without a criterion, in explicit dynamics")
    if release is not None and release != ProgressiveRelease():
        refuse(f"interface '{title}': the release law {release} in explicit dynamics")
    if isinstance(criterion, VCCT | EnhancedVCCT) and (
        criterion.viscosity or criterion.unstable_tolerance is not None
    ):
        refuse(f"interface '{title}': viscosity and unstable_tolerance in explicit dynamics")
    if interface.gap != "adjust":
        refuse(f"interface '{title}': gap='{interface.gap}' in explicit dynamics")
    model = [f'*SURFACE INTERACTION, NAME="{title}"']
    if thickness:
        model.append(number(thickness))
    if interface.friction:
        assert not callable(interface.friction)
        model += ["*FRICTION", number(float(interface.friction))]
    surfaces = f'"{title}", "{title} master"'
    step = ["*CONTACT", "*CONTACT INCLUSIONS", surfaces]
    step += ["*CONTACT PROPERTY ASSIGNMENT", f'{surfaces}, "{title}"']
    if criterion is not None:
        model += ["*COHESIVE BEHAVIOR", *criterion_lines(title, criterion, nodal)]
    if bonded:
        clearance = f'*CONTACT CLEARANCE, NAME="{title}", SEARCH NSET="{title} bonded"'
        model.append(clearance)
        step += ["*CONTACT CLEARANCE ASSIGNMENT", f'{surfaces}, "{title}"']
    else:
        step += ["*CONTACT FORMULATION, TYPE=PURE MASTER-SLAVE", f"{surfaces}, SLAVE"]
    return ContactLines(model, step)


__all__ = ["ContactLines", "explicit_interface"]
