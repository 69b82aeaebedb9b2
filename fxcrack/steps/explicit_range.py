"""Rotations of linear bodies in explicit dynamics, which their strains take as small."""

from __future__ import annotations

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.continuum.linear_range import LARGE, warn_of_range
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.solvers.explicit import ExplicitSolver

_GROWN = 1.5
"""Growth of the largest displacement from which on rotations are looked at again."""


class LinearRange:
    """Tells once where bodies that are linear have turned by angles that are not small.

    Bodies that swing back show nothing at the end, so that rows are looked at wherever the largest
    displacement has grown.

    Args:
        solver: The solver.
        said: What was warned of before, added to.
    """

    def __init__(self, solver: ExplicitSolver, said: set[str]) -> None:
        self._solver, self._said = solver, said
        self._largest = 0.0

    def look(self) -> None:
        """Look at the present displacement; collective."""
        solver, continuum = self._solver, self._solver.continuum
        if not solver.bodies.linear or "rotation" in self._said:
            return
        vector = solver.displacement()
        owned = vector.array_r.copy()
        vector.destroy()
        mine = float(np.abs(owned).max(initial=0.0))
        largest = float(max(continuum.comm.allgather(mine)))
        if not largest > _GROWN * self._largest:
            return
        self._largest = largest
        if isinstance(continuum, ShellBodies):
            self._look_at_shells(continuum, owned)
        else:
            # waves let the strains of triangles jump from cell to cell whatever they are good for
            rotation = self._said | {"triangles"}
            warn_of_range(continuum, owned, rotation)
            self._said |= rotation & {"rotation"}

    def _look_at_shells(self, shells: ShellBodies, owned: Array) -> None:
        """Warn of directors that have turned; directors are unit vectors, so that |w| is the angle.

        Args:
            shells: The bodies.
            owned: Displacement and change of the director of the owned nodes, shape (n_local,).
        """
        turned = shells.layout.by_node(owned)[:, shells.gdim :]
        mine = float(np.sqrt((turned**2).sum(axis=1)).max(initial=0.0))
        angle = float(max(shells.comm.allgather(mine)))
        if angle <= LARGE:
            return
        self._said.add("rotation")
        instead = "give the Scene effects=[FiniteStrain()]"
        if self._solver.pairs:
            instead = (
                "interfaces of shells are for small rotations in explicit steps: use a Dynamic "
                "step with FiniteStrain(), or ContinuumShell on hexahedra of first order"
            )
        log.warn(
            "parts of the shells have turned by up to %.2g radians, and linear shells take "
            "rotations as small: lengths, lever arms and openings err by up to about %.2g %%, and "
            "membrane forces neither stiffen nor weaken them; %s",
            angle,
            50.0 * angle**2,
            instead,
        )


__all__ = ["LinearRange"]
