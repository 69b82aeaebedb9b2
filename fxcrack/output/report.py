"""Crack tips and their quantities as a text table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fxcrack.output.atomic import replacing
from fxcrack.output.collective import together

if TYPE_CHECKING:
    from fxcrack.scene import Scene


def tip_table(scene: Scene) -> str:
    """Crack tip location and associated quantities, as text.

    Per interface and tip: crack number, initial tip, current tip, length grown between them along
    the slave surface, f and the quantities of the criterion.
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
    with together(scene.mesh.comm, f"writing {path}"):
        if scene.mesh.comm.rank == 0:
            with replacing(path) as temporary:
                temporary.write_text(text)
