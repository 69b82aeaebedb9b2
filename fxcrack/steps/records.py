"""What is known of every bond that has let go, under the usual output names.

DBT time of failure, ENRRT energy release rates (I, II, III) at failure, EFENRRTR the criterion's
value then (G_equiv/G_equivC for the VCCT family), OPENBC opening behind the crack when the
criterion was met, CRSTS bond stress at failure (normal, growth direction, front tangent). BDSTAT
and DBSF (bond state, remaining fraction of the force) change with time and are read off the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fxcrack.solve.jump_system import Equilibrium
from fxcrack.steps.evaluate import TipValues

if TYPE_CHECKING:
    from fxcrack.steps.growth import Growth
    from fxcrack.steps.letting_go import Letting

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class ReleaseRecord:
    """One node that has let go.

    Attributes:
        node: Slave node.
        DBT: Time (or cycle number in a fatigue step) of failure.
        EFENRRTR: Value of the criterion at failure.
        ENRRT: Energy release rates by mode, NaN for criteria without, shape (3,), force/length.
        OPENBC: Opening behind the tip, shape (3,), length.
        CRSTS: Bond force over tributary area, tension positive, shape (3,), force/length^2.
    """

    node: int
    DBT: float
    EFENRRTR: float
    ENRRT: tuple[float, float, float]
    OPENBC: tuple[float, float, float]
    CRSTS: tuple[float, float, float]


def release_records(
    growth: Growth, nodes: Ints, values: TipValues, state: Equilibrium, time: float
) -> list[ReleaseRecord]:
    """Records of nodes that are about to let go.

    Args:
        growth: Their interface.
        nodes: Slave nodes, force nodes of some tips, shape (n,).
        values: Values of the criterion at the tips.
        state: Equilibrium before the release.
        time: Time.
    """
    tips, model = values.tips, growth.model
    forces = model.bond_forces(growth.p, tips, state)
    openings = model.openings(growth.p, tips, state)
    out = []
    for node in nodes:
        rows, places = np.nonzero(tips.force_nodes == node)
        i, k = int(rows[0]), int(places[0])
        rates = [values.report[m][i] if m in values.report else np.nan for m in _MODES]
        stress = forces[i, k] / growth.front.surface.areas[node]
        out.append(
            ReleaseRecord(
                int(node), time, float(values.f[i]), _three(rates), _three(openings[i, 0]),
                _three(stress),
            )
        )  # fmt: skip
    return out


_MODES = ("GI", "GII", "GIII")


def _three(values: npt.ArrayLike) -> tuple[float, float, float]:
    a, b, c = np.asarray(values, dtype=float)
    return float(a), float(b), float(c)


def bond_state(growth: Growth, ramps: list[Letting], time: float) -> dict[str, Array]:
    """BDSTAT, DBSF and DBT of all slave nodes.

    Returns:
        BDSTAT: 1 bonded, 0 open, between them the remaining fraction; DBSF: remaining fraction of
        the force at failure, 1 while bonded; DBT: time of failure, NaN before; shape (n_nodes,).
    """
    bonded = growth.front.bonded
    fraction = bonded.astype(float)
    for bond in growth.model.system.soft.bonds:
        p, node, _ = bond.where
        if p == growth.p:
            opening = bond.opening(growth.model.state.jump)
            fraction[node] = bond.force(opening) / bond.strength
    for ramp in ramps:
        if ramp.p == growth.p:
            fraction[ramp.nodes] = ramp.fraction(ramp.now(time, 0)) if ramp.by_time else 0.0
    failed = np.full(len(bonded), np.nan)
    for record in growth.records:
        failed[record.node] = record.DBT
    return {"BDSTAT": fraction, "DBSF": fraction.copy(), "DBT": failed}
