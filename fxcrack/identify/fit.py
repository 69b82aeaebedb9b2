"""Toughness from measured load-opening data, by least squares on whole histories.

    minimise over the parameters  sum over tests and points ( (P_predicted(u) - P)/scale )^2 ,

where scale is the standard deviation of the measured loads, or the largest load of the test where
that is not known. With J the derivatives of the residuals at the minimum, n residuals and m
parameters, the covariance of the parameters is s^2 (J^T J)^-1, s^2 = (sum of squares)/(n - m)
where s is not known beforehand, and confidence intervals follow from Student's t with n - m
degrees of freedom (Seber and Wild 2003, Nonlinear Regression, section 5.1).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from mpi4py import MPI
from scipy.optimize import least_squares
from scipy.stats import t as student

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    between,
    check_instance,
    check_list,
    is_function,
    missing_members,
    number,
    positive,
    shown,
)
from fxcrack.base.errors import InputError
from fxcrack.criteria.criterion import Criterion
from fxcrack.history import History
from fxcrack.identify.picture import draw_fit
from fxcrack.identify.record import Record
from fxcrack.identify.response import Axes, Curve, LinearResponse, Simulation, curve_of
from fxcrack.output.plots.style import save

Criteria = Callable[..., Criterion]
"""Makes the criterion of some parameters, which it takes by name."""

_DEPENDENT = 1e-3
"""Smallest singular value of the derivatives (columns of length 1) over the largest,
below which the data do not tell parameters apart: correlations beyond 1 - 1e-6. Differences across
the kinks of a piecewise linear curve leave 1e-4 where there should be none."""

_BLIND = 1e-6
"""Largest change of the residuals, in units of their scale, for a parameter that grows by its own
value, which counts as none: round-off over the step of differences makes 1e-10."""

_STEP_OF_RUNS = 1e-4
"""Relative step of derivatives by whole runs, whose onsets are exact to about 1e-9."""


@dataclass(frozen=True, eq=False)
class Test:
    """A measured test and the scene that predicts it.

    Attributes:
        record: What was measured, under a growing opening.
        response: A :class:`LinearResponse`, or a function that runs the scene with a criterion and
            returns its history.
        axes: Columns to compare, with a function; a :class:`LinearResponse` has them.
        deviation: Standard deviation of the measured loads [force]; ``None``: not known, and the
            test is weighted by its largest load.
    """

    __test__ = False  # no test of pytest

    record: Record
    response: LinearResponse | Simulation
    axes: Axes | None = None
    deviation: float | None = None

    def __post_init__(self) -> None:
        """Check the parts."""
        check_instance("Test", "record", self.record, Record, "read_record('test.csv')")
        self.record.check_loading()
        simulated = is_function(self.response)
        if not (simulated or isinstance(self.response, LinearResponse)):
            raise InputError(
                f"Test: response = {shown(self.response)} must be linear_response(scene, until, "
                "axes), or a function that runs the scene with a criterion"
            )
        if simulated != (self.axes is not None):
            raise InputError(
                "Test: axes name the columns of the history that a function returns; a "
                "LinearResponse has them already"
            )
        if self.axes is not None:
            check_instance("Test", "axes", self.axes, Axes, "Axes('u[top.y]', 'R[top.y]')")
        if self.deviation is not None:
            positive("Test", deviation=self.deviation)

    @property
    def scale(self) -> float:
        """What residuals are divided by [force]."""
        known = self.deviation
        return float(np.asarray(self.record.load).max()) if known is None else float(known)

    def curve(self, criterion: Criterion) -> Curve:
        """Predicted load over opening; collective where it runs a scene."""
        if isinstance(self.response, LinearResponse):
            return self.response.curve(criterion)
        history = self.response(criterion)
        check_instance("Test", "what the function returns", history, History, "scene.run(step)")
        assert self.axes is not None
        return curve_of(history, self.axes)

    def residuals(self, criterion: Criterion) -> Array:
        """Predicted less measured load at each point, over :attr:`scale`, shape (n,)."""
        opening, load = self.record.points
        return np.asarray((self.curve(criterion).at(opening) - load) / self.scale)


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters that fit best, and how well the data determine them.

    Attributes:
        values: Parameters by name.
        half_widths: Half widths of their confidence intervals, by name.
        confidence: Level of the intervals.
        covariance: Covariance of the parameters in the order of ``values``, shape (m, m).
        deviation: Standard deviation of the residuals, relative to the scale of their tests.
        n_evaluations: Predictions of all tests; each is a run of the scenes unless all of them
            are linear responses.
        tests: The tests.
        curves: Their predictions.
    """

    values: dict[str, float]
    half_widths: dict[str, float]
    confidence: float
    covariance: Array
    deviation: float
    n_evaluations: int
    tests: Sequence[Test]
    curves: Sequence[Curve]

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters, shape (m, m); near 1 or -1 two are not told apart."""
        d = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(d, d))

    def interval(self, name: str) -> tuple[float, float]:
        """Lower and upper end of the confidence interval of a parameter."""
        return (
            self.values[name] - self.half_widths[name],
            self.values[name] + self.half_widths[name],
        )

    def __str__(self) -> str:
        """One line per parameter, and how large the residuals are."""
        lines = [
            f"{name} = {value:.6g} +- {self.half_widths[name]:.2g} "
            f"({100.0 * self.confidence:g} % confidence)"
            for name, value in self.values.items()
        ]
        n = sum(len(np.asarray(t.record.load)) for t in self.tests)
        lines.append(
            f"standard deviation of {n} residuals: {self.deviation:.3g} of the scale of their test"
        )
        return "\n".join(lines)

    def plot(self, path: str | Path | None = None, **options: Any) -> Any:
        """Draw measured points and fitted curves; collective.

        Args:
            path: Picture file (.png, .pdf, .svg), or ``None`` for none.
            **options: xlabel, ylabel, title, ax, as for :meth:`fxcrack.History.plot`.

        Returns:
            The ``matplotlib`` figure on rank 0, ``None`` on the others.
        """
        series = [
            (t.record.name, *t.record.points, c.opening, c.load)
            for t, c in zip(self.tests, self.curves, strict=True)
        ]
        return save(MPI.COMM_WORLD, path, lambda: draw_fit(series, str(self), **options))


def fit(
    tests: Test | Sequence[Test],
    criterion: Criteria,
    start: Mapping[str, float],
    *,
    confidence: float = 0.95,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> Fit:
    """Fit the parameters of a criterion to measured tests; collective where scenes are run.

    Args:
        tests: One test, or several that share the parameters (a DCB, an ENF and some MMB tests).
        criterion: Function of the parameters by name that returns the criterion, such as
            ``lambda GIc: fx.VCCT(GIc=GIc)``, or with a resistance curve
            ``lambda G0, G1: fx.VCCT(GIc=lambda x: G0 + G1 * np.maximum(x[0] - 30.0, 0.0))``.
        start: Value of each parameter to begin with, positive.
        confidence: Level of the intervals.
        bounds: Lower and upper bounds by name; positive by default.

    Returns:
        The fit. Its intervals hold what the scatter of the points tells: neither the error of the
        mesh nor that of the elastic constants, which shift the result as a whole.

    Raises:
        InputError: The data do not determine the parameters, there are too few points, a scene
            ends below the measured openings, or an argument is wrong.
    """
    chosen = [tests] if isinstance(tests, Test) else check_list("fit", "tests", tests, Test)
    names, x0, low, high = _parameters(start, bounds)
    if not chosen or not is_function(criterion):
        raise InputError("fit: give at least one Test, and a function that makes the criterion")
    between("fit", "confidence", confidence, 0.0, 1.0, ends=False)
    n = sum(len(np.asarray(t.record.load)) for t in chosen)
    if n <= len(names):
        raise InputError(
            f"fit: {n} points cannot determine {len(names)} parameters; give more points or fewer "
            "parameters"
        )
    n_evaluations = 0

    def made(x: Array) -> Criterion:
        try:
            found = criterion(**dict(zip(names, x.tolist(), strict=True)))
        except TypeError as error:
            raise InputError(
                f"fit: the criterion cannot be made of {', '.join(names)}: {error}; the names in "
                "start are those of the arguments of the function"
            ) from error
        lacking = missing_members(found, Criterion)
        if lacking:
            raise InputError(
                f"fit: what criterion returns, {shown(found)}, is no criterion: {lacking}"
            )
        return cast(Criterion, found)

    def residuals(x: Array) -> Array:
        nonlocal n_evaluations
        n_evaluations += 1
        found = made(x)
        return np.concatenate([test.residuals(found) for test in chosen])

    runs = any(not isinstance(test.response, LinearResponse) for test in chosen)
    result = least_squares(
        residuals,
        x0,
        jac="2-point" if runs else "3-point",
        diff_step=_STEP_OF_RUNS if runs else None,
        bounds=(low, high),
        x_scale=x0,
        xtol=1e-6 if runs else 1e-10,
        ftol=1e-8 if runs else 1e-12,
        gtol=1e-8 if runs else 1e-12,
        max_nfev=60,
    )
    if result.status <= 0:
        log.warn("fit: the search ended without converging: %s", result.message)
    derivatives = result.jac * result.x
    _check_determined(names, derivatives)
    _check_inside(names, result.x, low, high)
    curves = [test.curve(made(result.x)) for test in chosen]
    for test, curve in zip(chosen, curves, strict=True):
        most = float(test.record.points[0].max())
        if most > curve.end * (1.0 + 1e-9):
            raise InputError(
                f"fit: the scene of '{test.record.name}' ends at the opening {curve.end:g}, the "
                f"measurement at {most:g}; grow the crack further, or leave later points out"
            )
    freedom = n - len(names)
    variance = 2.0 * float(result.cost) / freedom
    known = all(test.deviation is not None for test in chosen)
    relative = np.linalg.inv(derivatives.T @ derivatives) * (1.0 if known else variance)
    covariance = relative * np.outer(result.x, result.x)
    wide = float(student.ppf(0.5 * (1.0 + confidence), freedom))
    half = wide * np.sqrt(np.diag(covariance))
    return Fit(
        dict(zip(names, result.x.tolist(), strict=True)),
        dict(zip(names, half.tolist(), strict=True)),
        float(confidence), covariance, float(np.sqrt(variance)), n_evaluations, chosen, curves,
    )  # fmt: skip


def _parameters(
    start: Mapping[str, float], bounds: Mapping[str, tuple[float, float]] | None
) -> tuple[list[str], Array, Array, Array]:
    """Names, start, lower and upper bounds of the parameters."""
    if not isinstance(start, Mapping) or not start:
        raise InputError(f"fit: start = {shown(start)} must be like {{'GIc': 0.2}}")
    positive("fit: start", **{str(name): value for name, value in start.items()})
    names = list(start)
    x0 = np.array([number("fit: start", name, start[name]) for name in names])
    low, high = np.zeros(len(names)), np.full(len(names), np.inf)
    if bounds is not None and not isinstance(bounds, Mapping):
        raise InputError(f"fit: bounds = {shown(bounds)} must be like {{'GIc': (0.1, 0.4)}}")
    for name, pair in ({} if bounds is None else bounds).items():
        if name not in names:
            raise InputError(f"fit: bounds of '{name}', which is not in start: {', '.join(names)}")
        i = names.index(name)
        try:
            low[i], high[i] = pair
        except (TypeError, ValueError) as error:
            raise InputError(f"fit: bounds of '{name}' = {shown(pair)} must be a pair") from error
        if not 0.0 <= low[i] < x0[i] < high[i]:
            raise InputError(
                f"fit: bounds of '{name}' = ({low[i]:g}, {high[i]:g}) must be positive and enclose "
                f"its start, {x0[i]:g}"
            )
    return names, x0, low, high


def _check_determined(names: list[str], derivatives: Array) -> None:
    """Refuse parameters that the data do not determine."""
    sizes = np.linalg.norm(derivatives, axis=0)
    if not np.isfinite(derivatives).all():
        raise InputError("fit: a prediction is NaN or infinite; begin closer to the solution")
    blind = [name for name, size in zip(names, sizes, strict=True) if size <= _BLIND]
    if blind:
        raise InputError(
            f"fit: the predictions do not depend on {', '.join(blind)}: no point lies where the "
            "crack grows, or this mode is not loaded; give other tests, or leave it out"
        )
    _, s, v = np.linalg.svd(derivatives / sizes)
    if s[-1] < _DEPENDENT * s[0]:
        mix = " and ".join(name for name, part in zip(names, v[-1], strict=True) if abs(part) > 0.1)
        raise InputError(
            f"fit: the data do not tell {mix} apart; give tests at another mode mix or crack "
            "length, or leave one of them out"
        )


def _check_inside(names: list[str], x: Array, low: Array, high: Array) -> None:
    """Warn of parameters that stopped at a bound, where intervals have no meaning."""
    for name, value, a, b in zip(names, x, low, high, strict=True):
        for bound in (a, b):
            if np.isfinite(bound) and abs(value - bound) <= 1e-6 * max(abs(bound), 1e-12):
                log.warn(
                    "fit: %s = %.4g lies at its bound; its confidence interval means nothing",
                    name,
                    value,
                )
