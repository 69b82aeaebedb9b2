"""Whether all ranks are where one of them is: collective functions compare their calls first.

Left alone, a rank that calls a collective function which another rank does not call waits for ever.
Here every rank says what it is about to do, and with which arguments, in one message that all of
them see. Where another rank does something else, has other arguments, or has left the program, all
are told by an error; where nothing can be known, a rank that has waited some seconds says for what.

A rank that leaves by ``sys.exit`` with an error, or in the middle of a collective function, ends
the job, unless all the others leave as well.
"""

from __future__ import annotations

import atexit
import dataclasses
import hashlib
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from mpi4py import MPI

from fxcrack.base.errors import FxcrackError, InputError

NOTICE = 8.0
"""Seconds a rank waits for the others before it says so."""

PATIENCE = 3.0
"""Seconds a rank that leaves with an error waits for the others to leave as well."""

_TASK, _DIGEST = 112, 16
_LEFT = 7
"""Tag of the message of a rank that leaves: its exit code."""

_HAND_ON = 0.5


class _Ranks:
    """The communicator on which calls are compared, and what is known of those that have left.

    It is a duplicate of the world, so that nothing here mixes with the messages of a program, and
    it is made without waiting, as not all ranks may import this package at the same time.
    """

    def __init__(self) -> None:
        self.comm: MPI.Intracomm | None = None
        self.left: dict[int, int] = {}
        self.exit: SystemExit | None = None
        self.inside = False
        self.broken = False
        self._request: MPI.Request | None = None
        self._sent: list[Any] = []

    def open(self) -> None:
        """Begin to make the communicator."""
        if self.comm is None and MPI.COMM_WORLD.size > 1:
            self.comm, self._request = MPI.COMM_WORLD.Idup()

    def ready(self) -> bool:
        """Whether all ranks have begun to make it."""
        if self._request is not None and self._request.Test():
            self._request = None
        return self.comm is not None and self._request is None

    def listen(self) -> None:
        """Note the ranks that have left."""
        assert self.comm is not None
        status = MPI.Status()
        while self.comm.Iprobe(source=MPI.ANY_SOURCE, tag=_LEFT, status=status):
            code = np.zeros(1, dtype=np.int64)
            self.comm.Recv(code, source=status.source, tag=_LEFT)
            self.left[status.source] = int(code[0])

    def announce_exit(self, code: int) -> None:
        """Tell all others that this rank leaves; does not wait."""
        assert self.comm is not None
        number = np.array([code], dtype=np.int64)
        for rank in range(self.comm.size):
            if rank != self.comm.rank:
                self._sent.append((self.comm.Isend(number, dest=rank, tag=_LEFT), number))
        for request, _ in self._sent:
            request.Test()


_ranks = _Ranks()
_ordinary_exit = sys.exit


def check_same_call(comm: MPI.Comm, task: str, given: Mapping[str, Any] | None = None) -> None:
    """All ranks begin the same task with the same arguments; collective.

    Args:
        comm: Communicator of the task.
        task: What is begun, as messages call it.
        given: Arguments by name that must be the same on every rank: numbers, texts, arrays, lists,
            dictionaries and data classes of them. Functions cannot be compared.

    Raises:
        FxcrackError: Another rank begins another task, or has left the program.
        InputError: An argument differs between ranks; the message says which.
    """
    if comm.size == 1:
        return
    words = {name: _described(value) for name, value in (given or {}).items()}
    digest = hashlib.sha256(repr(words).encode()).digest()[:_DIGEST]
    if MPI.Comm.Compare(comm, MPI.COMM_WORLD) not in (MPI.IDENT, MPI.CONGRUENT):
        tasks, digests = [task], comm.allgather(digest)
    else:
        tasks, digests = _gathered(task, digest)
    if len(set(tasks)) > 1:
        doing = ", ".join(f"rank {r} {t}" for r, t in enumerate(tasks[:4]))
        raise FxcrackError(
            f"the ranks begin different tasks, each of which takes all of them: {doing}; call the "
            "same functions on every rank in the same order"
        )
    if len(set(digests)) > 1:
        _name_difference(comm, task, words)


def _gathered(task: str, digest: bytes) -> tuple[list[str], list[bytes]]:
    """Tasks and digests of all ranks of the world."""
    _ranks.open()
    start, noted = time.monotonic(), False
    request: MPI.Request | None = None
    mine = np.zeros(_TASK + _DIGEST, dtype=np.uint8)
    name = task.encode()[:_TASK]
    mine[: len(name)] = np.frombuffer(name, np.uint8)
    mine[_TASK:] = np.frombuffer(digest, np.uint8)
    every = np.zeros((MPI.COMM_WORLD.size, len(mine)), dtype=np.uint8)
    pause = 0.0
    while True:
        if _ranks.ready():
            assert _ranks.comm is not None
            if request is None and not _ranks.broken:
                request = _ranks.comm.Iallgather(mine, every)
            if request is not None and request.Test():
                break
            _ranks.listen()
            if _ranks.left:
                _ranks.broken = True
                _gone(task)
        waited = time.monotonic() - start
        if waited > NOTICE and not noted:
            noted = True
            print(
                f"fxcrack: rank {MPI.COMM_WORLD.rank} has waited {waited:.0f} s for the other "
                f"ranks with {task}, which takes all ranks together: call it on every rank",
                file=sys.stderr,
                flush=True,
            )
        time.sleep(pause)  # leaves the core to ranks that still work
        pause = min(0.002, pause + 1e-5)
    tasks = [row[:_TASK].tobytes().rstrip(b"\0").decode(errors="replace") for row in every]
    return tasks, [row[_TASK:].tobytes() for row in every]


