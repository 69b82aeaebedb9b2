"""Checkpoints: one .npz file of plain arrays that holds the state of an analysis.

The format is open: numpy arrays by name, and one of them, ``about``, is a text in JSON with the
rest (rows of the history, counters, what the scene is made of). Nothing in it is code. A file is
written beside its place and renamed, so that it is whole whenever a job ends.
"""

from __future__ import annotations

import io
import json
import math
import os
import stat
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

VERSION = 5
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
    if comm.rank == 0 and os.path.lexists(path):
        try:
            found = _read(path)
        except Exception as error:  # whatever a foreign content makes the readers raise
            found = (
                f"{path} is no checkpoint of fxcrack ({error or type(error).__name__}); give "
                "another file, or run without restart"
            )
    found = comm.bcast(found)
    if isinstance(found, str):
        raise InputError(found)
    return found


def _read(path: Path) -> Saved | str:
    """Read a checkpoint on one rank; returns what is wrong where it is one that cannot be used.

    Nothing is unpacked before its size is known to be that of the file, and nothing in the file is
    believed.

    Raises:
        Exception: It is none.
    """
    # a pipe would block until somebody writes into it
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(handle, "rb") as stream:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise ValueError("it is no regular file")
        with zipfile.ZipFile(stream) as content:
            parts = content.infolist()
            if any(part.compress_type != zipfile.ZIP_STORED for part in parts):
                raise ValueError("it is compressed, which checkpoints are not")
            if sum(part.file_size for part in parts) > status.st_size:
                raise ValueError("its parts are larger than the file")
            names = [part.filename for part in parts]
            if len(set(names)) < len(names) or not all(n.endswith(".npy") for n in names):
                raise ValueError("its parts are no arrays of different names")
            arrays: Arrays = {n.removesuffix(".npy"): _array(content, n) for n in names}
    about = json.loads(arrays.pop("about").tobytes())
    if not isinstance(about, dict) or "version" not in about:
        raise ValueError("it says nothing of its version")
    if about["version"] != VERSION:
        return (
            f"checkpoint {path} has version {about['version']} of the format, this program reads "
            f"version {VERSION}; run without restart"
        )
    for name, kind in _ABOUT.items():
        if not isinstance(about.get(name), kind):
            raise ValueError(f"its entry '{name}' is missing or no {kind.__name__}")
    bad = _not_finite(about, arrays)
    if bad:
        raise ValueError(f"its state holds NaN or infinity in '{bad}'")
    return Saved(about, arrays)


_ABOUT: dict[str, type] = {
    **{"run": str, "finished": str, "scene": dict, "progress": dict},
    **{"balance": dict, "ramps": list, "fatigue": dict, "rows": dict},
}
"""What ``about`` must hold, and as what."""

_STATE = ("jump[", "force[", "loads", "conjugate", "bodies.", "dense.", "fatigue.credit")
"""Beginnings of the names of arrays that are finite in any equilibrium; in others NaN and infinity
stand for what does not exist (yet): rates of a criterion without, the largest opening of a new
softening bond."""


def _array(content: zipfile.ZipFile, name: str) -> npt.NDArray[np.generic]:
    """One array of a file, whose header must tell the size that it has.

    Raises:
        ValueError: It does not, or the array holds other than numbers and texts.
    """
    raw = content.read(name)
    stream = io.BytesIO(raw)
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, fortran, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise ValueError(f"its array '{name}' has version {version} of the format")
    if dtype.hasobject or dtype.kind not in "biufUS":
        raise ValueError(f"its array '{name}' holds values of type {dtype}")
    count = math.prod(shape)
    if min(shape, default=1) < 0 or count * dtype.itemsize != len(raw) - stream.tell():
        raise ValueError(f"its array '{name}' has not the size it claims, {shape}")
    flat = np.frombuffer(raw, dtype, count, stream.tell()) if count else np.zeros(0, dtype)
    return flat.reshape(shape, order="F" if fortran else "C").copy()


def _not_finite(about: dict[str, Any], arrays: Arrays) -> str:
    """Name of a part of the state that holds NaN or infinity, empty if none does."""
    for name, values in arrays.items():
        if values.dtype.kind == "f" and name.startswith(_STATE):
            if not np.all(np.isfinite(values.astype(np.float64))):
                return name
    for name, value in about["balance"].items():
        if isinstance(value, float) and not math.isfinite(value):
            return f"balance.{name}"
    return ""


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
