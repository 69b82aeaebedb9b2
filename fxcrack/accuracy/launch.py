"""Runs settings in processes of their own, under time limits, so that a study never hangs.

A worker serves all settings with the same number of ranks, so that Python starts once for them. One
that ends, takes too long or fails on one of several ranks is ended with all its ranks, and the next
setting gets a new one.
"""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import tempfile
import time
from dataclasses import replace
from typing import Any

from fxcrack.accuracy.study import Setting
from fxcrack.accuracy.worker import MARK
from fxcrack.base import processes
from fxcrack.base.errors import FxcrackError

_GRACE = 2.0  # seconds between asking a worker to end and ending it
START_LIMIT = 60.0
"""Seconds a worker may take to start: imports on a cold disk."""


class SettingFailed(FxcrackError):
    """A setting gave no result; the message says why."""


class Refused(SettingFailed):
    """It raised an error, and its process is ready for the next one."""


class TookTooLong(SettingFailed):
    """It did not end within its time limit."""


class _Worker:
    """One running worker."""

    def __init__(self, scene: str, ranks: int, limit: float) -> None:
        words = processes.command("fxcrack.accuracy.worker", [scene], ranks)
        if words is None:
            raise SettingFailed(f"no mpiexec found to start {ranks} ranks")
        self.log = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.log,
            env=processes.environment(), start_new_session=True,
        )  # fmt: skip
        assert self.process.stdout is not None
        os.set_blocking(self.process.stdout.fileno(), False)
        self._buffer = b""
        try:
            self._answer(limit)
        except SettingFailed:
            self.end()
            raise

    def ask(self, setting: Setting, limit: float) -> dict[str, Any]:
        """Run a setting.

        Raises:
            SettingFailed: It failed, or took longer than the limit (seconds).
        """
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(json.dumps(setting.as_dict()).encode() + b"\n")
            self.process.stdin.flush()
        except OSError as error:
            raise SettingFailed(f"the worker has ended: {self._last_error_line()}") from error
        answer = self._answer(limit)
        if "error" in answer:
            raise Refused(str(answer["error"]))
        result: dict[str, Any] = answer["result"]
        return result

    def _answer(self, limit: float) -> dict[str, Any]:
        """The next line of the worker that is an answer."""
        deadline = time.monotonic() + limit
        stream = self.process.stdout
        assert stream is not None
        with selectors.DefaultSelector() as wait:
            wait.register(stream, selectors.EVENT_READ)
            while True:
                line, newline, rest = self._buffer.partition(b"\n")
                if newline:
                    self._buffer = rest
                    text = line.decode(errors="replace")
                    if text.startswith(MARK):
                        answer: dict[str, Any] = json.loads(text[len(MARK) :])
                        return answer
                    continue
                left = deadline - time.monotonic()
                if left <= 0.0:
                    raise TookTooLong(f"stopped after {limit:.1f} s, its time limit")
                if wait.select(left):
                    piece = stream.read()
                    if piece == b"":
                        raise SettingFailed(f"its process ended: {self._last_error_line()}")
                    self._buffer += piece or b""

    def _last_error_line(self) -> str:
        """The last line the worker wrote to its standard error."""
        self.log.seek(0)
        lines = [w.strip() for w in self.log.read().decode(errors="replace").splitlines()]
        return next((w for w in reversed(lines) if w), "it wrote nothing")

    def end(self) -> None:
        """End all ranks: by the end of input, then by signals."""
        if self.process.stdin is not None:
            with contextlib.suppress(OSError):
                self.process.stdin.close()
        for how in (None, signal.SIGTERM, signal.SIGKILL):
            if how is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self.process.pid, how)
            try:
                self.process.wait(_GRACE)
                break
            except subprocess.TimeoutExpired:
                continue
        if self.process.stdout is not None:
            self.process.stdout.close()
        self.log.close()


class Workers:
    """Runs settings of one study; :meth:`close` ends its processes (``contextlib.closing``).

    Args:
        scene: Name of the study, as for :func:`fxcrack.accuracy.load.load`.
        warm: A cheap setting that each new worker runs first, unmeasured: libraries are loaded on
            first use.
    """

    def __init__(self, scene: str, warm: Setting | None = None) -> None:
        self._scene = scene
        self._warm = warm
        self._running: dict[int, _Worker] = {}

    def close(self) -> None:
        """End all workers."""
        for ranks in list(self._running):
            self._drop(ranks)

    def run(self, setting: Setting, limit: float) -> dict[str, Any]:
        """Run a setting within a time limit (seconds); see :func:`fxcrack.accuracy.worker.run`.

        Raises:
            SettingFailed: It gave no result.
        """
        ranks = setting.ranks
        begin = time.monotonic()
        if ranks not in self._running and self._warm is not None:
            with contextlib.suppress(SettingFailed):  # it fails again when its turn comes
                self._ask(replace(self._warm, ranks=ranks), limit)
        return self._ask(setting, max(limit - (time.monotonic() - begin), 0.0))

    def started(self, ranks: int) -> bool:
        """Whether a worker with this number of ranks waits for work."""
        return ranks in self._running

    def _ask(self, setting: Setting, limit: float) -> dict[str, Any]:
        ranks = setting.ranks
        try:
            if ranks not in self._running:
                self._running[ranks] = _Worker(self._scene, ranks, min(limit, START_LIMIT))
            return self._running[ranks].ask(setting, limit)
        except SettingFailed as error:
            if ranks > 1 or not isinstance(error, Refused):
                self._drop(ranks)
            raise

    def _drop(self, ranks: int) -> None:
        worker = self._running.pop(ranks, None)
        if worker is not None:
            worker.end()
