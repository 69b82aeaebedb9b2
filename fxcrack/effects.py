"""Effects a scene may include, and the solver they need.

A bare scene is linear and condensed once. Each effect adds one form term in the bodies, one load
pattern or one law of the interface; what is not named does not exist in the scene: no form, no
unknown, no memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fxcrack.base import log
from fxcrack.base.errors import InputError
from fxcrack.continuum.conserving import conserving
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.generalised_plane_strain import shared_unknowns
from fxcrack.continuum.inertia import Inertia, InertiaForces
from fxcrack.continuum.loads import Load, Pressure
from fxcrack.continuum.neo_hookean import NeoHookeanBodies
from fxcrack.continuum.plasticity import Plasticity
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_elastic import ShellElastic
from fxcrack.continuum.temperature import Temperature, expansion_of
from fxcrack.continuum.term import Term
from fxcrack.continuum.thermal_strain import is_linear, thermal_loads
from fxcrack.continuum.tied_elastic import TiedElastic
from fxcrack.interface.crack_fluid import CrackFluid
from fxcrack.interface.crack_pressure import CrackPressure
from fxcrack.interface.definition import Interface
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports
from fxcrack.solvers.plan import SOLVERS, Plan


@dataclass(frozen=True)
class FiniteStrain:
    """Large rotations and strains of the bodies.

    Elastic materials follow the St. Venant-Kirchhoff law (their stiffness between the second
    Piola-Kirchhoff stress and the Green-Lagrange strain). Normals at crack fronts are those
    of the deformed bodies, energy release rates are per undeformed area, and open faces are paired
    anew as they slide.
    """


_KNOWN = (FiniteStrain, Temperature, Inertia)


def temperature_of(effects: Sequence[Any]) -> Temperature | None:
    """The temperature among some effects, ``None`` if there is none.

    Raises:
        InputError: An effect is given twice, or is none that a scene knows.
    """
    names = [type(e).__name__ for e in effects]
    for effect, name in zip(effects, names, strict=True):
        if isinstance(effect, type) and issubclass(effect, _KNOWN):
            raise InputError(
                f"effects: {effect.__name__} is a class; make one, {effect.__name__}(...)"
            )
        if not isinstance(effect, _KNOWN):
            raise InputError(
                f"effects: {name} is not an effect; known: {', '.join(k.__name__ for k in _KNOWN)} "
                "(friction belongs to Interface, a pressure that follows to Pressure, plasticity "
                "to the material)"
            )
        if names.count(name) > 1:
            raise InputError(f"effects: {name} is given twice; give it once")
    return next((e for e in effects if isinstance(e, Temperature)), None)


def _forms(continuum: Continuum) -> set[str]:
    """Which forms the materials need."""
    return {
        getattr(m, "form", "elastic")
        for i, m in enumerate(continuum.part_materials)
        if i not in continuum.tied_cells
    }


def _is_finite(forms: set[str], effects: Sequence[Any]) -> bool:
    return any(isinstance(e, FiniteStrain) for e in effects) or "neo_hookean" in forms


def is_finite(continuum: Continuum, effects: Sequence[Any]) -> bool:
    """Whether strains and rotations of some bodies are finite, so that open faces slide."""
    return _is_finite(_forms(continuum), effects)


def _follows(load: Load) -> bool:
    """Whether a load is a pressure that follows the bodies."""
    return isinstance(load, Pressure) and load.follows


def _check_shells(loads: Sequence[Load]) -> None:
    """Refuse what shells cannot have."""
    for load in filter(_follows, loads):
        raise InputError(
            f"pressure '{load.title}': a pressure on a shell keeps its direction; leave out follows"
        )


def _check_section(
    continuum: Continuum, effects: Sequence[Any], loads: Sequence[Load], finite: bool
) -> None:
    """Refuse what generalised plane strain does not have."""
    if not continuum.layout.shared:
        return
    for load in filter(_follows, loads):
        raise InputError(
            f"pressure '{load.title}': GeneralisedPlaneStrain is for small strain, in which a "
            "pressure keeps its direction; leave out follows"
        )
    if finite:
        raise InputError(
            "GeneralisedPlaneStrain is for small strain; leave out FiniteStrain() and NeoHookean, "
            "or use PlaneStrain or a Solid"
        )
    inertia = next((e for e in effects if isinstance(e, Inertia)), None)
    if inertia is not None and inertia.velocity is not None and inertia.rayleigh[1]:
        raise InputError(
            "GeneralisedPlaneStrain: bodies with a velocity at the start and damping by stiffness "
            "have no first acceleration, as the strain out of the plane has no mass; use damping "
            "by mass, Inertia(rayleigh=(r, 0.0)), or begin at rest"
        )


def plan(
    continuum: Continuum,
    effects: Sequence[Any],
    loads: Sequence[Load],
    interfaces: Sequence[Interface],
    solver: str | None,
) -> Plan:
    """Choose the solver; collective.

    Args:
        continuum: Bodies with their materials and temperature.
        effects: The effects of the scene.
        loads: Its force patterns.
        interfaces: Its interfaces.
        solver: The solver the user insists on, ``None`` for the cheapest that will do.

    Raises:
        InputError: Effects that exclude each other, or a solver that cannot serve them.
    """
    why, on = [], []
    forms = _forms(continuum)
    finite = _is_finite(forms, effects)
    if isinstance(continuum, ShellBodies):
        _check_shells(loads)
    if finite and "plastic" in forms:
        raise InputError(
            "Plastic is a law for small strain and cannot stand beside finite strain; leave out "
            "FiniteStrain() and NeoHookean, or use an elastic material"
        )
    _check_section(continuum, effects, loads, finite)
    if continuum.layout.shared:
        names = ", ".join(s.title for s in shared_unknowns(continuum.model))
        on.append(f"generalised plane strain: {names} of the whole section")
    if finite:
        on.append("finite strain: large rotations and strains of the bodies")
        why.append("finite strain makes the bodies nonlinear")
    if "neo_hookean" in forms:
        on.append("neo-Hookean material")
    if "plastic" in forms:
        on.append("plasticity: J2 with isotropic hardening")
        why.append("plasticity makes the bodies nonlinear")
    for load in filter(_follows, loads):
        on.append(f"follower pressure '{load.title}'")
        why.append(f"pressure '{load.title}' follows the bodies")
    for load in loads:
        if isinstance(load, Pressure) and load.follows_crack:
            on.append(f"pressure '{load.title}' on the faces of a crack as they open")
    if continuum.temperature is not None:
        if not any(
            hasattr(m, "temperatures") or expansion_of(m).any() for m in continuum.part_materials
        ):
            log.warn(
                "Temperature: no material expands, so it strains nothing; give the materials an "
                "expansion, unless only the interface depends on temperature"
            )
        on.append("temperature: thermal strain and what is tabulated against temperature")
        if not is_linear(continuum):
            why.append("moduli change as the temperature does")
    if any(isinstance(e, Inertia) for e in effects):
        on.append("inertia: implicit dynamics")
        why.append("inertia is integrated in time, increment by increment")
    if any(i.contact for i in interfaces):
        on.append("contact of open faces")
    if any(i.friction for i in interfaces):
        on.append("Coulomb friction of closed faces")
    if solver is not None and solver not in SOLVERS:
        raise InputError(f"solver = '{solver}': choose 'linear', 'newton' or None")
    if why and solver == "linear":
        raise InputError(
            f"solver='linear' needs linear bodies, but {'; '.join(why)}; leave solver out"
        )
    if solver == "newton" and not why:
        why.append("solver='newton' was asked for; the bodies are linear")
    if why:
        return Plan("newton", tuple(why), tuple(on))
    return Plan("linear", ("the bodies are linear: one factorisation serves",), tuple(on))


def form_terms(continuum: Continuum, effects: Sequence[Any], loads: Sequence[Load]) -> list[Term]:
    """Terms of the bodies for the Newton solver, one per effect."""
    forms = _forms(continuum)
    terms: list[Term] = []
    if isinstance(continuum, ShellBodies):
        terms.append(ShellElastic(continuum, finite=_is_finite(forms, effects)))
    if continuum.tied_cells:
        terms.append(TiedElastic(continuum, finite=_is_finite(forms, effects)))
    if "elastic" in forms:
        terms.append(Elastic(continuum, finite=_is_finite(forms, effects)))
    if "neo_hookean" in forms:
        terms.append(NeoHookeanBodies(continuum))
    if "plastic" in forms:
        terms.append(Plasticity(continuum))
    terms += [
        FollowerPressure(continuum, x) for x in loads if isinstance(x, Pressure) and x.follows
    ]
    for effect in (e for e in effects if isinstance(e, Inertia)):
        terms = [*conserving(continuum, terms, effect), InertiaForces(continuum, effect)]
    return terms


def crack_fluids(
    continuum: Continuum, effects: Sequence[Any], loads: Sequence[Any], pairs: Sequence[Pair]
) -> list[Term]:
    """Terms of pressures that follow the crack where its faces turn; collective.

    Args:
        continuum: The bodies.
        effects: The effects of the scene.
        loads: Its force patterns.
        pairs: Its interfaces; replaced in this list where nodes are paired anew.
    """
    if not is_finite(continuum, effects):
        return []
    return [CrackFluid(continuum, x, pairs) for x in loads if isinstance(x, CrackPressure)]


def dead_loads(
    continuum: Continuum,
    loads: Sequence[Load],
    solver: str,
    pairs: Sequence[Pair],
    supports: Supports,
) -> list[Any]:
    """The loads that are force patterns: those that follow the bodies are terms instead.

    For the linear solver the temperature is a force pattern too.
    """
    out: list[Any] = [x for x in loads if not _follows(x)]
    for i, load in enumerate(out):
        if isinstance(load, Pressure) and load.follows_crack:
            out[i] = CrackPressure.of(load, pairs, continuum, supports)
    if continuum.temperature is not None and solver == "linear":
        out += thermal_loads(continuum)
    return out
