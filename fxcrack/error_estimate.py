"""How far a run is off for its mesh's sake, judged without knowing the answer.

A first-order run is compared with a second-order one to the first onset on the same mesh. The
difference is its error, but for the error of the second-order one, which goes with the element size
as well: the estimate is twice the difference.

A second-order run is run to its first onset again with the domain integral beside its criterion
(:mod:`fxcrack.criteria.domain_integral`): G of both at the same state differ by the error of the
forces and openings at the tip, which goes with the element size. What bodies are too stiff by is
added. On quadrilaterals and hexahedra it is half of the difference from a first-order run: energies
converge with the square of 1/order at tips and corners (I. Babuska, B. A. Szabo, I. N. Katz, The
p-version of the finite element method, SIAM J. Numer. Anal. 18 (1981) 515-545) and faster where
solutions are smooth, so that the error of second order is a third of that of first order at most.
First-order triangles and tetrahedra lock in bending and say nothing about second-order ones: on
them the energy of the jumps of the strain between cells of the run itself is taken
(:mod:`fxcrack.continuum.strain_jumps`).

Criteria without an energy release rate, shells, cycles and bonds for which there is no domain
integral are judged by the difference from the other order alone; for a second-order run that is a
bound, which is often far too large. Increment stepping adds what f exceeded 1 by. Growth far from
the first onset on a coarser mesh is not judged.
"""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Protocol, Self, cast

from fxcrack.base import log
from fxcrack.base.checks import number_or_nan
from fxcrack.base.errors import FxcrackError, InputError
from fxcrack.continuum.strain_jumps import part_of_jumps
from fxcrack.criteria import VCCT, StepRelease
from fxcrack.criteria.energy_release import Method, RateCriterion
from fxcrack.history import BEFORE_RELEASE, History, Row
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.debond import Debond
from fxcrack.steps.element_growth import cyclic_parts
from fxcrack.steps.end_conditions import Releases
from fxcrack.steps.static import Static

_STIFFER = 0.5
"""Error of second order over the difference of the orders: it is a third of that of first order."""
_MORE = 2.0
"""Estimated error of a first-order run over its difference from the second-order one."""
_ORDERS = {1: "first", 2: "second"}
_SIMPLICES = ("triangle", "tetrahedron")
_SMALL = 1e-6
"""Reactions below this share of the largest are round-off."""


class Rerunnable(Protocol):
    """What can be built again with changes and run: a scene."""

    @property
    def analysis(self) -> Analysis:
        """Its analysis."""

    def rebuilt(self, **changes: Any) -> Self:
        """A new one with some arguments changed; collective."""

    def run(self, step: Static | Cycles, *, grow: Sequence[Debond], progress: bool) -> History:
        """Run a step; collective."""

    def close(self) -> None:
        """Free all PETSc objects; collective."""


class AccuracyError(FxcrackError):
    """The accuracy asked for is not reached, or cannot be judged; the history is kept.

    Attributes:
        estimate: What was found; ``None`` if nothing could be.
    """

    def __init__(self, message: str, estimate: Estimate | None = None) -> None:
        super().__init__(message)
        self.estimate = estimate


