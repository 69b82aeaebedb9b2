"""Pairing a slave surface with a master surface: weights, frames, gaps, bonded set.

    u_s = sum_m W_sm u_m + R_s delta_s,    delta = (opening, slip, tear)

n, the first column of R, points from master to slave. W are the shape functions of the master at
the foot point of the node (node-to-surface), or means over the facets around the node, which hold
whichever side is the slave (surface-to-surface, :mod:`fxcrack.interface.mortar`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import (
    flag,
    format_point,
    is_count,
    is_function,
    keep,
    list_of,
    number,
    one_of,
    positive,
    shown,
    text,
)
from fxcrack.base.errors import InputError, InterfaceError
from fxcrack.base.positions import as_marks, marks_at, numbers_at
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.interface.hierarchy import Hierarchy, corner_surface, is_hierarchical, linked
from fxcrack.interface.mortar import surface_weights
from fxcrack.interface.projection import project
from fxcrack.interface.roles import (
    PAIRINGS,
    Role,
    choose_role,
    covered_whole,
    fineness_ratio,
    held_alike,
    matching,
    stiffness_ratio,
)
from fxcrack.interface.surface import FacetSurface, gather_surface

_FACING = -0.5
"""Cosine between the outward normals of two surfaces that face each other, at most."""
Bonded = str | Callable[[Array], Array] | Array | None


@dataclass(frozen=True, eq=False)
class Interface:
    """Two facing surfaces, partly bonded; the crack propagates between them.

    Args:
        slave: Facet group of the slave side, or the face of a shell (:class:`fxcrack.Face`).
        master: Facet group or face of the master side; must extend under every bonded slave node.
            Where the interface ends inside a body both sides share the nodes of that border, which
            stay bonded.
        bonded: The initially bonded slave nodes: the name of a group, a function of positions of
            shape (3, n) that returns n booleans, an array of booleans per slave node (in the
            order of ``Pair.surface``), or ``None``: all of them, and no tip exists.
        contact: Open faces cannot pass through each other (unilateral).
        friction: Coulomb's coefficient of the faces in contact, stick and slip alike: a number, or
            a function of positions of shape (3, n) that returns n numbers. ``None``: no friction.
        normal_only: Bonds hold the opening only and let the faces slip.
        tolerance: Search tolerance, length: how far a slave node may lie from the master surface;
            a tenth of the master's facet size by default.
        pairing: How slave nodes follow the master: "node-to-surface", the point under the node, or
            "surface-to-surface", means over the facets around it. ``None``: node-to-surface where
            both sides have the same nodes and facets, in which case the two are equal, and
            surface-to-surface elsewhere; the nodes of the history are then those of the coarser or
            much softer side, slave or master, unless ``bonded`` names slave nodes. With ``Inertia``
            and for contact at finite strain node-to-surface is the default, and in ``Explicit`` the
            only one; so it is where no slave node has a master at the start. Node-to-surface bonds
            of meshes that do not match hold only if the slave is the finer and softer side.
        gap: "adjust" counts small initial gaps as zero, "keep" starts contact from them.
        stiffness: Of bonds, force/length^3: normal, along the growth direction and along the front.
            In ``Explicit`` also "auto": that of the cells beside them. Between shells of linear
            bodies also "arms": what the faces of the arms yield beside the motion of their
            reference surfaces (:mod:`fxcrack.continuum.face_compliance`), so that the root of a
            crack turns and slides as that of solids. ``None``: bonds are exact, which costs
            nothing; in ``Explicit`` a stiffness shortens the increment and lowers G.
        strict: Nodes of the bonded group that are no slave nodes are an error; they are warned of
            and ignored otherwise.
        name: What the history calls the interface; the slave's name by default.
    """

    slave: str | Face
    master: str | Face
    bonded: Bonded = None
    contact: bool = False
    friction: float | Callable[[Array], npt.ArrayLike] | None = None
    normal_only: bool = False
    tolerance: float | None = None
    pairing: str | None = None
    gap: str = "adjust"
    strict: bool = False
    stiffness: str | tuple[float, float, float] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        """Refuse contradictions that need no mesh."""
        for name, value in (("slave", self.slave), ("master", self.master)):
            if not isinstance(value, Face):
                text("Interface", name, value)
        text("Interface", "name", self.name, optional=True)
        if self.slave == self.master:
            raise InterfaceError(
                f"interface '{self.slave}' pairs a surface with itself; self-contact is not "
                "possible here: name two distinct facet groups (a surface inside one conforming "
                "mesh becomes two by read_mesh(path, split=[Split(...)]))"
            )
        where = f"interface '{self.title}'"
        for name in ("contact", "normal_only", "strict"):
            keep(self, **{name: flag(where, name, getattr(self, name))})
        check_bonded(where, self.bonded)
        if self.tolerance is not None and not (
            0.0 < number(where, "tolerance", self.tolerance) < np.inf
        ):
            raise InterfaceError(
                f"interface '{self.title}': tolerance = {self.tolerance} must be positive and "
                "finite; None takes a tenth of the facet size"
            )
        if self.pairing is not None:
            one_of(where, "pairing", self.pairing, PAIRINGS)
        if not isinstance(self.gap, str) or self.gap not in ("adjust", "keep"):
            raise InterfaceError(f"gap = {shown(self.gap)}: choose 'adjust' or 'keep'")
        self._check_friction()
        self._check_stiffness(where)

    def _check_stiffness(self, where: str) -> None:
        if isinstance(self.stiffness, str) and self.stiffness in ("auto", "arms"):
            return
        if self.stiffness is None:
            return
        given = list_of(self.stiffness)
        if given is None or len(given) != 3:
            raise InterfaceError(
                f"{where}: stiffness = {shown(self.stiffness)} must be 'auto', 'arms' or three "
                "numbers per area, normal, along the growth direction and along the front"
            )
        positive(where, **{f"stiffness[{i}]": k for i, k in enumerate(given)})
        keep(self, stiffness=tuple(float(k) for k in given))

    def _check_friction(self) -> None:
        if self.friction is None:
            return
        where = f"interface '{self.title}'"
        if not self.contact:
            raise InterfaceError(
                f"{where}: friction needs contact; add contact=True or leave friction out"
            )
        if self.normal_only:
            raise InterfaceError(
                f"{where}: friction is not possible with bonds in the normal direction only; leave "
                "out friction, or bond in all directions"
            )
        if not is_function(self.friction):
            try:
                mu = number(where, "friction", self.friction)
            except InputError as error:
                raise InterfaceError(
                    f"{where}: friction = {shown(self.friction)}; give the coefficient, a number "
                    "such as 0.3, or a function of positions"
                ) from error
            check_coefficients(np.array([mu]), where)

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or str(self.slave)


@dataclass(frozen=True)
class Pair:
    """An interface on a mesh, the same on every rank.

    Attributes:
        interface: What the user asked for.
        surface: Slave surface; its node numbers are the slave node numbers. Where it lies on the
            master in part only, its facets are those that do: what has no partner is neither crack
            nor front.
        paired: Slave nodes that have a master point, shape (n_nodes,); not the nodes of a border
            inside a body, which belong to both sides.
        masters: Global displacement nodes of the masters, shape (n_nodes, k).
        weights: Their weights, shape (n_nodes, k).
        frames: Columns n, t1, t2 (n, t in 2-D), shape (n_nodes, gdim, gdim).
        gap: Initial normal gap, shape (n_nodes,), length.
        bonded: Initially bonded nodes, shape (n_nodes,).
        friction: Coefficient of friction per slave node, shape (n_nodes,); ``None`` without.
        master_maps: Displacement of a master's point per unknown of its node, shape
            (n_nodes, k, gdim, n_unknowns); ``None`` where the unknowns are the displacement
            (:mod:`fxcrack.continuum.dof_layout`).
        feet: Masters of the point under each node, and its weights on them, each of shape
            (n_nodes, n_facet_nodes), where ``weights`` are means over facets; ``None`` where
            they are those of this point.
        exchanged: Whether the nodes are those of the side that the interface calls the master
            (:mod:`fxcrack.interface.roles`).
        whole: Slave surface with all its facets where ``surface`` has not; ``None`` where it has.
        hierarchy: Midside nodes whose jumps are measured from those of their corners
            (:mod:`fxcrack.interface.hierarchy`). ``surface`` consists of first-order triangles
            then, and masters and weights of these nodes hold their corners. ``None`` where each
            node has its own jump.
    """

    interface: Interface
    surface: FacetSurface
    paired: Bools
    masters: Ints
    weights: Array
    frames: Array
    gap: Array
    bonded: Bools
    friction: Array | None = None
    master_maps: Array | None = None
    feet: tuple[Ints, Array] | None = None
    exchanged: bool = False
    whole: FacetSurface | None = None
    hierarchy: Hierarchy | None = None

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.interface.title

    @property
    def sides(self) -> tuple[str | Face, str | Face]:
        """The side whose nodes hold the jumps, and the other one."""
        slave, master = self.interface.slave, self.interface.master
        return (master, slave) if self.exchanged else (slave, master)

    @property
    def whole_surface(self) -> FacetSurface:
        """Slave surface with all its facets."""
        return self.whole or self.surface

    @property
    def under(self) -> tuple[Ints, Array]:
        """Masters of the whole jump of each node and their weights, each (n_nodes, k)."""
        if self.hierarchy is None:
            return self.masters, self.weights
        return self.hierarchy.masters, self.hierarchy.weights

    @property
    def can_touch(self) -> Bools:
        """Slave nodes whose normal jump contact bounds, shape (n_nodes,)."""
        if self.hierarchy is None:
            return self.paired
        out = self.paired.copy()
        out[self.hierarchy.midsides] = False
        return out

    def opened_with(self, bonded: Bools, nodes: Ints) -> Ints:
        """Some nodes and those that come free with them, sorted, shape (k,).

        Args:
            bonded: Nodes bonded so far, shape (n_nodes,).
            nodes: Nodes that are released, shape (m,).
        """
        if self.hierarchy is None:
            return nodes
        return np.union1d(nodes, self.hierarchy.opened_by(bonded, nodes))

    def by_nodes(self) -> Pair:
        """The same pair with a jump of its own at every node, on the same facets."""
        if self.hierarchy is None:
            return self
        masters, weights = self.under
        return replace(self, masters=masters, weights=weights, hierarchy=None)

    def by_corners(self) -> Pair:
        """The pair with jumps of midside nodes measured from those of their corners."""
        grown = self.bonded & ~self.paired
        hierarchy, masters, weights = linked(
            self.whole_surface, self.paired, grown, self.masters, self.weights
        )
        return replace(self, masters=masters, weights=weights, hierarchy=hierarchy)

    @property
    def surface_to_surface(self) -> bool:
        """Whether weights are means over facets."""
        return self.feet is not None

    def masters_under(self, node: int) -> Ints:
        """Global nodes whose shape functions do not vanish at the point under a slave node."""
        masters, weights = self.feet or self.under
        return np.asarray(masters[node][weights[node] != 0.0])

    def forces_on_masters(self, forces: Array) -> Array:
        """Forces on the masters' unknowns that do the work of given forces on the slave side.

        Args:
            forces: On the slave nodes' displacements, shape (n_nodes, gdim), force.

        Returns:
            W P_m^t f of each master, shape (n_nodes, k, n_unknowns); force in the components of the
            displacement.
        """
        each = self.weights[:, :, None] * forces[:, None, :]
        if self.master_maps is None:
            return each
        return np.asarray(np.einsum("nkc,nkcj->nkj", each, self.master_maps))


def check_bonded(where: str, bonded: object) -> None:
    """Refuse a bonded set that no surface could make sense of.

    Args:
        where: Beginning of the message.
        bonded: What the user gave.

    Raises:
        InterfaceError: It is neither a name, a function, booleans nor None.
    """
    if bonded is None or (isinstance(bonded, str) and bonded) or is_function(bonded):
        return
    entries = list_of(bonded) or []
    good = all(isinstance(e, bool | np.bool_) or (is_count(e) and e in (0, 1)) for e in entries)
    if not entries or not good:
        raise InterfaceError(
            f"{where}: bonded must be the name of a group, a function of position, or one boolean "
            f"for each slave node (no node numbers and no other numbers), but it is a "
            f"{type(bonded).__name__}"
            + (f" that begins with {shown(entries[0])}" if entries else "")
        )


def check_coefficients(mu: Array, where: str) -> None:
    """Refuse coefficients of friction that are negative or no numbers.

    Args:
        mu: Coefficients, shape (n,).
        where: Beginning of the message.

    Raises:
        InterfaceError: One of them is.
    """
    bad = ~(np.isfinite(mu) & (mu >= 0.0))
    if np.any(bad):
        raise InterfaceError(
            f"{where}: a coefficient of friction is {mu[bad][0]:g}; it must be a finite number, 0 "
            "or larger"
        )


def friction_of(interface: Interface, surface: FacetSurface) -> Array | None:
    """Coefficients of friction at the slave nodes, shape (n_nodes,); ``None`` without friction.

    Raises:
        InterfaceError: A function returns other than one finite number >= 0 per node.
    """
    chosen, n = interface.friction, surface.n_nodes
    if chosen is None:
        return None
    if not callable(chosen):
        return np.full(n, float(chosen))
    where = f"interface '{interface.title}'"
    mu = numbers_at(where, "friction", chosen, surface.x, error=InterfaceError)
    check_coefficients(mu, where)
    return mu


def local_frames(normals: Array, gdim: int) -> Array:
    """Orthonormal frames whose first column is the normal.

    Args:
        normals: Unit normals, shape (n, 3).
        gdim: 2 or 3.

    Returns:
        Shape (n, gdim, gdim); in 3-D the first tangent is the global axis most nearly in the
        tangent plane, projected.
    """
    if gdim == 2:
        n = normals[:, :2]
        return np.stack([n, np.stack([-n[:, 1], n[:, 0]], axis=1)], axis=2)
    axis = np.argmin(np.abs(normals) - 1e-6 * np.array([2.0, 1.0, 0.0]), axis=1)
    reference = np.eye(3)[axis]
    t1 = reference - np.einsum("ni,ni->n", reference, normals)[:, None] * normals
    t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
    return np.stack([normals, t1, np.cross(normals, t1)], axis=2)


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
        return marks_at(where, "bonded", chosen, surface.x, error=InterfaceError)
    marks = np.asarray(chosen)
    if marks.shape != (surface.n_nodes,):
        raise InterfaceError(
            f"{where}: bonded gives shape {marks.shape}; one boolean for each of the "
            f"{surface.n_nodes} slave nodes is needed"
        )
    return as_marks(where, "bonded", marks, error=InterfaceError)


def grown_together(slave: FacetSurface, master: FacetSurface, where: str) -> Bools:
    """Slave nodes that are master nodes as well, shape (n_slave,).

    An interface that ends inside a body has such nodes along its border, where its two sides face
    each other as everywhere; they stay bonded and no crack passes them.

    Raises:
        InterfaceError: The surfaces share nodes but do not face each other there.
    """
    _, mine, others = np.intersect1d(slave.dofs, master.dofs, return_indices=True)
    facing = np.einsum("nc,nc->n", slave.normals[mine], master.normals[others]) < _FACING
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
    inside = (paired | grown)[slave.facets].all(axis=1) if bonded.any() else np.ones(1, dtype=bool)
    partly = not inside.all() and inside.any()
    surface = slave.with_facets(inside) if partly else slave
    by_corners = cracks and is_hierarchical(slave)
    pair = Pair(
        interface=interface,
        surface=corner_surface(surface) if by_corners else surface,
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
        whole=slave if partly or by_corners else None,
    )
    if not by_corners:
        return pair
    pair = pair.by_corners()
    assert pair.hierarchy is not None
    return replace(pair, bonded=pair.hierarchy.bonded(bonded) | grown)


def _shares_nodes(
    continuum: Continuum, sides: Sequence[FacetSurface], others: Sequence[Interface]
) -> bool:
    """Whether other interfaces have nodes of two surfaces; collective."""
    own = np.concatenate([side.dofs for side in sides])
    for other in others:
        for name in (other.slave, other.master):
            if np.isin(gather_surface(continuum, name).dofs, own).any():
                return True
    return False


__all__ = ["Bonded", "InputError", "Interface", "Pair", "local_frames", "make_pair"]
