"""Files that are whole or not there: written beside their place, then renamed."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from fxcrack.base.errors import InputError

_NO_LINK = getattr(os, "O_NOFOLLOW", 0)


def open_to_append(path: Path) -> BinaryIO:
    """Open a file that is there to add to its end; a symbolic link is not followed."""
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_APPEND | _NO_LINK), "ab", buffering=0)


def _is_stream(path: Path) -> bool:
    """Whether a path names a device, a pipe or a descriptor of this process."""
    try:
        return path.is_char_device() or path.is_fifo() or path.is_socket() or _is_descriptor(path)
    except OSError:
        return False


def _is_descriptor(path: Path) -> bool:
    """Whether it is /dev/stdout, /dev/stderr or one of /dev/fd, whatever these lead to."""
    return path.exists() and path.absolute().parent in (Path("/dev"), Path("/dev/fd"))


def _stream(path: Path) -> int:
    """Open a stream for writing, behind what was written to it before."""
    return os.open(path, os.O_WRONLY | os.O_APPEND)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; it replaces ``path`` if nothing fails.

    A device, a pipe or what /dev/stdout stands for is never replaced: the file is copied into it.
    """
    path = Path(path)
    if _is_stream(path):
        with tempfile.TemporaryDirectory() as folder:
            whole = Path(folder) / path.name
            yield whole
            with whole.open("rb") as source, os.fdopen(_stream(path), "wb", buffering=0) as sink:
                shutil.copyfileobj(source, sink)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    # a name nobody can guess, which must not be there yet, with the permissions that the umask of
    # the user leaves
    temporary = path.parent / f".{path.stem}.{secrets.token_hex(8)}{path.suffix}"
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_LINK, 0o666))
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(what: str, path: str | Path, *, folder: bool = False) -> None:
    """Find out before a long run whether its results could be written; on one rank.

    Args:
        what: What the path was given as, for the message.
        path: The file, or the folder, to be written; folders above it are made.
        folder: Whether it is a folder.

    Raises:
        InputError: It could not; the message says why.
    """
    path = Path(path)
    try:
        if not folder and path.is_dir():
            raise IsADirectoryError("it is a folder, not a file")
        probe = path / "probe" if folder else path
        probe.parent.mkdir(parents=True, exist_ok=True)
        temporary = probe.parent / f".{secrets.token_hex(8)}"
        os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_LINK, 0o600))
        temporary.unlink()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{what} '{path}' cannot be written: {reason}; give another") from error


def write_json(path: str | Path, content: object) -> None:
    """Write plain types as JSON, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
