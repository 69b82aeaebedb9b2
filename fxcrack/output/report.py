"""Text tables: crack tips and their quantities, and every bond that has let go."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

from fxcrack.output.atomic import replacing
from fxcrack.output.collective import together

if TYPE_CHECKING:
    from fxcrack.scene import Scene
    from fxcrack.steps.growth import Growth


def tip_table(scene: Scene) -> str:
    """Crack tip location and associated quantities, as text.

    Per interface and tip: crack number, initial tip, current tip, cumulative growth, f and the
    quantities of the criterion.
    """
    lines = []
    for crack, g in enumerate(scene.growths, start=1):
        interface = g.debond.interface
        lines.append(
            f"crack {crack}: slave '{interface.slave}', master '{interface.master}', "
            f"{type(g.criterion).__name__}, {g.n_released} nodes released, "
            f"open area {g.extent.area(g.tips()):.6g}"
        )
        values = g.evaluate(g.tips(), scene.model.state, scene.time)
        names = list(values.report)
        head = ["current tip", "position", "initial tip", "growth", "f", *names]
        lines.append("  " + "  ".join(f"{h:>12}" for h in head))
        for i, node in enumerate(values.tips.node):
            first, growth = nearest_initial_tip(g, int(node))
            x = ", ".join(f"{c:.5g}" for c in g.front.surface.x[node, : scene.mesh.gdim])
            cells = [f"{int(node)}", f"({x})", f"{first}", f"{growth:.5g}", f"{values.f[i]:.5g}"]
            cells += [f"{values.report[name][i]:.5g}" for name in names]
            lines.append("  " + "  ".join(f"{c:>12}" for c in cells))
        if not len(values.tips):
            lines.append("  no tip is left")
    return "\n".join(lines) + "\n"


def nearest_initial_tip(growth: Growth, node: int) -> tuple[int, float]:
    """The initial front node closest to a front node, and the distance between them."""
    surface = growth.front.surface
    if not len(growth.initial_tips):
        return -1, 0.0
    away = ((surface.x[growth.initial_tips] - surface.x[node]) ** 2).sum(axis=1) ** 0.5
    k = int(away.argmin())
    return int(growth.initial_tips[k]), float(away[k])


def write_tip_table(scene: Scene, path: str | Path) -> None:
    """Write :func:`tip_table`; collective."""
    text = tip_table(scene)
    with together(scene.mesh.comm, f"writing {path}"):
        if scene.mesh.comm.rank == 0:
            with replacing(path) as temporary:
                temporary.write_text(text)


def write_releases(scene: Scene, path: str | Path) -> None:
    """Write every bond that has let go as comma-separated values; collective.

    Columns: interface, node, x, y, z, DBT, EFENRRTR, ENRRT11 to 13, OPENBC1 to 3, CRSTS11 to 13.
    """
    head = ["interface", "node", "x", "y", "z", "DBT", "EFENRRTR"]
    head += [f"ENRRT1{i}" for i in (1, 2, 3)]
    head += [f"OPENBC{i}" for i in (1, 2, 3)] + [f"CRSTS1{i}" for i in (1, 2, 3)]
    with together(scene.mesh.comm, f"writing {path}"):
        if scene.mesh.comm.rank == 0:
            with replacing(path) as temporary, temporary.open("w", newline="") as stream:
                writer = csv.writer(stream)
                writer.writerow(head)
                for g in scene.growths:
                    for r in g.records:
                        x = g.front.surface.x[r.node]
                        row = [g.title, r.node, *x, r.DBT, r.EFENRRTR]
                        writer.writerow([*row, *r.ENRRT, *r.OPENBC, *r.CRSTS])