@dataclass(frozen=True)
class Estimate:
    """Estimated relative errors of a run.

    Attributes:
        load: Of the load at the first onset; for cycles of the load at their maximum.
        G: Of the energy release rate at given loads or at given openings, the larger one (of f for
            other criteria).
        stepping: Of the load, by the increments.
        cycles: Of the number of cycles; ``None`` for quasi-static steps.
        order: Order of the displacement.
        size: Mean length of the facets at the first front.
        difference: Largest difference between the orders.
        interface: Name of the interface.
        simplices: Whether the cells are triangles or tetrahedra.
        domain: Difference of G from that of the domain integral at the same state, at the tip of
            largest f: along a front, one of its nodes; ``None`` where it was not found.
        jumps: Part of the strain energy that belongs to jumps of the strain between cells; ``None``
            where the other order tells the stiffness of the bodies.
        seconds: What the estimate has cost.
    """

    load: float
    G: float
    stepping: float
    cycles: float | None
    order: int
    size: float
    difference: float
    interface: str
    simplices: bool = False
    domain: float | None = None
    jumps: float | None = None
    seconds: float = 0.0

    @property
    def total(self) -> float:
        """The largest of the errors, each with that of the increments."""
        return max(self.load, self.G, self.cycles or 0.0) + self.stepping

    def __str__(self) -> str:
        """What it found, in words."""
        other = _ORDERS[3 - self.order]
        parts = [f"the load {_percent(self.load)}", f"G {_percent(self.G)}"]
        if self.cycles is not None:
            parts.append(f"the number of cycles {_percent(self.cycles)}")
        text = (
            f"this mesh ({_ORDERS[self.order]} order, elements of {self.size:.3g} at the crack of "
            f"'{self.interface}') gives {', '.join(parts)} off at first growth, "
            f"{'about' if self.order == 1 else 'or less'}, judged by "
        )
        if self.domain is None:
            text += f"the {other}-order solution on the same mesh"
        else:
            text += (
                f"the domain integral, from which G differs by {_percent(self.domain)} at the same "
                "state at the tip that grows first, "
            )
            text += (
                f"for the stiffness of the bodies by the {other}-order solution on the same mesh"
                if self.jumps is None
                else "for the stiffness of the bodies by the jumps of the strain between cells, to "
                f"which {_percent(self.jumps)} of the strain energy belong"
            )
        if self.seconds > 0.0:
            text += f" ({self.seconds:.2g} s)"
        if self.stepping > 0.0:
            text += f"; its increments add {_percent(self.stepping)} to the load"
        return text

    def remedy(self, accuracy: float) -> str:
        """What would reach an accuracy."""
        out = []
        mesh = self.total - self.stepping
        if self.stepping > 0.5 * accuracy:
            out.append(
                f"stepping='event' or a tolerance of the criterion of at most {accuracy:.1g}"
            )
        if mesh > accuracy - min(self.stepping, 0.5 * accuracy):
            size = self.size * accuracy / mesh
            out.append(f"elements of at most about {size:.2g} at the crack and like ones elsewhere")
            if self.order == 1:
                # the error left in second order is taken to be what the orders differ by
                enough = self.difference <= accuracy
                size = self.size * accuracy / self.difference
                mesh_of = "on this mesh" if enough else f"with elements of at most about {size:.2g}"
                out[-1] = f"order=2 {mesh_of}, or in first order {out[-1]}"
            elif self.jumps is not None:
                out[-1] += (
                    " (keep order=2, in first order they would have to be far smaller; the jumps "
                    "of the strain are a bound, so halve the elements once and compare)"
                )
            elif self.domain is not None:
                out[-1] += " (keep order=2, in first order they would have to be far smaller)"
            elif self.simplices:
                out[-1] += (
                    " (keep order=2; the bound is the error of first-order simplices, which are "
                    "far too stiff in bending, so halve the elements once and compare)"
                )
            else:
                out[-1] += " (keep order=2)"
        return " and ".join(out)


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def check_accuracy(accuracy: float) -> None:
    """Refuse an accuracy that is no share.

    Raises:
        InputError: It does not lie between 0 and 1.
    """
    if not 0.0 < number_or_nan("run", "accuracy", accuracy) < 1.0:
        raise InputError(f"accuracy = {accuracy}: give a relative error between 0 and 1, e.g. 0.01")


def demand(
    scene: Rerunnable, step: Static | Cycles, accuracy: float, grow: Sequence[Debond]
) -> Estimate:
    """Estimate the errors of a scene's run and refuse it if they are too large; collective.

    Args:
        scene: The scene, after its run.
        step: The step it ran.
        accuracy: Largest relative error allowed.
        grow: Debonds that were allowed to grow.

    Raises:
        AccuracyError: The accuracy is not reached, or cannot be judged.
    """
    estimate = estimate_errors(scene, step, grow)
    if estimate.total > accuracy:
        remedy = estimate.remedy(accuracy)
        raise AccuracyError(
            f"accuracy = {_percent(accuracy)} is not reached: {estimate}. For "
            f"{_percent(accuracy)} use {remedy}. The run is complete and kept in scene.history; "
            "leave accuracy out to take it as it is",
            estimate,
        )
    return estimate


