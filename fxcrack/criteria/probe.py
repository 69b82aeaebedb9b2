"""What a criterion may ask of a state of one interface, and forces and openings at the tips.

A :class:`FrontProbe` answers for one interface on one solver; criteria see nothing else of it.
Vectors are global, with three components also in 2-D (the third is zero there). Forces are those of
the full thickness or ring.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.criteria.crack_closure import opens
from fxcrack.interface.front import Front
from fxcrack.interface.front_cells import FrontCells
from fxcrack.interface.pair import Pair
from fxcrack.interface.tips import Tips

State = Any
"""A state of the solver, e.g. an equilibrium; criteria pass it to the probe and read nothing."""


class CellsAround(Protocol):
    """The cells of the bodies, of which those near some positions can be had on every rank."""

    def sizes(self, nodes: list[Ints], x: Array, along: Array) -> Array:
        """How far the cells at some nodes reach from a position; collective.

        Args:
            nodes: Global displacement nodes, per position those that lie there.
            x: Positions, shape (n, gdim) [length].
            along: Unit vectors of the front, along which nothing is measured, shape (n, gdim).

        Returns:
            Shape (n,) [length].
        """
        ...

    def near(self, x: Array, radius: Array) -> FrontCells:
        """Cells that reach into spheres around some positions, the same on every rank; collective.

        Args:
            x: Positions, shape (n, gdim) [length].
            radius: Radii, shape (n,) [length].
        """
        ...

    def temperature_table(self, points: Array) -> Array:
        """Values of the temperature's element at reference points, shape (n_points, n_values)."""
        ...


class Bodies(Protocol):
    """The bodies beside an interface, as integrals over them see them.

    Attributes:
        continuum: Their mesh, materials and model.
        loads: Force patterns, without those of a temperature.
        finite: Whether their strain is finite.
        uncovered: What an integral for elastic bodies in equilibrium does not cover, in words;
            empty where there is nothing.
    """

    continuum: Continuum
    loads: list[Any]
    finite: bool
    uncovered: str

    def cells_around(self, groups: list[str | None]) -> CellsAround:
        """The cells; collective.

        Args:
            groups: Cell groups whose cells are marked; ``None`` stands for the whole mesh.
        """
        ...

    def displacements(self, nodes: Ints, state: State) -> Array:
        """Displacements of global nodes, the same on all ranks; collective.

        Args:
            nodes: Global displacement nodes, sorted, shape (n,).
            state: State of the solver.

        Returns:
            Shape (n, gdim) [length].
        """
        ...

    def changes(self, nodes: Ints, before: State, after: State) -> Array:
        """Change of displacements between two states of the same loads; collective.

        Of bodies that are not linear by their tangent.

        Args:
            nodes: Global displacement nodes, sorted, shape (n,).
            before: State of the solver.
            after: Another one, from :meth:`FrontProbe.opened`.

        Returns:
            Shape (n, gdim) [length].
        """
        ...

    def held(self, nodes: Ints) -> Bools:
        """Which components supports prescribe at global nodes, the same on all ranks; collective.

        Args:
            nodes: Global displacement nodes, sorted, shape (n,).

        Returns:
            Shape (n, gdim).
        """
        ...

    def load_factors(self, state: State) -> Array:
        """Factors of the force patterns, shape (n_loads,)."""
        ...

    def temperature_factors(self, state: State) -> Array:
        """Factors of the temperature patterns, shape (n_patterns,)."""
        ...


