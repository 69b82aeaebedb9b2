"""A study from its name to the numbers that are reported, as plain types for JSON.

Settings run from cheap to costly; their cost is predicted from what was measured, and the study
ends before its budget does. What was left out is part of the result.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import fxcrack  # isort: skip  (orders MPI before DOLFINx)
import dolfinx
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.accuracy.family import settings
from fxcrack.accuracy.launch import START_LIMIT, SettingFailed, TookTooLong, Workers
from fxcrack.accuracy.load import load
from fxcrack.accuracy.pareto import TARGETS, advice, cheapest, pareto_front
from fxcrack.accuracy.prediction import FIT_POINTS, FIT_RANGE, fit_power, plan, predict
from fxcrack.accuracy.reference import Reference, reference, worst
from fxcrack.accuracy.study import Setting, Study
from fxcrack.accuracy.worker import REPEATS, SHORT
from fxcrack.base.errors import InputError
from fxcrack.base.machine import cores, processor

Result = dict[str, Any]
Tell = Callable[[str], None]

_PATIENCE = 4.0  # a setting may take so many times its predicted seconds,
_START = 4.0  # seconds a new worker is thought to take
_NEAR = 0.5  # seconds to the end of the budget that are not worth starting for
_AT_LEAST = 10.0  # or so many seconds, but not more than the budget has left


def run_study(
    scene: str,
    *,
    budget: float = 60.0,
    sizes: Sequence[float] = (),
    measure: str = "worst",
    tell: Tell = lambda line: None,
) -> Result:
    """Run a study.

    Args:
        scene: Name of a study, see :func:`fxcrack.accuracy.load.load`.
        budget: Seconds of wall-clock time for all runs together.
        sizes: Element sizes instead of the study's own (length).
        measure: "worst" of load, G and crack length, or the name of one quantity measured.
        tell: Called with one line about each setting.

    Raises:
        InputError: The study cannot be run as asked.
    """
    if not budget > 0.0:
        raise InputError(f"budget = {budget}: give the seconds the study may take, e.g. 60")
    study = load(scene)
    if sizes:
        study = replace(study, sizes=tuple(sizes))
    waiting = settings(study)
    session = _Session(scene, waiting, budget, tell)
    session.run()
    records, failed, done = session.records, session.failed, session.done
    waiting = session.waiting
    left_out = [
        {"setting": s.as_dict(), "name": str(s), "predicted_seconds": predict(s, done)}
        for s in waiting
    ]
    if not records:
        why = failed[0]["why"] if failed else f"the budget of {budget:g} s is too small"
        raise InputError(f"study '{scene}': no setting gave a result: {why}")
    result = assemble(study, records, measure)
    return {
        "scene": scene,
        "title": study.title,
        "unit": study.unit,
        **result,
        "failed": failed,
        "left_out": left_out,
        "budget": budget,
        "wall": session.wall,
        "machine": machine(),
    }


class _Session:
    """Settings run one after the other until the budget ends."""

    def __init__(self, scene: str, waiting: list[Setting], budget: float, tell: Tell) -> None:
        self.waiting = waiting
        self.records: list[tuple[Setting, Result]] = []
        self.failed: list[Result] = []
        self.done: dict[Setting, float] = {}
        self._scene, self._budget, self._tell = scene, budget, tell
        self._begin = time.monotonic()
        self._start = _START  # seconds a new worker takes, as seen so far

    @property
    def wall(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self._begin

    def run(self) -> None:
        """Run what fits."""
        with closing(Workers(self._scene, min(self.waiting, key=_cheapness))) as workers:

            def extra(setting: Setting, seconds: float) -> float:
                start = 0.0 if workers.started(setting.ranks) else self._start
                return start + (REPEATS * seconds if seconds < SHORT else seconds)

            while self.waiting:
                left = self._budget - self.wall
                setting, predicted = plan(self.waiting, self.done, left, extra)
                if setting is None:
                    return
                self.waiting.remove(setting)
                fresh = not workers.started(setting.ranks)
                limit = min(left, max(_PATIENCE * predicted, START_LIMIT if fresh else _AT_LEAST))
                begin = self.wall
                try:
                    found = workers.run(setting, limit)
                except SettingFailed as error:
                    if isinstance(error, TookTooLong) and self.wall >= self._budget - _NEAR:
                        self.waiting.append(setting)
                        self._tell(f"{setting}: not done before the end of the budget")
                        return
                    self._fail(setting, error)
                    continue
                self.done[setting] = found["seconds"]
                if fresh:
                    self._start = self.wall - begin
                self.records.append((setting, found))
                self._tell(f"{setting}: {found['seconds']:.3g} s, {found['dofs']} dofs")

    def _fail(self, setting: Setting, error: SettingFailed) -> None:
        """Note a failure, and leave out what would fail the same way."""
        again = any(f["setting"] == {**setting.as_dict(), "size": f["setting"]["size"]}
                    for f in self.failed)  # fmt: skip
        self._note(setting, str(error))
        if again or isinstance(error, TookTooLong):
            for other in [s for s in self.waiting if s.line == setting.line]:
                if again or other.size < setting.size:
                    self.waiting.remove(other)
                    self._note(other, f"left out after {setting}")

    def _note(self, setting: Setting, why: str) -> None:
        self.failed.append({"setting": setting.as_dict(), "name": str(setting), "why": why})
        self._tell(f"{setting}: {why}")


def _cheapness(setting: Setting) -> tuple[int, int, float]:
    return setting.ranks, setting.order, -setting.size


def assemble(study: Study, records: list[tuple[Setting, Result]], measure: str) -> Result:
    """Errors, front, exponents and advice from what was measured; needs no process.

    Args:
        study: The study.
        records: Settings and what their worker answered.
        measure: As for :func:`run_study`.

    Raises:
        InputError: The quantity asked for was not measured.
    """
    simplest = {setting: i for i, setting in enumerate(settings(study))}
    records = sorted(records, key=lambda record: simplest[record[0]])
    values = [(setting, found["values"]) for setting, found in records]
    measured = sorted({name for _, v in values for name in v})
    if measure != "worst" and measure not in measured:
        raise InputError(
            f"measure = '{measure}': this study measures {', '.join(measured)}; name one of them, "
            "or worst"
        )
    theory = records[0][1]["theory"]
    trusted = [(s, v) for s, v in values if not study.refers_to or s.cell in study.refers_to]
    known = reference(trusted, theory, study.steppings[0])
    if known is None:
        raise InputError(
            "there is neither an exact closed form nor a line of two sizes to count errors from; "
            "raise the budget or give coarser sizes"
        )
    errors = [known.errors(found["values"]) for _, found in records]
    counted = [worst(e, measure) for e in errors]
    seconds = [found["seconds"] for _, found in records]
    blur = _uncertainty(known, measure)
    total = [e + blur for e in counted]
    front = pareto_front(seconds, counted)
    names = [f"{s}{' ' + study.unit if study.unit else ''}" for s, _ in records]
    targets = [
        {"target": t, "setting": None if i is None else records[i][0].as_dict(), "record": i}
        for t in TARGETS
        for i in [cheapest(seconds, total, t)]
    ]
    return {
        "measure": measure,
        "reference": {
            "source": known.source,
            "exact": known.exact,
            "values": dict(known.values),
            "uncertainty": dict(known.uncertainty),
        },
        "uncertainty": blur,
        "theory": _beside_theory(known, theory),
        "records": [
            {
                "setting": s.as_dict(),
                "name": str(s),
                **{k: v for k, v in found.items() if k != "theory"},
                "errors": e,
                "error": c,
                "pareto": i in front,
            }
            for i, ((s, found), e, c) in enumerate(zip(records, errors, counted, strict=True))
        ],
        "pareto": front,
        "rates": _rates(records, counted),
        "exponents": _exponents(records),
        "targets": targets,
        "advice": advice(names, seconds, counted, uncertainty=blur),
    }


def _uncertainty(known: Reference, measure: str) -> float:
    return worst({n: known.uncertainty.get(n, 0.0) for n in known.values}, measure)


def _beside_theory(known: Reference, theory: dict[str, Any] | None) -> Result | None:
    """The closed form relative to the reference, where it is another model's."""
    if theory is None:
        return None
    off = {n: v / known.values[n] - 1.0 for n, v in theory["values"].items() if known.values.get(n)}
    return {**theory, "relative_to_reference": off}


