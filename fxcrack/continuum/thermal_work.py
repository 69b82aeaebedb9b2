"""The work that a changing temperature does on bodies.

At a fixed displacement the stored energy W(u, T) changes with the temperature:

    work = int  dW/dT (u, T)  dT     along the increments, by the trapezoidal rule

which is exact where W is quadratic in u and T together.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fxcrack.base.arrays import Array
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.temperature import ByTemperature


class ThermalWork:
    """Follows the temperature of a continuum for one term.

    Args:
        continuum: Where the temperature is.
        energy: Stored energy of the term at a displacement, a form that contains the present
            temperature.

    Attributes:
        work: Work up to the last commit, force x length, the same on all ranks.
    """

    def __init__(self, continuum: Continuum, energy: Callable[[fem.Function], Any]) -> None:
        assert continuum.temperature is not None
        self._continuum = continuum
        self._field = continuum.temperature
        self._energy = energy
        self._tabulated = any(isinstance(m, ByTemperature) for m in continuum.part_materials)
        self._last = np.zeros_like(fem.Function(continuum.space).x.array)
        self._last_rise = np.zeros_like(self._field.rise.x.array)  # from the unstrained body on
        self._power: tuple[Any, Any, Any] | None = None
        self.work = 0.0

    @property
    def version(self) -> int:
        """Counts the changes of the moduli."""
        return self._field.version if self._tabulated else 0

    def begin(self, time: float) -> None:
        """Set the temperature."""
        self._field.set(time)

    def path_work(self, u: fem.Function) -> float:
        """Work since the last commit, by the trapezoidal rule; collective."""
        rise = self._field.rise
        now = rise.x.array.copy()
        c = self._continuum
        if not c.comm.allreduce(bool(np.any(now != self._last_rise)), op=MPI.LOR):
            return 0.0
        if self._power is None:
            at, step = fem.Function(c.space), fem.Function(rise.function_space)
            self._power = at, step, fem.form(ufl.derivative(self._energy(at), rise, step))
        at, step, form = self._power
        step.x.array[:] = now - self._last_rise
        at.x.array[:] = u.x.array
        power = fem.assemble_scalar(form)
        at.x.array[:], rise.x.array[:] = self._last, self._last_rise
        power += fem.assemble_scalar(form)
        rise.x.array[:] = now
        return 0.5 * float(c.comm.allreduce(power, op=MPI.SUM))

    def commit(self, u: fem.Function) -> None:
        """Add the work since the last commit; collective."""
        self.work += self.path_work(u)
        self._last[:] = u.x.array
        self._last_rise = self._field.rise.x.array.copy()

    def state(self) -> dict[str, Array]:
        """Displacement and temperature of the last commit, work so far.

        Returns:
            "last": displacement of the local dofs, ghosts too, shape (n_dofs,), length; "rise":
            T - T_ref, local values, ghosts too, shape (n_values,), temperature; "work": shape
            (1,), force x length.
        """
        return {
            "last": self._last.copy(),
            "rise": self._last_rise.copy(),
            "work": np.array([self.work]),
        }

    def places(self) -> dict[str, Place]:
        """Spaces of displacement and temperature."""
        return {"last": self._continuum.space, "rise": self._field.rise.function_space}

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        self._last[:] = state["last"]
        self._last_rise = state["rise"].copy()
        self.work = float(state["work"][0])
