"""What a scene and a step of explicit dynamics must be like."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fxcrack.base import log
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.couplings import Constraint
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.term import Term
from fxcrack.criteria import VCCT
from fxcrack.interface.crack_pressure import CrackPressure
from fxcrack.interface.definition import Interface
from fxcrack.interface.pair import Pair
from fxcrack.steps.debond import Debond
from fxcrack.steps.release_choice import explicit_law


def inertia_of(effects: Sequence[Any]) -> Inertia:
    """The inertia of a scene, fit for explicit dynamics.

    Raises:
        InputError: There is none, or it has damping by stiffness.
    """
    found = [e for e in effects if isinstance(e, Inertia)]
    if not found:
        raise InputError(
            "Explicit moves bodies that have inertia, and the scene has none; write "
            "Scene(..., effects=[Inertia()]) with densities, or use a Static step"
        )
    effect: Inertia = found[0]
    if effect.rayleigh[1]:
        raise InputError(
            f"Inertia: rayleigh = {effect.rayleigh}: damping by stiffness would shorten the "
            "increments of explicit dynamics far more than it damps; use damping by mass, "
            "rayleigh=(r, 0.0)"
        )
    return effect


def _check_shells(interfaces: Sequence[Interface]) -> None:
    """Refuse interfaces between shells that explicit dynamics does not have.

    Raises:
        InputError: Says which, and what to do instead.
    """
    for interface in interfaces:
        if interface.stiffness is not None:
            raise InputError(
                f"Explicit: interface '{interface.title}' between shells has bonds with a "
                "stiffness; leave stiffness out, exact bonds take no increment"
            )


def check_large_rotation(
    continuum: Continuum, interfaces: Sequence[Interface], terms: Sequence[Term]
) -> None:
    """Refuse interfaces between shells of large rotation.

    Raises:
        InputError: There is one.
    """
    if isinstance(continuum, ShellBodies) and interfaces and any(t.finite for t in terms):
        raise InputError(
            f"Explicit: interface '{interfaces[0].title}' between shells is for small rotations; "
            "leave FiniteStrain() out, use a Dynamic step, or ContinuumShell on hexahedra of first "
            "order"
        )


def check_bodies(
    continuum: Continuum, loads: Sequence[Any], interfaces: Sequence[Interface]
) -> None:
    """Refuse bodies and loads that explicit dynamics does not have.

    Args:
        continuum: The bodies.
        loads: Their force patterns.
        interfaces: Their interfaces.

    Raises:
        InputError: Says which, and what to do instead.
    """
    if isinstance(continuum, ShellBodies):
        _check_shells(interfaces)
    if continuum.layout.shared:
        raise InputError(
            "Explicit: the strain out of the plane in GeneralisedPlaneStrain has no mass that "
            "could move it; use a Dynamic step, or PlaneStrain"
        )
    if continuum.order != 1:
        raise InputError(
            "Explicit needs first-order elements: row sums of second-order ones give corner nodes "
            "a negative mass; write Scene(..., order=1), or use a Dynamic step"
        )
    for load in loads:
        if isinstance(load, CrackPressure):
            raise InputError(
                f"Explicit: pressure '{load.title}' with follows_crack is not available in "
                "explicit dynamics; use a Static or Dynamic step"
            )


def check_start(continuum: Continuum, interfaces: Sequence[Interface]) -> None:
    """Refuse a start in equilibrium that statics of exact bonds and elastic bodies does not give.

    Raises:
        InputError: A material yields, or bonds have a stiffness.
    """
    for interface in interfaces:
        if interface.stiffness is not None:
            raise InputError(
                f"Explicit: start='equilibrium' is that of exact bonds, and interface "
                f"'{interface.title}' has bonds with a stiffness; begin at rest, and apply the "
                "loads slowly (SmoothStep)"
            )
    for material in continuum.part_materials:
        if getattr(material, "form", "elastic") == "plastic":
            raise InputError(
                "Explicit: start='equilibrium' does not know what bodies that yield have gone "
                "through; begin at rest, and apply the loads slowly (SmoothStep)"
            )


def check_constraints(continuum: Continuum, constraints: Sequence[Constraint]) -> None:
    """Refuse couplings and equations of shells, whose faces and directors have other masses.

    Raises:
        InputError: There is one.
    """
    if constraints and isinstance(continuum, ShellBodies):
        raise InputError(
            f"Explicit: couplings and equations ('{constraints[0].title}') of shells on surface "
            "meshes are not available in explicit dynamics; prescribe the displacements of the "
            "nodes by Displacement, or load them by PointForce"
        )


def check_interfaces(debonds: Sequence[Debond], bonds: Sequence[Interface]) -> None:
    """Refuse criteria, bonds and release laws that explicit dynamics does not have.

    Args:
        debonds: Interfaces that may grow in the step.
        bonds: Interfaces without a criterion.

    Raises:
        InputError: Says which, and what to do instead.
    """
    for debond in debonds:
        criterion, where = debond.criterion, f"interface '{debond.interface.title}'"
        name = type(criterion).__name__
        if not isinstance(criterion, VCCT) or criterion.softens or criterion.grows_in_cycles:
            raise InputError(
                f"{where}: {name} is not possible in explicit dynamics, which has VCCT alone; use "
                "VCCT, or leave the interface out of this step, grow=[other debonds]"
            )
        if criterion.method != "vcct":
            raise InputError(
                f"{where}: method='{criterion.method}' needs the condensed stiffness of the "
                "bodies, which explicit dynamics does not have; use method='vcct'"
            )
        if criterion.mode_length is not None:
            raise InputError(
                f"{where}: mode_length is not available in explicit dynamics, whose crack-tip "
                "fields depend on the speed of the crack as well; leave it out"
            )
        if criterion.viscosity > 0.0 and explicit_law(debond).driver != "once":
            raise InputError(
                f"{where}: in explicit dynamics viscosity delays a release at once; add "
                "release=StepRelease(), or use viscosity=0: a progressive release needs none"
            )
    for interface in (*[d.interface for d in debonds], *bonds):
        if interface.normal_only and not interface.is_rigid:
            raise InputError(
                f"interface '{interface.title}': bonds between bodies of explicit dynamics hold in "
                "all directions; leave normal_only out"
            )
        if interface.stiffness == "arms":
            raise InputError(
                f"interface '{interface.title}': stiffness='arms' is that of shells on surface "
                "meshes, whose bonds are exact in Explicit; leave stiffness out there, and give "
                "'auto' or three numbers per area between solids"
            )
        if interface.pairing == "surface-to-surface":
            raise InputError(
                f"interface '{interface.title}': surface-to-surface weights would give lumped "
                "masses of masters below zero; leave pairing out in explicit dynamics"
            )


def warn_of_ties(bonds: Sequence[Pair]) -> None:
    """Warn where bonds of a given set have no criterion; a set may mark no node at all."""
    for pair in bonds:
        if pair.interface.bonded is not None and pair.bonded.any():
            log.warn(
                "interface '%s' has a bonded set but no criterion: its bonds stay tied whatever "
                "they carry; make it a Debond if they may fail",
                pair.title,
            )


def warn_of_step_release(debonds: Sequence[Debond]) -> None:
    """Warn where bonds are released at once: then a running crack does not measure toughness."""
    for debond in debonds:
        law = explicit_law(debond)
        if law.driver == "once" and not debond.criterion.viscosity > 0.0:
            log.warn(
                "interface '%s': StepRelease in explicit dynamics lets a node go at once, which "
                "overshoots in force and opening by up to 2 each; a crack that runs passes "
                "through up to three times its toughness. It is meant for comparison with other "
                "programs: use ProgressiveRelease() (the default) otherwise",
                debond.interface.title,
            )


__all__ = [
    "check_bodies",
    "check_interfaces",
    "check_start",
    "inertia_of",
    "warn_of_step_release",
    "warn_of_ties",
]
