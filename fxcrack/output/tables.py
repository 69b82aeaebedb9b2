"""Bonds under the usual output names: as a table of the present state, and as a history.

Names and components are those of :mod:`fxcrack.steps.bond_records`: BDSTAT, DBSF, DBT,
EFENRRTR, and DBS11 to 13, CRSTS11 to 13, OPENBC11 to 13, ENRRT11 to 13.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import counted, file_path, is_function, shown, text
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none
from fxcrack.base.positions import marks_at
from fxcrack.history import Row
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of
from fxcrack.steps.bond_records import bond_state
from fxcrack.steps.crack import Crack


def bond_rows(analysis: Analysis, crack: Crack, nodes: Ints, time: float) -> list[Row]:
    """One row per slave node with position and all the usual names; the same on every rank.

    Args:
        analysis: The analysis.
        crack: One of its cracks.
        nodes: Slave nodes of its interface, shape (n,).
        time: Time at which criteria are evaluated.
    """
    values = None
    if crack in analysis.active:
        values = crack.evaluate(crack.tips(), analysis.solver.state, time)
    bonds = bond_state(crack, analysis.ramps, values)
    rows = []
    for node in nodes:
        x, y, z = crack.front.surface.x[node]
        row: Row = {"interface": crack.title, "node": int(node)}
        row |= {"x": float(x), "y": float(y), "z": float(z)}
        for name, field in bonds.items():
            if field.ndim == 1:
                row[name] = float(field[node])
            else:
                row |= {f"{name}1{i + 1}": float(v) for i, v in enumerate(field[node])}
        rows.append(row)
    return rows


def failed(crack: Crack) -> Ints:
    """Released slave nodes in the order of their release, shape (n_released,)."""
    return np.array([record.node for record in crack.records], dtype=np.int64)


def bond_table(source: Analysis | HasAnalysis) -> str:
    """Every released bond with the usual names, in the order of failure, as text.

    Args:
        source: A scene or its analysis, after a step.

    Raises:
        InputError: No step was run yet.
    """
    analysis = analysis_of(source)
    analysis.check_started("its bonds")
    lines = []
    for crack in analysis.cracks:
        rows = bond_rows(analysis, crack, failed(crack), analysis.time)
        lines.append(f"interface '{crack.title}': {counted(len(rows), 'bond')} released")
        if rows:
            names = [name for name in rows[0] if name != "interface"]
            lines.append("  " + "  ".join(f"{name:>11}" for name in names))
            lines += ["  " + "  ".join(f"{row[n]:>11.5g}" for n in names) for row in rows]
    return "\n".join(lines) + "\n"


class BondHistory:
    """Observer that records the usual names at chosen bonds at every event of a run.

    Args:
        source: The scene or its analysis.
        interface: Name of the interface.
        where: Which slave nodes: a function of positions of shape (3, n) that returns n booleans;
            by default those released so far.

    Attributes:
        rows: time, event and the columns of :func:`bond_rows`, the same on every rank.

    Example:
        ``seen = fx.BondHistory(scene, "bond"); scene.run(step, observers=[seen])``
    """

    def __init__(
        self,
        source: Analysis | HasAnalysis,
        interface: str,
        where: Callable[[Array], npt.NDArray[np.bool_]] | None = None,
    ) -> None:
        self._analysis = analysis_of(source)
        text("BondHistory", "interface", interface)
        titles = [debond.interface.title for debond in self._analysis.debonds]
        if interface not in titles:
            unknown_name("debond of interface", interface, titles)
        self._p = titles.index(interface)
        self._nodes: Ints | None = None
        if where is not None:
            x = self._analysis.pairs[self._p].surface.x
            if not is_function(where):
                raise InputError(f"BondHistory: where = {shown(where)} is no function of position")
            owner = f"BondHistory of interface '{interface}'"
            self._nodes = np.flatnonzero(marks_at(owner, "where", where, x))
        self.rows: list[Row] = []

    def __call__(self, event: str, row: Row) -> None:
        """Record the bonds at an event."""
        crack = self._analysis.cracks[self._p]
        nodes = failed(crack) if self._nodes is None else self._nodes
        for bond in bond_rows(self._analysis, crack, nodes, float(row["time"])):
            self.rows.append({"time": row["time"], "event": event, **bond})

    def to_csv(self, path: str | Path) -> None:
        """Write all rows as comma-separated values; collective, rank 0 writes."""
        write_rows(self._analysis, path, self.rows)


def write_releases(source: Analysis | HasAnalysis, path: str | Path) -> None:
    """Write every released bond as comma-separated values; collective, rank 0 writes.

    Columns: those of :func:`bond_rows`.

    Raises:
        InputError: No step was run yet.
        FxcrackError: The file could not be written.
    """
    analysis = analysis_of(source)
    analysis.check_started("its bonds")
    time = analysis.time
    rows = [row for g in analysis.cracks for row in bond_rows(analysis, g, failed(g), time)]
    write_rows(analysis, path, rows)


def write_rows(analysis: Analysis, path: str | Path, rows: list[Row]) -> None:
    """Write rows of the same columns; collective, rank 0 writes."""
    comm = analysis.comm
    path = file_path("the table", "path", path)
    with all_or_none(comm, f"writing {path}"):
        if comm.rank == 0:
            with (
                replacing(path) as temporary,
                temporary.open("w", newline="", encoding="utf-8") as stream,
            ):
                writer = csv.DictWriter(stream, list(rows[0]) if rows else ["interface", "node"])
                writer.writeheader()
                writer.writerows(rows)


def tip_table(source: Analysis | HasAnalysis) -> str:
    """Crack tip location and associated quantities, as text.

    Per interface and tip: crack number, initial tip, current tip, length grown between them along
    the slave surface, f and the quantities of the criterion.
    """
    analysis = analysis_of(source)
    lines = []
    for number, g in enumerate(analysis.cracks, start=1):
        slave, master = analysis.pairs[g.p].sides
        lines.append(
            f"crack {number}: slave '{slave}', master '{master}', "
            f"{type(g.criterion).__name__}, {counted(g.n_released, 'node')} released, "
            f"open area {g.extent.area(g.tips()):.6g}"
        )
        values = g.evaluate(g.tips(), analysis.solver.state, analysis.time)
        origins = g.paths.origins(values.tips)
        names = list(values.report)
        head = ["current tip", "position", "initial tip", "growth", "f", *names]
        lines.append("  " + "  ".join(f"{h:>12}" for h in head))
        for i, node in enumerate(values.tips.node):
            first, growth = int(origins.nearest[i]), origins.grown[i]
            x = ", ".join(f"{c:.5g}" for c in g.front.surface.x[node, : analysis.mesh.gdim])
            cells = [f"{int(node)}", f"({x})", f"{first}", f"{growth:.5g}", f"{values.f[i]:.5g}"]
            cells += [f"{values.report[name][i]:.5g}" for name in names]
            lines.append("  " + "  ".join(f"{c:>12}" for c in cells))
        if not len(values.tips):
            lines.append("  no tip is left")
    return "\n".join(lines) + "\n"


def write_tip_table(source: Analysis | HasAnalysis, path: str | Path) -> None:
    """Write :func:`tip_table`; collective."""
    text, comm = tip_table(source), analysis_of(source).comm
    path = file_path("write_tip_table", "path", path)
    with all_or_none(comm, f"writing {path}"):
        if comm.rank == 0:
            with replacing(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
