"""Prescribed displacement components: one column of the transformation each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError, InterfaceError, raise_on_all_ranks
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.couplings import Constraint, Coupling, Equation
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.continuum.generalised_plane_strain import SharedUnknown, shared_unknowns
from fxcrack.continuum.loads import Displacement
from fxcrack.continuum.node_supports import Clamp, Rotation, Support, Symmetry, rotation_values
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.interface.following import Following, collect_following
from fxcrack.interface.nodes import InterfaceNodes

AnySupport = Displacement | Support | Constraint


@dataclass(frozen=True)
class SupportColumn:
    """One prescribed component: displacement = amplitude times ``shape`` on some dofs.

    Attributes:
        title: Name in the history, e.g. "pin_top.y".
        support: The support it belongs to.
        moves: Whether any prescribed value differs from zero.
        scale: Prescribed displacement at amplitude 1 where it is the same on all dofs; the column
            then holds ones, its coordinate is a displacement and its conjugate the reaction.
            1 where it varies: the coordinate is the amplitude.
        largest: Largest prescribed displacement at amplitude 1 on any of its dofs, where known.
    """

    title: str
    support: AnySupport | SharedUnknown
    moves: bool
    scale: float
    largest: float = 0.0

    def coordinate(self, time: float) -> float:
        """Value of the column's coordinate at a time."""
        return self.scale * self.support.amplitude(time) if self.moves else 0.0


@dataclass(frozen=True)
class Supports:
    """Prescribed displacement components of a scene.

    Attributes:
        columns: One per component.
        which: Column number per owned dof, -1 where free, shape (n_local,).
        value: Entry of that column per owned dof, shape (n_local,).
        following: Dofs that follow others; ``None`` where there are no couplings and equations.
            The columns of prescribed motions of references are the last ones.
        n_motions: Number of these.
        constraints: The couplings and equations.
    """

    columns: tuple[SupportColumn, ...]
    which: Ints
    value: Array
    following: Following | None = None
    n_motions: int = 0
    constraints: tuple[Constraint, ...] = ()

    def at_nodes(self, nodes: InterfaceNodes) -> tuple[Ints, Array]:
        """Supports of the interface nodes' unknowns; collective.

        Args:
            nodes: The interface nodes.

        Returns:
            Column number, -1 where free, and entry of that column, each of shape
            (n_nodes, n_unknowns).
        """
        dofs = nodes.layout.dofs(nodes.local)
        return nodes.share(self.which[dofs]), nodes.share(self.value[dofs])


def _prescribed(
    continuum: Continuum, support: Displacement | Support, nodes: Ints
) -> list[tuple[str, Ints, Array]]:
    """Name, unknown of each node (-1 for none) and value there of what a support prescribes.

    Args:
        continuum: The bodies.
        support: The support.
        nodes: Nodes of its group that this rank owns, shape (n,).

    Raises:
        InputError: The support does not fit the bodies; collective.
    """
    gdim, n = continuum.gdim, len(nodes)
    x = continuum.positions()[nodes]
    if isinstance(support, Displacement):
        out = []
        for component, field in enumerate((support.x, support.y, support.z)):
            if field is None:
                continue
            if component >= gdim:
                raise InputError(
                    f"Displacement('{support.title}') prescribes {'xyz'[component]} in {gdim} "
                    "dimensions"
                )
            axis, value, problem = "xyz"[component], np.zeros(n), None
            try:
                if callable(field):
                    value = numbers_at(f"Displacement('{support.title}')", axis, field, x)
                else:
                    value = np.full(n, float(field))
            except InputError as error:  # on this rank, perhaps
                problem = str(error)
            raise_on_all_ranks(continuum.comm, problem)
            out.append((axis, np.full(n, component), value))
        return out
    names = ["xyz"[c] for c in range(gdim)]
    if isinstance(continuum, ShellBodies):
        names += ["wx", "wy", "wz"]
    if isinstance(support, Rotation):
        if not isinstance(continuum, ShellBodies):
            raise InputError(
                f"Rotation('{support.title}'): only shells have rotations; prescribe displacements "
                "that vary over the thickness"
            )
        found: list[tuple[str, Array, Array]] = []
        fault = None
        try:
            found = rotation_values(support, continuum.directors[nodes], x)
        except InputError as error:
            fault = str(error)
        raise_on_all_ranks(continuum.comm, fault)
        return [(name, np.where(c < 0, -1, gdim + c), value) for name, c, value in found]
    if isinstance(support, Symmetry):
        names = [name for name in names if name[-1] == support.axis]
        if not names:
            raise InputError(f"Symmetry('{support.title}'): there is no axis {support.axis}")
    assert isinstance(support, Clamp | Symmetry)
    number = {"x": 0, "y": 1, "z": 2, "wx": 3, "wy": 4, "wz": 5}
    return [(name, np.full(n, number[name]), np.zeros(n)) for name in names]


