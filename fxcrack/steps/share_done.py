"""How much of a step is done, from the end conditions that can tell: time, crack length, releases.

Times tell it where time only grows. Along an equilibrium path or at a controlled opening it is a
load factor that falls as well; cycles jump from release to release, which is no measure of what is
left to compute.
"""

from __future__ import annotations

from fxcrack.history import Row
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.end_conditions import CrackLength, Releases, Time
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.static import Static


class ShareDone:
    """The part of a step that is done, as its rows come.

    Args:
        step: The step.

    Attributes:
        goals: Values of columns at which the step ends.
        part: Between 0 and 1, counted from the first row; ``None`` where nothing can tell.
    """

    def __init__(self, step: Static | Cycles | Explicit) -> None:
        forth_and_back = isinstance(step, Static) and step.stepping in ("path", "opening")
        by_time = not (isinstance(step, Cycles) or forth_and_back)
        self.goals: dict[str, float] = {}
        self._releases: int | None = None
        self.part: float | None = None
        for end in step.ends:
            if isinstance(end, CrackLength):
                name = f"a[{end.interface.title}]"
                self.goals[name] = min(end.length, self.goals.get(name, end.length))
            elif isinstance(end, Time) and by_time:
                self.goals["time"] = min(end.time, self.goals.get("time", end.time))
            elif isinstance(end, Releases):
                self._releases = min(end.count, self._releases or end.count)
        self._begin: dict[str, float] = {}

    def update(self, row: Row) -> None:
        """Take account of a row of the history."""
        found = []
        wanted = dict(self.goals)
        values = {k: float(row[k]) for k in wanted if k in row}
        if self._releases is not None:
            wanted["releases"] = float(self._releases)
            values["releases"] = sum(float(v) for k, v in row.items() if k.startswith("released["))
        for name, value in values.items():
            begin = self._begin.setdefault(name, value)
            if wanted[name] > begin:
                found.append((value - begin) / (wanted[name] - begin))
        # whichever condition is nearest to be met ends the step
        self.part = min(max(found), 1.0) if found else None
