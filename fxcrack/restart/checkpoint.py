"""Checkpoints: one .npz file of plain arrays that holds the state of an analysis.

The format is open: numpy arrays by name, and one of them, ``about``, is a text in JSON with the
rest (rows of the history, counters, what the scene is made of). Nothing in it is code. A file is
written beside its place and renamed, so that it is whole whenever a job ends.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.checks import check_instance, keep, number, whole
from fxcrack.base.errors import InputError
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none

Arrays = dict[str, npt.NDArray[np.generic]]

VERSION = 4
"""Changes when a file of an earlier program can no longer be read."""


@dataclass(frozen=True)
class Checkpoint:
    """Where and how often the state of an analysis is saved.

    The second, third ... step of a scene have files of their own, NAME-2.npz, NAME-3.npz ...

    Args:
        path: File, ending in .npz.
        every: Accepted increments or releases between two checkpoints; only time counts if not
            given.
        seconds: Time between two checkpoints; infinite to let only ``every`` count. What comes
            first counts. At the end of a step, and when a signal stops it, one is always written.
    """

    path: str | Path
    every: int | None = None
    seconds: float = 60.0

    def __post_init__(self) -> None:
        """Check the file's name and the numbers."""
        check_instance("Checkpoint", "path", self.path, (str, Path), "'run.npz'")
        if Path(self.path).suffix != ".npz":
            raise InputError(f"Checkpoint('{self.path}'): the file's name must end in .npz")
        if self.every is not None:
            keep(self, every=whole("Checkpoint", "every", self.every))
        if not number("Checkpoint", "seconds", self.seconds) >= 0.0:
            raise InputError(f"Checkpoint: seconds = {self.seconds} must not be negative")

    def file(self, step: int) -> Path:
        """File of a step, counted from 1."""
        path = Path(self.path)
        return path if step == 1 else path.with_stem(f"{path.stem}-{step}")


@dataclass
class Saved:
    """What a checkpoint holds.

    Attributes:
        about: Plain values: numbers, texts, lists and dictionaries of them.
        arrays: Arrays by name.
    """

    about: dict[str, Any]
    arrays: Arrays = field(default_factory=dict)


def write(comm: MPI.Comm, path: Path, saved: Saved) -> None:
    """Write a checkpoint; collective, rank 0 writes.

    Raises:
        FxcrackError: The file could not be written; one that was there is untouched.
    """
    with all_or_none(comm, f"writing the checkpoint {path}"):
        if comm.rank == 0:
            text = json.dumps({"version": VERSION, **saved.about}).encode()
            with replacing(path) as temporary, temporary.open("wb") as stream:
                arrays: dict[str, Any] = {"about": np.frombuffer(text, np.uint8), **saved.arrays}
                np.savez(stream, **arrays)
                stream.flush()
                os.fsync(stream.fileno())


def read(comm: MPI.Comm, path: Path) -> Saved | None:
    """Read a checkpoint, ``None`` if there is none; collective, rank 0 reads.

    Raises:
        InputError: The file is no checkpoint, or of another version.
    """
    found: Saved | str | None = None
    if comm.rank == 0 and path.exists():
        try:
            with np.load(path, allow_pickle=False) as content:
                arrays = dict(content)
            about = json.loads(arrays.pop("about").tobytes())
            found = Saved(about, arrays)
            if about["version"] != VERSION:
                found = (
                    f"checkpoint {path} has version {about['version']} of the format, this "
                    f"program reads version {VERSION}; run without restart"
                )
        except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
            found = (
                f"{path} is no checkpoint of fxcrack ({error}); give another file, or run without "
                "restart"
            )
    found = comm.bcast(found)
    if isinstance(found, str):
        raise InputError(found)
    return found


# -- checkpoints of scenes that do not ask for them -------------------------------------------


@dataclass
class _Folder:
    """Files of all scenes of a program.

    Attributes:
        folder: Where.
        restart: Whether scenes continue from what is there.
        seconds: As in :class:`Checkpoint`.
        count: Number of scenes so far.
    """

    folder: Path
    restart: bool
    seconds: float
    count: int = 0


_folder: ContextVar[_Folder | None] = ContextVar("fxcrack_checkpoints", default=None)


@contextmanager
def checkpoints(
    folder: str | Path, *, restart: bool = False, seconds: float = 60.0
) -> Iterator[None]:
    """Keep checkpoints and histories of all scenes that are run inside, in one folder.

    Scenes are numbered in the order in which they are first run: scene-1.npz and scene-1.csv, and
    so on. A scene that is run with a checkpoint of its own follows that.

    Args:
        folder: Where the files are written.
        restart: Continue from the files that are there.
        seconds: Time between two checkpoints.
    """
    token = _folder.set(_Folder(Path(folder), restart, seconds))
    try:
        yield
    finally:
        _folder.reset(token)


def next_of_folder() -> tuple[Checkpoint, Path, bool] | None:
    """Checkpoint, history file and restart of the next scene inside :func:`checkpoints`."""
    here = _folder.get()
    if here is None:
        return None
    here.count += 1
    name = here.folder / f"scene-{here.count}"
    return (
        Checkpoint(name.with_suffix(".npz"), seconds=here.seconds),
        name.with_suffix(".csv"),
        here.restart,
    )