class FrontProbe(Protocol):
    """One interface of a solver, as criteria see it; every solver provides its own.

    ``nodes`` are slave nodes, numbers in the slave surface, of any shape (...).
    """

    @property
    def pair(self) -> Pair:
        """The interface: title, slave surface with positions and areas, frames, gaps [length]."""
        ...

    @property
    def front(self) -> Front:
        """Which nodes are bonded, tips, and the slave surface where it is now."""
        ...

    @property
    def gdim(self) -> int:
        """Number of components of a displacement, 2 or 3."""
        ...

    @property
    def bodies(self) -> Bodies:
        """The bodies; one back-substitution per state may be the price of what they answer."""
        ...

    def bond_forces(self, nodes: Ints, state: State) -> Array:
        """Forces that the bonds hold the slave nodes with, tension positive.

        Returns:
            Global vectors, shape (..., 3) [force]; zero where nothing is bonded.
        """
        ...

    def round_off(self, nodes: Ints, state: State) -> Array:
        """How large bond forces may be by round-off alone.

        Returns:
            Largest of the components, shape (...) [force].
        """
        ...

    def jumps(self, nodes: Ints, state: State) -> Array:
        """Displacement of slave nodes less that of the master surface at their place.

        On a plane of symmetry that of both halves, twice the displacement of the node.

        Returns:
            Global vectors, shape (..., 3) [length]; an opening is positive along the normal, which
            points from master to slave.
        """
        ...

    @property
    def has_face_loads(self) -> bool:
        """Whether loads act on the crack faces anywhere."""
        ...

    def face_loads(self, nodes: Ints, state: State) -> Array:
        """Loads on the crack faces at slave nodes, as they act on the slave side.

        Returns:
            Global vectors, shape (..., 3) [force].
        """
        ...

    def released_jumps(self, nodes: Ints, force: Array, normal: Array | None = None) -> Array:
        """Jumps that releasing some nodes would open, everything else as it is in the last state.

        Args:
            nodes: Bonded slave nodes, shape (k,).
            force: Their bond forces, global vectors, tension positive, shape (k, 3) [force].
            normal: Direction in which nothing moves, shape (3,); None: all components are released.

        Returns:
            Global vectors, shape (k, 3) [length].
        """
        ...

    def opened(self, nodes: Ints, closed: Bools, force: Array, state: State) -> State:
        """The state that releasing bonded nodes would lead to, everything else as it is.

        Loads and contact are those of the given state. A state near the last one, of whose bodies
        only the displacements are asked for.

        Args:
            nodes: Bonded slave nodes, shape (k,).
            closed: Whether their normal jump stays zero, shape (k,).
            force: Forces that their bonds hold, global vectors, tension positive, shape (k, 3)
                [force].
            state: State of the solver.
        """
        ...

    def mean_position(self, group: str) -> Array:
        """Mean position of the nodes of a group in the undeformed body, shape (3,); collective.

        Raises:
            InputError: The mesh has no such group, or it holds no node.
        """
        ...

    def follow(self, where: str | int) -> int:
        """Follow the mean displacement of a group, or that of a slave node; before the first step.

        Returns:
            Its row in :meth:`motion`.
        """
        ...

    def motion(self, state: State) -> Array:
        """Displacements that are followed, shape (n_followed, gdim) [length]."""
        ...


def bond_forces(probe: FrontProbe, tips: Tips, state: State) -> Array:
    """Bond forces at the force nodes of tips in the tip frames, tension positive.

    Loads on the crack faces are carried on to the faces that would open.

    Args:
        probe: The interface.
        tips: Front nodes.
        state: State of the solver.

    Returns:
        Components (normal, growth direction, front tangent), shape (n, k, 3) [force].
    """
    vectors = probe.bond_forces(tips.force_nodes, state)
    if probe.has_face_loads:
        vectors = vectors + _loads_to_come(probe, tips, state)
    out = np.einsum("nci,nkc->nki", tips.frame, vectors)
    if tips.force_nodes.shape[1] > 1:
        # at the end of a surface there is no midside node ahead
        out[tips.force_nodes[:, 0] == tips.force_nodes[:, 1], 1] = 0.0
    return np.asarray(out)


def load_density(probe: FrontProbe, tips: Tips, state: State) -> Array:
    """Load per area on the faces behind tips, as it acts on the slave side, shape (n_tips, 3)."""
    areas = probe.pair.surface.areas
    wake = probe.face_loads(tips.wake_nodes, state).sum(axis=(1, 2))
    return np.asarray(wake / areas[tips.wake_nodes].sum(axis=(1, 2))[:, None])


def _loads_to_come(probe: FrontProbe, tips: Tips, state: State) -> Array:
    """Load on the faces the crack is about to open, if that of the wake continues there.

    A pressure p on the faces leaves the bond forces short by p times the part of the tip's
    tributary area that is still bonded (as superposing the uniform stress -p shows); without
    this the error of G falls with the square root of the element size only.

    Returns:
        Global vectors per force node, shape (n, k, 3).
    """
    areas = probe.pair.surface.areas
    density = load_density(probe, tips, state)
    whole = areas[tips.force_nodes][..., None] * density[:, None]
    to_come = whole - probe.face_loads(tips.force_nodes, state)
    to_come[~np.any(density, axis=1)] = 0.0
    return np.asarray(to_come)


