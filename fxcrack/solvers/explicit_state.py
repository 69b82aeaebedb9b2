"""The state of explicit dynamics between two increments: to return to, and for checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.input_order import FileOrder
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.solvers.explicit_acting import InterfaceEnergies
from fxcrack.solvers.explicit_bonds import Fading, SofteningBonds
from fxcrack.solvers.explicit_energies import Totals
from fxcrack.solvers.explicit_interface import InterfaceDynamics

Arrays = dict[str, npt.NDArray[Any]]
_SAME = 1e-9
"""Nodes of another number of ranks may be off by round-off, in parts of the largest coordinate."""


@dataclass(frozen=True)
class InterfaceSnapshot:
    """State of the interfaces.

    Attributes:
        tied: Rows that are tied, shape (n_rows,).
        elastic: Rows whose elastic bonds hold, shape (n_rows,).
        bonds: Softening bonds.
        fading: Bonds that fade.
        energies: What has left the bodies.
        references: Displacement and velocity of prescribed references, shape (2, n_motions).
    """

    tied: Bools
    elastic: Bools
    bonds: SofteningBonds
    fading: list[Fading]
    energies: InterfaceEnergies
    references: Array

    @classmethod
    def of(cls, dynamics: InterfaceDynamics) -> InterfaceSnapshot:
        """A copy of the present state."""
        bonds = dynamics.bonds
        copied = {f.name: getattr(bonds, f.name).copy() for f in fields(bonds)}
        return cls(
            dynamics.lumped.tied.copy(), dynamics.elastic.active.copy(), SofteningBonds(**copied),
            list(dynamics.fading), replace(dynamics.energies), dynamics.references.copy(),
        )  # fmt: skip

    def restore(self, dynamics: InterfaceDynamics) -> None:
        """Put the interfaces into this state."""
        again = {f.name: getattr(self.bonds, f.name).copy() for f in fields(self.bonds)}
        dynamics.bonds = SofteningBonds(**again)
        dynamics.fading = list(self.fading)
        dynamics.energies = replace(self.energies)
        dynamics.elastic.active = self.elastic.copy()
        dynamics.references = self.references.copy()
        dynamics.set_ties(self.tied)

    def arrays(self) -> Arrays:
        """Plain arrays by name: those of the bonds, rows and forces of fading ones, energies."""
        out: Arrays = {"tied": self.tied, "elastic": self.elastic}
        out["references"] = self.references
        out |= {f"bonds.{f.name}": getattr(self.bonds, f.name) for f in fields(self.bonds)}
        out["energies"] = np.array(list(asdict(self.energies).values()))
        gdim = self.bonds.direction.shape[1]
        rows = [np.zeros(0, dtype=np.int64), *(f.rows for f in self.fading)]
        forces = [np.zeros((0, gdim)), *(f.force for f in self.fading)]
        law = [[len(f.rows), f.increments, f.viscosity, f.age] for f in self.fading]
        out["fading.rows"], out["fading.force"] = np.concatenate(rows), np.concatenate(forces)
        out["fading.law"] = np.array(law, dtype=float).reshape(-1, 4)
        return out

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> InterfaceSnapshot:
        """The state that :meth:`arrays` were made of."""
        kinds = {
            f.name: bool if f.name in ("active", "freed") else float for f in fields(SofteningBonds)
        }
        bonds = SofteningBonds(**{k: arrays[f"bonds.{k}"].astype(t) for k, t in kinds.items()})
        law = arrays["fading.law"].astype(float)
        ends = np.cumsum(law[:, 0].astype(np.int64))
        rows = np.split(arrays["fading.rows"].astype(np.int64), ends[:-1])
        forces = np.split(arrays["fading.force"].astype(float), ends[:-1])
        fading = [
            Fading(r, f, int(increments), float(viscosity), int(age))
            for r, f, (_, increments, viscosity, age) in zip(rows, forces, law, strict=False)
        ]
        energies = InterfaceEnergies(*arrays["energies"].astype(float).tolist())
        tied, elastic = (arrays[name].astype(bool) for name in ("tied", "elastic"))
        # checkpoints written before there were couplings have none
        references = np.asarray(arrays.get("references", np.zeros((2, 0))), dtype=float)
        return cls(tied, elastic, bonds, fading, energies, references)


@dataclass(frozen=True)
class MotionSnapshot:
    """State of bodies and interfaces at the start of an increment.

    Attributes:
        u: Displacement of the owned dofs, shape (n_local,), length.
        v: Their velocity in the middle of the last increment, length/time.
        interfaces: State of the interfaces.
        at: Time of the displacement.
        last_dt: Length of the last increment, time.
        sums: Energies as :meth:`MotionEnergies.totals` gives them, force times length.
        increments: How many were done.
        coordinates: Coordinates of support columns and load factors at the start of the increment
            and at its end, shape (n_loads,) each; ``None`` where they are not known.
        bodies: State of bodies that depend on those they passed.
    """

    u: Array
    v: Array
    interfaces: InterfaceSnapshot
    at: float
    last_dt: float
    sums: Totals
    increments: int
    coordinates: tuple[Array, Array] | None = None
    bodies: dict[str, Array] = field(default_factory=dict)


class MotionFiles:
    """Fields of the bodies as arrays of a checkpoint, and back; the same on any number of ranks.

    Args:
        continuum: Displacement space.
        bodies: The bodies.
    """

    def __init__(self, continuum: Continuum, bodies: InternalForces) -> None:
        self._continuum, self._bodies = continuum, bodies
        self._order = FileOrder(continuum.mesh.domain)
        self._field = fem.Function(continuum.space)

    def arrays(self, saved: MotionSnapshot) -> Arrays:
        """A state as plain arrays; collective.

        Returns:
            displacement, velocity and positions of all nodes in the order of the input, on rank 0;
            motion, the numbers of the state; interfaces.*, bonds and energies by row; bodies.*,
            what bodies remember, cell by cell.
        """
        out: Arrays = {
            "displacement": self.gather(saved.u),
            "velocity": self.gather(saved.v),
            "positions": self.positions(),
            "motion": np.array([saved.at, saved.last_dt, *saved.sums, saved.increments]),
        }
        places = self._bodies.places()
        for name, values in saved.bodies.items():
            whole = self._order.gather(values, places[name]) if name in places else values
            out[f"bodies.{name}"] = whole
        return out | {f"interfaces.{k}": v for k, v in saved.interfaces.arrays().items()}

    def snapshot(self, arrays: Arrays) -> MotionSnapshot:
        """The state that :meth:`arrays` were made of, on any number of ranks; collective."""
        at, last_dt, work, damped, viscous, initial, renewed, heated, increments = (
            arrays["motion"].astype(float).tolist()
        )
        places, local, bodies = self._bodies.places(), self._bodies.state(), {}
        for name, mine in local.items():
            values = arrays[f"bodies.{name}"]
            if name in places:
                values = self._order.scatter(values, places[name]).reshape(mine.shape)
            bodies[name] = values.astype(float)
        part = {k.removeprefix("interfaces."): v for k, v in arrays.items() if "interfaces." in k}
        return MotionSnapshot(
            self.scatter(arrays["displacement"]), self.scatter(arrays["velocity"]),
            InterfaceSnapshot.from_arrays(part), at, last_dt,
            (work, damped, viscous, initial, renewed, heated), int(increments), bodies=bodies,
        )  # fmt: skip

    def gather(self, owned: Array) -> Array:
        """Values of the owned dofs in the order of the input, on rank 0; collective."""
        x = self._field.x
        x.array[: self._continuum.n_local] = owned
        x.scatter_forward()
        return self._order.gather(x.array, self._continuum.space)

    def scatter(self, whole: Array) -> Array:
        """Values of the owned dofs out of a whole field; collective."""
        mine = self._order.scatter(whole, self._continuum.space).ravel()
        return mine[: self._continuum.n_local].copy()

    def positions(self) -> Array:
        """Positions of the nodes, on rank 0; collective."""
        return self._order.gather(self._continuum.positions(), self._continuum.space)

    def check_positions(self, whole: Array) -> None:
        """Refuse a state of another mesh; collective.

        Raises:
            InputError: Cells or their nodes have another order than they had.
        """
        x = self._continuum.positions()
        mine = self._order.scatter(whole, self._continuum.space).reshape(x.shape)
        size = np.abs(x).max(initial=0.0)
        same = bool(np.abs(mine - x).max(initial=0.0) <= _SAME * size)
        if not min(self._continuum.comm.allgather(same)):
            raise InputError(
                "the checkpoint does not fit: its mesh has the same cells in another order, or "
                "nodes elsewhere. Give the mesh it was written with, or run without restart"
            )


__all__ = ["Arrays", "InterfaceSnapshot", "MotionFiles", "MotionSnapshot"]
