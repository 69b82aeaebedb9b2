"""Seconds spent per phase of a run."""

from __future__ import annotations

import time
from dataclasses import dataclass, field


@dataclass
class Timings:
    """Seconds and counts of the phases of a run, the same meaning on every rank."""

    seconds: dict[str, float] = field(default_factory=dict)
    factorizations: int = 0

    def add(self, phase: str, start: float) -> None:
        """Add the time since ``start`` (of ``time.perf_counter``) to a phase."""
        self.seconds[phase] = self.seconds.get(phase, 0.0) + time.perf_counter() - start
