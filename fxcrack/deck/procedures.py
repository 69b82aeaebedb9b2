"""Steps of a deck as steps of the scene.

``*STATIC``, ``*VISCO``, ``*DYNAMIC``, ``*DIRECT CYCLIC``, ``*FATIGUE`` and ``*CONTROLS``.
A new procedure is one function in :data:`PROCEDURES`; explicit dynamics has a module of its own,
:mod:`fxcrack.deck.explicit`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from fxcrack.base.errors import InputError
from fxcrack.continuum.inertia import Inertia
from fxcrack.deck.cards import Card
from fxcrack.deck.explicit import explicit_step, explicit_words
from fxcrack.deck.model import Family
from fxcrack.deck.report import Report
from fxcrack.deck.tracks import Period
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.end_conditions import Time
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.static import Dynamic, Static

_SMALLEST = 1e-5
"""Smallest increment where the deck gives none, as part of the step."""


@dataclass(eq=False)
class DeckStep:
    """A step of a deck, to be changed and run.

    Attributes:
        name: Its name in the deck.
        step: What :meth:`fxcrack.Scene.run` takes.
        grow: Names of the interfaces that may grow in it.
        frequency: Increments between two outputs of their crack tips, 0 for none.
    """

    name: str
    step: Static | Cycles | Explicit
    grow: tuple[str, ...] = ()
    frequency: dict[str, int] = field(default_factory=dict)


@dataclass(eq=False)
class Procedure:
    """What the cards of a step say beside its loads.

    Attributes:
        card: The card of the procedure.
        period: Its beginning and end in total time.
        step: The step of the scene.
        finite: Whether NLGEOM is on.
        inertia: The effect it needs of the scene, None for a quasi-static step.
    """

    card: Card
    period: Period
    step: Static | Cycles | Explicit
    finite: bool
    inertia: Inertia | None = None


@dataclass
class _Controls:
    """What ``*CONTROLS`` and ``*STEP`` say of increments; later steps inherit it."""

    linear_scaling: float | None = None
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _Asked:
    """What a procedure reads."""

    card: Card
    start: float
    max_increments: int
    controls: _Controls
    ramp: bool | None
    report: Report
    step: Family

    def period(self, length: float, *, ramp: bool, moving: bool = False) -> Period:
        chosen = ramp if self.ramp is None else self.ramp
        return Period(self.start, self.start + length, chosen, moving)


def read_procedures(steps: Sequence[Family], report: Report) -> list[Procedure]:
    """Procedures of all steps, in total time.

    Raises:
        DeckError: A step has no procedure or two, or one that is not available.
    """
    out: list[Procedure] = []
    controls, time, finite = _Controls(), 0.0, False
    for family in steps:
        if family.card.has("PERTURBATION"):
            if len(steps) > 1:
                family.card.fail(
                    "PERTURBATION, a linear step about the state before, is not available beside "
                    "others; compute each as a deck of its own, where a *STATIC one begins from "
                    "the undeformed bodies"
                )
            report.replace(
                "the linear step about the undeformed bodies is computed as one with NLGEOM=NO, in "
                "which contact opens and closes",
                family.card,
            )
        else:
            finite = _nlgeom(family.card, finite)
        for card in family.cards:
            if card.keyword == "CONTROLS":
                _read_controls(card, controls, report)
        found = [card for card in family.cards if card.keyword in PROCEDURES]
        if len(found) != 1:
            family.card.fail(
                f"the step has {len(found)} procedures; one of *STATIC, *VISCO, *DYNAMIC, *DIRECT "
                "CYCLIC and *FATIGUE is needed"
            )
        asked = _Asked(
            found[0],
            time,
            max(int(family.card.number("INC", 100)), 1),
            controls,
            _ramp(family.card),
            report,
            family,
        )
        explicit = found[0].keyword == "DYNAMIC" and found[0].has("EXPLICIT")
        if not explicit:
            for card in explicit_words(family):
                card.fail("it belongs to explicit dynamics, *DYNAMIC, EXPLICIT; leave it out")
        elif not family.card.has("NLGEOM") and not finite:
            report.replace(
                "NLGEOM is on, as in every explicit step that does not say NLGEOM=NO", family.card
            )
            finite = True
        try:
            period, step, inertia = PROCEDURES[found[0].keyword](asked)
        except InputError as error:
            if type(error) is not InputError:
                raise
            found[0].fail(str(error))
        if out and isinstance(out[-1].step, Cycles) and not isinstance(step, Cycles):
            found[0].fail("after a step of cycles only further steps of cycles are available")
        if isinstance(step, Cycles) and finite:
            family.card.fail(
                "cycles need NLGEOM=NO in a deck; at finite strain run them from Python, fx.Cycles"
            )
        if out and isinstance(step, Explicit) != isinstance(out[0].step, Explicit):
            found[0].fail(
                "explicit steps and others in one deck are not available; compute them as two decks"
            )
        if out and (inertia is None) != (out[0].inertia is None):
            found[0].fail(
                "dynamic and quasi-static steps in one deck are not available; compute them as two"
            )
        if out and inertia is not None and inertia != out[0].inertia:
            found[0].fail("the time integration must be the same in all dynamic steps")
        out.append(Procedure(found[0], period, step, finite, inertia))
        time = period.end
    return out


def _nlgeom(card: Card, before: bool) -> bool:
    if not card.has("NLGEOM"):
        return before
    if not card.options["NLGEOM"]:
        return True
    return card.choose("NLGEOM", ("YES", "NO"), "YES") == "YES" or before


def _ramp(card: Card) -> bool | None:
    """Whether the step asks for ramps or steps, None where the procedure decides."""
    if not card.has("AMPLITUDE"):
        return None
    return card.choose("AMPLITUDE", ("RAMP", "STEP"), "RAMP") == "RAMP"


def _read_controls(card: Card, controls: _Controls, report: Report) -> None:
    if card.has("RESET"):
        controls.linear_scaling, controls.options = None, {}
        return
    if card.word("TYPE") == "VCCTLINEARSCALING":
        rows = card.rows()
        controls.linear_scaling = rows[0].number(0, 0.9) if rows else 0.9
        return
    if card.word("PARAMETERS") == "TIMEINCREMENTATION":
        rows = card.rows()
        if rows and rows[0].text(7):
            controls.options["max_cutbacks"] = rows[0].whole(7)
        if len(rows) > 1:
            if rows[1].text(1):
                controls.options["cutback"] = rows[1].number(1)
            if rows[1].text(6):
                controls.options["growth"] = rows[1].number(6)
        return
    report.replace("a control of the other program's solution method; left out", card)


# -- procedures ------------------------------------------------------------------------------------

Found = tuple[Period, Static | Cycles | Explicit, Inertia | None]


def _increments(asked: _Asked) -> tuple[float, dict[str, Any]]:
    """Length of the step, and sizes of its increments."""
    rows = asked.card.rows()
    card = asked.card
    first = rows[0].number(0, 0.0) if rows else 0.0
    length = (rows[0].number(1, 0.0) if rows else 0.0) or 1.0
    if length < 0.0 or first < 0.0:
        card.fail(f"increment {first:g} and time {length:g} of the step must be positive")
    first = min(first or length, length)
    if card.has("DIRECT"):
        return length, {"initial": first, "minimum": first, "maximum": first}
    smallest = (rows[0].number(2, 0.0) if rows else 0.0) or _SMALLEST * length
    largest = (rows[0].number(3, 0.0) if rows else 0.0) or length
    return length, {
        "initial": min(first, largest),
        "minimum": min(smallest, first, largest),
        "maximum": largest,
    }


def _static(asked: _Asked) -> Found:
    card = asked.card
    if card.has("RIKS"):
        card.fail(
            "RIKS is not available from a deck; run the step in Python with Static(stepping='path')"
            ", which follows a proportional load down as well"
        )
    if card.has("STABILIZE", "ALLSDTOL", "FACTOR"):
        asked.report.replace("the damping of STABILIZE is left out", card)
    length, sizes = _increments(asked)
    period = asked.period(length, ramp=True)
    step = Static(
        until=Time(period.end),
        stepping="increment",
        max_increments=asked.max_increments,
        linear_scaling=asked.controls.linear_scaling,
        **sizes,
        **asked.controls.options,
    )
    return period, step, None


def _visco(asked: _Asked) -> Found:
    asked.report.replace("no material depends on time, so the step is a *STATIC one", asked.card)
    return _static(asked)


def _dynamic(asked: _Asked) -> Found:
    card = asked.card
    if card.has("EXPLICIT"):
        return _explicit(asked)
    kinds = ("TRANSIENT FIDELITY", "MODERATE DISSIPATION", "QUASI-STATIC")
    kind = card.choose("APPLICATION", kinds, "TRANSIENT FIDELITY")
    length, sizes = _increments(asked)
    alpha = card.number("ALPHA", -0.05 if kind == "TRANSIENT FIDELITY" else -1.0 / 3.0)
    if alpha < -1.0 / 3.0 or (kind != "TRANSIENT FIDELITY" and not card.has("ALPHA")):
        asked.report.replace(
            f"the integration of APPLICATION={kind} is replaced by that of Hilber, Hughes and "
            "Taylor with alpha = -1/3, its largest damping",
            card,
        )
        alpha = -1.0 / 3.0
    if card.has("HAFTOL", "HALFINC SCALE FACTOR") or not card.has("DIRECT"):
        asked.report.replace(
            f"increments of the time step {sizes['initial']:g} are kept, and cut back only where "
            "equilibrium or the crack asks for it",
            card,
        )
    period = asked.period(length, ramp=kind == "QUASI-STATIC", moving=True)
    step = Dynamic(
        until=Time(period.end),
        dt=sizes["initial"],
        max_increments=asked.max_increments,
        **asked.controls.options,
    )
    return period, step, Inertia.hht(alpha)


def _explicit(asked: _Asked) -> Found:
    """``*DYNAMIC, EXPLICIT``: second field of the data line is the length of the step."""
    length, step = explicit_step(asked.card, asked.step, asked.start, asked.report)
    # the effect brings densities, velocity at the start and damping; its alphas are not used
    return asked.period(length, ramp=False, moving=True), step, Inertia()


def _cyclic(asked: _Asked) -> Found:
    card = asked.card
    if card.keyword == "DIRECTCYCLIC" and not card.has("FATIGUE"):
        card.fail("*DIRECT CYCLIC is available with FATIGUE only; run cycles by *STATIC steps")
    rows = card.need_rows("increment, time of a cycle")
    length = rows[0].number(1, 0.0)
    if length <= 0.0:
        rows[0].fail("the time of one cycle is missing in the second field")
    n_max = float("inf")
    if len(rows) > 1:
        n_max = rows[1].number(2, 0.0) or 1.0 + 0.5 * rows[1].number(1, 1000.0)
    period = asked.period(length, ramp=True)
    if card.keyword == "DIRECTCYCLIC":
        asked.report.replace(
            "the Fourier series is replaced by the equilibria of the cycle themselves", card
        )
    return period, Cycles(period=(period.start, period.end), n_max=n_max), None


PROCEDURES: dict[str, Callable[[_Asked], Found]] = {
    "STATIC": _static,
    "VISCO": _visco,
    "DYNAMIC": _dynamic,
    "DIRECTCYCLIC": _cyclic,
    "FATIGUE": _cyclic,
}
"""What makes the step of each procedure card."""
