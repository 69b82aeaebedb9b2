"""What must hold after every event of an analysis, checked on the state itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from specimens import gathered, gathered_vector

import fxcrack as fx
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.history import Row

PENETRATION = 1e-10  # of the largest jump: asked for
FORCE = 1e-11  # of the sum of |stiffness| |displacement| a force is the difference of: round-off
BALANCE = 1e-8  # of the work: where bonds change branch is found to 1e-6 of their force


def stored_in(bond: CohesiveBond, opening: float) -> float:
    """What a softening bond would give back on its way to zero force."""
    most = opening if bond.largest is None else bond.largest
    return 0.5 * bond.force(opening) ** 2 / replace(bond, largest=most).secant


class Watch:
    """Checks the state after every event; an observer.

    Args:
        scene: Scene with one debond.
        work: Energy against which round-off counts while little work has been seen.
    """

    def __init__(self, scene: fx.Scene, work: float = 0.0) -> None:
        self.scene = scene
        self.bonded = scene.solver.fronts[0].bonded.copy()
        self.dissipated = self.terms = self.jump = 0.0
        self.work = work  # what a load does between two rows is not seen
        self.count = 0

    def __call__(self, event: str, row: Row) -> None:
        model = self.scene.solver
        system, state = model.system, model.state
        front, index = model.fronts[0], model.index[0]
        assert all(np.isfinite(v) for k, v in row.items() if k != "event"), row
        force = system.forces(state, np.arange(system.n_retained))
        last = np.abs(np.concatenate([state.jump, state.loads]))
        terms = np.abs(system.schur[: len(last), : len(last)]) @ last
        # where the load passes zero, what is left is round-off of the largest load so far
        self.terms = max(self.terms, float(terms.max(initial=0.0)))
        self.jump = max(self.jump, float(np.abs(state.jump).max(initial=0.0)))
        slack = FORCE * self.terms
        # irreversibility
        assert not np.any(front.bonded & ~self.bonded)
        self.bonded = front.bonded.copy()
        # bonds are shut; what is released carries what its law says and no more
        held = index[front.bonded]
        assert np.all(state.jump[held[held >= 0]] == 0.0)
        soft = np.zeros(system.n_retained, dtype=bool)
        soft[system.soft.components] = True
        free = system.free & ~soft
        assert np.abs(force - state.force)[free].max(initial=0.0) <= slack
        bonds = system.soft.bonds
        for bond in bonds:
            carried = -force[bond.components] @ bond.direction
            assert carried <= bond.strength * (1.0 + 1e-6) + slack  # as the events are found
        # contact
        if system.contact.any():
            gap = (state.jump + system.gap)[system.contact]
            push = (force - state.force)[system.contact]
            assert gap.min() >= -PENETRATION * self.jump
            assert push.min() >= -slack
            assert np.abs(gap * push).max() <= self.jump * slack
        # energies
        self.work = max(self.work, abs(float(row["external_work"])))
        none = BALANCE * self.work + 0.01 * slack * float(last.max())
        assert row["strain_energy"] >= -none
        stored = sum(stored_in(b, b.opening(state.jump)) for b in bonds)
        dissipated = float(row["released_energy"]) - stored  # bonds give the rest back
        # the first part of a bond's path, 1e-7 of it, is its unloading path too
        elastic = 1e-7 * sum(0.5 * b.strength * b.final for b in bonds)
        assert dissipated >= self.dissipated - none - elastic
        assert abs(row["balance"]) <= none
        self.dissipated = dissipated
        self.count += 1


def assert_in_balance(scene: fx.Scene) -> None:
    """K u - f on the mesh: zero at free nodes, opposite at the two sides of the interface."""
    model = scene.solver
    u = model.displacement()
    vector = model.nodal_forces(u)
    gdim = scene.mesh.gdim
    residual = gathered_vector(vector).reshape(-1, gdim)
    which = np.concatenate(scene.mesh.comm.allgather(scene.supports.which)).reshape(-1, gdim)
    stiffness = abs(gathered(model.stiffness))
    slack = FORCE * float((stiffness @ np.abs(gathered_vector(u))).max())
    u.destroy()
    vector.destroy()
    pair = scene.pairs[0]
    at_interface = np.zeros(len(residual), dtype=bool)
    at_interface[pair.surface.dofs] = True
    at_interface[pair.masters.ravel()] = True
    free = (which < 0) & ~at_interface[:, None]
    assert np.abs(residual[free]).max(initial=0.0) <= slack
    # the interface forces on slaves come back on masters: only supports are left in the sum
    slaves = np.where(which[pair.surface.dofs] < 0, residual[pair.surface.dofs], 0.0)
    spread = np.zeros_like(residual)
    np.add.at(spread, pair.masters, -pair.weights[..., None] * slaves[:, None])
    rest = np.where(which < 0, residual - spread, 0.0)
    rest[pair.surface.dofs] = 0.0
    assert np.abs(rest).max() <= slack
