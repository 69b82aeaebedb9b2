"""Fields on an interface: jumps, bond tractions, state and front, the same on every rank.

Jumps and bond forces are taken from the displacement field, so they are known on the whole
interface and not only among the retained ones:

    jump_s = u_s - sum_m W_sm u_m,        r = K u - sum_i lambda_i f_i,        t_s = -f_s / area_s

with f_s the bond or contact force on slave node s, its row of T^t r: the residual there, plus that
of the slaves it carries as a master.
"""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from fxcrack.base.arrays import Array
from fxcrack.criteria.evaluator import TipValues
from fxcrack.interface.hierarchy import links_in_chain
from fxcrack.interface.nodes import InterfaceNodes, point_displacements
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of
from fxcrack.steps.bond_records import bond_state

_ROUND_OFF = 1e-9
"""Forces below this fraction of the largest bond force count as zero."""


@dataclass(frozen=True)
class InterfaceFields:
    """What is known at the slave nodes of an interface, the same on every rank.

    Attributes:
        displacement: Displacement of the slave nodes, shape (n_nodes, 3), length.
        opening: Jump from master to slave, shape (n_nodes, 3), length.
        traction: Bond or contact force per tributary area, positive along the normal in tension,
            shape (n_nodes, 3), force/length^2.
        normal: Unit vectors from master to slave, shape (n_nodes, 3).
        state: 1 bonded, 0.5 being released (some bond force is left), 0 open, -1 no master beneath,
            shape (n_nodes,).
        front: 1 on front nodes, shape (n_nodes,).
        release_time: Time at which a node was released, 0 if it was open from the start, NaN while
            it is bonded, shape (n_nodes,).
        at_front: Values of the criterion at the front nodes, 0 elsewhere, each of shape (n_nodes,):
            f, and what is behind it, as GI, GII, GIII and their sum G (force/length).
        bonds: The bonds under the usual output names, see
            :func:`~fxcrack.steps.bond_records.bond_state`; empty where no criterion is given.
    """

    displacement: Array
    opening: Array
    traction: Array
    normal: Array
    state: Array
    front: npt.NDArray[np.int32]
    release_time: Array
    at_front: dict[str, Array]
    bonds: dict[str, Array]


def residual(analysis: Analysis, u: fem.Function) -> Array:
    """Forces of interfaces and supports on the bodies, K u - f; collective.

    Args:
        analysis: The analysis.
        u: Displacement, n_local owned dofs on this rank, length.

    Returns:
        Array of shape (n_local,), the owned dofs of this rank, force.
    """
    vector = analysis.solver.nodal_forces(u.x.petsc_vec)
    values = np.array(vector.array)
    vector.destroy()
    return values


def in_space(values: Array) -> Array:
    """Vectors with three components, shape (n, gdim) to (n, 3)."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def interface_fields(
    source: Analysis | HasAnalysis, u: fem.Function, time: float | None = None
) -> list[InterfaceFields]:
    """Fields on every interface of a scene, in the order of ``scene.pairs``; collective.

    Args:
        source: The scene or its analysis, after a step.
        u: Its displacement, from :func:`displacement_function`.
        time: Time of the present state; that of the scene by default.
    """
    analysis = analysis_of(source)
    continuum, pairs = analysis.continuum, analysis.pairs
    nodes, gdim = InterfaceNodes.of_pairs(continuum.layout, pairs), continuum.gdim
    motion = nodes.gather(u.x.array[: continuum.n_local])
    direct = nodes.gather(residual(analysis, u))
    slaves = [nodes.find(p.surface.dofs) for p in pairs]
    masters = [nodes.find(p.masters) for p in pairs]
    faces = [nodes.find(p.under[0]) for p in pairs]
    acting = [
        pair.paired & (front.bonded | analysis.retained_nodes(p))
        for p, (pair, front) in enumerate(zip(pairs, analysis.solver.fronts, strict=True))
    ]
    total = direct
    # a slave may carry other slaves: at most as long a chain
    for _ in range(links_in_chain(pair.hierarchy for pair in pairs) - 1):
        carried = np.zeros_like(direct)
        for pair, s, m, on in zip(pairs, slaves, masters, acting, strict=True):
            on_masters = pair.forces_on_masters(total[s, :gdim])[on]
            np.add.at(carried[:, : on_masters.shape[2]], m[on], on_masters)
        total = direct + carried
    return [
        _fields_of(
            analysis,
            p,
            point_displacements(motion[slaves[p]], pair.surface.point_maps, gdim),
            point_displacements(motion[faces[p]], pair.master_maps, gdim),
            np.where(acting[p][:, None], total[slaves[p], :gdim], 0.0),
            analysis.time if time is None else time,
        )
        for p, pair in enumerate(pairs)
    ]


def _fields_of(
    analysis: Analysis, p: int, slave: Array, masters: Array, force: Array, time: float
) -> InterfaceFields:
    """Fields on pair p from the displacements and forces at its nodes."""
    pair, solver = analysis.pairs[p], analysis.solver
    surface = pair.surface
    under = np.einsum("nk,nkc->nc", pair.under[1], masters)
    opening = np.where(pair.paired[:, None], slave - under, 0.0)
    # a component that a support holds carries the support's reaction, not a bond force
    local = np.einsum("nck,nc->nk", solver.frames[p], force)
    local[solver.held_by_supports[p]] = 0.0
    bond = np.einsum("nck,nk->nc", solver.frames[p], local)
    area = np.where(surface.areas > 0.0, surface.areas, np.inf)  # corners of second-order facets
    traction = -in_space(bond) / area[:, None]
    if pair.hierarchy is not None:
        traction = pair.hierarchy.spread(traction)
    bonded = solver.fronts[p].bonded
    given = np.abs(analysis.given_forces_at(p)) > _ROUND_OFF * np.abs(local).max(initial=0.0)
    state = np.where(bonded, 1.0, np.where(given.any(axis=1), 0.5, 0.0))
    state[~pair.paired] = -1.0
    front = np.zeros(surface.n_nodes, dtype=np.int32)
    when = np.where(bonded, np.nan, 0.0)
    at_front: dict[str, Array] = {}
    bonds: dict[str, Array] = {}
    for crack in analysis.cracks:
        if crack.p == p:
            tips = crack.tips()
            front[tips.node] = 1
            for node, moment in crack.released:
                when[node] = moment
            values = None
            if crack in analysis.active:
                values = crack.evaluate(tips, solver.state, time)
            bonds = bond_state(crack, analysis.ramps, values)
            if values is not None:
                at_front = _at_front(values, surface.n_nodes)
    return InterfaceFields(
        displacement=in_space(slave),
        opening=in_space(opening),
        traction=traction,
        normal=in_space(pair.frames[:, :, 0]),
        state=state,
        front=front,
        release_time=when,
        at_front=at_front,
        bonds=bonds,
    )


def _at_front(values: TipValues, n_nodes: int) -> dict[str, Array]:
    """Values at the tips as arrays over all slave nodes."""
    report = {"f": values.f, **values.report}
    modes = [values.report[mode] for mode in ("GI", "GII", "GIII") if mode in values.report]
    if modes:
        report["G"] = np.sum(modes, axis=0)
    out = {name: np.zeros(n_nodes) for name in report}
    for name, value in report.items():
        out[name][values.tips.node] = value
    return out
