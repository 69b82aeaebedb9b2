"""The load that a scene predicts at each opening, for any toughness.

A linear scene with one crack tip under a proportional load is solved once. At every crack length
a_i its opening q, load p and energy release rates G_I, G_II, G_III are those of one state, and at
another load all openings are s q, loads s p, rates s^2 G. So with the toughness as a criterion
gives it, growth is at

    s_i^2 = G_c(mode mix_i, x_i)/(G_I + G_II + G_III)_i ,

whatever the toughness and wherever it varies along the path: none of it needs another solution, and
for one toughness alone all loads and openings scale with sqrt(G_c).

Under a prescribed opening the crack grows while its onset opening s_i q_i is below it. Where the
onset opening falls with the crack length, growth is unstable: the load falls at that opening to
the first crack length that needs more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import check_instance, finite, keep_floats
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.criteria.criterion import Criterion
from fxcrack.criteria.mixed_mode import total
from fxcrack.criteria.vcct import VCCT
from fxcrack.history import BEFORE_RELEASE, History
from fxcrack.scene import Scene
from fxcrack.solvers.linear import LinearSolver
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.end_conditions import CrackLength
from fxcrack.steps.static import Static

PROPORTIONAL = 1e-6
"""Relative difference of a compliance at two loads that round-off may make (condition 1e9 times
1e-16, and a margin)."""


@dataclass(frozen=True)
class Axes:
    """Which columns of a history are compared with the measured opening and load.

    Attributes:
        opening: Column, such as "u[pin_top.y]".
        load: Column, such as "R[pin_top.y]".
        opening_factor: Measured opening over the column; 2 where the column is that of one arm of
            two, -1 where the load acts against the axis.
        load_factor: Measured load over the column.
    """

    opening: str
    load: str
    opening_factor: float = 1.0
    load_factor: float = 1.0

    def __post_init__(self) -> None:
        """Check the factors."""
        finite("Axes", opening_factor=self.opening_factor, load_factor=self.load_factor)
        keep_floats(self, "opening_factor", "load_factor")
        if self.opening_factor == 0.0 or self.load_factor == 0.0:
            raise InputError("Axes: a factor of zero leaves nothing to compare; give another")

    def of(self, history: History) -> tuple[Array, Array]:
        """Opening and load in all rows, shapes (n_rows,).

        Raises:
            InputError: The history lacks a column.
        """
        for name in (self.opening, self.load):
            if name not in history.columns:
                unknown_name("column", name, history.columns)
        return (
            self.opening_factor * history[self.opening].astype(float),
            self.load_factor * history[self.load].astype(float),
        )


@dataclass(frozen=True, eq=False)
class Curve:
    """A predicted load over opening, piecewise linear from the origin.

    Attributes:
        opening: Openings that never fall, shape (n,) [length]; two alike where the load drops.
        load: Loads, shape (n,) [force].
    """

    opening: Array
    load: Array

    @property
    def end(self) -> float:
        """Opening at which the prediction ends [length]."""
        return float(self.opening[-1])

    def at(self, opening: npt.ArrayLike) -> Array:
        """Loads at some openings, of their shape.

        Beyond the end the last load goes on as (opening)^(-1/2), the law of a slender double
        cantilever beam, so that a search may pass there; :func:`fxcrack.identify.fit` refuses a
        result that relies on it.
        """
        x = np.asarray(opening, dtype=float)
        inside = np.interp(x, self.opening, self.load)
        beyond = np.sqrt(self.end / np.maximum(x, self.end))
        return np.asarray(inside * beyond)


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """A crack that was grown once in a linear scene; made by :func:`linear_response`.

    Attributes:
        a: Crack lengths, increasing, shape (n,) [length].
        opening: Opening at an equilibrium of each crack length, shape (n,) [length].
        load: Load there, shape (n,) [force].
        rates: G_I, G_II, G_III there, shape (n, 3) [force/length].
        x: Positions of the tip, shape (n, 3) [length].
        nodes: Slave nodes at the tip, shape (n,).
        n_slave: Number of slave nodes of the interface.
    """

    a: Array
    opening: Array
    load: Array
    rates: Array
    x: Array
    nodes: Ints
    n_slave: int

    def factors(self, criterion: VCCT) -> Array:
        """Factor s on the loads of each crack length at which the crack grows, shape (n,).

        Raises:
            InputError: The criterion needs temperatures, or its toughness is not positive.
        """
        toughness = criterion.toughness_at(self.x, self.nodes, n_slave=self.n_slave)
        critical = criterion.critical(self.rates, toughness)
        return np.asarray(np.sqrt(critical / total(self.rates)))

    def curve(self, criterion: Criterion) -> Curve:
        """Load over a growing opening for a criterion.

        Raises:
            InputError: It is no :class:`~fxcrack.VCCT`, or as for :meth:`factors`.
        """
        check_instance("LinearResponse", "criterion", criterion, VCCT, "VCCT(GIc=0.2)")
        assert isinstance(criterion, VCCT)
        s = self.factors(criterion)
        q, p = s * self.opening, s * self.load
        openings, loads = [0.0, q[0]], [0.0, p[0]]
        last = 0
        highest = np.concatenate(([-np.inf], np.maximum.accumulate(q)[:-1]))
        for i in np.flatnonzero(q > highest)[1:].tolist():
            if i > last + 1:  # unstable: all lengths in between need less than is there
                openings.append(q[last])
                loads.append(q[last] * p[i] / q[i])
            openings.append(q[i])
            loads.append(p[i])
            last = i
        if last < len(q) - 1:  # still unstable at the last length: what follows is not known
            openings.append(q[last])
            loads.append(q[last] * p[-1] / q[-1])
        return Curve(np.array(openings), np.array(loads))


def linear_response(scene: Scene, until: CrackLength, axes: Axes) -> LinearResponse:
    """Grow the crack of a linear scene once, for all later comparisons; collective.

    Args:
        scene: A plane or axisymmetric scene of which no step was run, with linear bodies, one
            crack with one tip and a proportional load. The toughness in it does not matter.
        until: Crack length up to which the comparison may go.
        axes: Columns that are compared with the measurement.

    Raises:
        InputError: The scene is nonlinear, has another number of tips, or is not proportional:
            gaps that close, preloads, friction or temperatures.
    """
    owner = "linear_response"
    check_instance(owner, "scene", scene, Scene, "Scene(mesh, ...)")
    check_instance(owner, "until", until, CrackLength, "CrackLength(bond, 60.0)")
    check_instance(owner, "axes", axes, Axes, "Axes('u[pin_top.y]', 'R[pin_top.y]')")
    if len(scene.history):
        raise InputError(f"{owner}: a step of the scene was run already; give a new scene")
    if not isinstance(scene.solver, LinearSolver):
        raise InputError(
            f"{owner}: the bodies are nonlinear, so that loads do not scale; give "
            "fit a function that runs the scene with a criterion and returns its history"
        )
    if scene.mesh.gdim != 2 or len(scene.debonds) != 1:
        raise InputError(
            f"{owner}: {scene.mesh.gdim}-D with {len(scene.debonds)} debonds; one crack in a plane "
            "or axisymmetric scene has one tip. Give fit a function that runs the scene instead"
        )
    debond = scene.debonds[0]
    check_instance(owner, "the criterion of the debond", debond.criterion, VCCT, "VCCT(GIc=0.2)")
    history = scene.run(Static(until=until, stepping="path"), progress=False)
    opening, load = axes.of(history)
    name = debond.interface.title
    _check_tip(scene.analysis, name)
    rates = np.column_stack([history[f"G{mode}[{name}]"].astype(float) for mode in _modes(history)])
    if rates.shape[1] == 2:  # a plane has no mode III
        rates = np.column_stack((rates, np.zeros(len(rates))))
    a = history[f"a[{name}]"].astype(float)
    onset = np.flatnonzero(np.isin(history["event"], BEFORE_RELEASE))
    if len(onset) < 2:
        raise InputError(f"{owner}: the crack did not grow; give a larger length in until")
    _check_proportional(a, opening, load, total(rates))
    if not (opening[onset] * load[onset] > 0.0).all() or load[onset].min() < 0.0:
        raise InputError(
            f"{owner}: opening {opening[onset[0]]:g} and load {load[onset[0]]:g} must be positive "
            "as the crack grows; change the signs of the factors of Axes"
        )
    nodes = history[f"node[{name}]"][onset].astype(np.int64)
    surface = scene.analysis.active[0].front.surface
    return LinearResponse(
        a[onset], opening[onset], load[onset], rates[onset],
        np.asarray(surface.x[nodes], dtype=float), nodes, len(surface.x),
    )  # fmt: skip


def _modes(history: History) -> list[str]:
    return [m for m in ("I", "II", "III") if any(c.startswith(f"G{m}[") for c in history.columns)]


def _check_tip(analysis: Analysis, name: str) -> None:
    """Refuse a crack with several tips, whose order of growth depends on the toughness."""
    n = len(analysis.active[0].tips())
    if n != 1:
        raise InputError(
            f"linear_response: the crack of '{name}' has {n} tips; its order of growth depends on "
            "the toughness. Give fit a function that runs the scene instead"
        )


def _check_proportional(a: Array, opening: Array, load: Array, rate: Array) -> None:
    """Refuse a response whose compliance or whose G/P^2 differs between two loads at one length."""
    scale = np.abs(load).max()
    for i in range(len(a) - 1):
        apart = abs(load[i + 1] - load[i])
        if a[i] != a[i + 1] or apart < 1e-3 * scale or min(abs(load[i : i + 2])) < 1e-3 * scale:
            continue
        p = load[i : i + 2]
        pairs = {"opening/load": opening[i : i + 2] / p, "G/load^2": rate[i : i + 2] / p**2}
        for what, value in pairs.items():
            # the larger one is zero only if both are
            off = abs(value[1] - value[0]) / (np.abs(value).max() or 1.0)
            if off > PROPORTIONAL * scale / apart:
                raise InputError(
                    f"linear_response: {what} at the crack length {a[i]:g} differs by {off:.2g} "
                    f"between the loads {load[i]:g} and {load[i + 1]:g}: the scene is not "
                    "proportional. Give fit a function that runs the scene instead"
                )


def curve_of(history: History, axes: Axes) -> Curve:
    """Load over a growing opening from a history, whatever the scene.

    Points are the onsets and, where several nodes are released at one opening (unstable growth),
    the state after the last of these as well. In increment stepping they are all increments.

    Raises:
        InputError: A column is missing, or the crack did not grow.
    """
    check_instance("curve_of", "history", history, History, "scene.history")
    check_instance("curve_of", "axes", axes, Axes, "Axes('u[tip]', 'R[tip]')")
    opening, load = axes.of(history)
    event = history["event"]
    released = sum(
        history[c].astype(float) for c in history.columns if c.startswith("released[")
    ) + np.zeros(len(event))
    if not (released[-1] > released[0] if len(event) else False):
        raise InputError("fit: the crack did not grow in the scene; load it further")
    kept = [0]
    growth = np.isin(event, BEFORE_RELEASE)
    if growth.any():
        size = np.abs(opening).max()
        onset = np.flatnonzero(growth).tolist()
        for i in onset:
            if i < kept[-1]:
                continue
            alike = np.abs(opening[i:] - opening[i]) <= 1e-12 * size
            last = i + (int(np.argmin(alike)) if not alike.all() else len(alike)) - 1
            kept.append(i)
            if released[last] > released[i] + 1.0:
                kept.append(last)
    else:
        kept = np.flatnonzero(event == "increment").tolist()
    x, y = opening[kept], load[kept]
    forward = x >= np.maximum.accumulate(x) * (1.0 - 1e-12)
    return Curve(np.maximum.accumulate(x[forward]), y[forward])


Simulation = Callable[[Criterion], History]
"""Runs a scene with a criterion and returns its history."""
