"""What the user says of an interface: two surfaces, the bonded nodes, contact and friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    as_float,
    flag,
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
from fxcrack.continuum.face import Face
from fxcrack.interface.rigid import RIGID, RigidCylinder, RigidPlane, RigidSphere
from fxcrack.interface.roles import PAIRINGS

Bonded = str | Callable[[Array], Array] | Array | None


@dataclass(frozen=True, eq=False)
class Interface:
    """Two facing surfaces, partly bonded; the crack propagates between them.

    Args:
        slave: Facet group of the slave side, or the face of a shell (:class:`fxcrack.Face`).
        master: Facet group or face of the master side; must extend under every bonded slave node.
            Where the interface ends inside a body both sides share the nodes of that border, which
            stay bonded. Or a rigid surface that does not move, :class:`fxcrack.RigidPlane`,
            :class:`fxcrack.RigidCylinder` or :class:`fxcrack.RigidSphere`; it has no nodes, and a
            jump is the displacement of the slave node.
        bonded: The initially bonded slave nodes: the name of a group, a function of positions of
            shape (3, n) that returns n booleans (nodes on the border of its region are bonded,
            ``>`` and ``>=`` mean the same), an array of booleans per slave node (in the order of
            ``Pair.surface``), or ``None``: all of them, and no tip exists.
        contact: Open faces cannot pass through each other (unilateral).
        friction: Coulomb's coefficient of the faces in contact, stick and slip alike: a number, or
            a function of positions of shape (3, n) that returns n numbers. ``None``, or 0
            everywhere: no friction.
        normal_only: Bonds hold the opening only and let the faces slip.
        symmetry: The master is a plane of symmetry (:class:`fxcrack.RigidPlane`), and the scene
            models one half of the body. Bonds hold the opening only, as with ``normal_only``.
            Openings that criteria and tables of tips give are those of the whole crack, twice the
            displacement of the node, and energy release rates are those of the whole body, as are
            toughness, strength and critical opening; areas count once. All energies of the history,
            its loads and reactions, and the openings of written fields are those of the half that
            is modelled: a bond dissipates half the toughness times its area, so that the energies
            balance. Without it, rates and openings are those of a body on a rigid support: half as
            large.
        tolerance: Search tolerance, length: how far a slave node may lie from the master surface;
            a tenth of the master's facet size by default, of the slave's on a rigid surface.
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
            bodies also "arms": the compliance of the faces of the arms beside the motion of
            their reference surfaces (:mod:`fxcrack.continuum.face_compliance`), so that the root of
            a crack turns and slides as that of solids. ``None``: bonds are exact, which costs
            nothing; in ``Explicit`` a stiffness shortens the increment and lowers G.
        strict: Nodes of the bonded group that are no slave nodes are an error; they are warned of
            and ignored otherwise.
        name: What the history calls the interface; the slave's name by default.
    """

    slave: str | Face
    master: str | Face | RigidPlane | RigidCylinder | RigidSphere
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
    symmetry: bool = False

    def __post_init__(self) -> None:
        """Refuse contradictions that need no mesh."""
        for name, value in (("slave", self.slave), ("master", self.master)):
            rigid = name == "master" and isinstance(value, RIGID)
            if not isinstance(value, Face) and not rigid:
                text("Interface", name, value)
        text("Interface", "name", self.name, optional=True)
        if self.slave == self.master:
            raise InterfaceError(
                f"interface '{self.slave}' pairs a surface with itself; self-contact is not "
                "possible here: name two distinct facet groups (a surface inside one conforming "
                "mesh becomes two by read_mesh(path, split=[Split(...)]))"
            )
        where = f"interface '{self.title}'"
        for name in ("contact", "normal_only", "strict", "symmetry"):
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
        self._check_rigid(where)
        self._check_friction()
        self._check_stiffness(where)

    def _check_rigid(self, where: str) -> None:
        """Refuse what a rigid master, or a plane of symmetry, cannot have."""
        if self.symmetry:
            if not isinstance(self.master, RigidPlane):
                raise InterfaceError(
                    f"{where}: symmetry=True needs a plane of symmetry as its master, "
                    f"fxcrack.RigidPlane(point, normal), not {shown(self.master)}"
                )
            if self._rubs:
                raise InterfaceError(
                    f"{where}: friction is not possible on a plane of symmetry, where both halves "
                    "slide alike; leave out friction, or leave out symmetry=True if the plane is a "
                    "rigid support"
                )
            keep(self, normal_only=True)
        if not isinstance(self.master, RIGID):
            return
        if self.pairing == "surface-to-surface":
            raise InterfaceError(
                f"{where}: a rigid surface has no facets to average over; leave pairing out"
            )
        if self.stiffness is not None:
            raise InterfaceError(
                f"{where}: bonds with a stiffness are not available on a rigid surface; leave "
                "stiffness out"
            )

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
        if not is_function(self.friction):
            try:
                mu = number(where, "friction", self.friction)
            except InputError as error:
                raise InterfaceError(
                    f"{where}: friction = {shown(self.friction)}; give the coefficient, a number "
                    "such as 0.3, or a function of positions"
                ) from error
            check_coefficients(np.array([mu]), where)
        if self._rubs and not self.contact:
            raise InterfaceError(
                f"{where}: friction needs contact; add contact=True or leave friction out"
            )
        if self._rubs and self.normal_only:
            raise InterfaceError(
                f"{where}: friction is not possible with bonds in the normal direction only; leave "
                "out friction, or bond in all directions"
            )

    @property
    def _rubs(self) -> bool:
        """Whether faces may have friction: a coefficient of 0 is none."""
        return self.friction is not None and as_float(self.friction) != 0.0

    @property
    def is_rigid(self) -> bool:
        """Whether the master is a rigid surface."""
        return isinstance(self.master, RIGID)

    @property
    def mode_i_only(self) -> bool:
        """Whether criteria see the opening alone: the master is rigid, and the face slips on it.

        Bonds carry no shear there, and what the face slips is no jump between the faces of a crack.
        """
        return self.is_rigid and self.normal_only

    @property
    def opening_factor(self) -> float:
        """Opening of the whole crack over the jump of a node: 2 on a plane of symmetry."""
        return 2.0 if self.symmetry else 1.0

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or str(self.slave)


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
