"""What is known of every bond, under the usual output names.

At failure, kept for good: DBT time, ENRRT energy release rates (I, II, III), EFENRRTR the
criterion's value (G_equiv/G_equivC for the VCCT family), OPENBC opening behind the crack, CRSTS
bond stress. Changing with time, read off the present state: BDSTAT bond state, DBSF remaining
fraction of the force at failure, DBS remaining stress. Components are those of the tip at failure:
11 normal, 12 growth direction, 13 front tangent; stresses are forces over tributary areas.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria.evaluator import TipValues
from fxcrack.criteria.probe import openings
from fxcrack.equilibrium.contact import Equilibrium

if TYPE_CHECKING:
    from fxcrack.steps.crack import Crack
    from fxcrack.steps.force_ramps import ForceRamp

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ReleaseRecord:
    """One node that was released.

    Attributes:
        node: Slave node.
        DBT: Time (or cycle number in a fatigue step) of failure.
        EFENRRTR: Value of the criterion at failure.
        ENRRT: Energy release rates by mode, NaN for criteria without, shape (3,), force/length.
        OPENBC: Opening behind the tip, shape (3,), length.
        CRSTS: Bond force over tributary area, tension positive, shape (3,), force/length^2.
        frame: Normal, growth direction and front tangent at failure as columns, shape (3, 3).
    """

    node: int
    DBT: float
    EFENRRTR: float
    ENRRT: Triple
    OPENBC: Triple
    CRSTS: Triple
    frame: Array = field(repr=False, compare=False)


def release_records(
    growth: Crack, nodes: Ints, values: TipValues, state: Equilibrium, time: float
) -> list[ReleaseRecord]:
    """Records of nodes that are about to be released.

    Args:
        growth: Their interface.
        nodes: Slave nodes, force nodes of some tips, shape (n,).
        values: Values of the criterion at the tips.
        state: Equilibrium before the release.
        time: Time.
    """
    tips = values.tips
    opened = openings(growth.probe, tips, state)
    stresses = per_area(growth, nodes, growth.probe.bond_forces(nodes, state))
    out = []
    for node, stress in zip(nodes, stresses, strict=True):
        i = int(np.nonzero(tips.force_nodes == node)[0][0])
        rates = [values.report[m][i] if m in values.report else np.nan for m in _MODES]
        frame = tips.frame[i]
        out.append(
            ReleaseRecord(
                int(node), float(time), float(values.f[i]), _three(rates), _three(opened[i, 0]),
                _three(stress @ frame), frame,
            )
        )  # fmt: skip
    return out


_MODES = ("GI", "GII", "GIII")


def _three(values: npt.ArrayLike) -> Triple:
    a, b, c = np.asarray(values, dtype=float)
    return float(a), float(b), float(c)


def per_area(growth: Crack, nodes: Ints, forces: Array) -> Array:
    """Forces over tributary areas, shape (n, 3) [force/length^2].

    Args:
        growth: The interface.
        nodes: Slave nodes, shape (n,).
        forces: Vectors, shape (n, 3) [force].
    """
    areas = growth.solver.pairs[growth.p].surface.areas[nodes]
    areas = np.where(areas > 0.0, areas, np.inf)  # corners of second-order facets may have none
    return np.asarray(forces / areas[:, None])


def bond_state(
    growth: Crack, ramps: list[ForceRamp], values: TipValues | None = None
) -> dict[str, Array]:
    """All of the usual names at all slave nodes, in the present state.

    Args:
        growth: The interface.
        ramps: Bonds that are released with time or over increments.
        values: Values of the criterion at the present front; None where it is not active.

    Returns:
        BDSTAT: 1 bonded, 0 open, between them the remaining fraction; DBSF: remaining fraction of
        the force at failure, 1 while bonded; DBT: time of failure, NaN before; EFENRRTR: value of
        the criterion, at failed nodes that at failure, at the front the present one; all of shape
        (n_nodes,). DBS, CRSTS, OPENBC and, as EFENRRTR, ENRRT: by component, shape (n_nodes, 3).
        What is not known is 0: at nodes that never failed, and ENRRT without rates.
    """
    bonded, n = growth.front.bonded, len(growth.front.bonded)
    fraction = bonded.astype(float)
    state = growth.solver.state
    nodes, left = growth.solver.remaining(growth.p)
    fraction[nodes] = left
    for ramp in ramps:
        if ramp.p == growth.p:
            index = growth.solver.index[ramp.p][ramp.nodes]
            now = np.where(index >= 0, state.force[np.maximum(index, 0)], 0.0)
            whole = np.maximum((ramp.force**2).sum(axis=1), np.finfo(float).tiny)
            fraction[ramp.nodes] = (now * ramp.force).sum(axis=1) / whole
    out = {"BDSTAT": fraction, "DBSF": fraction.copy(), "DBT": np.full(n, np.nan)}
    out |= {"EFENRRTR": np.zeros(n)}
    out |= {name: np.zeros((n, 3)) for name in ("DBS", "CRSTS", "OPENBC", "ENRRT")}
    for record in growth.records:
        for name in ("DBT", "EFENRRTR", "CRSTS", "OPENBC", "ENRRT"):
            out[name][record.node] = getattr(record, name)
    gone = np.array([record.node for record in growth.records], dtype=np.int64)
    if len(gone):
        stress = -per_area(growth, gone, growth.solver.vectors(growth.p, gone, state.force))
        frames = np.stack([record.frame for record in growth.records])
        out["DBS"][gone] = np.einsum("nc,nci->ni", stress, frames)
    if values is not None and len(values.tips):
        front = values.tips.node
        out["EFENRRTR"][front] = values.f
        for i, mode in enumerate(_MODES):
            out["ENRRT"][front, i] = values.report.get(mode, 0.0)
    out["ENRRT"] = np.nan_to_num(out["ENRRT"])
    return out
