"""Criteria and releases within an increment of explicit dynamics.

No cutback exists: a node whose f has passed its onset at the start of an increment is released in
it. Whether the criterion need be evaluated at all is found by a bound: no mode can have more than
|F| |w| of the product of force and opening.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.sparse import Product
from fxcrack.criteria import ProgressiveRelease
from fxcrack.criteria.closure_lengths import uneven
from fxcrack.criteria.crack_closure import closure_weights
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.criteria.evaluator import SofteningEvaluator, TipValues
from fxcrack.criteria.mixed_mode import least_critical
from fxcrack.interface.lumped_rows import mean_jumps
from fxcrack.interface.tips import Tips
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.explicit_bonds import Fading
from fxcrack.solvers.explicit_interface import ChosenBonds
from fxcrack.steps.crack import Crack

_TIE = 1e-6
"""Front nodes whose f lies within this fraction below the onset go together with those above."""
_CLOSE = 0.999
"""Part of the bound below which f is surely below the onset, round-off included."""


@dataclass(frozen=True)
class _Screen:
    """What the bound needs at one front.

    Attributes:
        tips: The front.
        forces: Bond forces at its nodes.
        openings: Openings behind it by the motion of the nodes, (n gdim, n_nodes gdim).
        bound: Square of |F| |w| below which f is below the onset, shape (n,).
        version: Position of the front and ties for which this holds.
    """

    tips: Tips
    forces: ChosenBonds
    openings: Product
    bound: Array
    version: tuple[int, int, int]


class ReleaseControl:
    """Releases the nodes of one crack when their time has come.

    Args:
        solver: The solver.
        crack: The crack.
    """

    def __init__(self, solver: ExplicitSolver, crack: Crack) -> None:
        self._solver, self._crack = solver, crack
        self.law = crack.law
        self.onset = self.law.onset if isinstance(self.law, ProgressiveRelease) else 1.0
        self._screen: _Screen | None = None

    def tips(self) -> Tips:
        """The present front, kept until it changes."""
        return self._present().tips

    def _present(self) -> _Screen:
        crack, front = self._crack, self._crack.front
        lumped = self._solver.lumped
        version = front.version, front.placed, lumped.version
        if self._screen is None or self._screen.version != version:
            tips = crack.tips()
            if len(tips):
                crack.check_wake(tips)
            row_of = self._solver.row_of[crack.p]
            # on a plane of symmetry rates are those of the whole crack
            factor = crack.probe.pair.interface.opening_factor
            rows = row_of[tips.wake_nodes[:, 0]]
            behind = mean_jumps(lumped, rows, factor * tips.wake_weights[:, 0])
            self._screen = _Screen(
                tips, self._solver.dynamics.chosen_bonds(row_of[tips.node]),
                behind, self._bounds(tips), version,
            )  # fmt: skip
        return self._screen

    def _bounds(self, tips: Tips) -> Array:
        criterion = self._crack.criterion
        zero = np.zeros(len(tips))
        changes = criterion.needs_temperature or self._crack.probe.has_face_loads
        if not len(tips) or changes or not isinstance(criterion, RateCriterion):
            return zero
        toughness = self._crack.evaluator.toughness
        assert toughness is not None
        least = least_critical(criterion.law, toughness[tips.node])
        ahead = np.where(tips.straight, tips.d_ahead, tips.d_behind)
        if criterion.normalisation == "equal_length" and uneven(ahead, tips.d_behind).any():
            return zero  # the product of force and opening alone is no bound
        lengths = tips.d_ahead, tips.d_behind, tips.width
        weights = closure_weights(*lengths, 1, criterion.normalisation, tips.straight)[:, 0]
        power = 1.0 if criterion.law.degree is None else 1.0 / criterion.law.degree
        if criterion.law.degree is None and self.onset < 1.0:
            return zero
        return np.asarray((_CLOSE * self.onset**power * least / weights) ** 2)

    def critical(self) -> TipValues | None:
        """Values at the tips if some of them are to be released now, else ``None``."""
        screen = self._present()
        if not len(screen.tips):
            return None
        dynamics, n = self._solver.dynamics, len(screen.tips)
        force, opening = dynamics.bonds_at(screen.forces), dynamics.moved(screen.openings)
        if n == 1:
            below = (force @ force) * (opening @ opening) < screen.bound[0]
        else:
            force *= force
            opening *= opening
            products = force.reshape(n, -1).sum(axis=1) * opening.reshape(n, -1).sum(axis=1)
            below = not np.any(products >= screen.bound)
        if below:
            return None
        values = self.values()
        return values if values.f.max() >= self.onset else None

    def values(self) -> TipValues:
        """Values of the criterion at the present front."""
        return self._crack.evaluate(self.tips(), self._solver.state, self._solver.at)

    def release(self, values: TipValues) -> None:
        """Release the critical nodes by the law of the debond, and record them."""
        crack, solver, law = self._crack, self._solver, self.law
        chosen = np.flatnonzero(values.f >= self.onset * (1.0 - _TIE))
        nodes = np.unique(values.tips.force_nodes[chosen])
        rows = solver.row_of[crack.p][nodes]
        forces = solver.present.bonds[rows]
        crack.record(nodes, values, solver.state, solver.at)
        if law.driver == "opening":
            energy, area, force = self._to_spend(nodes, values, forces)
        crack.front.release(nodes)
        dynamics = solver.dynamics
        lost = dynamics.release(rows)
        viscosity = crack.criterion.viscosity
        if law.driver == "opening":
            f = values.f[np.searchsorted(values.tips.node, nodes)]
            power = 0.5 if crack.evaluator.degree is None else 1.0 / crack.evaluator.degree
            dynamics.soften(rows, force, (self.onset / f) ** power, energy, area, lost)
        elif law.driver == "increments":
            dynamics.fading.append(Fading(rows, forces, int(getattr(law, "increments", 1)), 0.0))
        elif viscosity > 0.0:
            dynamics.fading.append(Fading(rows, forces, 0, viscosity))

    def _to_spend(
        self, nodes: Ints, values: TipValues, forces: Array
    ) -> tuple[Array, Array, Array]:
        """Energy of each node and the area it sweeps, shape (n,), and the force that softens.

        Where faces are pressed together contact keeps the normal force from then on.
        """
        crack, solver = self._crack, self._solver
        evaluator = crack.evaluator
        units = _softening(evaluator).to_soften(nodes, values, self.law)
        energy, area, force = np.zeros(len(nodes)), np.zeros(len(nodes)), forces.copy()
        normals = solver.lumped.frames[solver.row_of[crack.p][nodes]][:, :, 0]
        for unit in units:
            at = np.searchsorted(nodes, unit.nodes)
            energy[at], area[at] = unit.energy / len(at), unit.area / len(at)
            if unit.pressed:
                along = np.maximum((force[at] * normals[at]).sum(axis=1), 0.0)
                force[at] -= along[:, None] * normals[at]
        return energy, area, force


def _softening(evaluator: object) -> SofteningEvaluator:
    assert hasattr(evaluator, "to_soften")
    return evaluator  # type: ignore[return-value]


__all__ = ["ReleaseControl"]