def openings(probe: FrontProbe, tips: Tips, state: State) -> Array:
    """Openings behind tips in the tip frames.

    Args:
        probe: The interface.
        tips: Front nodes.
        state: State of the solver.

    Returns:
        Components (opening, slip, tear), shape (n, k, 3) [length]; k = 1 the wake node, k = 2
        (second order) the wake corner and the wake midside.
    """
    jump = probe.jumps(tips.wake_nodes, state)
    jump = np.einsum("nkm,nkmc->nkc", tips.wake_weights, jump)
    return np.asarray(np.einsum("nci,nkc->nki", tips.frame, jump))


def further_openings(probe: FrontProbe, tips: Tips, rows: Ints, state: State) -> Array:
    """Openings at the second corner points behind some tips, in the tip frames.

    Args:
        probe: The interface.
        tips: Front nodes.
        rows: Which of them, shape (m,).
        state: State of the solver.

    Returns:
        Components (opening, slip, tear), shape (m, 3) [length].
    """
    jump = probe.jumps(tips.further_nodes[rows], state)
    jump = np.einsum("nm,nmc->nc", tips.further_weights[rows], jump)
    return np.asarray(np.einsum("nci,nc->ni", tips.frame[rows], jump))


def closure_units(
    probe: FrontProbe, tips: Tips, force: Array, state: State, width: int
) -> tuple[Array, Array]:
    """Forces and jumps of the units of tips whose jumps are hierarchical, in the tip frames.

    A unit is the corner and the midside nodes that come free with it alone
    (:mod:`fxcrack.interface.hierarchy`).

    Args:
        probe: The interface.
        tips: Front nodes.
        force: Bond forces of the corners in the tip frames, shape (n, 1, 3) [force].
        state: State of the solver.
        width: Rows of the result, at least those of the largest unit.

    Returns:
        Bond forces and jumps after release of each unit alone, the corner first and zero rows last,
        each of shape (n, width, 3) [force, length].
    """
    forces, jumps = np.zeros((len(tips), width, 3)), np.zeros((len(tips), width, 3))
    pair, bonded = probe.pair, probe.front.bonded
    assert pair.hierarchy is not None
    for i, node in enumerate(tips.node):
        frame = tips.frame[i]
        midsides = pair.hierarchy.opened_by(bonded, np.array([node]))
        nodes, k = np.append(node, midsides), 1 + len(midsides)
        forces[i, 0] = force[i, 0]
        forces[i, 1:k] = probe.bond_forces(midsides, state) @ frame
        pulls = forces[i, :k] @ frame.T
        jump = probe.released_jumps(nodes, pulls) @ frame
        if not opens(forces[None, i, :1, 0], jump[None, :1, 0])[0]:
            jump = probe.released_jumps(nodes, pulls, frame[:, 0]) @ frame
        jumps[i, :k] = jump
    return forces, jumps


def closure_jumps(probe: FrontProbe, tips: Tips, force: Array) -> Array:
    """Jumps that releasing the force nodes of each tip alone would open, in the tip frames.

    Args:
        probe: The interface.
        tips: Front nodes.
        force: Their bond forces in the tip frames, shape (n, k, 3) [force].

    Returns:
        Shape (n, k, 3) [length].
    """
    out = np.zeros_like(force)
    for i in range(len(tips)):
        nodes = np.unique(tips.force_nodes[i])
        order = np.searchsorted(nodes, tips.force_nodes[i, : len(nodes)])
        frame, pulls = tips.frame[i], np.zeros((len(nodes), 3))
        pulls[order] = force[i, : len(nodes)] @ frame.T
        jump = probe.released_jumps(nodes, pulls)[order] @ frame
        if not opens(force[None, i, : len(nodes), 0], jump[None, :, 0])[0]:
            # pressed together: it stays closed, shear alone is released
            jump = probe.released_jumps(nodes, pulls, frame[:, 0])[order] @ frame
        out[i, : len(nodes)] = jump
    return out
