"""The vocabulary of accuracy studies: what a scene function is given and what it gives back.

A study is a function ``make(setting) -> Case`` that builds the same problem in any discretisation,
and the values of each setting that are worth trying.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.errors import InputError
from fxcrack.condensation.options import CondensedOptions
from fxcrack.history import BEFORE_RELEASE, History, Row
from fxcrack.scene import Scene
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.end_conditions import Until
from fxcrack.steps.static import Static

_CELLS = {
    **{"quadrilateral": 2, "triangle": 2, "hexahedron": 3, "tetrahedron": 3},
    **{"continuum shell": 3, "shell": 2, "shell with compliant bonds": 2},
}
_SHORT = {
    **{"quadrilateral": "quad", "triangle": "tri", "hexahedron": "hex", "tetrahedron": "tet"},
    **{"continuum shell": "continuum shell", "shell": "shell"},
    **{"shell with compliant bonds": "shell with compliant bonds"},
}
_ORDERS = {1: "1st", 2: "2nd"}


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One discretisation.

    Args:
        size: Element size along the crack (length).
        order: Order of mesh and displacement, 1 or 2.
        cell: "quadrilateral", "triangle", "hexahedron" or "tetrahedron"; "continuum shell" for
            hexahedra, or "shell" for quadrilaterals in space, as these elements;
            "shell with compliant bonds" for the latter with the compliance of their arms in bonds.
        method: How G is found: "vcct", "closure" or "domain".
        stepping: "event", "increment" or "path".
        tolerance: f_tol of increment stepping; ``None`` for the criterion's own.
        solver: How the bodies are condensed: a ``method`` of :class:`fxcrack.CondensedOptions`.
        ranks: Number of processes.
    """

    size: float
    order: int = 1
    cell: str = "quadrilateral"
    method: str = "vcct"
    stepping: str = "event"
    tolerance: float | None = None
    solver: str = "auto"
    ranks: int = 1

    def __post_init__(self) -> None:
        """Refuse what no scene function could make sense of."""
        if not (np.isfinite(self.size) and self.size > 0.0):
            raise InputError(f"Setting: size = {self.size} must be a positive length")
        if self.cell not in _CELLS:
            raise InputError(f"Setting: cell = '{self.cell}': choose {', '.join(_CELLS)}")
        if self.order not in _ORDERS or self.ranks < 1:
            raise InputError(
                f"Setting: order = {self.order} must be 1 or 2 and ranks = {self.ranks} at least 1"
            )
        if self.tolerance is not None and self.stepping != "increment":
            raise InputError(
                f"Setting: a tolerance is for stepping='increment', not for '{self.stepping}'"
            )

    @property
    def dimension(self) -> int:
        """Dimension of the cells, 2 or 3."""
        return _CELLS[self.cell]

    @property
    def line(self) -> Setting:
        """The same with size 1: what settings that differ in size alone have in common."""
        return replace(self, size=1.0)

    @property
    def title(self) -> str:
        """All but the size in words, what is usual left out."""
        words = [f"{_ORDERS[self.order]}-order {_SHORT[self.cell]}"]
        if self.method != "vcct":
            words.append(self.method)
        if self.stepping == "increment":
            words.append("incr." if self.tolerance is None else f"incr. tol {self.tolerance:g}")
        if self.solver != "auto":
            words.append(self.solver)
        if self.ranks > 1:
            words.append(f"{self.ranks} ranks")
        return ", ".join(words)

    def __str__(self) -> str:
        """The title with the size."""
        return f"{self.title}, size {self.size:g}"

    def options(self) -> CondensedOptions:
        """Options of the scene."""
        return CondensedOptions(method=self.solver)

    def step(self, until: Until | tuple[Until, ...]) -> Static:
        """A quasi-static step with this stepping, cut back as often as the tolerance needs."""
        return Static(until, stepping=self.stepping, max_cutbacks=40)

    def rate_options(self) -> dict[str, Any]:
        """Keywords for :class:`fxcrack.VCCT` and its kin: method and tolerance."""
        tolerance = {} if self.tolerance is None else {"tolerance": self.tolerance}
        return {"method": self.method, **tolerance}

    def as_dict(self) -> dict[str, Any]:
        """Plain types."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True)
class Measured:
    """What a run of a case gave, or a closed form gives; ``None`` for what the case has not.

    Args:
        load: Critical load.
        G: Energy release rate at a given load or opening.
        length: Crack length at a given load or opening.
        others: Anything else, by name.
    """

    load: float | None = None
    G: float | None = None
    length: float | None = None
    others: Mapping[str, float] = field(default_factory=dict)

    def values(self) -> dict[str, float]:
        """All that is there, by name."""
        own = {"load": self.load, "G": self.G, "length": self.length}
        return {k: float(v) for k, v in {**own, **self.others}.items() if v is not None}


@dataclass(frozen=True)
class ClosedForm:
    """Theoretical values of a case.

    Args:
        source: Whose theory, e.g. "Sneddon 1946".
        measured: Its values.
        exact: Whether a computation should converge to it. ``False`` for theories of another model,
            beams for instance: they are shown, and errors are counted from the finest run.
    """

    source: str
    measured: Measured
    exact: bool = False


@dataclass(frozen=True)
class Case:
    """A problem in one discretisation.

    Args:
        scene: The scene, not yet run.
        step: What to run.
        measure: Reads the values off the history.
        theory: A closed form, if there is one.
    """

    scene: Scene
    step: Static | Cycles
    measure: Callable[[History], Measured]
    theory: ClosedForm | None = None


@dataclass(frozen=True)
class Study:
    """A problem in every discretisation that is worth trying.

    The first of each is the base; see :func:`fxcrack.accuracy.family.settings` for what is combined
    with what.

    Args:
        make: The scene function.
        sizes: Element sizes, coarse to fine (length).
        orders: Orders.
        cells: Shapes of cells.
        methods: How G is found.
        steppings: Ways to step.
        tolerances: Tolerances of increment stepping, where that is among the steppings.
        solvers: Ways to condense.
        ranks: Numbers of processes.
        admits: Which settings are possible at all; ``None`` for every one.
        refers_to: Cells whose runs the errors are counted from, where no closed form is exact;
            empty for all. Elements of other theories tend to values of their own.
        title: What the problem is.
        unit: Unit of lengths.
    """

    make: Callable[[Setting], Case]
    sizes: tuple[float, ...] = ()
    orders: tuple[int, ...] = (1, 2)
    cells: tuple[str, ...] = ("quadrilateral", "triangle")
    methods: tuple[str, ...] = ("vcct", "closure")
    steppings: tuple[str, ...] = ("event",)
    tolerances: tuple[float, ...] = ()
    solvers: tuple[str, ...] = ("auto",)
    ranks: tuple[int, ...] = (1,)
    admits: Callable[[Setting], bool] | None = None
    refers_to: tuple[str, ...] = ()
    title: str = ""
    unit: str = ""

    def __call__(self, setting: Setting) -> Case:
        """Build the case."""
        return self.make(setting)


def study(**choices: Any) -> Callable[[Callable[[Setting], Case]], Study]:
    """Decorator that turns a scene function into a :class:`Study`.

    ::

        @study(sizes=(1.0, 0.5, 0.25), title="my beam", unit="mm")
        def beam(setting: Setting) -> Case: ...
    """

    def turn(make: Callable[[Setting], Case]) -> Study:
        title = choices.get("title") or make.__name__
        return Study(make, **{**choices, "title": title})

    return turn


# -- reading histories ---------------------------------------------------------------


def critical(history: History, interface: str) -> list[Row]:
    """Rows in which the crack is about to grow, in order of crack length.

    Args:
        history: A quasi-static history.
        interface: Name of the interface.

    Raises:
        InputError: The crack never grows.
    """
    name = f"f[{interface}]"
    rows = [
        row
        for row in history
        if row["event"] in (*BEFORE_RELEASE, "increment")
        and float(row.get(name, 0.0)) >= 1.0 - 1e-9
    ]
    if not rows:
        raise InputError(
            f"the crack of interface '{interface}' never grows in this history ({history.reason}); "
            "run the step further"
        )
    return rows


def along(rows: list[Row], at: str, value: float, column: str) -> float:
    """A column where another has a value, linear between rows.

    Args:
        rows: Rows in which ``at`` rises or falls all the way.
        at: Column with the given value.
        value: The value.
        column: Column wanted.

    Raises:
        InputError: The rows do not reach the value.
    """
    x, y = (np.array([float(row[c]) for row in rows]) for c in (at, column))
    if x[0] > x[-1]:
        x, y = x[::-1], y[::-1]
    near = 1e-9 * max(abs(x[0]), abs(x[-1]))
    if not x[0] - near <= value <= x[-1] + near:
        raise InputError(
            f"{at} runs from {x[0]:.6g} to {x[-1]:.6g} and does not reach {value:.6g}; run the "
            "step further, or ask for another value"
        )
    return float(np.interp(value, x, y))


def as_number(value: npt.ArrayLike) -> float:
    """A Python number from an array of shape ()."""
    return float(np.asarray(value, dtype=float))
