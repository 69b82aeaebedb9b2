"""Release of bonds at the present load: which nodes, and by which law their forces go to zero."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.criteria.evaluator import TipValues
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack
from fxcrack.steps.force_ramps import (
    PrescribedRamp,
    ViscousCohesiveRamp,
    ViscousRamp,
    bond_forces_of,
)

_SAME_F = 1e-6
"""Cracks whose largest f lies within this fraction of that of all are critical together."""


def release_critical(analysis: Analysis, *, all_ready: bool = False) -> None:
    """Release the critical nodes and find the tips anew; collective.

    Args:
        analysis: The analysis, some f of it at least 1 as far as the path resolves it.
        all_ready: Release all nodes whose f is in the release range of their criterion, not only
            those of the largest f.
    """
    critical = analysis.largest * (1.0 - _SAME_F)
    for g, v in analysis.at_tips():
        if all_ready:
            chosen = np.flatnonzero(v.f >= g.criterion.release_range[0])
        elif v.f.max(initial=0.0) >= critical:
            chosen = g.ready(v, critical)
        else:
            continue
        if len(chosen):
            release_tips(analysis, g, v, chosen, analysis.time)
    analysis.update_tips()


def release_tips(
    analysis: Analysis, g: Crack, values: TipValues, chosen: Ints, moment: float
) -> None:
    """Release the nodes at some tips of a crack and record them; collective.

    Args:
        analysis: The analysis.
        g: The crack.
        values: Values of its criterion at the tips.
        chosen: Positions of tips, shape (n,).
        moment: Time or number of cycles to record.

    Raises:
        NotPositiveDefinite: A body would come free; nothing is changed or recorded.
    """
    nodes, before = g.nodes_of(values, chosen), analysis.solver.state
    _open(analysis, g, nodes, values)
    g.record(nodes, values, before, moment)


def _open(analysis: Analysis, g: Crack, nodes: Ints, values: TipValues) -> None:
    """Open nodes by the release law of their debond: at once, cohesive, or along a ramp.

    Midside nodes that have no tip of their own open with the corners that hold them
    (:mod:`fxcrack.interface.hierarchy`).
    """
    solver, time = analysis.condensed, analysis.time
    corners = nodes
    nodes = solver.pairs[g.p].opened_with(g.front.bonded, nodes)
    law, viscosity = g.law, g.criterion.viscosity
    ramp: PrescribedRamp | ViscousRamp | ViscousCohesiveRamp
    if g.opening_driven:
        units = g.to_soften(corners, values)
        if viscosity <= 0.0:
            solver.soften(g.p, units)
            return
        ramp = ViscousCohesiveRamp.begin(solver, g.p, units, viscosity, time)
    elif law.driver != "once":
        now = time if law.driver == "time" else float(analysis.balance.increment)
        ramp = PrescribedRamp.begin(solver, g.p, nodes, law, now)
    elif viscosity > 0.0:
        ramp = ViscousRamp(g.p, nodes, bond_forces_of(solver, g.p, nodes), viscosity, time)
    else:
        _open_at_once(analysis, g, nodes)
        return
    analysis.add_ramp(ramp)
    solver.open(g.p, ramp.nodes)


def _open_at_once(analysis: Analysis, g: Crack, nodes: Ints) -> None:
    """Take the bond forces of nodes away at constant load."""
    if not len(nodes):
        return
    condensed = analysis.condensed
    taken = condensed.system.soft.taken(analysis.solver.state.jump)
    energy, work = condensed.release(g.p, nodes, analysis.given_force(analysis.time))
    # bonds that soften, of another debond or of an earlier step, open with it and take their part
    taken = condensed.system.soft.taken(analysis.solver.state.jump) - taken
    analysis.balance.released += energy
    analysis.balance.by_force += energy - taken
    analysis.balance.external_work += work
