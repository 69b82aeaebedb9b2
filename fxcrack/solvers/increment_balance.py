"""Energy stored in nonlinear bodies, and the balance that an increment has to keep."""

from __future__ import annotations

from fxcrack.continuum.weak_form import WeakForm
from fxcrack.solvers.increment_work import TrialIncrement

ANOTHER = 1e-2
"""An equilibrium that is off by more than this part of the stored energy from the work of its
increment, however short that is, does not lie on the way: SNES has found another solution."""


class StoredEnergy:
    """Energy stored in the bodies in the accepted state, which trials are compared with.

    Args:
        bodies: The form terms.

    Attributes:
        largest: The largest one in an accepted state of which it was known on acceptance.
        most: The largest one in any accepted state: what is left of it is round-off.
    """

    def __init__(self, bodies: WeakForm) -> None:
        self._bodies = bodies
        self.largest = 0.0
        self.most = 0.0
        self._now: dict[str, float] | None = None  # of the accepted state, once asked for

    def now(self) -> dict[str, float]:
        """Energies of the accepted state, which the bodies are in, by name; collective."""
        if self._now is None:
            self._now = self._bodies.stored()
        self.most = max(self.most, sum(self._now.values()))
        return self._now

    def accept(self, energies: dict[str, float] | None) -> None:
        """Take the energies of a state that is accepted, ``None`` where they are not known."""
        self._now = energies
        self.largest = max(self.largest, sum((energies or {}).values()))

    def forget(self) -> None:
        """The accepted state is another one now."""
        self._now = None

    def imbalance(self, trial: TrialIncrement, n_forces: int, more: float, part: float) -> str:
        """Find and keep the energies of a trial, and compare them with its work; collective.

        Bodies that yield are integrated by the trapezoidal rule, which their energies fulfil
        exactly: what is off there is the work of faces that close or open within the increment.

        Args:
            trial: The trial, its work known; the bodies are in its state.
            n_forces: Number of force patterns.
            more: Work of contact that pushed overlapping faces apart.
            part: How much of what is stored work and energies may be off.

        Returns:
            By how much they are off, in words; empty where it is no more than that.
        """
        work = trial.work
        assert work is not None and self._now is not None
        trial.energies = self._bodies.stored()
        before, after = (sum(e.values()) for e in (self._now, trial.energies))
        given = work.external_work(n_forces) + self._bodies.path_work() + more
        off = given - (after - before) - work.bonds - work.friction - self._bodies.path_spent()
        size = max(after, self.largest)
        allowed = part * (size if part < ANOTHER else max(size, self.most))
        if not abs(off) > allowed + trial.noise:
            return ""
        return f"the energies of an increment are off by {off:.2e} beside {size:.2e} stored"


__all__ = ["ANOTHER", "StoredEnergy"]
