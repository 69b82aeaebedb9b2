"""Bonds under the usual output names: as a table of the present state, and as a history.

Names and components are those of :mod:`fxcrack.steps.records`: BDSTAT, DBSF, DBT, EFENRRTR, and
DBS11 to 13, CRSTS11 to 13, OPENBC11 to 13, ENRRT11 to 13.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fxcrack.errors import InputError, unknown_name
from fxcrack.output.atomic import replacing
from fxcrack.output.collective import together
from fxcrack.output.history import Row
from fxcrack.steps.records import bond_state

if TYPE_CHECKING:
    from fxcrack.scene import Scene
    from fxcrack.steps.growth import Growth

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def bond_rows(scene: Scene, growth: Growth, nodes: Ints, time: float) -> list[Row]:
    """One row per slave node with position and all the usual names; the same on every rank."""
    p = growth.p
    values = growth.evaluate(growth.tips(), scene.model.state, time)
    bonds = bond_state(growth, scene.ramps, values if scene.model.active[p] else None)
    rows = []
    for node in nodes:
        x, y, z = growth.front.surface.x[node]
        row: Row = {"interface": growth.title, "node": int(node)}
        row |= {"x": float(x), "y": float(y), "z": float(z)}
        for name, field in bonds.items():
            if field.ndim == 1:
                row[name] = float(field[node])
            else:
                row |= {f"{name}1{i + 1}": float(v) for i, v in enumerate(field[node])}
        rows.append(row)
    return rows


def failed(growth: Growth) -> Ints:
    """Slave nodes that have let go, in that order."""
    return np.array([record.node for record in growth.records], dtype=np.int64)


def bond_table(scene: Scene) -> str:
    """Every bond that has let go with the usual names, in the order of failure, as text.

    Raises:
        InputError: No step was run yet.
    """
    lines = []
    for growth in _growths(scene):
        rows = bond_rows(scene, growth, failed(growth), scene.time)
        lines.append(f"interface '{growth.title}': {len(rows)} bonds have let go")
        if rows:
            names = [name for name in rows[0] if name != "interface"]
            lines.append("  " + "  ".join(f"{name:>11}" for name in names))
            lines += ["  " + "  ".join(f"{row[n]:>11.5g}" for n in names) for row in rows]
    return "\n".join(lines) + "\n"


class BondHistory:
    """Observer that notes the usual names at chosen bonds at every event of a run.

    Args:
        scene: The scene.
        interface: Name of the interface.
        where: Which slave nodes: a function of positions of shape (3, n) that returns n booleans;
            by default those that have let go so far.

    Attributes:
        rows: time, event and the columns of :func:`bond_rows`, the same on every rank.

    Example:
        ``seen = fx.BondHistory(scene, "bond"); scene.run(step, observers=[seen])``
    """

    def __init__(
        self,
        scene: Scene,
        interface: str,
        where: Callable[[Array], npt.NDArray[np.bool_]] | None = None,
    ) -> None:
        titles = [debond.interface.title for debond in scene.debonds]
        if interface not in titles:
            unknown_name("debond of interface", interface, titles)
        self._scene = scene
        self._p = titles.index(interface)
        self._nodes: Ints | None = None
        if where is not None:
            x = scene.pairs[self._p].surface.x
            marks = np.asarray(where(np.ascontiguousarray(x.T)))
            if marks.shape != (len(x),):
                raise InputError(
                    f"BondHistory: where gives shape {marks.shape}; one boolean for each of the "
                    f"{len(x)} slave nodes of interface '{interface}' is needed"
                )
            self._nodes = np.flatnonzero(marks)
        self.rows: list[Row] = []

    def __call__(self, event: str, row: Row) -> None:
        """Note the bonds at an event."""
        growth = self._scene.growths[self._p]
        nodes = failed(growth) if self._nodes is None else self._nodes
        for bond in bond_rows(self._scene, growth, nodes, float(row["time"])):
            self.rows.append({"time": row["time"], "event": event, **bond})

    def to_csv(self, path: str | Path) -> None:
        """Write all rows as comma-separated values; collective, rank 0 writes."""
        write_rows(self._scene, path, self.rows)


def write_releases(scene: Scene, path: str | Path) -> None:
    """Write every bond that has let go as comma-separated values; collective, rank 0 writes.

    Columns: those of :func:`bond_rows`.

    Raises:
        InputError: No step was run yet.
        FxcrackError: The file could not be written.
    """
    growths = _growths(scene)
    rows = [row for g in growths for row in bond_rows(scene, g, failed(g), scene.time)]
    write_rows(scene, path, rows)


def write_rows(scene: Scene, path: str | Path, rows: list[Row]) -> None:
    """Write rows of the same columns; collective, rank 0 writes."""
    comm = scene.mesh.comm
    with together(comm, f"writing {path}"):
        if comm.rank == 0:
            with replacing(path) as temporary, temporary.open("w", newline="") as stream:
                writer = csv.DictWriter(stream, list(rows[0]) if rows else ["interface", "node"])
                writer.writeheader()
                writer.writerows(rows)


def _growths(scene: Scene) -> list[Growth]:
    if not hasattr(scene.model, "state"):
        raise InputError("the scene has no state yet; run a step before asking for its bonds")
    return scene.growths
