"""Which settings of a study are run: not all combinations, but every choice beside the base.

Each cell shape and order is run with the base way to find G, each other way to find G with the base
cell. Increments and solvers are run with the base of all else on the second and third coarsest
size, ranks with the base cell and way on the two finest: where they make a difference.
"""

from __future__ import annotations

from dataclasses import replace

from fxcrack.accuracy.study import Setting, Study
from fxcrack.base.errors import InputError


def settings(study: Study) -> list[Setting]:
    """Settings of a study, each once, from coarse to fine within a line.

    Raises:
        InputError: A study without sizes, or with nothing to choose from.
    """
    if not study.sizes:
        raise InputError(
            f"study '{study.title}' names no element sizes; give sizes=(...) to @study or "
            "--sizes on the command line"
        )
    for name in ("orders", "cells", "methods", "steppings", "solvers", "ranks"):
        if not getattr(study, name):
            raise InputError(f"study '{study.title}' leaves {name} empty; name at least one")
    sizes = sorted(set(study.sizes), reverse=True)
    middle, fine = sizes[1:3] or sizes, sizes[-2:]
    out: list[Setting] = []
    for cell in study.cells:
        for order in study.orders:
            for method in study.methods:
                if method != study.methods[0] and cell != study.cells[0]:
                    continue
                base = Setting(
                    size=1.0, order=order, cell=cell, method=method,
                    stepping=study.steppings[0], solver=study.solvers[0], ranks=study.ranks[0],
                )  # fmt: skip
                out += [replace(base, size=h) for h in sizes]
    base = out[0]
    for stepping in study.steppings[1:]:
        tolerances = study.tolerances if stepping == "increment" else ()
        for tolerance in tolerances or (None,):
            other = replace(base, stepping=stepping, tolerance=tolerance)
            out += [replace(other, size=h) for h in middle]
    for solver in study.solvers[1:]:
        out += [replace(base, solver=solver, size=h) for h in middle]
    for order in study.orders:
        for ranks in study.ranks[1:]:
            out += [replace(base, order=order, ranks=ranks, size=h) for h in fine]
    admitted = [s for s in dict.fromkeys(out) if study.admits is None or study.admits(s)]
    if not admitted:
        raise InputError(f"study '{study.title}' admits none of its {len(out)} settings")
    return admitted
