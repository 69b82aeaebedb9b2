"""Pairing a slave surface with a master surface: weights, frames, gaps, bonded set.

    u_s = sum_m W_sm u_m + R_s delta_s,    delta = (opening, slip, tear)

n, the first column of R, points from master to slave. W are the shape functions of the master at
the foot point of the node (node-to-surface), or means over the facets around the node, which hold
whichever side is the slave (surface-to-surface, :mod:`fxcrack.interface.mortar`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError
from fxcrack.base.positions import as_marks, marks_at, numbers_at
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.definition import Interface, check_coefficients
from fxcrack.interface.frames import local_frames
from fxcrack.interface.hierarchy import corner_surface, is_hierarchical
from fxcrack.interface.mortar import surface_weights
from fxcrack.interface.pair import FACING, Pair
from fxcrack.interface.projection import project
from fxcrack.interface.rigid import RIGID, RigidSurface
from fxcrack.interface.rigid_pairing import check_symmetry, find_partners
from fxcrack.interface.roles import (
    Role,
    choose_role,
    covered_whole,
    fineness_ratio,
    held_alike,
    matching,
    stiffness_ratio,
)
from fxcrack.interface.surface import FacetSurface, gather_surface

_BORDER = 1e-6
"""Distance to the border of the bonded region, in facet lengths, up to which a node is on it."""


def friction_of(interface: Interface, surface: FacetSurface) -> Array | None:
    """Coefficients of friction at the slave nodes, shape (n_nodes,); ``None`` without friction.

    Faces whose coefficient is 0 everywhere have none.

    Raises:
        InterfaceError: A function returns other than one finite number >= 0 per node.
    """
    chosen, n = interface.friction, surface.n_nodes
    if chosen is None:
        return None
    if callable(chosen):
        where = f"interface '{interface.title}'"
        mu = numbers_at(where, "friction", chosen, surface.x, error=InterfaceError)
        check_coefficients(mu, where)
    else:
        mu = np.full(n, float(chosen))
    return mu if mu.any() else None


def bonded_nodes(interface: Interface, surface: FacetSurface, continuum: Continuum) -> Bools:
    """Initially bonded slave nodes, shape (n_nodes,).

    Raises:
        InterfaceError: The specification does not fit the surface.
    """
    chosen = interface.bonded
    where = f"interface '{interface.title}'"
    if chosen is None:
        return np.ones(surface.n_nodes, dtype=bool)
    if isinstance(chosen, str):
        owned = continuum.owned_nodes(chosen).astype(np.int32)
        index_map = continuum.space.dofmap.index_map
        mine = np.asarray(index_map.local_to_global(owned), dtype=np.int64)
        named = np.concatenate(continuum.comm.allgather(mine))
        outside = ~np.isin(mine, surface.dofs)
        places = continuum.comm.allgather(continuum.positions()[owned[outside]])
        stray = np.concatenate(places)
        if len(stray):
            found = (
                f"{where}: {len(stray)} nodes of bonded set '{chosen}' are not slave nodes, one of "
                f"them at {format_point(stray[0])}"
            )
            if interface.strict:
                raise InterfaceError(
                    f"{found}; take them out of the set, let the slave surface extend to them, or "
                    "leave out strict=True"
                )
            log.warn("%s; they are ignored", found)
        return np.asarray(np.isin(surface.dofs, named))
    if callable(chosen):
        return _within(where, chosen, surface)
    marks = np.asarray(chosen)
    if marks.shape != (surface.n_nodes,):
        raise InterfaceError(
            f"{where}: bonded gives shape {marks.shape}; one boolean for each of the "
            f"{surface.n_nodes} slave nodes is needed"
        )
    return as_marks(where, "bonded", marks, error=InterfaceError)


def _within(where: str, region: Callable[..., Any], surface: FacetSurface) -> Bools:
    """Slave nodes in a region of the user or on its border, shape (n_nodes,).

    A crack that begins at x = 30 has its tip in the node there, whether ``x[0] >= 30`` or
    ``x[0] > 30`` says so and whatever the last digit of the node's coordinate is. A node counts
    where a point within _BORDER facet lengths of it does, in a direction of the axes; none of these
    points leaves the box around the surface.
    """
    low, high = surface.x.min(axis=0), surface.x.max(axis=0)
    found = marks_at(where, "bonded", region, surface.x, error=InterfaceError)
    reach = _BORDER * surface.facet_size
    for axis in np.flatnonzero(high - low > reach):
        for side in (-1.0, 1.0):
            x = surface.x.copy()
            x[:, axis] += side * reach
            np.clip(x, low, high, out=x)
            found |= marks_at(where, "bonded", region, x, error=InterfaceError)
    return found


def grown_together(slave: FacetSurface, master: FacetSurface, where: str) -> Bools:
    """Slave nodes that are master nodes as well, shape (n_slave,).

    An interface that ends inside a body has such nodes along its border, where its two sides face
    each other as everywhere; they stay bonded and no crack passes them.

    Raises:
        InterfaceError: The surfaces share nodes but do not face each other there.
    """
    _, mine, others = np.intersect1d(slave.dofs, master.dofs, return_indices=True)
    facing = np.einsum("nc,nc->n", slave.normals[mine], master.normals[others]) < FACING
    if not np.all(facing) or len(mine) == slave.n_nodes:
        raise InterfaceError(
            f"{where}: surfaces '{slave.name}' and '{master.name}' share {len(mine)} nodes; the "
            "two sides need nodes of their own (split the mesh there, fxcrack.Split); only where "
            "an interface ends inside a body may its sides, face to face, share the nodes of "
            "that border"
        )
    grown = np.zeros(slave.n_nodes, dtype=bool)
    grown[mine] = True
    return grown


def make_pair(
    continuum: Continuum,
    interface: Interface,
    *,
    others: Sequence[Interface] = (),
    supported: Ints | None = None,
    by_nodes: bool = False,
    cracks: bool = False,
) -> Pair:
    """Pair slave and master surface; collective, the same result on every rank.

    Args:
        continuum: The bodies.
        interface: The interface.
        others: Other interfaces of these bodies; where they share nodes with this one, its sides
            keep their roles.
        supported: Support of each owned dof, -1 where free, shape (n_local,); where one holds the
            master and not the slave, they keep their roles as well.
        by_nodes: Whether node-to-surface is the default: where bodies may have lumped masses,
            which weights below 0 would make negative, and where faces slide and are paired anew,
            which gives and takes energy with means over facets.
        cracks: Whether the interface may come apart: second-order triangles then have hierarchical
            jump coordinates (:mod:`fxcrack.interface.hierarchy`).

    Raises:
        InterfaceError: A bonded slave node lies outside the master surface, the two surfaces
            share nodes other than those of a border inside the body, or the bonded set does not
            fit.
    """
    if isinstance(interface.master, RIGID):
        return _on_rigid(continuum, interface, interface.master, cracks=cracks)
    slave = gather_surface(continuum, interface.slave)
    master = gather_surface(continuum, interface.master)
    where = f"interface '{interface.title}'"
    grown = grown_together(slave, master, where)
    bonded = bonded_nodes(interface, slave, continuum) | grown
    foot = project(slave.x, master)
    tolerance = interface.tolerance
    if tolerance is None:
        tolerance = 0.1 * master.facet_size
    paired = (foot.distance <= tolerance) & ~grown
    lost = bonded & ~paired & ~grown
    if np.any(lost):
        i = int(np.argmax(np.where(lost, foot.distance, -1.0)))
        raise InterfaceError(
            f"{where}: {int(lost.sum())} bonded slave nodes lie outside the master surface "
            f"'{interface.master}', the farthest at {format_point(slave.x[i])} by "
            f"{foot.distance[i]:.3g} (search tolerance {tolerance:.3g}); let the master surface "
            "extend under them, take them out of the bonded set, or raise Interface(tolerance=...)"
        )
    pairing = interface.pairing or ("node-to-surface" if by_nodes else None)
    role = Role.SURFACES if pairing == "surface-to-surface" else Role.NODES
    if not grown.any() and not matching(slave, master, foot, paired):
        # both sides of a border inside the body share its nodes, and have the same mesh there
        back = project(master.x, slave)
        under = back.distance <= tolerance
        shared = _shares_nodes(continuum, (slave, master), others)
        alike = supported is None or held_alike(continuum, supported, master, slave, back, under)
        role = choose_role(
            interface.title,
            pairing,
            stiffness_ratio(continuum, interface.slave, interface.master),
            fineness_ratio(slave, master, foot, paired),
            may_exchange=(interface.bonded is None or callable(interface.bonded))
            and covered_whole(master, under)
            and alike
            and not shared,
        )
        if role is Role.EXCHANGED:
            slave, master, paired, grown = master, slave, under, np.zeros_like(under)
            bonded = under.copy()
            if interface.bonded is not None:
                bonded &= bonded_nodes(interface, slave, continuum)
            foot = back
    normals = -slave.normals
    nodes, weights, feet = master.facets[foot.facet], foot.weights, None
    if role is not Role.NODES:
        feet = master.dofs[nodes], weights
        means = surface_weights(slave, master, foot, tolerance)
        nodes, weights = means.masters, means.weights
    gap = np.zeros(slave.n_nodes)
    if interface.gap == "keep":
        below = np.einsum("nk,nkc->nc", weights, master.x[nodes])
        gap = np.einsum("ni,ni->n", slave.x - below, normals)
    pair = Pair(
        interface=interface,
        surface=slave,
        paired=paired,
        masters=master.dofs[nodes],
        weights=weights,
        frames=local_frames(normals, continuum.gdim),
        gap=gap,
        bonded=bonded,
        friction=friction_of(interface, slave),
        master_maps=master.maps_at(nodes),
        feet=feet,
        exchanged=role is Role.EXCHANGED,
    )
    return _with_partners(pair, grown, cracks=cracks)


def _with_partners(pair: Pair, grown: Bools, *, cracks: bool) -> Pair:
    """A pair whose surface has only facets with a partner, with hierarchical jumps if it cracks.

    Args:
        pair: The pair, its surface whole.
        grown: Slave nodes that are master nodes as well, shape (n_nodes,).
        cracks: As for :func:`make_pair`.
    """
    slave, bonded = pair.surface, pair.bonded
    inside: Bools = np.ones(1, dtype=bool)
    if bonded.any():
        inside = (pair.paired | grown)[slave.facets].all(axis=1)
    partly = not inside.all() and inside.any()
    surface = slave.with_facets(inside) if partly else slave
    if not (cracks and is_hierarchical(slave)):
        return replace(pair, surface=surface, whole=slave if partly else None)
    pair = replace(pair, surface=corner_surface(surface), whole=slave).by_corners()
    assert pair.hierarchy is not None
    return replace(pair, bonded=pair.hierarchy.bonded(bonded) | grown)


def _on_rigid(
    continuum: Continuum, interface: Interface, master: RigidSurface, *, cracks: bool
) -> Pair:
    """Pair a slave surface with a rigid one, which has no nodes; collective.

    Raises:
        InterfaceError: A bonded node does not lie on the surface, the body is on its other side,
            or the surface does not fit the model.
    """
    where = f"interface '{interface.title}'"
    if interface.symmetry:
        check_symmetry(where, master, continuum.model)
    slave = gather_surface(continuum, interface.slave)
    bonded = bonded_nodes(interface, slave, continuum)
    tolerance = interface.tolerance
    if tolerance is None:
        tolerance = 0.1 * slave.facet_size
    paired, normals, gap = find_partners(master, slave, bonded, tolerance, where, continuum)
    n, maps = slave.n_nodes, slave.point_maps
    pair = Pair(
        interface=interface,
        surface=slave,
        paired=paired,
        masters=np.zeros((n, 0), dtype=np.int64),
        weights=np.zeros((n, 0)),
        frames=local_frames(normals, continuum.gdim),
        gap=gap if interface.gap == "keep" else np.zeros(n),
        bonded=bonded,
        friction=friction_of(interface, slave),
        master_maps=None if maps is None else np.zeros((n, 0, *maps.shape[1:])),
        rigid=master,
    )
    return _with_partners(pair, np.zeros(n, dtype=bool), cracks=cracks)


def _shares_nodes(
    continuum: Continuum, sides: Sequence[FacetSurface], others: Sequence[Interface]
) -> bool:
    """Whether other interfaces have nodes of two surfaces; collective."""
    own = np.concatenate([side.dofs for side in sides])
    for other in others:
        for name in (other.slave, other.master):
            if isinstance(name, RIGID):
                continue
            if np.isin(gather_surface(continuum, name).dofs, own).any():
                return True
    return False


__all__ = ["Interface", "Pair", "local_frames", "make_pair"]