def _by_line(records: list[tuple[Setting, Result]]) -> dict[Setting, list[int]]:
    """Positions of the records of each line that has at least two, coarse to fine."""
    lines: dict[Setting, list[int]] = {}
    for i, (setting, _) in enumerate(records):
        lines.setdefault(setting.line, []).append(i)
    for places in lines.values():
        places.sort(key=lambda i: -records[i][0].size)
    return {line: places for line, places in lines.items() if len(places) > 1}


def _rates(records: list[tuple[Setting, Result]], errors: list[float]) -> dict[str, float]:
    """Power of the size with which the error falls on each line, from its three finest sizes."""
    out = {}
    for line, places in _by_line(records).items():
        power = fit_power(
            [records[i][0].size for i in places[-3:]], [errors[i] for i in places[-3:]]
        )
        if power is not None:
            out[line.title] = power.exponent
    return out


def _exponents(records: list[tuple[Setting, Result]]) -> dict[str, dict[str, Any]]:
    """Powers of the number of dofs for time, its phases and memory, per line with three sizes."""
    out: dict[str, dict[str, Any]] = {}
    for line, places in _by_line(records).items():
        if len(places) < 3:
            continue
        largest = max(records[i][1]["dofs"] for i in places)
        used = [i for i in places if records[i][1]["dofs"] >= largest / 10**FIT_RANGE]
        used = used[-FIT_POINTS:]
        dofs = [records[i][1]["dofs"] for i in used]
        series = {"seconds": [records[i][1]["seconds"] for i in used]}
        for phase in records[places[-1]][1]["phases"]:
            series[phase] = [records[i][1]["phases"].get(phase, 0.0) for i in used]
        series["memory"] = [max(records[i][1]["memory"].values(), default=0.0) for i in used]
        fits = {name: fit_power(dofs, y) for name, y in series.items()}
        out[line.title] = {
            name: {"factor": f.factor, "exponent": f.exponent}
            for name, f in fits.items()
            if f is not None
        }
    return out


def machine() -> Result:
    """Where and with what it was measured."""
    return {
        "fxcrack": fxcrack.__version__,
        "python": platform.python_version(),
        "dolfinx": dolfinx.__version__,
        "PETSc": ".".join(str(n) for n in PETSc.Sys.getVersion()),
        "mpi": " ".join(MPI.Get_library_version().replace("\0", "").split()[:3]),
        "numpy": np.__version__,
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
        "cores": cores(),
        "threads": os.environ.get("OMP_NUM_THREADS", "1"),
        "date": time.strftime("%Y-%m-%d"),
    }
