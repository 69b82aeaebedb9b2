"""State of the interfaces by slave node, whatever jumps are retained.

It is the one way back to an earlier state: within a set of retained jumps (a trial is rejected),
on another one (a step begins, a front leaves the set), and from a checkpoint. States are carried
over, never found anew: where a bond softens or faces slip, more than one equilibrium may belong to
the same loads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import SolverError
from fxcrack.condensation.mumps_schur import HELD_BY_ROUND_OFF, mumps_message
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.coulomb import FrictionState, NodeStates
from fxcrack.equilibrium.friction_state import make_friction, nodes_of
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.equilibrium.jump_system import ComponentStates
from fxcrack.interface.front import Front
from fxcrack.interface.pair import Pair, with_friction

Arrays = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class InterfaceState:
    """What the interfaces remember of an equilibrium.

    The values of the retained jumps are stored in the numbering they have then, together with that
    numbering, so that they belong to slave nodes.

    Attributes:
        index: Number of each value per pair, -1 where there is none, shape (n_nodes, gdim).
        bonded: Bonded slave nodes per pair, shape (n_nodes,).
        equilibrium: Loads, given forces, jumps and conjugates.
        states: Which components are free, closed, may be in contact; softening bonds; friction.
        friction_energy: Energy dissipated by friction so far.
        overlap_energy: Energy given by contact that pushed overlapping faces apart so far.
    """

    index: list[Ints]
    bonded: list[Bools]
    equilibrium: Equilibrium
    states: ComponentStates
    friction_energy: float
    overlap_energy: float = 0.0

    # -- the present state, and back to it -----------------------------------------------

    @classmethod
    def of(
        cls,
        system: ContactSystem,
        fronts: list[Front],
        index: list[Ints],
        equilibrium: Equilibrium,
        friction_energy: float,
        overlap_energy: float = 0.0,
    ) -> InterfaceState:
        """The present state of a system.

        Args:
            system: The dense system.
            fronts: Fronts per pair.
            index: Numbers of its retained jumps per pair, -1 elsewhere, shape (n_nodes, gdim).
            equilibrium: Present equilibrium.
            friction_energy: Energy dissipated by friction so far.
            overlap_energy: Energy given by contact that pushed overlapping faces apart so far.
        """
        bonded = [front.bonded.copy() for front in fronts]
        return cls(index, bonded, equilibrium, system.snapshot(), friction_energy, overlap_energy)

    def restore_bonds(self, fronts: list[Front]) -> None:
        """Give fronts the bonded nodes of this state."""
        for front, bonded in zip(fronts, self.bonded, strict=True):
            for nodes, act in (
                (np.flatnonzero(front.bonded & ~bonded), front.release),
                (np.flatnonzero(bonded & ~front.bonded), front.bond),
            ):
                if len(nodes):
                    act(nodes)

    # -- another set of retained jumps ---------------------------------------------------

    def nodes_to_retain(self, pairs: list[Pair]) -> list[tuple[int, int]]:
        """(pair, slave node) of what must be retained wherever the front is.

        Bonds that soften or still carry a given force, and faces without a law of contact that
        stay pressed together where a bond softens.
        """
        out = [(b.where[0], k) for b in self.states.bonds for k in b.where[1].tolist()]
        force, contact = self.equilibrium.force != 0.0, self.states.contact
        for p, (pair, index) in enumerate(zip(pairs, self.index, strict=True)):
            carried = force if pair.interface.contact else force | contact
            if carried.any():
                inside = np.append(carried, False)[index]  # the index is -1 where there is none
                out += [(p, int(k)) for k in np.flatnonzero(inside.any(axis=1))]
        return out

    def values(
        self, values: npt.NDArray[Any], index: list[Ints], n_retained: int
    ) -> npt.NDArray[Any]:
        """Values of this state's retained jumps on another set, 0 where it has none.

        Args:
            values: Shape (number of them here,).
            index: Numbers in the other set per pair, shape (n_nodes, gdim).
            n_retained: Their number.
        """
        out = np.zeros(n_retained, dtype=values.dtype)
        for then, now in zip(self.index, index, strict=True):
            both = (then >= 0) & (now >= 0)
            out[now[both]] = values[then[both]]
        return out

    def carry_over(
        self, system: ContactSystem, pairs: list[Pair], fronts: list[Front], index: list[Ints]
    ) -> None:
        """Put a system on another set of retained jumps, all bonded so far, into this state.

        Args:
            system: The dense system of the new set.
            pairs: Interfaces.
            fronts: Their fronts, with the bonds of this state.
            index: Numbers of the new set per pair, shape (n_nodes, gdim).

        Raises:
            SolverError: Nothing holds a body once its open part is open.
        """
        n = system.n_retained
        bonds = [
            replace(b, components=index[b.where[0]][b.where[1], b.where[2]])
            for b in self.states.bonds
        ]
        soft = np.concatenate([b.components for b in bonds]) if bonds else np.zeros(0, np.int64)
        system.closed[:] = self.values(self.states.closed, index, n)
        system.contact[:] = self.values(self.states.contact, index, n)
        friction = bool(with_friction(pairs))
        for pair, front, numbers in zip(pairs, fronts, index, strict=True):
            retained = numbers[:, 0] >= 0
            system.gap[numbers[retained, 0]] = pair.gap[retained]
            is_open = ~front.bonded
            if friction:
                # their bonds are released as well, but contact and friction decide on them
                is_open[nodes_of(pair, front, numbers)] = False
            free = numbers[is_open]
            free = free[free >= 0]
            free = free[~system.closed[free] & ~np.isin(free, soft)]
            if len(free):
                _free_open(system, pair, numbers[is_open & pair.can_touch, 0], free)
            if pair.interface.contact:
                allow_contact(system, pair, front, numbers)
        if friction:
            make_friction(system, pairs, fronts, index, self.states.friction)
        system.soft.finished = self.states.finished
        if bonds:
            if not system.soft_contact:
                system.contact[soft] = False
            system.soften(bonds)

    # -- checkpoints ---------------------------------------------------------------------

    def arrays(self) -> Arrays:
        """Plain arrays by name, for :meth:`from_arrays`.

        Returns:
            loads and conjugate, shape (n_loads,); per pair p bonded[p], shape (n_nodes,), and
            jump[p], force[p], closed[p], contact[p], shape (n_nodes, gdim), and index[p], likewise;
            soft.* per softening bond; friction.* per contact node if there is friction.
        """
        out: Arrays = {"loads": self.equilibrium.loads, "conjugate": self.equilibrium.conjugate}
        fields = {
            "jump": self.equilibrium.jump,
            "force": self.equilibrium.force,
            "closed": self.states.closed.astype(float),
            "contact": self.states.contact.astype(float),
        }
        for p, (bonded, index) in enumerate(zip(self.bonded, self.index, strict=True)):
            out[f"bonded[{p}]"], out[f"index[{p}]"] = bonded, index
            for name, values in fields.items():
                out[f"{name}[{p}]"] = np.append(values, 0.0)[index]  # -1 where there is none
        friction = self.states.friction
        if friction is not None:
            out["friction.where"] = friction.where
            out["friction.status"] = friction.states.status
            out["friction.direction"] = friction.states.direction
            out["friction.reference"] = friction.reference
            out["friction.error"] = np.array([friction.error])
            out["friction.energy"] = np.array(self.friction_energy)
        if self.overlap_energy:
            out["overlap.energy"] = np.array(self.overlap_energy)
        return out | _arrays_of_bonds(self.states.bonds, self.states.finished)

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]], n_pairs: int) -> InterfaceState:
        """The state that :meth:`arrays` were made of.

        Args:
            arrays: By name, of the shapes that :meth:`arrays` gives.
            n_pairs: Number of interfaces.
        """
        index = [arrays[f"index[{p}]"].astype(np.int64) for p in range(n_pairs)]
        bonded = [arrays[f"bonded[{p}]"].astype(bool) for p in range(n_pairs)]
        n = max((int(i.max(initial=-1)) for i in index), default=-1) + 1

        def numbered(name: str) -> Array:
            out = np.zeros(n)
            for p, numbers in enumerate(index):
                inside = numbers >= 0
                out[numbers[inside]] = arrays[f"{name}[{p}]"][inside]
            return out

        loads, conjugate = (arrays[k].astype(float) for k in ("loads", "conjugate"))
        equilibrium = Equilibrium(loads, numbered("force"), numbered("jump"), conjugate)
        friction, energy = None, 0.0
        if "friction.where" in arrays:
            friction = FrictionState(
                arrays["friction.where"].astype(np.int64),
                NodeStates(
                    arrays["friction.status"].astype(np.int64),
                    arrays["friction.direction"].astype(float),
                ),
                arrays["friction.reference"].astype(float),
                float(arrays["friction.error"][0]),
            )
            energy = float(arrays["friction.energy"])
        states = ComponentStates(
            free=np.zeros(n, dtype=bool),  # what is open and not closed, on any set
            closed=numbered("closed") > 0.0,
            contact=numbered("contact") > 0.0,
            bonds=_bonds_of_arrays(arrays),
            finished=float(arrays["soft.finished"]),
            friction=friction,
        )
        overlap = float(arrays.get("overlap.energy", np.zeros(())))
        return cls(index, bonded, equilibrium, states, energy, overlap)


def allow_contact(system: ContactSystem, pair: Pair, front: Front, index: Ints) -> None:
    """Mark the open normal components of a pair as possible contacts.

    Args:
        system: The dense system.
        pair: The interface.
        front: Its front.
        index: Numbers of its retained jumps, -1 elsewhere, shape (n_nodes, gdim).
    """
    normals = index[~front.bonded & pair.can_touch, 0]
    normals = normals[normals >= 0]
    system.touches[normals] = True
    system.contact[normals[~np.isin(normals, system.soft.components)]] = True


def _free_open(system: ContactSystem, pair: Pair, normals: Ints, free: Ints) -> None:
    """Free open components; a body that only contact holds begins with all of it closed.

    Raises:
        SolverError: Nothing holds a body once its open part is open.
    """
    try:
        system.release(free)
    except NotPositiveDefinite as error:
        if not pair.interface.contact:
            if error.why == HELD_BY_ROUND_OFF:
                raise SolverError(f"the open part cannot be opened: {error.why}") from error
            why = f" ({error.why})" if error.why else ""
            raise SolverError(f"{mumps_message(-10, 0)}{why}") from error
        normals = normals[normals >= 0]
        system.closed[normals] = True
        system.release(np.setdiff1d(free, normals))


def _arrays_of_bonds(bonds: list[CohesiveBond], finished: float) -> Arrays:
    rows = [
        (i, b.where[0], node, local)
        for i, b in enumerate(bonds)
        for node, local in zip(*b.where[1:], strict=True)
    ]
    return {
        "soft.where": np.array(rows, dtype=np.int64).reshape(-1, 4),
        "soft.direction": np.concatenate([np.zeros(0), *(b.direction for b in bonds)]),
        "soft.strength": np.array([b.strength for b in bonds], dtype=float),
        "soft.final": np.array([b.final for b in bonds], dtype=float),
        "soft.largest": np.array([np.nan if b.largest is None else b.largest for b in bonds]),
        "soft.fixed": np.array([b.fixed for b in bonds], dtype=bool),
        "soft.finished": np.array(finished),
    }


def _bonds_of_arrays(arrays: Mapping[str, npt.NDArray[Any]]) -> list[CohesiveBond]:
    law = tuple(arrays[f"soft.{name}"].astype(float) for name in ("strength", "final", "largest"))
    rows, direction = arrays["soft.where"].astype(np.int64), arrays["soft.direction"].astype(float)
    fixed = arrays.get("soft.fixed", np.zeros(len(law[0]), dtype=bool)).astype(bool)
    bonds = []
    for i, (strength, final, largest) in enumerate(zip(*law, strict=True)):
        mine = rows[:, 0] == i
        _, pair, nodes, local = rows[mine].T
        bonds.append(
            CohesiveBond(
                np.full(len(nodes), -1), direction[mine], float(strength), float(final),
                (int(pair[0]), nodes, local), None if np.isnan(largest) else float(largest),
                bool(fixed[i]),
            )
        )  # fmt: skip
    return bonds


__all__ = ["InterfaceState", "allow_contact"]
