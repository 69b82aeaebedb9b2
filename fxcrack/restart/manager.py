"""What is left when a job ends early: checkpoints, the history on disk, an orderly stop.

Between two increments or releases nothing is half done. There all ranks agree, by one reduction,
whether a checkpoint is due, a file could not be written, or a signal asks to stop.
"""

from __future__ import annotations

import importlib.metadata
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.errors import FxcrackError, InputError, raise_on_all_ranks
from fxcrack.base.files import check_writable
from fxcrack.base.parallel import all_or_none
from fxcrack.base.signals import Interrupted, Listener
from fxcrack.restart.checkpoint import Checkpoint, Saved, next_of_folder, read, write
from fxcrack.restart.fingerprint import differences, fingerprint, summary
from fxcrack.restart.history_file import HistoryFile
from fxcrack.restart.scene_state import (
    Packed,
    apply_after_condensation,
    apply_before_condensation,
    collect,
)
from fxcrack.steps.analysis import Analysis

_MALFORMED = (
    *(ArithmeticError, AssertionError, AttributeError, LookupError),
    *(MemoryError, StopIteration, TypeError, ValueError),
)
"""What plain values raise that are not those which this program writes."""


@contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Say that a checkpoint is none, where what it holds cannot be put into the analysis.

    What it holds is the same on every rank, and so is the error.
    """
    try:
        yield
    except FxcrackError:
        raise
    except _MALFORMED as error:
        raise InputError(
            f"{path} is no checkpoint of fxcrack that fits this scene ({type(error).__name__}: "
            f"{error}); give another file, or run without restart"
        ) from error


class RestartManager:
    """Saves one step of an analysis and resumes it; a context manager around its run.

    Args:
        analysis: The analysis, with its cracks; not yet prepared for the step.
        files: What the steps of the scene share.
        step: The step.
        grow: Which debonds may grow.
        checkpoint: Where the state is written, if anywhere.
        restart: Continue from the checkpoint, if there is one.
        save: Where the history is written while the step runs, if anywhere.

    Attributes:
        progress: Progress of the step to continue from, ``None`` if it begins.
        finished: Why the step ended, if the checkpoint is that of its end; else empty.

    Raises:
        InputError: The checkpoint belongs to another scene or step, or cannot be read.
    """

    def __init__(
        self,
        analysis: Analysis,
        files: RunFiles,
        step: Any,
        grow: list[bool],
        *,
        checkpoint: Checkpoint | None,
        restart: bool,
        save: str | Path | None,
    ) -> None:
        if restart and checkpoint is None:
            raise InputError(
                "restart=True needs checkpoint=fx.Checkpoint(path): where to go on from"
            )
        self._analysis = analysis
        self._files = files
        self._comm = analysis.comm
        self._checkpoint = checkpoint
        self._file = None if save is None else HistoryFile(analysis.history, save)
        with all_or_none(self._comm, "before the run", InputError):
            if self._comm.rank == 0:
                if save is not None:
                    check_writable("save", save)
                if checkpoint is not None:
                    check_writable("the checkpoint", checkpoint.file(files.steps))
        self._listener = Listener()
        self._stack = ExitStack()
        self._count, self._last = 0, time.monotonic()
        self._print: dict[str, Any] = {}
        self._saved: Saved | None = None
        self._packed = Packed()
        self.progress: dict[str, Any] | None = None
        self.finished = ""
        if checkpoint is not None:
            self._print = fingerprint(analysis, step, grow)
            if restart:
                self._open(checkpoint)
        if self.finished and self._file is not None:
            raise_on_all_ranks(self._comm, self._file.update(last=True), FxcrackError)

    @property
    def wanted(self) -> bool:
        """Whether anything is kept."""
        return self._checkpoint is not None or self._file is not None

    def _open(self, checkpoint: Checkpoint) -> None:
        """Read the checkpoint of the step and put the analysis into its state."""
        files, path = self._files, checkpoint.file(self._files.steps)
        saved = read(self._comm, path)
        if saved is None:
            log.warn("no checkpoint %s to go on from: the step begins at its beginning", path)
            return
        if files.steps > 1 and saved.about["run"] != files.run_id:
            log.warn("checkpoint %s is of another run: the step begins at its beginning", path)
            return
        found = differences(saved.about["scene"], self._print)
        if found:
            if all(name.startswith("step.") for name in found):
                raise InputError(
                    f"checkpoint {path} belongs to another step of this scene: {summary(found)}. "
                    "To go further than it went, run the step as it was with restart=True, which "
                    "goes on from the checkpoint, and then this one; or run without restart"
                )
            raise InputError(
                f"checkpoint {path} belongs to another scene: {summary(found)}. Run without "
                "restart, or correct the scene"
            )
        with _refused(path):
            apply_before_condensation(self._analysis, saved)
        files.run_id = saved.about["run"]
        self._saved = saved
        self.progress = saved.about["progress"]
        self.finished = saved.about["finished"]
        log.info("going on from %s, time %g", path, self._analysis.time)

    @property
    def resumes(self) -> bool:
        """Whether the step continues from a checkpoint."""
        return self.progress is not None

    def put_in_equilibrium(self) -> None:
        """Find the saved equilibrium on the retained jumps."""
        assert self._saved is not None
        assert self._checkpoint is not None
        with _refused(self._checkpoint.file(self._files.steps)):
            apply_after_condensation(self._analysis, self._saved)
        self._saved = None

    def __enter__(self) -> RestartManager:
        """Listen to signals from now on."""
        if self.wanted:
            self._stack.enter_context(self._listener)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give signals back."""
        self._stack.close()

    def checkpoint_point(self, progress: dict[str, Any]) -> None:
        """Save what is due, stop if a signal came; collective.

        Args:
            progress: What the step needs to continue from here, plain values.

        Raises:
            Interrupted: A signal came on some rank.
            FxcrackError: A file could not be written.
        """
        problem = None if self._file is None else self._file.update()
        flags = np.array([self._listener.signum, problem is not None, self._due()], dtype=np.int64)
        if self._comm.size > 1:
            self._comm.Allreduce(MPI.IN_PLACE, flags, op=MPI.MAX)
        signum, failed, due = flags.tolist()
        if failed:
            raise_on_all_ranks(self._comm, problem, FxcrackError)
        if signum:
            raise Interrupted(signum, self._save_all(progress))
        if due:
            self._save(progress, "")

    def finish(self, reason: str) -> None:
        """Save the end of the step; collective."""
        if self._file is not None:
            raise_on_all_ranks(self._comm, self._file.update(last=True), FxcrackError)
        if self._checkpoint is not None:
            self._save({}, reason)

    def _due(self) -> bool:
        """Whether a checkpoint is due, as rank 0 sees it."""
        checkpoint = self._checkpoint
        self._count += 1
        if checkpoint is None or self._comm.rank > 0 or self._count == 1:
            return False
        by_count = checkpoint.every is not None and (self._count - 1) % checkpoint.every == 0
        return by_count or time.monotonic() >= self._last + checkpoint.seconds

    def _save(self, progress: dict[str, Any], reason: str) -> None:
        assert self._checkpoint is not None
        saved = collect(self._analysis, self._packed)
        about = {
            "fxcrack": importlib.metadata.version("fxcrack"),
            "run": self._files.run_id,
            "finished": reason,
            "scene": self._print,
            "progress": progress,
        }
        saved.about = {**about, **saved.about}
        write(self._comm, self._checkpoint.file(self._files.steps), saved)
        self._last = time.monotonic()

    def _save_all(self, progress: dict[str, Any]) -> str:
        """Save everything and report what and where."""
        kept = []
        if self._file is not None:
            raise_on_all_ranks(self._comm, self._file.update(last=True), FxcrackError)
            kept.append(f"history in {self._file.path}")
        if self._checkpoint is not None:
            self._save(progress, "")
            kept.append(f"restart goes on from {self._checkpoint.file(self._files.steps)}")
        return ", ".join(kept)


@dataclass
class RunFiles:
    """The run of a scene, and the files of its steps where they are not given step by step.

    Attributes:
        steps: Number of steps begun.
        run_id: Distinguishes this run from others that write to the same files.
        default: Checkpoint, history file and restart for all steps, if there are such.
    """

    steps: int = 0
    run_id: str = ""
    default: tuple[Checkpoint, Path, bool] | None = None

    def manager(
        self,
        analysis: Analysis,
        step: Any,
        grow: list[bool],
        checkpoint: Checkpoint | None,
        restart: bool,
        save: str | Path | None,
    ) -> RestartManager:
        """The restart manager of the next step; collective.

        Arguments as for :class:`RestartManager`. Without a checkpoint of its own, a step takes that
        of :func:`fxcrack.restart.checkpoint.checkpoints`.
        """
        self.steps += 1
        if self.steps == 1:
            self.run_id = analysis.comm.bcast(uuid.uuid4().hex)
            self.default = next_of_folder()
        if checkpoint is None and self.default is not None:
            checkpoint, path, restart = self.default
            save = save or path
        return RestartManager(
            analysis, self, step, grow, checkpoint=checkpoint, restart=restart, save=save
        )