def estimate_errors(scene: Rerunnable, step: Static | Cycles, grow: Sequence[Debond]) -> Estimate:
    """See :func:`demand`.

    Raises:
        AccuracyError: Nothing can be said; the message says why.
    """
    cycles = isinstance(step, Cycles)
    start = clock.perf_counter()
    analysis = scene.analysis
    ours, name, excess = _first(analysis.history, grow, cycles=cycles)
    order = analysis.continuum.order
    # of an unknown power the smallest is assumed: it makes the error of the load the largest
    degree = min((d.criterion.degree or 1.0 for d in grow), default=1.0)
    rates = all(d.criterion.knows_toughness for d in grow)
    simplices = analysis.continuum.mesh.domain.topology.cell_name() in _SIMPLICES
    domain: float | None = None
    jumps: float | None = None
    # of nonlinear triangles and tetrahedra neither order nor jumps tell the stiffness
    if order == 2 and not cycles and (analysis.linear or not simplices):
        domain, jumps, size = _beside_domain_integral(
            scene, cast(Static, step), grow, name, simplices=simplices
        )
    life = None
    at_tip = domain or 0.0
    if domain is not None and jumps is not None:
        stiff = jumps, 2.0 * jumps  # at given openings G goes with the square of the stiffness
        difference = max(jumps, domain)
    else:
        jumps = None
        load, rate, size = _beside_other_order(scene, step, grow, ours, excess, degree, rates)
        more = _MORE if order == 1 else 1.0 if domain is None else _STIFFER
        stiff, difference = (more * load, more * rate), max(load, rate)
        if cycles:
            exponents = [
                abs(g.criterion.life_exponent(float(cyclic_parts(g)[1].toughness[:, 0].mean())))
                for g in analysis.active
            ]
            life = (1.0 + more * rate) ** max(exponents, default=0.0) - 1.0
    return Estimate(
        load=stiff[0] + (1.0 + at_tip) ** (1.0 / degree) - 1.0,
        G=stiff[1] + at_tip,
        stepping=_stepping(analysis.history, name, degree, excess),
        cycles=life,
        order=order,
        size=size,
        difference=difference,
        interface=name,
        simplices=simplices,
        domain=domain,
        jumps=jumps,
        seconds=_since(analysis, start),
    )


def _beside_other_order(
    scene: Rerunnable, step: Static | Cycles, grow: Sequence[Debond],
    ours: Row, excess: float, degree: float, rates: bool,
) -> tuple[float, float, float]:  # fmt: skip
    """Another run to the first onset, of the other order on the same mesh; collective.

    Args:
        scene: The scene, after its run.
        step: The step it ran.
        grow: Debonds that were allowed to grow.
        ours: Its row at the first onset.
        excess: f - 1 there.
        degree: Power of the load with which f goes.
        rates: Whether all criteria know energy release rates.

    Returns:
        Relative differences of the load and of G, and the element size at the front, length.

    Raises:
        AccuracyError: The scene does not run with the other order.
    """
    analysis = scene.analysis
    order, cycles = analysis.continuum.order, isinstance(step, Cycles)
    _, name, _ = _first(analysis.history, grow, cycles=cycles)
    try:
        twin = scene.rebuilt(order=3 - order)
        try:
            short = _to_onset(step, linear=analysis.linear)
            twin.run(short, grow=grow, progress=False)
            theirs, _, other = _first(twin.analysis.history, grow, cycles=cycles)
            size = _size(twin.analysis, name)
        finally:
            twin.close()
    except FxcrackError as error:
        raise AccuracyError(
            f"the accuracy of this run cannot be judged: the scene does not run with order="
            f"{3 - order} on the same mesh ({error}). Compare with a finer mesh instead: fxcrack "
            "accuracy does so for any scene function. The run is kept in scene.history"
        ) from error
    scale = ((1.0 + other) / (1.0 + excess)) ** (1.0 / degree)  # both at f = 1
    load, rate = _differences(ours, theirs, name, 2 if rates else 1, scale, cycles=cycles)
    return load, rate, size


def _beside_domain_integral(
    scene: Rerunnable, step: Static, grow: Sequence[Debond], name: str, *, simplices: bool
) -> tuple[float | None, float | None, float]:
    """Another run to the first onset with the domain integral beside the criterion; collective.

    Args:
        scene: The scene, after its run.
        step: The step it ran.
        grow: Debonds that were allowed to grow.
        name: Interface that is to grow first.
        simplices: Whether the cells are triangles or tetrahedra.

    Returns:
        Relative difference of G at the first onset, ``None`` where there is no energy release rate
        or no domain integral; the part of the energy that belongs to jumps of the strain, of linear
        bodies of triangles and tetrahedra; the element size at the front, length.
    """
    analysis = scene.analysis
    if not all(isinstance(d.criterion, RateCriterion) for d in grow):
        return None, None, 0.0
    jumps: float | None = None
    columns = [f"G{mode}{{}}[{name}]" for mode in ("I", "II", "III")]
    watched: dict[Debond, Debond] = {}
    try:
        for d in analysis.debonds:
            watched[d] = d
            if d in grow and d.interface.title == name:
                # at the first onset nothing is released yet
                decides = cast(RateCriterion, d.criterion).method
                other: Method = "vcct" if decides == "domain" else "domain"
                another = VCCT(GIc=1.0, method=other)
                watched[d] = replace(d, release=StepRelease(), watch=[another])
        twin = scene.rebuilt(debonds=list(watched.values()))
        try:
            short = _to_onset(step, linear=analysis.linear)
            again = [watched[d] for d in grow]
            twin.run(short, grow=again, progress=False)
            row, _, _ = _first(twin.analysis.history, again, cycles=False)
            size = _size(twin.analysis, name)
            if simplices:
                u = twin.analysis.condensed.displacement()
                jumps = part_of_jumps(twin.analysis.continuum, u.array_r.copy())
                u.destroy()
        finally:
            twin.close()
    except FxcrackError as error:
        log.info("accuracy: no domain integral to compare with (%s)", error)
        return None, None, 0.0
    suffix = "_vcct" if f"GI_vcct[{name}]" in row else "_domain"
    own, beside = (sum(float(row.get(c.format(of), 0.0)) for c in columns) for of in ("", suffix))
    if not (own > 0.0 and beside > 0.0):
        return None, None, 0.0
    return abs(own / beside - 1.0), jumps, size


