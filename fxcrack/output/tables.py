"""Bonds under the usual output names: as a table of the present state, and as a history.

Names and components are those of :mod:`fxcrack.steps.bond_records`: BDSTAT, DBSF, DBT,
EFENRRTR, and DBS11 to 13, CRSTS11 to 13, OPENBC11 to 13, ENRRT11 to 13.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none
from fxcrack.history import Row
from fxcrack.steps.bond_records import bond_state

if TYPE_CHECKING:
    from fxcrack.scene import Scene
    from fxcrack.steps.crack import Crack


def bond_rows(scene: Scene, growth: Crack, nodes: Ints, time: float) -> list[Row]:
    """One row per slave node with position and all the usual names; the same on every rank."""
    p = growth.p
    values = growth.evaluate(growth.tips(), scene.solver.state, time)
    bonds = bond_state(growth, scene.ramps, values if scene.solver.active[p] else None)
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


def failed(growth: Crack) -> Ints:
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
        growth = self._scene.cracks[self._p]
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
    cracks = _growths(scene)
    rows = [row for g in cracks for row in bond_rows(scene, g, failed(g), scene.time)]
    write_rows(scene, path, rows)


def write_rows(scene: Scene, path: str | Path, rows: list[Row]) -> None:
    """Write rows of the same columns; collective, rank 0 writes."""
    comm = scene.mesh.comm
    with all_or_none(comm, f"writing {path}"):
        if comm.rank == 0:
            with replacing(path) as temporary, temporary.open("w", newline="") as stream:
                writer = csv.DictWriter(stream, list(rows[0]) if rows else ["interface", "node"])
                writer.writeheader()
                writer.writerows(rows)


def _growths(scene: Scene) -> list[Crack]:
    if not scene.solver.prepared:
        raise InputError("the scene has no state yet; run a step before asking for its bonds")
    return scene.cracks


if TYPE_CHECKING:
    from fxcrack.scene import Scene


def tip_table(scene: Scene) -> str:
    """Crack tip location and associated quantities, as text.

    Per interface and tip: crack number, initial tip, current tip, length grown between them along
    the slave surface, f and the quantities of the criterion.
    """
    lines = []
    for crack, g in enumerate(scene.cracks, start=1):
        interface = g.debond.interface
        lines.append(
            f"crack {crack}: slave '{interface.slave}', master '{interface.master}', "
            f"{type(g.criterion).__name__}, {g.n_released} nodes released, "
            f"open area {g.extent.area(g.tips()):.6g}"
        )
        values = g.evaluate(g.tips(), scene.solver.state, scene.time)
        origins = g.paths.origins(values.tips)
        names = list(values.report)
        head = ["current tip", "position", "initial tip", "growth", "f", *names]
        lines.append("  " + "  ".join(f"{h:>12}" for h in head))
        for i, node in enumerate(values.tips.node):
            first, growth = int(origins.nearest[i]), origins.grown[i]
            x = ", ".join(f"{c:.5g}" for c in g.front.surface.x[node, : scene.mesh.gdim])
            cells = [f"{int(node)}", f"({x})", f"{first}", f"{growth:.5g}", f"{values.f[i]:.5g}"]
            cells += [f"{values.report[name][i]:.5g}" for name in names]
            lines.append("  " + "  ".join(f"{c:>12}" for c in cells))
        if not len(values.tips):
            lines.append("  no tip is left")
    return "\n".join(lines) + "\n"


def write_tip_table(scene: Scene, path: str | Path) -> None:
    """Write :func:`tip_table`; collective."""
    text = tip_table(scene)
    with all_or_none(scene.mesh.comm, f"writing {path}"):
        if scene.mesh.comm.rank == 0:
            with replacing(path) as temporary:
                temporary.write_text(text)