def collect_supports(continuum: Continuum, supports: Sequence[AnySupport]) -> Supports:
    """Number the prescribed components and place them on the dofs; collective.

    Raises:
        InputError: Two supports prescribe different values for one dof, a value is not finite, or
            couplings and equations contradict the supports or each other.
    """
    constraints = [s for s in supports if isinstance(s, Coupling | Equation)]
    plain = [s for s in supports if not isinstance(s, Coupling | Equation)]
    layout = continuum.layout
    which = np.full(layout.n_local, -1, dtype=np.int64)
    value = np.zeros(layout.n_local)
    columns: list[SupportColumn] = []
    problem = None
    x = continuum.positions()
    for support in plain:
        group = continuum.owned_nodes(support.where).astype(np.int64)
        owner = f"{type(support).__name__}('{support.title}')"
        for axis, unknown, wanted in _prescribed(continuum, support, group):
            nodes, values = group[unknown >= 0], wanted[unknown >= 0]
            dofs = layout.dof(nodes, unknown[unknown >= 0])
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                at = format_point(x[nodes[bad[0]]])
                problem = f"{owner}: {axis} is not a finite number ({values[bad[0]]} at {at})"
                values = np.where(np.isfinite(values), values, 0.0)
            taken = which[dofs] >= 0
            other = np.array([c.support.amplitude != support.amplitude for c in columns] + [False])
            differs = (value[dofs] != values) | (other[which[dofs]] & (values != 0.0))
            if np.any(taken & differs):
                first = int(np.argmax(taken & differs))
                problem = (
                    f"supports '{support.title}.{axis}' and '{columns[which[dofs[first]]].title}' "
                    f"prescribe different values or amplitudes at {format_point(x[nodes[first]])}; "
                    "let only one of them hold that node"
                )
            free = ~taken
            which[dofs[free]], value[dofs[free]] = len(columns), values[free]
            low = continuum.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
            high = continuum.comm.allreduce(float(values.max(initial=-np.inf)), op=MPI.MAX)
            if low > high:
                problem = (
                    f"{owner}: {axis} prescribes nothing, the director of all "
                    "nodes lies along that axis"
                )
            moves = low != 0.0 or high != 0.0
            scale = high if moves and low == high else 1.0
            largest = max(abs(low), abs(high))
            columns.append(SupportColumn(f"{support.title}.{axis}", support, moves, scale, largest))
    raise_on_all_ranks(continuum.comm, problem)
    for shared in shared_unknowns(continuum.model):
        if shared.prescribed is not None:
            dofs = layout.dof(np.arange(layout.n_owned), shared.unknown)
            which[dofs], value[dofs] = len(columns), shared.prescribed / shared.per_unknown
            moves = shared.prescribed != 0.0
            size = abs(shared.prescribed / shared.per_unknown)
            scale = shared.prescribed / shared.per_unknown if moves else 1.0
            columns.append(SupportColumn(shared.title, shared, moves, scale, size))
    _share_at_joints(layout, which, value, columns)
    for i, column in enumerate(columns):
        # a component that stays zero keeps a column of ones, which gives its reaction
        value[which == i] = 1.0 if not column.moves else value[which == i] / column.scale
    moves = np.array([column.moves for column in columns], dtype=bool)
    titles = [column.title for column in columns]
    following, motions = collect_following(continuum, constraints, which, value, moves, titles)
    for motion in motions:
        moved = motion.value != 0.0
        columns.append(
            SupportColumn(motion.title, motion.constraint, moved, motion.value if moved else 1.0)
        )
    return Supports(tuple(columns), which, value, following, len(motions), tuple(constraints))


def _share_at_joints(
    layout: DofLayout, which: Ints, value: Array, columns: Sequence[SupportColumn]
) -> None:
    """Prescribe the displacement of all nodes of a joint as that of one is, in place; collective.

    Raises:
        InterfaceError: Supports prescribe different displacements of them.
    """
    joints = layout.joints
    if not len(joints.nodes):
        return
    nodes = InterfaceNodes(layout, joints.nodes)
    dofs = layout.dof(nodes.local[:, None], np.arange(layout.gdim))
    at = nodes.find(joints.nodes)
    column, wanted = nodes.share(which[dofs])[at], nodes.share(value[dofs])[at]
    for rows in joints.groups():
        for c in range(layout.gdim):
            held = rows[column[rows, c] >= 0]
            if not len(held):
                continue
            first = held[0]
            one = columns[column[first, c]]
            for r in held[1:]:
                other = columns[column[r, c]]
                if wanted[r, c] != wanted[first, c] or (
                    wanted[r, c] != 0.0 and other.support.amplitude != one.support.amplitude
                ):
                    raise InterfaceError(
                        f"supports '{one.title}' and '{other.title}' prescribe different "
                        "displacements of nodes at which shells meet; let only one of them hold "
                        "the joint"
                    )
            free = np.setdiff1d(rows, held)
            column[free, c], wanted[free, c] = column[first, c], wanted[first, c]
    mine = layout.is_owned(joints.nodes)
    dofs = layout.dof(layout.to_local(joints.nodes[mine])[:, None], np.arange(layout.gdim))
    which[dofs], value[dofs] = column[mine], wanted[mine]
