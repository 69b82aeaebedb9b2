"""What the solvers did between two rows of the history, as DEBUG records of the log."""

from __future__ import annotations

import logging
import time
from collections import Counter

from fxcrack.base import log
from fxcrack.history import Row
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis

_WORDS = {
    "trials": "trials",
    "failures": "failed trials",
    "iterations": "iterations",
    "factorisations": "factorisations",
    "contact": "changes of contact",
    "bonds": "solves of softening bonds",
    "increments": "increments",
    "forces": "internal forces",
}


class SolverWork:
    """Observer of a step that logs what each row has cost, on rank 0.

    Args:
        analysis: The analysis.
        number: Number of the step.
    """

    def __init__(self, analysis: Analysis, number: int = 1) -> None:
        self._analysis, self._number = analysis, number
        self._counts, self._seconds = self._now()
        self._at = time.perf_counter()
        self._rows = len(analysis.history)

    @property
    def wanted(self) -> bool:
        """Whether anybody reads such records."""
        return logging.getLogger(__name__).isEnabledFor(logging.DEBUG)

    def __call__(self, event: str, row: Row) -> None:
        """Log what was done since the row before."""
        if not self.wanted:
            return
        (counts, seconds), at = self._now(), time.perf_counter()
        done, spent = counts - self._counts, seconds - self._seconds
        parts = [f"{words} {done[k]}" for k, words in _WORDS.items() if done[k]]
        phases = [f"{k} {v:.3g}" for k, v in spent.most_common() if v >= 1e-3]
        log.debug(
            "step %d, row %d, %s at t = %.9g: %s; %.3g s%s",
            self._number, len(self._analysis.history) - self._rows, event, row["time"],
            ", ".join(parts) or "on the condensed equations at hand", at - self._at,
            f" ({', '.join(phases)})" if phases else "",
        )  # fmt: skip
        self._counts, self._seconds, self._at = counts, seconds, at

    def _now(self) -> tuple[Counter[str], Counter[str]]:
        """Counts and seconds per phase since the scene was made."""
        solver = self._analysis.solver
        counts: Counter[str] = Counter(factorisations=solver.timings.factorizations)
        seconds: Counter[str] = Counter()
        seconds.update(solver.timings.seconds)
        if isinstance(solver, ExplicitSolver):
            counts += Counter(increments=solver.increments, forces=solver.bodies.evaluations)
            return counts, seconds
        counts += Counter(contact=self._analysis.condensed.system.contact_steps)
        counts += Counter(bonds=self._analysis.condensed.soft_counts.solves)
        if isinstance(solver, NewtonSolver):
            made = solver.counts
            counts += Counter(
                trials=made.solves + made.failures,
                failures=made.failures,
                iterations=made.iterations,
            )
        return counts, seconds