def _stepping(history: History, name: str, degree: float, excess: float) -> float:
    """Error of the load by increments that end at f above 1."""
    return _largest(history, name) ** (1.0 / degree) - 1.0 if excess else 0.0


def _since(analysis: Analysis, start: float) -> float:
    """Seconds since a time of the clock, those of rank 0."""
    return float(analysis.comm.bcast(clock.perf_counter() - start))


def _to_onset(step: Static | Cycles, *, linear: bool) -> Static | Cycles:
    """The step as far as the first growth; to f = 1 exactly where the bodies are linear."""
    if isinstance(step, Cycles):
        return replace(step, until=(), n_max=1.0)
    if not linear:
        return replace(step, until=Releases(1))
    return Static(Releases(1), stepping="path" if step.stepping == "path" else "event")


def _size(analysis: Analysis, name: str) -> float:
    """Mean element length at the front of an interface; that of all its facets without a front."""
    crack = next(g for g in analysis.cracks if g.title == name)
    tips = crack.tips()
    return float(tips.d_ahead.mean() if len(tips) else crack.front.surface.facet_size)


def _first(history: History, grow: Sequence[Debond], *, cycles: bool) -> tuple[Row, str, float]:
    """The first row in which a crack is about to grow, the interface, and f - 1 there."""
    names = [d.interface.title for d in grow]
    for row in history:
        if cycles and row["event"] == "cycle":
            return row, names[0], 0.0
        if cycles or row["event"] not in (*BEFORE_RELEASE, "increment"):
            continue
        f = {n: float(row.get(f"f[{n}]", 0.0)) for n in names}
        name = max(f, key=lambda n: f[n])
        if f[name] >= 1.0 - 1e-9:
            excess = f[name] - 1.0 if row["event"] != "onset" else 0.0
            return row, name, max(excess, 0.0)
    raise AccuracyError(
        "the accuracy of this run cannot be judged: nothing grew in it "
        f"({history.reason}), so there is no critical load to compare"
    )


def _largest(history: History, name: str) -> float:
    """The largest f at which something was released."""
    rows = [r for r in history if r["event"] == "increment"]
    return max((float(r.get(f"f[{name}]", 0.0)) for r in rows), default=1.0)


def _differences(
    ours: Row, theirs: Row, name: str, degree: int, scale: float, *, cycles: bool
) -> tuple[float, float]:
    """Relative differences of the load, and of G at given loads or openings, the larger one."""
    moving = [k[2:-1] for k in ours if k.startswith("u[")]
    loads = [f"R[{k}]" for k in moving] + [k for k in ours if k.startswith("F[")]
    drivers = [f"u[{k}]" for k in moving] + [k for k in ours if k.startswith("F[")]
    load = _largest_difference(ours, theirs, loads, scale)
    if cycles:
        key = f"G_max[{name}]"
        return load, abs(float(ours[key]) / float(theirs[key]) - 1.0)
    driver = _largest_difference(ours, theirs, drivers, scale)
    return load, (1.0 + max(driver, load)) ** degree - 1.0


def _largest_difference(ours: Row, theirs: Row, columns: list[str], scale: float) -> float:
    values = {c: (scale * float(ours[c]), float(theirs[c])) for c in columns}
    largest = max((abs(b) for _, b in values.values()), default=0.0)
    return max(
        (abs(a / b - 1.0) for a, b in values.values() if abs(b) > _SMALL * largest), default=0.0
    )


def as_details(estimate: Estimate) -> dict[str, Any]:
    """Plain types for the details of a history."""
    return {**asdict(estimate), "total": estimate.total, "words": str(estimate)}
