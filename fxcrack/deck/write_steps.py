"""Steps of a scene as procedures of a deck."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from fxcrack.base.errors import InputError
from fxcrack.continuum.inertia import Inertia
from fxcrack.deck.explicit import SAFETY
from fxcrack.deck.lines import number
from fxcrack.deck.procedures import DeckStep
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.end_conditions import Time
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.static import Dynamic, Static


def refuse(what: str) -> NoReturn:
    """Raise an error about what a deck cannot say."""
    raise InputError(f"write_deck: {what}: a deck has no word for it")


def step_lines(
    step: DeckStep, length: float, inertia: Inertia | None, *, finite: bool
) -> list[str]:
    """Lines of a step but its conditions, from ``*STEP`` on.

    Args:
        step: The step.
        length: Of the step, time.
        inertia: That of the scene, ``None`` without.
        finite: Whether bodies turn far.

    Raises:
        InputError: A deck has no word for it.
    """
    what = step.step
    count = what.max_increments if isinstance(what, Static) else 100
    out = [f'*STEP, NAME="{step.name}", NLGEOM={"YES" if finite else "NO"}, INC={count}']
    if inertia is not None and not isinstance(what, Dynamic | Explicit):
        refuse("the effect Inertia in a step without motion")
    if isinstance(what, Cycles):
        n_max = number(what.n_max) if np.isfinite(what.n_max) else "1e12"
        return [
            *out,
            "*DIRECT CYCLIC, FATIGUE",
            f"{number(0.1 * length)}, {number(length)}",
            f", , {n_max}",
        ]
    if isinstance(what, Explicit):
        return out + _explicit(what, length)
    if isinstance(what, Dynamic):
        out += _dynamic(what, length, inertia)
    else:
        sizes = (what.initial, length, what.minimum, min(what.maximum, length))
        out += ["*STATIC", ", ".join(number(x) for x in sizes)]
        if what.linear_scaling is not None:
            out += ["*CONTROLS, TYPE=VCCT LINEAR SCALING", number(what.linear_scaling)]
    return [
        *out,
        "*CONTROLS, PARAMETERS=TIME INCREMENTATION",
        f", , , , , , , {what.max_cutbacks}",
        f", {number(what.cutback)}, , , , , {number(what.growth)}",
    ]


def _dynamic(what: Dynamic, length: float, inertia: Inertia | None) -> list[str]:
    alpha_m, alpha_f = (0.0, -1.0) if inertia is None else inertia.parameters[:2]
    if inertia is None or alpha_m != 0.0 or not 0.0 <= alpha_f <= 1.0 / 3.0 or inertia.lumped:
        refuse(f"{inertia} in a Dynamic step; Inertia.hht(alpha) has one")
    return [f"*DYNAMIC, ALPHA={number(-alpha_f)}, DIRECT", f"{number(what.dt)}, {number(length)}"]


def _explicit(what: Explicit, length: float) -> list[str]:
    for name, default in (("start", "rest"), ("contact", "exact")):
        if getattr(what, name) != default:
            refuse(f"Explicit({name}='{getattr(what, name)}')")
    words = "*DYNAMIC, EXPLICIT"
    scale = what.safety / SAFETY
    if scale > 1.0:
        refuse(f"Explicit(safety={what.safety})")
    if scale < 1.0:
        words += f", SCALE FACTOR={number(scale)}"
    first, scaling = "", []
    if isinstance(what.mass_scale, str):
        assert what.dt is not None
        scaling = [f"*FIXED MASS SCALING, TYPE=BELOW MIN, DT={number(what.dt)}"]
    else:
        if what.dt is not None:
            words, first = f"{words}, DIRECT USER CONTROL", number(what.dt)
        if what.mass_scale != 1.0:
            scaling = [f"*FIXED MASS SCALING, FACTOR={number(what.mass_scale)}"]
    return [
        words,
        f"{first}, {number(length)}",
        *scaling,
        "*BULK VISCOSITY",
        ", ".join(number(b) for b in what.bulk),
        f"*OUTPUT, HISTORY, NUMBER INTERVAL={what.rows}",
    ]


def ends_of(steps: Sequence[DeckStep]) -> list[float]:
    """Total time at the end of each step.

    Raises:
        InputError: A step does not end at a time, or proceeds in another way than by increments.
    """
    out: list[float] = []
    for step in steps:
        what = step.step
        if isinstance(what, Cycles):
            start = out[-1] if out else 0.0
            if what.period is None or what.period[0] != start or what.ends:
                refuse(f"cycles {what} without a period that begins at time {start:g}")
            assert what.period is not None
            out.append(what.period[1])
            continue
        if isinstance(what, Static) and what.stepping != "increment":
            refuse(f"step '{step.name}' with stepping='{what.stepping}', use stepping='increment'")
        times = [e.time for e in what.ends if isinstance(e, Time)]
        if len(times) != 1 or len(what.ends) != 1:
            refuse(f"step '{step.name}' that does not end at a Time alone")
        out.append(times[0])
    return out


__all__ = ["ends_of", "refuse", "step_lines"]
