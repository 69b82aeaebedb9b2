"""Prescribed displacement components: one column of the transformation each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack import log
from fxcrack.continuum import Continuum
from fxcrack.errors import InputError, agree
from fxcrack.interface.pairing import Pair
from fxcrack.loads import Displacement
from fxcrack.mesh.raw import place

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


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
    """

    title: str
    support: Displacement
    moves: bool
    scale: float

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
    """

    columns: tuple[SupportColumn, ...]
    which: Ints
    value: Array


def collect_supports(continuum: Continuum, supports: list[Displacement]) -> Supports:
    """Number the prescribed components and place them on the dofs; collective.

    Raises:
        InputError: Two supports prescribe different values for one dof, or a value is not finite.
    """
    gdim = continuum.gdim
    which = np.full(continuum.n_local, -1, dtype=np.int64)
    value = np.zeros(continuum.n_local)
    columns: list[SupportColumn] = []
    problem = None
    x = continuum.positions()
    for support in supports:
        nodes = continuum.owned_nodes(support.where)
        for axis, field in zip("xyz", (support.x, support.y, support.z), strict=True):
            if field is None:
                continue
            component = "xyz".index(axis)
            if component >= gdim:
                raise InputError(
                    f"Displacement('{support.title}') prescribes {axis} in {gdim} dimensions"
                )
            dofs = gdim * nodes.astype(np.int64) + component
            values = np.broadcast_to(
                np.asarray(field(x[nodes].T) if callable(field) else field, dtype=float),
                (len(nodes),),
            )
            if not np.all(np.isfinite(values)):
                problem = f"Displacement('{support.title}'): {axis} is not a finite number"
            taken = which[dofs] >= 0
            other = np.array([c.support.amplitude != support.amplitude for c in columns] + [False])
            differs = (value[dofs] != values) | (other[which[dofs]] & (values != 0.0))
            if np.any(taken & differs):
                first = int(np.argmax(taken & differs))
                problem = (
                    f"supports '{support.title}.{axis}' and '{columns[which[dofs[first]]].title}' "
                    f"prescribe different values or amplitudes at {place(x[nodes[first]])}; "
                    "let only one of them hold that node"
                )
            free = ~taken
            which[dofs[free]], value[dofs[free]] = len(columns), values[free]
            low = continuum.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
            high = continuum.comm.allreduce(float(values.max(initial=-np.inf)), op=MPI.MAX)
            moves = low != 0.0 or high != 0.0
            scale = high if moves and low == high else 1.0
            columns.append(SupportColumn(f"{support.title}.{axis}", support, moves, scale))
    agree(continuum.comm, problem)
    for i, column in enumerate(columns):
        # a component that stays zero keeps a column of ones, which gives its reaction
        value[which == i] = 1.0 if not column.moves else value[which == i] / column.scale
    return Supports(tuple(columns), which, value)


def warn_of_held_bonds(pair: Pair, held: npt.NDArray[np.bool_]) -> None:
    """Warn where supports on both faces keep bonds from ever opening.

    Supports that only stop faces from sliding (planes of symmetry, axes) are the usual case and go
    without a word.

    Args:
        pair: Interface.
        held: Jump components that supports hold, shape (n_nodes, gdim).
    """
    stuck = np.flatnonzero(held[:, 0] & pair.bonded)
    if len(stuck):
        log.warn(
            "interface '%s': supports hold both faces at %d of its bonded nodes, one of them at "
            "%s; those bonds cannot open and show no force",
            pair.title,
            len(stuck),
            place(pair.surface.x[stuck[0]]),
        )
