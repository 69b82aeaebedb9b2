"""Using what a study has measured: the cheapest setting for an accuracy, out of its JSON file."""

from __future__ import annotations

import json
from pathlib import Path

from fxcrack.accuracy.pareto import cheapest, percent
from fxcrack.accuracy.reference import worst
from fxcrack.accuracy.study import Setting
from fxcrack.base.errors import InputError
from fxcrack.error_estimate import AccuracyError, check_accuracy


def choose(path: str | Path, accuracy: float, *, measure: str | None = None) -> Setting:
    """The fastest setting of a study that has the accuracy; the reference's own error counts.

    ::

        setting = choose("out/accuracy/dcb/accuracy.json", 0.01)
        case = known("dcb")(setting)

    It holds for the problem that was studied; for another one run a study of it.

    Args:
        path: JSON file of ``fxcrack accuracy``.
        accuracy: Largest relative error allowed.
        measure: Quantity the error is of; that of the study by default.

    Raises:
        InputError: There is no such file, or it is none of a study.
        AccuracyError: No setting reached the accuracy.
    """
    check_accuracy(accuracy)
    try:
        result = json.loads(Path(path).read_text(encoding="utf-8"))
        records, measure = result["records"], measure or result["measure"]
        blur = worst(result["reference"]["uncertainty"], measure)
        blur = blur if blur == blur else 0.0  # an exact reference has none
        errors = [worst(r["errors"], measure) + blur for r in records]
        i = cheapest([r["seconds"] for r in records], errors, accuracy)
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise InputError(
            f"'{path}' is no result of fxcrack accuracy ({type(error).__name__}: {error}); make it "
            "with fxcrack accuracy SCENE --out DIR"
        ) from error
    if i is None:
        finite = [e for e in errors if e == e]
        best = f"; the best reached {percent(min(finite))}" if finite else ""
        raise AccuracyError(
            f"no setting in '{path}' reached {percent(accuracy)} in {measure}{best}; run the study "
            "with a larger budget or finer sizes"
        )
    return Setting(**records[i]["setting"])
