"""Materials and criteria as lines of a deck."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fxcrack.base.errors import InputError
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.materials import (
    Isotropic,
    Material,
    NeoHookean,
    Orthotropic,
    Plastic,
    directions,
)
from fxcrack.continuum.temperature import ByTemperature
from fxcrack.criteria import (
    BK,
    VCCT,
    CrackLengthVsTime,
    CrackOpening,
    Criterion,
    CriticalStress,
    EnhancedVCCT,
    Fatigue,
    Power,
    Reeder,
    Tabulated,
)
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.deck.lines import number


def _row(values: list[float]) -> str:
    return ", ".join(number(v) for v in values)


# -- materials -------------------------------------------------------------------------------------


def material_lines(
    title: str, material: Material, inertia: Inertia | None = None
) -> tuple[list[str], list[str]]:
    """Lines of a material, and of its orientation if it has one.

    Args:
        title: Name of both.
        material: The material.
        inertia: Density of all bodies and damping, in a scene whose bodies move.

    Raises:
        InputError: A deck has no word for it.
    """
    out = [f'*MATERIAL, NAME="{title}"']
    kind = type(material)
    tables: list[tuple[float | None, Material]] = [(None, material)]
    if isinstance(material, ByTemperature):
        tables = list(zip(material.temperatures, material.materials, strict=True))
        kind = type(tables[0][1])
    first = tables[0][1]
    orientation: list[str] = []
    if kind is NeoHookean and isinstance(first, NeoHookean):
        mu = first.E / (2.0 * (1.0 + first.nu))
        bulk = first.E / (3.0 * (1.0 - 2.0 * first.nu))
        out += ["*HYPERELASTIC, NEO HOOKE", _row([0.5 * mu, 2.0 / bulk])]
    elif kind in (Isotropic, Plastic):
        out.append("*ELASTIC")
        out += [_row([m.E, m.nu, *_at(t)]) for t, m in tables]  # type: ignore[attr-defined]
        if isinstance(first, Plastic):
            strain, stress, slope = first.curve()
            out.append("*PLASTIC")
            if slope[-1]:
                raise InputError(
                    f"write_deck: {first}: a deck's yield stress stays after its last entry; give "
                    "hardening as a table"
                )
            out += [_row([s, e]) for e, s in zip(strain, stress, strict=True)]
    elif kind is Orthotropic:
        out.append("*ELASTIC, TYPE=ENGINEERING CONSTANTS")
        for t, m in tables:
            assert isinstance(m, Orthotropic)
            nine = [*m.E, *m.nu, *m.G]
            out += [_row(nine[:8]), _row([nine[8], *_at(t)])]
        assert isinstance(first, Orthotropic)
        orientation = [
            f'*ORIENTATION, NAME="{title}"',
            _row([x for direction in directions("Orthotropic", first.frame) for x in direction]),
        ]
    else:
        raise InputError(f"write_deck: material {material}: a deck has no word for it")
    density = getattr(material, "density", None)
    if inertia is not None:
        density = density if inertia.density is None else inertia.density
        by_mass, by_stiffness = inertia.rayleigh
        if by_mass or by_stiffness:
            out.append(f"*DAMPING, ALPHA={number(by_mass)}, BETA={number(by_stiffness)}")
    if density is not None:
        out += ["*DENSITY", number(density)]
    if any(np.any(m.expansion) for _, m in tables):  # type: ignore[attr-defined]
        out.append(f"*EXPANSION, TYPE={'ORTHO' if kind is Orthotropic else 'ISO'}")
        out += [_row([*np.atleast_1d(m.expansion), *_at(t)]) for t, m in tables]  # type: ignore[attr-defined]
    return out, orientation


def _at(temperature: float | None) -> list[float]:
    return [] if temperature is None else [temperature]


# -- criteria --------------------------------------------------------------------------------------


def criterion_lines(title: str, criterion: Criterion, nodal: bool) -> list[str]:
    """Lines of a criterion.

    Args:
        title: Of the interface, for messages.
        criterion: The criterion.
        nodal: Whether its toughness is given at the slave nodes.

    Raises:
        InputError: A deck has no word for it.
    """
    tolerance = f"TOLERANCE={number(getattr(criterion, 'tolerance', 0.0))}"
    if isinstance(criterion, CriticalStress):
        strengths = [criterion.sigma_f, criterion.tau1_f or 0.0, criterion.tau2_f or 0.0]
        head = f"TYPE=CRITICAL STRESS, DISTANCE={number(criterion.distance)}, {tolerance}"
        lines = [_row([*row, *t]) for row, t in _against_temperature(strengths)]
    elif isinstance(criterion, CrackOpening):
        symmetry = ", SYMMETRY" if criterion.symmetry else ""
        head = f"TYPE=COD, DISTANCE={number(criterion.distance)}, {tolerance}{symmetry}"
        if isinstance(criterion.critical, tuple):
            lengths, values = criterion.critical
            lines = [_row([v, x]) for x, v in zip(lengths, values, strict=True)]
        else:
            lines = [_row([row[0], 0.0, *t]) for row, t in _against_temperature(
                [criterion.critical])]  # fmt: skip
    elif isinstance(criterion, CrackLengthVsTime):
        if criterion.direction is not None:
            raise InputError(
                f"write_deck: interface '{title}': direction={criterion.direction} has no word in "
                "a deck: lengths are measured from the reference point itself there"
            )
        head = f'TYPE=CRACK LENGTH, NSET="{criterion.reference}", {tolerance}'
        pairs = zip(criterion.times, criterion.lengths, strict=True)
        lines = [_row([t, x]) for t, x in pairs]
    elif isinstance(criterion, RateCriterion):
        head, lines = _rates(title, criterion, nodal)
        head += f", {tolerance}"
    else:
        raise InputError(
            f"write_deck: interface '{title}': criterion {type(criterion).__name__}: a deck has no "
            "word for it"
        )
    return [f"*FRACTURE CRITERION, {head}", *lines]


def _rates(title: str, criterion: RateCriterion, nodal: bool) -> tuple[str, list[str]]:
    if criterion.method != "vcct" or criterion.normalisation != "equal_length":
        raise InputError(
            f"write_deck: interface '{title}': method='{criterion.method}' and normalisation="
            f"'{criterion.normalisation}' have no word in a deck; the defaults are what it is read "
            "with"
        )
    if criterion.mode_length is not None:
        raise InputError(
            f"write_deck: interface '{title}': mode_length={criterion.mode_length:g} has no word "
            "in a deck, whose modes are those of the element length; leave it out"
        )
    law, exponents = _law(title, criterion)
    head = f"MIXED MODE BEHAVIOR={law}"
    if nodal:
        head += ", NODAL ENERGY RATE"
    toughness = [criterion.GIc, criterion.GIIc, criterion.GIIIc]
    given: list[object] = _filled(toughness) if not nodal else [0.0, 0.0, 0.0]
    if isinstance(criterion, Fatigue):
        p = criterion.paris
        limits = () if p is None else (p.r1, p.r2)
        constant = [r for r in limits if isinstance(r, float)]
        if p is None or p.drive != "dG" or p.normalised or len(constant) < 2:
            raise InputError(
                f"write_deck: interface '{title}': a deck has words for a Paris law in dG with "
                "constant threshold and upper limit only"
            )
        if criterion.partial:
            raise InputError(f"write_deck: interface '{title}': partial=True has no word in a deck")
        if criterion.credit:
            raise InputError(f"write_deck: interface '{title}': credit=True has no word in a deck")
        paris = [p.c1, p.c2, p.c3, p.c4, *constant]
        rows = [[*paris, *row, *exponents, *t] for row, t in _against_temperature(given)]
        return f"TYPE=FATIGUE, {head}", _in_eights(rows)
    assert isinstance(criterion, VCCT | EnhancedVCCT)
    if criterion.unstable_tolerance is not None:
        value = criterion.unstable_tolerance
        head += ", UNSTABLE GROWTH TOLERANCE" + ("" if math.isinf(value) else f"={number(value)}")
    if criterion.viscosity:
        head += f", VISCOSITY={number(criterion.viscosity)}"
    kind = "VCCT"
    if isinstance(criterion, EnhancedVCCT):
        kind = "ENHANCED VCCT"
        given = [*given, *_filled([criterion.GIc_p, criterion.GIIc_p, criterion.GIIIc_p])]
    rows = [[*row, *exponents, *t] for row, t in _against_temperature(given)]
    return f"TYPE={kind}, {head}", _in_eights(rows)


def _law(title: str, criterion: RateCriterion) -> tuple[str, list[float]]:
    mix = criterion.mix
    if mix is None:
        return "BK", [0.0]
    if isinstance(mix, Power):
        return "POWER", [float(x) for x in mix.exponents]
    if isinstance(mix, BK | Reeder):
        return ("BK" if isinstance(mix, BK) else "REEDER"), [mix.eta]
    raise InputError(f"write_deck: interface '{title}': mix = {mix}: a deck has no word for it")


def _filled(toughness: Sequence[object]) -> list[object]:
    """Toughness by mode, one that is not given equal to the one before."""
    out: list[object] = []
    for value in toughness:
        out.append(out[-1] if value is None else value)
    return out


def _against_temperature(values: Sequence[object]) -> list[tuple[list[float], list[float]]]:
    """Rows of values, and the temperature of each if one of them is tabulated."""
    tables = [v for v in values if isinstance(v, Tabulated)]
    if not tables:
        return [([float(v) for v in values], [])]  # type: ignore[arg-type]
    knots = sorted({t for table in tables for t in table.temperatures})
    return [
        ([float(v.at(t)) if isinstance(v, Tabulated) else float(v) for v in values], [t])  # type: ignore[arg-type]
        for t in knots
    ]


def _in_eights(rows: list[list[float]]) -> list[str]:
    """Rows in lines of eight numbers."""
    return [_row(row[i : i + 8]) for row in rows for i in range(0, len(row), 8)]
