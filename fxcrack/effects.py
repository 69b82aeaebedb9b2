"""Effects a scene may ask for, and the solver path they need.

A bare scene is linear and condensed once. Each effect adds one form term in the bodies, one load
pattern or one law of the interface; what is not named does not exist in the scene: no form, no
unknown, no memory, and its module is not even imported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fxcrack.base import log
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import Load, Pressure
from fxcrack.continuum.temperature import expansion_of
from fxcrack.interface.pairing import Interface

if TYPE_CHECKING:
    from fxcrack.continuum.term import Term


@dataclass(frozen=True)
class FiniteStrain:
    """Large rotations and strains of the bodies.

    Elastic materials follow the St. Venant-Kirchhoff law (their stiffness between the second
    Piola-Kirchhoff stress and the Green-Lagrange strain). Normals at crack fronts are those
    of the deformed bodies, energy release rates are per undeformed area, and open faces are paired
    anew as they slide.
    """


@dataclass(frozen=True)
class Plan:
    """How a scene is solved, and why.

    Attributes:
        path: "condensed" or "newton".
        why: One sentence per reason.
        effects: What is on, one sentence each.
    """

    path: str
    why: tuple[str, ...]
    effects: tuple[str, ...]


def temperature_of(effects: Sequence[Any]) -> Any:
    """The temperature among some effects, ``None`` if there is none.

    Raises:
        InputError: There are two, or one of the effects is none that a scene knows.
    """
    known = ("FiniteStrain", "Temperature", "Inertia")
    names = [type(e).__name__ for e in effects]
    for name in names:
        if name not in known:
            raise InputError(
                f"effects: {name} is not an effect; known: {', '.join(known)} (friction belongs to "
                "Interface, a pressure that follows to Pressure, plasticity to the material)"
            )
        if names.count(name) > 1:
            raise InputError(f"effects: {name} is given twice; give it once")
    found = [e for e, name in zip(effects, names, strict=True) if name == "Temperature"]
    return found[0] if found else None


def _forms(continuum: Continuum) -> set[str]:
    """Which forms the materials need."""
    return {getattr(m, "form", "elastic") for m in continuum.part_materials}


def plan(
    continuum: Continuum,
    effects: Sequence[Any],
    loads: Sequence[Load],
    interfaces: Sequence[Interface],
    path: str | None,
) -> Plan:
    """Choose the solver path; collective.

    Args:
        continuum: Bodies with their materials and temperature.
        effects: What the scene asks for.
        loads: Its force patterns.
        interfaces: Its interfaces.
        path: The path the user insists on, ``None`` for the cheapest that will do.

    Raises:
        InputError: Effects that exclude each other, or a path that cannot serve them.
    """
    why, on = [], []
    forms = _forms(continuum)
    names = {type(e).__name__ for e in effects}
    finite = "FiniteStrain" in names or "neo_hookean" in forms
    if finite and "plastic" in forms:
        raise InputError(
            "Plastic is a law for small strain and cannot stand beside finite strain; leave out "
            "FiniteStrain() and NeoHookean, or use an elastic material"
        )
    if finite:
        on.append("finite strain: large rotations and strains of the bodies")
        why.append("finite strain makes the bodies nonlinear")
    if "neo_hookean" in forms:
        on.append("neo-Hookean material")
    if "plastic" in forms:
        on.append("plasticity: J2 with isotropic hardening")
        why.append("plasticity makes the bodies nonlinear")
    follows = [x.title for x in loads if isinstance(x, Pressure) and getattr(x, "follows", False)]
    for title in follows:
        on.append(f"follower pressure '{title}'")
        why.append(f"pressure '{title}' follows the bodies")
    if continuum.temperature is not None:
        from fxcrack.continuum import thermal_strain as thermal

        if not any(
            hasattr(m, "temperatures") or expansion_of(m).any() for m in continuum.part_materials
        ):
            log.warn(
                "Temperature: no material expands, so it strains nothing; give the materials an "
                "expansion, unless only the interface depends on temperature"
            )
        on.append("temperature: thermal strain and what is tabulated against temperature")
        if not thermal.is_linear(continuum):
            why.append("moduli change as the temperature does")
    if "Inertia" in names:
        on.append("inertia: implicit dynamics")
        why.append("inertia is integrated in time, increment by increment")
    if any(i.contact for i in interfaces):
        on.append("contact of open faces")
    if any(getattr(i, "friction", None) for i in interfaces):
        on.append("Coulomb friction of closed faces")
    if path not in (None, "condensed", "newton"):
        raise InputError(f"path = '{path}': choose 'condensed', 'newton' or None")
    if why and path == "condensed":
        raise InputError(
            f"path='condensed' needs linear bodies, but {'; '.join(why)}; leave path out"
        )
    if path == "newton" and not why:
        why.append("path='newton' was asked for; the bodies are linear")
    if why:
        return Plan("newton", tuple(why), tuple(on))
    return Plan("condensed", ("the bodies are linear: one factorisation serves",), tuple(on))


def form_terms(continuum: Continuum, effects: Sequence[Any], loads: Sequence[Load]) -> list[Term]:
    """Terms of the bodies on the Newton path, one per effect."""
    forms = _forms(continuum)
    names = {type(e).__name__: e for e in effects}
    terms: list[Term] = []
    if "elastic" in forms:
        from fxcrack.continuum.elastic import Elastic

        finite = "FiniteStrain" in names or "neo_hookean" in forms
        terms.append(Elastic(continuum, finite=finite))
    if "neo_hookean" in forms:
        from fxcrack.continuum.neo_hookean import NeoHookeanBodies

        terms.append(NeoHookeanBodies(continuum))
    if "plastic" in forms:
        from fxcrack.continuum.plasticity import Plasticity

        terms.append(Plasticity(continuum))
    for load in loads:
        if isinstance(load, Pressure) and getattr(load, "follows", False):
            from fxcrack.continuum.follower_pressure import FollowerPressure

            terms.append(FollowerPressure(continuum, load))
    if "Inertia" in names:
        from fxcrack.continuum.inertia import InertiaForces

        terms.append(InertiaForces(continuum, names["Inertia"]))
    return terms


def dead_loads(continuum: Continuum, loads: Sequence[Load], path: str) -> list[Any]:
    """The loads that are force patterns: those that follow the bodies are terms instead.

    On the condensed path the temperature is a force pattern too.
    """
    out: list[Any] = [x for x in loads if not getattr(x, "follows", False)]
    if continuum.temperature is not None and path == "condensed":
        from fxcrack.continuum.thermal_strain import thermal_loads

        out += thermal_loads(continuum)
    return out
