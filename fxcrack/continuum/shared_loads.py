"""Resultants and monitors of the numbers that all nodes of a section share."""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.continuum.amplitudes import AmplitudeLike
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.generalised_plane_strain import SharedUnknown, shared_unknowns


@dataclass(frozen=True)
class SharedForce:
    """Resultant of a free number of the section, a force pattern.

    Attributes:
        shared: The number.
    """

    shared: SharedUnknown

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.shared.answer

    @property
    def amplitude(self) -> AmplitudeLike:
        """Factor in time."""
        return self.shared.amplitude

    def vector(self, continuum: Continuum) -> PETSc.Vec:
        """Forces on the dofs at amplitude 1; collective; the caller destroys the vector."""
        size = continuum.n_local, continuum.n_global
        out = PETSc.Vec().createMPI(size, comm=continuum.comm)
        out.array[:] = _at_dof(continuum, self.shared, self.shared.load / self.shared.per_reaction)
        return out


@dataclass(frozen=True)
class SharedMonitor:
    """A free number of the section, watched as displacements are.

    Attributes:
        shared: The number.
    """

    shared: SharedUnknown

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.shared.title

    def weights(self, continuum: Continuum) -> Array:
        """Weights of the owned dofs, shape (n_local,), per unit of the unknown."""
        return _at_dof(continuum, self.shared, self.shared.per_unknown)


def _at_dof(continuum: Continuum, shared: SharedUnknown, value: float) -> Array:
    """A value at the dof that stands for a shared unknown, zero elsewhere, shape (n_local,)."""
    out = np.zeros(continuum.n_local)
    at = continuum.layout.shared_dof(shared.unknown)
    if at is not None:
        out[at] = value
    return out


def shared_loads(continuum: Continuum) -> list[SharedForce]:
    """Resultants of free numbers that are not zero."""
    free = [s for s in shared_unknowns(continuum.model) if s.prescribed is None]
    return [SharedForce(s) for s in free if s.load]


def shared_monitors(continuum: Continuum) -> list[SharedMonitor]:
    """Monitors of the free numbers."""
    return [SharedMonitor(s) for s in shared_unknowns(continuum.model) if s.prescribed is None]


__all__ = ["SharedForce", "SharedMonitor", "shared_loads", "shared_monitors"]
