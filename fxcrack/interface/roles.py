"""Which side of an interface holds the jumps, and how its nodes follow the other side.

On meshes that do not match the choice decides how evenly bonds open. Each bonded node is one
condition on the other side: a fine or stiff slave puts more of them on a facet of the master than
this has freedom, so that some releases free nothing and others twice as much. In a pull-out test
(10 elements beside 7, and 7 beside 3) G of single nodes varies by

    surface-to-surface  coarser slave   3 % at most, softer or stiffer
                        finer slave     2 % if it is 10 times softer, 10 % if it is as stiff as
                                        the master, up to 100 % if it is stiffer
    node-to-surface     finer slave     1 % if it is much softer, up to 100 % if it is stiffer

so the jumps are those of the coarser side, and of the softer one where the ratio is 10 or more.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.arrays import Bools, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.continuum.materials import stiffness_of
from fxcrack.interface.projection import Projection
from fxcrack.interface.surface import FacetSurface, facet_nodes

PAIRINGS = ("node-to-surface", "surface-to-surface")
"""What ``Interface(pairing=...)`` may be."""
_STIFF = 10.0
"""Ratio of stiffness from which the softer side holds the jumps, whatever its mesh."""
_FINE = 1.05
"""Ratio of the lengths of facets from which one side counts as finer."""
_WARN = 3.0
"""Ratio of stiffness from which a slave that does not suit is warned of."""
_SAME = 1e-9
"""Ratios that differ from a limit by this part of it, by round-off, have reached it."""


class Role(Enum):
    """How slave and master are paired."""

    NODES = "node-to-surface"
    SURFACES = "surface-to-surface"
    EXCHANGED = "surface-to-surface, jumps of the master's nodes"


def stiffness_ratio(continuum: Continuum, slave: str | Face, master: str | Face) -> float:
    """Mean normal stiffness of the cells behind the slave over that of the master; collective."""
    found = []
    for side in (slave, master):
        is_face = isinstance(side, Face)
        name = side.group if isinstance(side, Face) else side
        entities = continuum.mesh.group(name, dim=continuum.mesh.tdim - (0 if is_face else 1))
        cells = entities.entities
        if not is_face:
            cells = facet_nodes(continuum, cells)[1]
        total = np.zeros(2)
        for material, own in zip(continuum.part_materials, continuum.part_cells, strict=True):
            count = int(np.isin(cells, own).sum())
            # of shells that of their plies; asked for on every rank, as it may raise an error
            solid = getattr(material, "laminate", material)
            stiffness = float(np.diag(stiffness_of(solid))[:3].mean())
            total += np.array([count, count * stiffness])
        total = continuum.comm.allreduce(total)
        found.append(float(total[1] / max(total[0], 1.0)))
    return found[0] / found[1] if found[1] > 0.0 else 1.0


def fineness_ratio(
    slave: FacetSurface, master: FacetSurface, foot: Projection, paired: Bools
) -> float:
    """Mean facet size of the master over that of the slave where they lie on each other.

    Args:
        slave: Slave surface.
        master: Master surface, of which the facets under slave nodes count.
        foot: Projections of the slave nodes.
        paired: Slave nodes that have a master point, shape (n_nodes,).
    """
    inside = paired[slave.facets].all(axis=1)
    under = np.zeros(len(master.facets), dtype=bool)
    under[foot.facet[paired]] = True
    return float(
        _mean_size(master, under if under.any() else None)
        / _mean_size(slave, inside if inside.any() else None)
    )


def _mean_size(surface: FacetSurface, chosen: Bools | None = None) -> float:
    corner = surface.x[surface.facets[:, : surface.n_corners]]
    if chosen is not None:
        corner = corner[chosen]
    radius = np.linalg.norm(corner - corner.mean(axis=1, keepdims=True), axis=2).mean(axis=1)
    return float(radius.mean())


def matching(slave: FacetSurface, master: FacetSurface, foot: Projection, paired: Bools) -> bool:
    """Whether the surfaces have the same nodes and facets where they lie on each other.

    Args:
        slave: Slave surface.
        master: Master surface.
        foot: Projections of the slave nodes.
        paired: Slave nodes that have a master point, shape (n_nodes,).
    """
    single = foot.weights.max(axis=1) == 1.0
    if np.any(paired & ~single):
        return False
    under = master.facets[foot.facet, foot.weights.argmax(axis=1)]
    inside = paired[slave.facets].all(axis=1)
    known, wanted = np.sort(master.facets, axis=1), np.sort(under[slave.facets[inside]], axis=1)
    _, number = np.unique(np.concatenate([known, wanted]), axis=0, return_inverse=True)
    number = number.ravel()
    return bool(np.isin(number[len(known) :], number[: len(known)]).all())


def _reaches(ratio: float, limit: float) -> bool:
    """Whether a ratio is a limit or more, whatever round-off of other units or numbers does."""
    return ratio >= limit * (1.0 - _SAME)


def choose_role(
    title: str,
    pairing: str | None,
    ratio: float,
    fine: float,
    *,
    may_exchange: bool,
) -> Role:
    """How a pair whose meshes do not match is paired; warns where its slave does not suit.

    Args:
        title: Name of the interface, for the warning.
        pairing: What the user asked for.
        ratio: Stiffness of slave over master.
        fine: Facet size of master over slave.
        may_exchange: Whether the jumps may be those of the master's nodes.
    """
    if pairing == "node-to-surface":
        if _reaches(ratio, _WARN):
            log.warn(
                "interface '%s': the slave is %.3g times as stiff as the master and their meshes "
                "do not match; forces of node-to-surface bonds, and G from them, then vary from "
                "node to node; exchange slave and master, or leave out pairing='node-to-surface'",
                title,
                ratio,
            )
        return Role.NODES
    finer = _reaches(fine, _FINE)
    if _reaches(ratio, _STIFF):
        suits = False
    elif _reaches(1.0 / ratio, _STIFF):
        suits = True
    else:
        coarser = _reaches(1.0 / fine, _FINE)
        suits = not finer and not (_reaches(ratio, _WARN) and not coarser)
    if pairing is None and may_exchange and not suits:
        log.info(
            "interface '%s': meshes do not match; jumps are those of the nodes of the master, "
            "which is the coarser or much softer side",
            title,
        )
        return Role.EXCHANGED
    if finer and not _reaches(1.0 / ratio, _WARN):
        log.warn(
            "interface '%s': the slave is %.3g times finer than the master and %.3g times as "
            "stiff; on meshes that do not match, G then varies from node to node (by 10 %% for "
            "equal bodies, much more for stiff slaves); exchange slave and master",
            title,
            fine,
            ratio,
        )
    return Role.SURFACES


def covered_whole(slave: FacetSurface, paired: Bools) -> bool:
    """Whether facets of the slave lie on the master either whole or not at all.

    Args:
        slave: Slave surface.
        paired: Slave nodes that have a master point, shape (n_nodes,).
    """
    touched = paired[slave.facets]
    inside = touched.all(axis=1)
    # facets beside those that lie on the master share some of its nodes with them
    border = touched.any(axis=1) & ~inside
    used = np.zeros(slave.n_nodes, dtype=bool)
    used[slave.facets[inside]] = True
    only = touched[border] & ~used[slave.facets[border]]
    return bool(inside.any() and not only.any())


def held_alike(
    continuum: Continuum,
    which: Ints,
    slave: FacetSurface,
    master: FacetSurface,
    foot: Projection,
    paired: Bools,
) -> bool:
    """Whether supports that hold slave nodes hold their masters as well; collective.

    Args:
        continuum: The bodies.
        which: Support of each owned dof, -1 where free, shape (n_local,).
        slave: Surface whose nodes are to hold the jumps.
        master: The other surface.
        foot: Projections of the slave nodes.
        paired: Slave nodes that have a master point, shape (n_nodes,).
    """
    layout = continuum.layout
    by_node = (which >= 0).reshape(-1, layout.n_unknowns)

    def held(dofs: Ints) -> Bools:
        out = np.zeros((len(dofs), layout.n_unknowns), dtype=bool)
        own = (dofs >= layout.first_node) & (dofs < layout.first_node + len(by_node))
        out[own] = by_node[dofs[own] - layout.first_node]
        continuum.comm.Allreduce(MPI.IN_PLACE, out, op=MPI.LOR)
        return out

    on_slave, on_master = held(slave.dofs), held(master.dofs)[master.facets[foot.facet]]
    shared = (on_master | (foot.weights == 0.0)[..., None]).all(axis=1)
    return bool(np.all(shared | ~on_slave | ~paired[:, None]))