def _gone(task: str) -> NoReturn:
    """Say that a rank has left the program."""
    rank, code = min(_ranks.left.items())
    if code:  # it ends the job itself, with its own exit code
        time.sleep(PATIENCE + 2.0 * _HAND_ON)
    raise FxcrackError(
        f"{task} takes all ranks together, but rank {rank} has left the program"
        f"{f' with exit code {code}' if code else ''}: let every rank call it, and exit on all "
        "ranks or on none"
    )


def _name_difference(comm: MPI.Comm, task: str, words: dict[str, Any]) -> NoReturn:
    """Say which argument differs; collective."""
    every = comm.allgather(words)
    names = [n for n in every[0] if any(other.get(n) != every[0][n] for other in every)]
    name = names[0] if names else "arguments"
    rank = next((r for r, other in enumerate(every) if other.get(name) != every[0].get(name)), 0)
    a, b = _different(every[0].get(name), every[rank].get(name))
    raise InputError(
        f"{task}: {name} differs between ranks: {_cut(a)} on rank 0, {_cut(b)} on rank {rank}; "
        "every rank must give the same (read files on one rank and broadcast what they hold)"
    )


def _different(a: Any, b: Any) -> tuple[Any, Any]:
    """The first part in which two descriptions differ."""
    if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
        for x, y in zip(a, b, strict=True):
            if x != y:
                return _different(x, y)
    return a, b


def _cut(value: Any) -> str:
    shown = value if isinstance(value, str) else repr(value)
    return shown if len(shown) <= 70 else f"{shown[:67]}..."


def _described(value: Any, depth: int = 0) -> Any:
    """A value as nested tuples of texts that are equal where the values are."""
    if depth > 12:
        return "..."
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | complex | str | bytes | Path):
        return repr(value)
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject or value.size <= 8:
            return ("array", *(_described(v, depth + 1) for v in value.ravel().tolist()))
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()[:12]
        return f"array of shape {value.shape}, digest {digest}"
    if isinstance(value, list | tuple):
        return ("list", *(_described(v, depth + 1) for v in value))
    if isinstance(value, Mapping):
        pairs = ((repr(k), _described(v, depth + 1)) for k, v in value.items())
        return ("mapping", *pairs)
    name = type(value).__name__
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = (getattr(value, f.name, None) for f in dataclasses.fields(value))
        return (name, *(_described(v, depth + 1) for v in fields))
    return f"a {'function' if callable(value) else name}"


@contextmanager
def in_collective_call() -> Iterator[None]:
    """Note that a collective function is at work: who leaves in the middle of it ends the job."""
    try:
        yield
    except SystemExit:
        _ranks.inside = True
        raise


def install() -> None:
    """Let ``sys.exit`` and the end of the program be known to the other ranks.

    Called again, it makes sure that it runs before what was registered for the end meanwhile
    (PETSc's end is collective).
    """
    if MPI.COMM_WORLD.size == 1:
        return
    _ranks.open()
    if sys.exit is _ordinary_exit:
        sys.exit = _exit
    atexit.unregister(_leave)
    atexit.register(_leave)


def _exit(status: Any = None, /) -> NoReturn:
    """As ``sys.exit``; the exception is kept, to be known for the one that ends the program."""
    _ranks.exit = SystemExit(status)
    raise _ranks.exit


def _exit_code() -> int:
    """The code with which the program ends by ``sys.exit``; 0 where it just ends.

    An exit that was caught has not ended the program: its traceback does not reach the outermost
    frame, or that frame went on from there.
    """
    trace = None if _ranks.exit is None else _ranks.exit.__traceback__
    if _ranks.exit is None or trace is None:
        return 0
    frame = trace.tb_frame
    if frame.f_back is not None or frame.f_lineno != trace.tb_lineno:
        return 0
    code = _ranks.exit.code
    if code is None or isinstance(code, int):
        return code or 0
    return 1


def _leave() -> None:
    """Tell the other ranks that this one leaves; with an error, end those that do not."""
    if MPI.Is_finalized():
        return
    code = _exit_code() or int(_ranks.inside)
    # where not all ranks import this package, the communicator never comes to be
    deadline = time.monotonic() + (PATIENCE if code else NOTICE)
    while not _ranks.ready() and time.monotonic() < deadline:
        time.sleep(0.01)
    deadline = time.monotonic() + PATIENCE
    if _ranks.ready():
        assert _ranks.comm is not None
        _ranks.announce_exit(code)
        while code and len(_ranks.left) < _ranks.comm.size - 1 and time.monotonic() < deadline:
            _ranks.listen()
            time.sleep(0.01)
        if len(_ranks.left) == _ranks.comm.size - 1:
            return
    if code:
        print(
            f"rank {MPI.COMM_WORLD.rank} of {MPI.COMM_WORLD.size} has left by sys.exit with code "
            f"{code} while others go on: all ranks are ended",
            file=sys.stderr,
            flush=True,
        )
        time.sleep(_HAND_ON)
        MPI.COMM_WORLD.Abort(code)
