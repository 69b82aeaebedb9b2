"""A report of an analysis in one HTML file: what was run, what came out, what it cost.

The file holds its pictures and needs nothing else, so that it can be sent to a colleague. Importing
this module loads Jinja2 and matplotlib; the package imports it on first use only.
"""

from __future__ import annotations

import base64
import io
import platform
from collections.abc import Callable, Sequence
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx
import jinja2
import numpy as np
import petsc4py
from matplotlib.figure import Figure

from fxcrack.base.errors import InputError
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none
from fxcrack.history import History
from fxcrack.output import plots
from fxcrack.output.explain import Explanation, explain
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of

_MOST_ROWS = 200
"""Rows of the history in the report; of longer ones the first and last half of them."""

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title><style>
body {font: 15px/1.5 system-ui, sans-serif; color: #1f2430; max-width: 60em; margin: 2em auto;
      padding: 0 1em}
h1 {font-size: 1.6em} h2 {font-size: 1.2em; border-bottom: 1px solid #e6e9ee; margin-top: 2em}
table {border-collapse: collapse; font-size: 13px} th, td {padding: 2px 10px; text-align: right;
      border-bottom: 1px solid #e6e9ee} th:first-child, td:first-child {text-align: left}
pre {background: #f5f6f8; padding: 1em; overflow-x: auto; font-size: 13px}
figure {margin: 1.5em 0} figure img {max-width: 100%} .rows {overflow-x: auto; max-height: 40em}
.warning {background: #fff4e5; border-left: 4px solid #d8611a; padding: .5em 1em; margin: .5em 0}
small {color: #8b929e}
</style></head><body>
<h1>{{ title }}</h1>
<p><small>{{ date }}; {{ versions }}</small></p>
<h2>What was run</h2>
<p>{{ bodies }}</p>
<pre>{{ explanation }}</pre>
<h2>What came out</h2>
<pre>{{ description }}</pre>
{% for text in warnings %}<p class="warning">{{ text }}</p>
{% else %}<p>There were no warnings.</p>
{% endfor %}
{% if accuracy %}<h2>Accuracy</h2><pre>{{ accuracy }}</pre>{% endif %}
{% for caption, data in figures %}<figure>
<img alt="{{ caption }}" src="data:image/png;base64,{{ data }}">
<figcaption>{{ caption }}</figcaption></figure>
{% endfor %}
{% if seconds %}<h2>Cost</h2>
<table><tr><th>phase</th><th>seconds</th></tr>
{% for name, value in seconds %}<tr><td>{{ name }}</td><td>{{ "%.3f" % value }}</td></tr>
{% endfor %}</table>{% endif %}
<h2>History</h2>
<details><summary>{{ n_rows }} rows</summary><div class="rows"><table>
<tr>{% for name in columns %}<th>{{ name }}</th>{% endfor %}</tr>
{% for row in rows %}<tr>{% for value in row %}<td>{{ value }}</td>{% endfor %}</tr>
{% endfor %}</table></div></details>
</body></html>
"""


def write_report(
    source: Analysis | HasAnalysis,
    path: str | Path,
    *,
    title: str = "Crack growth analysis",
    warnings: Sequence[str] = (),
) -> None:
    """Write the report of a scene whose steps were run; collective.

    Args:
        source: A scene or its analysis.
        path: HTML file.
        title: Heading.
        warnings: What was warned of while the scene was made and run.

    Raises:
        InputError: No step was run yet.
        FxcrackError: The file could not be written.
    """
    analysis = analysis_of(source)
    analysis.check_started("its report")
    if Path(path).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"a report is an .html file, not '{path}'; a browser prints it to PDF")
    history, explanation = analysis.history, explain(analysis)
    figures = _figures(analysis, history)
    with all_or_none(analysis.comm, f"writing {path}"):
        if analysis.comm.rank == 0:
            page = jinja2.Environment(autoescape=True).from_string(_PAGE)
            text = page.render(
                title=title,
                date=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
                versions=_versions(analysis),
                bodies=_bodies(analysis),
                explanation=str(explanation),
                description=history.describe(),
                warnings=warnings,
                accuracy=history.details.get("accuracy", {}).get("words", ""),
                figures=figures,
                seconds=_seconds(explanation),
                n_rows=len(history),
                columns=history.columns,
                rows=_rows(history),
            )
            with replacing(path) as temporary:
                temporary.write_text(text, encoding="utf-8")


def _figures(analysis: Analysis, history: History) -> list[tuple[str, str]]:
    """Captions and pictures of what there is to show; collective, pictures on rank 0 only."""
    drawn: list[tuple[str, Callable[[], Figure | None]]] = []
    names = history.columns
    if any(n.startswith(("u[", "F[")) for n in names):
        drawn.append(("Load against displacement", lambda: plots.load_opening(history)))
    for crack in analysis.cracks:
        title = crack.title
        if f"a[{title}]" in names and len(plots.growth_rows(history, title)):
            quantity = "G" if f"GI[{title}]" in names else "f"
            drawn.append(
                (
                    f"Growth of crack {title}",
                    lambda t=title, q=quantity: plots.r_curve(history, None, t, quantity=q),  # type: ignore[misc]
                )
            )
    drawn.append(("Energies", lambda: plots.energies(history)))
    found = []
    for caption, draw in drawn:
        figure = draw()
        if figure is not None:
            stream = io.BytesIO()
            figure.savefig(stream, format="png", dpi=120)
            found.append((caption, base64.b64encode(stream.getvalue()).decode()))
    return found


def _versions(analysis: Analysis) -> str:
    found = {"fxcrack": metadata.version("fxcrack"), "DOLFINx": dolfinx.__version__}
    found |= {"petsc4py": petsc4py.__version__, "Python": platform.python_version()}
    named = ", ".join(f"{name} {version}" for name, version in found.items())
    ranks = analysis.comm.size
    return (
        f"{named}; {ranks} {'process' if ranks == 1 else 'processes'} on {platform.system()} "
        f"{platform.machine()}"
    )


def _bodies(analysis: Analysis) -> str:
    continuum = analysis.continuum
    mesh = continuum.mesh
    cells = mesh.domain.topology.index_map(mesh.domain.topology.dim).size_global
    return (
        f"Mesh '{mesh.name}': {cells:,} cells in {mesh.gdim} dimensions, "
        f"{continuum.layout.n_distinct:,} unknown displacements; "
        f"{len(analysis.pairs)} interface{'' if len(analysis.pairs) == 1 else 's'}."
    )


def _seconds(explanation: Explanation) -> list[tuple[str, float]]:
    return [(n, s) for n, s in explanation.phases.items() if s > 0.0]


def _rows(history: History) -> list[list[str]]:
    rows: list[Any] = history.rows
    if len(rows) > _MOST_ROWS:
        rows = [*rows[: _MOST_ROWS // 2], {}, *rows[-_MOST_ROWS // 2 :]]

    def text(row: Any, name: str) -> str:
        value = row.get(name, "" if row else "...")
        return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)

    return [[text(row, name) for name in history.columns] for row in rows]


__all__ = ["write_report"]
