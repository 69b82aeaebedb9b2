"""What a test measured: opening and load, and the crack length where it was observed."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import file_path, keep, numbers, text
from fxcrack.base.errors import InputError, unknown_name

UNLOADED = 0.02
"""Part of the largest opening by which openings may fall: measuring noise, no unloading."""


@dataclass(frozen=True, eq=False)
class Record:
    """Measured points of one test, in the order in which they were measured.

    Attributes:
        opening: Opening, or the displacement of the load, shape (n,) [length].
        load: Load, shape (n,) [force].
        crack_length: Observed crack length, shape (n,) [length]; ``None`` where it was not
            observed. The standards' data reduction needs it, :func:`fxcrack.identify.fit` does not.
        name: What messages and pictures call the test.
    """

    opening: npt.ArrayLike
    load: npt.ArrayLike
    crack_length: npt.ArrayLike | None = None
    name: str = "test"

    def __post_init__(self) -> None:
        """Check the columns and make arrays of them.

        Raises:
            InputError: A column holds anything but finite numbers, they differ in length, there
                are fewer than three points, or none of them is loaded.
        """
        text("Record", "name", self.name)
        owner = f"Record '{self.name}'"
        columns = {"opening": self.opening, "load": self.load}
        if self.crack_length is not None:
            columns["crack_length"] = self.crack_length
        found = {name: _column(owner, name, value) for name, value in columns.items()}
        keep(self, **found)
        lengths = {name: len(value) for name, value in found.items()}
        if len(set(lengths.values())) > 1:
            raise InputError(
                f"{owner}: columns of different lengths: {lengths}; give one per point"
            )
        if len(found["load"]) < 3:
            raise InputError(f"{owner}: {len(found['load'])} points; at least three are needed")
        if not (found["load"].max() > 0.0 and found["opening"].max() > 0.0):
            raise InputError(
                f"{owner}: no point has a positive opening and load; turn the signs round "
                "where the test machine counts them the other way"
            )
        if self.crack_length is not None and found["crack_length"].min() <= 0.0:
            row = int(np.argmin(found["crack_length"]))
            raise InputError(
                f"{owner}: crack_length = {found['crack_length'][row]:g} at point {row} must be "
                "positive; it is measured from the line of load"
            )

    @property
    def points(self) -> tuple[Array, Array]:
        """Opening and load, shapes (n,)."""
        return np.asarray(self.opening), np.asarray(self.load)

    @property
    def compliance(self) -> Array:
        """Opening over load, shape (n,) [length/force].

        Raises:
            InputError: An opening or a load is not positive.
        """
        opening, load = self.points
        bad = np.flatnonzero(~((opening > 0.0) & (load > 0.0)))
        if bad.size:
            raise InputError(
                f"Record '{self.name}': opening {opening[bad[0]]:g}, load {load[bad[0]]:g} at "
                f"point {bad[0]}: a compliance needs both positive; leave such points out"
            )
        return np.asarray(opening / load)

    def lengths(self) -> Array:
        """Observed crack lengths, shape (n,) [length].

        Raises:
            InputError: None were given.
        """
        if self.crack_length is None:
            raise InputError(
                f"Record '{self.name}' has no crack_length, which this data reduction needs; give "
                "the column"
            )
        return np.asarray(self.crack_length)

    def check_loading(self) -> None:
        """Check that the opening only grows, as :func:`fxcrack.identify.fit` compares it.

        Raises:
            InputError: It falls by more than 2 % of its largest value below an earlier one.
        """
        opening, _ = self.points
        below = np.maximum.accumulate(opening) - opening
        row = int(np.argmax(below))
        if below[row] > UNLOADED * opening.max():
            raise InputError(
                f"Record '{self.name}': the opening falls to {opening[row]:g} at point {row} after "
                f"{opening[:row].max():g}: leave unloading out, record.loading()"
            )

    def loading(self) -> Record:
        """The points at which the opening is larger than ever before; unloading is left out."""
        opening, load = self.points
        before = np.concatenate(([-math.inf], np.maximum.accumulate(opening)[:-1]))
        new = opening > before
        a = None if self.crack_length is None else np.asarray(self.crack_length)[new]
        return Record(opening[new], load[new], a, self.name)


def read_record(
    path: str | Path,
    *,
    opening: str = "opening",
    load: str = "load",
    crack_length: str | None = None,
    name: str | None = None,
) -> Record:
    """Read a measured test from a file of separated values; every rank reads it.

    The first line that is not empty and does not begin with ``#`` names the columns. Values are
    separated by commas, semicolons or tabs; beside semicolons and tabs a comma may stand for the
    decimal point.

    Args:
        path: The file.
        opening: Name of the column of the opening.
        load: Name of the column of the load.
        crack_length: Name of the column of the observed crack length, if there is one.
        name: What messages call the test; the file's name by default.

    Raises:
        InputError: The file cannot be read, a column is missing, or a line has more values than
            there are columns or no number where one is needed; the message names the line.
    """
    path = file_path("read_record", "path", path)
    for argument, given in (("opening", opening), ("load", load)):
        text("read_record", argument, given)
    text("read_record", "crack_length", crack_length, optional=True)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is no text in UTF-8"
        raise InputError(f"read_record: '{path}' cannot be read: {why}") from error
    kept = [(n, s) for n, s in enumerate(lines, 1) if s.strip() and not s.lstrip().startswith("#")]
    if not kept:
        raise InputError(f"read_record: '{path}' is empty; its first line must name the columns")
    head = kept[0][1]
    separator = next((c for c in "\t;" if c in head), ",")
    names = [cell.strip() for cell in next(csv.reader([head], delimiter=separator))]
    wanted = [opening, load, *([crack_length] if crack_length is not None else [])]
    for column in wanted:
        if names.count(column) > 1:
            raise InputError(
                f"read_record: '{path}' names {names.count(column)} columns '{column}'"
            )
        if column not in names:
            unknown_name(f"column in '{path}'", column, names)
    values: dict[str, list[float]] = {column: [] for column in wanted}
    for n, line in kept[1:]:
        cells = next(csv.reader([line], delimiter=separator))
        if any(cell.strip() for cell in cells[len(names) :]):
            raise InputError(
                f"read_record: '{path}', line {n} has {len(cells)} values for {len(names)} columns"
                "; where a comma is the decimal point, separate values by semicolons or tabs"
            )
        for column in wanted:
            place = names.index(column)
            cell = cells[place].strip() if place < len(cells) else ""
            value = _read(cell, decimal_comma=separator != ",")
            if value is None:
                raise InputError(
                    f"read_record: '{path}', line {n}: {column} = '{cell}' is not a finite number; "
                    "correct the line or begin it with #"
                )
            values[column].append(value)
    a = None if crack_length is None else values[crack_length]
    return Record(values[opening], values[load], a, path.stem if name is None else name)


def _column(owner: str, name: str, value: object) -> Array:
    """A column as an array; columns of pandas are columns as well."""
    given = np.asarray(value) if hasattr(value, "__array__") else value
    return np.array(numbers(owner, name, given, words="one per point"))


def _read(cell: str, *, decimal_comma: bool) -> float | None:
    """A cell as a finite number, None where it is none."""
    try:
        value = float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
