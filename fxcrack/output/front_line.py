"""Quantities along a crack front as arrays against its arc length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import text
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.interface.definition import Interface
from fxcrack.interface.front_order import ordered_fronts
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of


@dataclass(frozen=True)
class FrontLine:
    """One connected part of a crack front, its nodes in order.

    Attributes:
        s: Arc length from its first node along straight lines between nodes of the undeformed
            body, shape (n,), length.
        x: Positions of the nodes in the undeformed body, shape (n, 3), length.
        node: Slave nodes, shape (n,).
        f: Value of the criterion, shape (n,).
        values: Quantities of the criterion, each of shape (n,): "GI", "GII", "GIII" [force/length]
            for those on energy release rates.
        closed: Whether the last node is followed by the first.
    """

    s: Array
    x: Array
    node: Ints
    f: Array
    values: dict[str, Array]
    closed: bool


def front_lines(source: Analysis | HasAnalysis, interface: Interface | str) -> list[FrontLine]:
    """Criterion and energy release rates along the front of a crack in the present state.

    Each line begins at the end of the front with the smaller coordinates, so that the order does
    not depend on numbering. The values are the same on every rank; collective.

    Args:
        source: A scene in three dimensions, or its analysis, after a step or in an observer.
        interface: Interface or its name.

    Returns:
        Connected parts of the front, the longest first; none where no front is left.

    Raises:
        InputError: The interface is unknown or a line, or no step was run yet.

    Example:
        ``line = fx.front_lines(scene, "bond")[0]; plt.plot(line.s, line.values["GI"])``
    """
    analysis = analysis_of(source)
    analysis.check_started("its front")
    title = interface.title if isinstance(interface, Interface) else interface
    text("front_lines", "interface", title)
    crack = next((g for g in analysis.cracks if g.title == title), None)
    if crack is None:
        unknown_name("debond of interface", title, [g.title for g in analysis.cracks])
    front = crack.front
    if front.surface.dim == 1:
        raise InputError(
            f"interface '{title}' is a line: its front is a point; its rates are columns of the "
            "history"
        )
    tips = crack.tips()
    if not len(tips):
        return []
    values = crack.evaluate(tips, analysis.solver.state, analysis.time)
    row_of = {int(node): i for i, node in enumerate(values.tips.node)}
    x = analysis.pairs[crack.p].surface.x
    out = []
    for nodes, closed in ordered_fronts(front, x):
        kept = [n for n in nodes if n in row_of]
        if not kept:
            continue
        rows, at = np.array([row_of[n] for n in kept]), np.array(kept)
        steps = np.linalg.norm(np.diff(x[at], axis=0), axis=1)
        out.append(
            FrontLine(
                s=np.concatenate([[0.0], np.cumsum(steps)]),
                x=x[at].copy(),
                node=at,
                f=values.f[rows],
                values={name: v[rows] for name, v in values.report.items()},
                closed=closed,
            )
        )
    return sorted(out, key=lambda line: -float(line.s[-1]))
