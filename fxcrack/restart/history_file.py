"""The history on disk while the analysis runs: readable at any time, whatever happens then.

CSV grows row by row; when a new column appears the file is written anew beside its place and
renamed. JSON is written anew, every few seconds.
"""

from __future__ import annotations

import csv
import io
import os
import time
from pathlib import Path

from fxcrack.base.errors import InputError
from fxcrack.base.files import open_to_append
from fxcrack.history import History

_SECONDS = 1.0
"""Time between two writings of a JSON file, and between two orders to bring rows to the disk."""


class HistoryFile:
    """A file that follows a history; rank 0 writes, the others have nothing to do.

    Args:
        history: The history.
        path: File, ending in .csv or .json.

    Raises:
        InputError: The ending is another one.
    """

    def __init__(self, history: History, path: str | Path) -> None:
        self.path = Path(path)
        self._history = history
        self._columns: list[str] = []
        self._rows = 0
        self._size = 0
        self._synced = time.monotonic()
        if self.path.suffix not in (".csv", ".json"):
            raise InputError(f"save = '{path}': the file's name must end in .csv or .json")

    def update(self, *, last: bool = False) -> str | None:
        """Write the rows that are new.

        Args:
            last: Nothing follows: write all of them, and bring them to the disk.

        Returns:
            What failed, ``None`` if nothing. The rows that were there stay readable.
        """
        if self._history.comm.rank > 0:
            return None
        try:
            if self.path.suffix == ".csv":
                self._update_csv(last)
            else:
                self._update_json(last)
        except OSError as error:
            return f"writing {self.path}: {error}; {self._rows} rows of the history are in it"
        return None

    def _update_json(self, last: bool) -> None:
        if last or not self._rows or time.monotonic() > self._synced + _SECONDS:
            self._history.write_json(self.path)
            self._synced = time.monotonic()
            self._rows = len(self._history)

    def _update_csv(self, last: bool) -> None:
        rows = self._history.rows[self._rows :]
        known = set(self._columns)
        if not self._rows or any(not known.issuperset(row) for row in rows):
            self._history.write_csv(self.path)
            self._columns, self._size = self._history.columns, self.path.stat().st_size
        elif rows:
            self._append(rows)
        self._rows = len(self._history)
        if last or time.monotonic() > self._synced + _SECONDS:
            with self.path.open("rb") as stream:
                os.fsync(stream.fileno())
            self._synced = time.monotonic()

    def _append(self, rows: list[dict[str, float | int | str]]) -> None:
        text = io.StringIO(newline="")
        csv.DictWriter(text, self._columns).writerows(rows)
        content = text.getvalue().encode()
        with open_to_append(self.path) as stream:
            try:
                written = 0
                while written < len(content):
                    written += stream.write(content[written:])
            except OSError:
                os.ftruncate(stream.fileno(), self._size)  # no half row stays
                raise
        self._size += len(content)
