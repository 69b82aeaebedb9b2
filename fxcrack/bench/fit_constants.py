"""Constants of the cost model from measured cases: least squares of relative errors, none < 0."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import nnls

from fxcrack.base.errors import InputError

Result = dict[str, Any]


def fit_law(n: list[float], y: list[float], exponent: float, log: float, linear: bool) -> Result:
    """Law a n + b n^e (log2 n)^l through measured values, smallest relative errors."""
    sizes, values = np.array(n, dtype=float), np.array(y, dtype=float)
    terms = [sizes, sizes**exponent * np.log2(sizes) ** log]
    use = [linear, exponent != 1.0 or log != 0.0]
    columns = [t / values for t, on in zip(terms, use, strict=True) if on]
    found, _ = nnls(np.stack(columns, axis=1), np.ones(len(values)))
    both = np.zeros(2)
    both[np.flatnonzero(use)] = found
    return {
        "linear": float(both[0]), "power": float(both[1]), "exponent": exponent, "log": log,
        "low": float(sizes.min()), "high": float(sizes.max()),
    }  # fmt: skip


def fit_constants(result: Result) -> Result:
    """What ``Constants.read`` expects, from a result of :func:`fxcrack.bench.scale.run`.

    Raises:
        InputError: Cases that are needed were not measured.
    """
    cases = [c for c in result["cases"] if "failed" not in c]

    def some(title: str, keep: Callable[[Result], bool]) -> list[Result]:
        found = [c for c in cases if keep(c)]
        if not found:
            raise InputError(f"no case of {title} was measured; the cost model needs one")
        return found

    laws, per_entry, gain = {}, {}, {}
    for d, exponent, memory in ((2, 1.5, (1.0, 1.0, False)), (3, 2.0, (4.0 / 3.0, 0.0, True))):
        shape = "plane" if d == 2 else "block"
        mine = some(
            f"{d}-D, direct, 1 rank",
            lambda c: c["method"] == "schur" and c["shape"] == shape and c["ranks"] == 1,  # noqa: B023
        )
        n = [c["dofs"] for c in mine]
        factor = [c["seconds"]["factor_with_schur"] for c in mine]
        laws[f"direct_seconds_{d}"] = fit_law(n, factor, exponent, 0.0, True)
        size = [1e6 * c["memory_mb"] - 16.0 * c["retained"] ** 2 for c in mine]
        laws[f"direct_memory_{d}"] = fit_law(n, size, *memory)
        laws[f"base_seconds_{d}"] = fit_law(n, [_base(c) for c in mine], 1.0, 0.0, True)
        gain[f"direct_{d}"] = _gain(cases, d, "schur", "factor_with_schur")
    mine = some("3-D, iterative, 1 rank", lambda c: c["method"] == "iterative" and c["ranks"] == 1)
    blocks = [c for c in mine if c["shape"] == "block"] or mine
    n = [c["dofs"] for c in blocks]
    each = [c["seconds"]["columns"] / c["columns"] / c["iterations"] for c in blocks]
    laws["setup_seconds_3"] = fit_law(
        n, [c["seconds"]["multigrid"] for c in blocks], 1.0, 0.0, True
    )
    laws["iteration_seconds_3"] = fit_law(n, each, 1.0, 0.0, True)
    size = [1e6 * c["memory_mb"] - 4.0 * c["columns"] * c["dofs"] for c in blocks]
    laws["iterative_memory_3"] = fit_law(n, size, 1.0, 0.0, True)
    gain["iterative_3"] = _gain(cases, 3, "iterative", "columns")
    iterations = {
        shape: max((c["iterations"] for c in mine if c["shape"] == shape), default=30.0)
        for shape in ("block", "plate")
    }
    for d, shape in ((2, "plane"), (3, "plate")):
        per_entry[str(d)] = _per_entry(cases, shape)
    message = result.get("message") or {"latency": 0.0, "per_byte": 0.0}
    return {
        "date": result["date"],
        "machine": result["machine"],
        "laws": laws,
        "iterations": iterations,
        "per_entry": per_entry,
        "release": result["dense"]["release_per_square"],
        "latency": message["latency"],
        "per_byte": message["per_byte"],
        "gain": gain,
    }


def _base(case: Result) -> float:
    seconds = case["seconds"]
    return float(sum(seconds[k] for k in ("mesh", "scene", "assemble", "transform")))


def _per_entry(cases: list[Result], shape: str) -> float:
    """Seconds per entry of S: the same model with many and with few retained jumps."""
    of = [c for c in cases if c["shape"] == shape and c["method"] == "schur" and c["ranks"] == 1]
    found = []
    for big in (c for c in of if c["ahead"]):
        for small in (c for c in of if not c["ahead"] and c["dofs"] == big["dofs"]):
            more = [c["seconds"]["factor_with_schur"] for c in (small, big)]
            entries = big["retained"] ** 2 - small["retained"] ** 2
            found.append(max(more[1] - more[0], 0.0) / entries)
    return max(found, default=5e-8 if shape == "plane" else 2.5e-7)


def _gain(cases: list[Result], dim: int, method: str, phase: str) -> float:
    """Exponent g of t_2 = t_1 / 2^g, from 0 to 1; 0.8 where no case was measured on 2 ranks."""
    of = [c for c in cases if c["dim"] == dim and c["method"] == method]
    found = []
    for two in (c for c in of if c["ranks"] == 2):
        for one in of:
            same = all(one[k] == two[k] for k in ("shape", "dofs", "ahead"))
            if same and one["ranks"] == 1:
                found.append(np.log2(_of(one, phase) / _of(two, phase)))
    return float(np.clip(np.mean(found), 0.0, 1.0)) if found else 0.8


def _of(case: Result, phase: str) -> float:
    """Seconds of a phase, of columns per column."""
    seconds = float(case["seconds"][phase])
    return seconds / case["columns"] if phase == "columns" else seconds
