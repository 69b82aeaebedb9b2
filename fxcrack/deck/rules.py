"""What decks of dynamics and of shells must be like, looked at before a scene is made of them."""

from __future__ import annotations

from collections.abc import Sequence

from fxcrack.continuum.couplings import Coupling, Equation
from fxcrack.continuum.materials import Material, NeoHookean
from fxcrack.continuum.section import Section
from fxcrack.deck.cards import Card
from fxcrack.deck.flat import Flat
from fxcrack.deck.loads import Loads
from fxcrack.deck.model import Model
from fxcrack.deck.procedures import Procedure
from fxcrack.deck.properties import Sections
from fxcrack.deck.supports import AnySupport, Boundary


def density_of(material: Material | Section) -> float | None:
    """Density of a material or the mean one of a section, mass/volume; ``None`` without."""
    found = material.laminate if isinstance(material, Section) else material
    density: float | None = getattr(found, "density", None)
    return density


def check_shells(loads: Loads) -> None:
    """Refuse what shells on surfaces do not have.

    Raises:
        DeckError: Says which, and what to do instead.
    """
    entry = loads.following
    if entry is not None:
        entry.row.fail(
            "a pressure on a shell keeps its direction here, but follows the shell where NLGEOM is "
            "on; add FOLLOWER=NO to let it keep its direction, or write NLGEOM=NO"
        )


def check_density(procedure: Procedure, sections: Sections, model: Model) -> None:
    """Refuse bodies without a density in a dynamic step.

    Raises:
        DeckError: Says which material has none.
    """
    for name, material in sections.materials.items():
        if density_of(material) is None:
            procedure.card.fail(
                f"the material of '{name}' has no *DENSITY, which moving bodies must have; add it"
            )


def check_explicit(
    procedure: Procedure, flat: Flat, sections: Sections, boundary: Boundary
) -> None:
    """Refuse what explicit dynamics does not have.

    Args:
        procedure: The first explicit step.
        flat: The model.
        sections: Its materials.
        boundary: Its prescribed displacements.

    Raises:
        DeckError: Says which, and what to do instead.
    """
    card = procedure.card
    if flat.kind.order != 1:
        card.fail(
            f"{flat.given_kind.name} elements of the second order are not possible in explicit "
            "dynamics: their lumped masses would be negative; use first-order elements, or "
            "implicit *DYNAMIC"
        )
    for family in flat.model.materials.values():
        damping = family.first("DAMPING")
        if damping is not None and sections.rayleigh[1]:
            damping.fail(
                "BETA shortens the increments of explicit dynamics far more than it damps; give "
                "ALPHA alone"
            )
    for given in boundary.entries:
        if given.value and given.curve is None and not (given.rate or given.fixed):
            given.card.fail(
                f"the displacement {given.value:g} of '{given.name}' jumps at the beginning of an "
                "explicit step, with a velocity without bound; give it an AMPLITUDE"
            )


def no_bulk_viscosity(flat: Flat, sections: Sections, *, finite: bool) -> str | None:
    """Why the bodies of an explicit step have no bulk viscosity; ``None`` where they have it.

    Args:
        flat: The model.
        sections: Its materials.
        finite: Whether NLGEOM is on.
    """
    if finite:
        return "steps with NLGEOM, which is on unless NLGEOM=NO is written"
    if flat.kind.shell:
        return "shells"
    if flat.kind.stacked:
        return "continuum shells"
    if any(isinstance(m, NeoHookean) for m in sections.materials.values()):
        return "hyperelastic bodies"
    return None


def check_constraints(supports: Sequence[AnySupport], cards: Sequence[Card], flat: Flat) -> None:
    """Refuse couplings and equations of shells on surface meshes in explicit dynamics.

    Args:
        supports: What the constraints are in the words of a scene.
        cards: Model data.
        flat: The model.

    Raises:
        DeckError: One is more than a prescribed displacement.
    """
    if not flat.kind.shell or not any(isinstance(s, Coupling | Equation) for s in supports):
        return
    kinds = ("KINEMATIC", "DISTRIBUTING", "RIGIDBODY", "MPC", "EQUATION")
    card = next(c for c in cards if c.keyword in kinds)
    card.fail(
        "couplings and equations of shells whose reference is free are not available in explicit "
        "dynamics; prescribe all its components by *BOUNDARY, or load the nodes themselves"
    )


__all__ = [
    "check_constraints",
    "check_density",
    "check_explicit",
    "check_shells",
    "density_of",
    "no_bulk_viscosity",
]
