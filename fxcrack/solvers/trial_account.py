"""The trial increment at hand, and the work of the last one that was accepted."""

from __future__ import annotations

from petsc4py import PETSc

from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.solvers.increment_work import IncrementWork, TrialIncrement


class TrialAccount:
    """Owns the trial until it is accepted or given up, and answers for its work."""

    def __init__(self) -> None:
        self._trial: TrialIncrement | None = None
        self._last: IncrementWork | None = None  # of the last trial that was accepted

    @property
    def at_hand(self) -> TrialIncrement:
        """The trial that is neither accepted nor given up."""
        assert self._trial is not None
        return self._trial

    def take(self, trial: TrialIncrement) -> None:
        """Own a trial, in place of the one at hand."""
        self.give_up()
        self._trial = trial

    def give_up(self) -> None:
        """Forget the trial, if there is one."""
        if self._trial is not None:
            self._trial.u.destroy()
            self._trial = None

    def accept(self) -> None:
        """Keep the work of the trial only."""
        self._last = self.at_hand.work
        self.give_up()

    def work_of(self, here: Equilibrium, point: Equilibrium) -> IncrementWork:
        """Work of the trial, or of the last one accepted, which leads from here to a point."""
        work = self._last if self._trial is None else self._trial.work
        assert work is not None and work.start is here and work.end is point
        return work

    def displacement_of(self, state: Equilibrium) -> PETSc.Vec | None:
        """Displacement of the end of the trial, which the caller destroys; ``None`` elsewhere."""
        if self._trial is None or state is not self._trial.end:
            return None
        return self._trial.u.copy()


def overlap_work(system: ContactSystem, here: Equilibrium, point: Equilibrium) -> float:
    """Work of contact that pushed overlapping faces apart.

    Nothing pressed on them before, and the pressure grows as they move apart.

    Args:
        system: The dense system.
        here: Equilibrium before.
        point: Equilibrium afterwards.
    """
    closing = system.closing(here, point)
    mean = 0.5 * system.pressure(point, closing)
    return float(mean @ (point.jump - here.jump)[closing])


__all__ = ["TrialAccount", "overlap_work"]
