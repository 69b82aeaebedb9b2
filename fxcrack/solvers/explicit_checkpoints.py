"""Collecting the state of explicit dynamics for a checkpoint, and resuming from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.interface.front import Front
from fxcrack.solvers.explicit_moving import MovingInterfaces
from fxcrack.solvers.explicit_present import PresentInterface
from fxcrack.solvers.explicit_stability import Stability
from fxcrack.solvers.explicit_state import Arrays, MotionFiles, MotionSnapshot


class MotionCheckpoints:
    """The state at the start of an increment as plain arrays, on any number of ranks.

    Args:
        continuum: Displacement space.
        bodies: The bodies.
        fronts: Fronts per pair.
        moving: Fronts, faces and pairs of bodies that move far.
        present: Forces and jumps of the present increment.
        stability: The stable increment.
    """

    def __init__(
        self, continuum: Continuum, bodies: InternalForces, fronts: Sequence[Front],
        moving: MovingInterfaces, present: PresentInterface, stability: Stability,
    ) -> None:  # fmt: skip
        self._files = MotionFiles(continuum, bodies)
        self._finite = bodies.finite
        self._fronts, self._moving = fronts, moving
        self._present, self._stability = present, stability

    def arrays(self, saved: MotionSnapshot, state: Equilibrium, stable: float) -> Arrays:
        """A state as plain arrays; collective.

        Args:
            saved: Bodies and interfaces.
            state: Loads and jumps.
            stable: Largest stable increment, time.

        Returns:
            displacement, velocity and positions of all nodes in the order of the input, on rank 0;
            bonds and energies of the interfaces by row; bonded[p], shape (n_nodes,), and jump[p],
            shape (n_nodes, gdim), per pair; loads, shape (n_loads,). Where the stable increment
            changes also the last look at it, and at finite strain pairs and gaps that have changed.
        """
        files = self._files
        out = files.arrays(saved) | {"loads": state.loads}
        look = self._stability
        if look.changes:
            out["stable"] = np.array([stable, look.compressed])
            out["highest"] = files.gather(look.highest)
            out["most_damped"] = files.gather(look.most_damped)
        if self._finite:
            out |= self._moving.arrays()
            out["looked"] = files.gather(look.looked)
        return out | self._present.arrays(self._fronts, state.jump)

    def resumed(self, arrays: Arrays) -> MotionSnapshot:
        """Put fronts, pairs and stable increment into a state; collective.

        Args:
            arrays: As :meth:`arrays` gave them.

        Returns:
            State of bodies and interfaces, for the caller to take.

        Raises:
            InputError: The arrays do not fit the mesh.
        """
        files = self._files
        files.check_positions(arrays["positions"])
        for p, front in enumerate(self._fronts):
            gone = front.bonded & ~arrays[f"bonded[{p}]"].astype(bool)
            if gone.any():
                front.release(np.flatnonzero(gone))
        if "highest" in arrays:
            looked = np.zeros(0)
            if self._finite:
                self._moving.restore(arrays)
                looked = files.scatter(arrays["looked"])
            highest = files.scatter(arrays["highest"])
            # not in files written before increments followed quadratic bulk viscosity
            damped = files.scatter(arrays.get("most_damped", arrays["highest"]))
            stable, compressed = [*arrays["stable"].astype(float).ravel().tolist(), 0.0][:2]
            self._stability.restore(highest, stable, looked, damped, compressed)
        return files.snapshot(arrays)


__all__ = ["MotionCheckpoints"]
