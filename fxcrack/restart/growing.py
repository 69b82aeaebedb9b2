"""Tables that grow while an analysis runs, kept as arrays so that a checkpoint packs a row once.

What a checkpoint costs does not grow with the history: only rows that are new since the last one
are converted; the rest is copied as blocks of numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Cell = float | int | str | bool
Arrays = dict[str, npt.NDArray[np.generic]]

_MISSING, _FLOAT, _INT, _TEXT, _BOOL = range(5)
_EXACT = 2**53
"""Whole numbers up to this size are floats as well."""


class RowTable:
    """Rows of named cells (numbers, texts, truth values) as two arrays and two lists of names."""

    def __init__(self) -> None:
        self._columns: dict[str, int] = {}
        self._texts: dict[str, int] = {}
        self._values = np.zeros((0, 0))
        self._kinds = np.zeros((0, 0), dtype=np.uint8)
        self._n = 0

    def update(self, rows: Sequence[Mapping[str, Cell]]) -> None:
        """Pack the rows that are new; those packed before must not have changed.

        Args:
            rows: All rows so far.
        """
        for row in rows[self._n :]:
            for name in row:
                self._columns.setdefault(name, len(self._columns))
            self._make_room()
            for name, cell in row.items():
                where = self._n, self._columns[name]
                self._kinds[where], self._values[where] = self._packed(cell)
            self._n += 1

    def _make_room(self) -> None:
        """Let one more row and all columns fit; capacity is doubled, so that copies stay few."""
        n, k = self._values.shape
        if self._n < n and len(self._columns) <= k:
            return
        shape = max(2 * self._n, 16), max(len(self._columns), k)
        for name in ("_values", "_kinds"):
            old = getattr(self, name)
            new = np.zeros(shape, dtype=old.dtype)
            new[: self._n, :k] = old[: self._n]
            setattr(self, name, new)

    def _packed(self, cell: Cell | np.generic) -> tuple[int, float]:
        value = cell.item() if isinstance(cell, np.generic) else cell
        if isinstance(value, bool):
            return _BOOL, float(value)
        if isinstance(value, int) and abs(value) <= _EXACT:
            return _INT, float(value)
        if isinstance(value, int | float):
            return _FLOAT, float(value)
        return _TEXT, float(self._texts.setdefault(str(value), len(self._texts)))

    def names(self) -> dict[str, list[str]]:
        """Columns and texts, plain values for :func:`rows_of`."""
        return {"columns": list(self._columns), "texts": list(self._texts)}

    def arrays(self, name: str) -> Arrays:
        """Values and kinds, each of shape (n_rows, n_columns), by name."""
        n, k = self._n, len(self._columns)
        return {f"{name}.values": self._values[:n, :k], f"{name}.kinds": self._kinds[:n, :k]}


def rows_of(
    names: Mapping[str, Any], arrays: Mapping[str, Any], name: str
) -> list[dict[str, Cell]]:
    """The rows that :class:`RowTable` has packed.

    Args:
        names: What :meth:`RowTable.names` gave.
        arrays: What :meth:`RowTable.arrays` gave.
        name: Name of the table among them.

    Raises:
        ValueError: They do not belong together.
    """
    columns, texts = list(names["columns"]), list(names["texts"])
    values, kinds = arrays[f"{name}.values"], arrays[f"{name}.kinds"]
    if values.shape != kinds.shape or values.ndim != 2 or values.shape[1] != len(columns):
        raise ValueError(f"table '{name}' of shape {values.shape} has {len(columns)} columns")
    if kinds.size and int(kinds.max()) > _BOOL:
        raise ValueError(f"table '{name}' holds kinds of values that do not exist")

    def cell(kind: int, value: float) -> Cell:
        if kind == _TEXT:
            return str(texts[int(value)])
        return {_FLOAT: value, _INT: int(value) if kind == _INT else 0, _BOOL: bool(value)}[kind]

    return [
        {c: cell(k, v) for c, k, v in zip(columns, some, row, strict=True) if k != _MISSING}
        for some, row in zip(kinds.tolist(), values.tolist(), strict=True)
    ]


class GrowingArray:
    """Rows of one shape, appended; the array of all of them is a view."""

    def __init__(self) -> None:
        self._rows: npt.NDArray[Any] | None = None
        self._n = 0

    def __len__(self) -> int:
        """Number of rows."""
        return self._n

    def append(self, row: npt.ArrayLike) -> None:
        """Add a row."""
        value = np.asarray(row)
        if self._rows is None:
            self._rows = np.zeros((16, *value.shape), dtype=value.dtype)
        elif self._n == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        self._rows[self._n] = value
        self._n += 1

    def array(self) -> npt.NDArray[Any]:
        """All rows, shape (n, ...)."""
        return np.zeros(0) if self._rows is None else self._rows[: self._n]
