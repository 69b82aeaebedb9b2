"""What survives when a job ends early: checkpoints, the history on disk, an orderly stop.

A step rests between two increments or releases. There all ranks agree, by one small reduction,
whether a checkpoint is due, a file could not be written, or a signal asks to stop.
"""

from __future__ import annotations

import importlib.metadata
import time
import uuid
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.errors import FxcrackError, InputError, raise_on_all_ranks
from fxcrack.base.signals import Interrupted, Listener
from fxcrack.restart.checkpoint import Checkpoint, Saved, next_of_folder, read, write
from fxcrack.restart.fingerprint import differences, fingerprint, summary
from fxcrack.restart.history_file import HistoryFile
from fxcrack.restart.scene_state import apply_after_condensation, apply_before_condensation, collect
from fxcrack.steps.driver import StepDriver

if TYPE_CHECKING:
    from fxcrack.scene import Scene


class RestartManager:
    """Keeps one step of a scene; a context manager around its march.

    Args:
        scene: The scene, with its cracks; not yet prepared for the step.
        step: The step.
        grow: Which debonds may grow.
        checkpoint: Where the state goes, if anywhere.
        restart: Go on from the checkpoint, if there is one.
        save: Where the history goes while the step runs, if anywhere.

    Attributes:
        wanted: Whether there is anything to keep; without, nothing is done at all.
        resume: Books to go on from, ``None`` if the step begins.
        finished: Why the step ended, if the checkpoint is that of its end; else empty.

    Raises:
        InputError: The checkpoint belongs to another scene or step, or cannot be read.
    """

    def __init__(
        self,
        scene: Scene,
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
        self._scene = scene
        self._comm = scene.mesh.comm
        self._checkpoint = checkpoint
        self._file = None if save is None else HistoryFile(scene.history, save)
        self._listener = Listener()
        self._stack = ExitStack()
        self._count, self._last = 0, time.monotonic()
        self._print: dict[str, Any] = {}
        self._saved: Saved | None = None
        self.resume: dict[str, Any] | None = None
        self.finished = ""
        if checkpoint is not None:
            self._print = fingerprint(scene, step, grow)
            if restart:
                self._open(checkpoint)
        if self.finished and self._file is not None:
            raise_on_all_ranks(self._comm, self._file.update(last=True), FxcrackError)

    @property
    def wanted(self) -> bool:
        """Whether anything is kept."""
        return self._checkpoint is not None or self._file is not None

    def _open(self, checkpoint: Checkpoint) -> None:
        """Read the checkpoint of the step and put the scene into its state."""
        scene, path = self._scene, checkpoint.file(self._scene.steps)
        saved = read(self._comm, path)
        if saved is None:
            log.warn("no checkpoint %s to go on from: the step begins at its beginning", path)
            return
        if scene.steps > 1 and saved.about["run"] != scene.run_id:
            log.warn("checkpoint %s is of another run: the step begins at its beginning", path)
            return
        found = differences(saved.about["scene"], self._print)
        if found:
            raise InputError(
                f"checkpoint {path} belongs to another scene: {summary(found)}. Run without "
                "restart, or mend the scene"
            )
        scene.run_id = saved.about["run"]
        apply_before_condensation(scene, saved)
        self._saved = saved
        self.resume = saved.about["books"]
        self.finished = saved.about["finished"]
        log.info("going on from %s, time %g", path, saved.about["books"]["time"])

    def put_in_equilibrium(self) -> None:
        """Find the saved equilibrium in the window of the scene."""
        assert self._saved is not None
        apply_after_condensation(self._scene, self._saved)
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

    def checkpoint_point(self, march: StepDriver) -> None:
        """Save what is due, stop if a signal came; collective.

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
            raise Interrupted(signum, self._keep_all(march))
        if due:
            self._save(march, "")

    def finish(self, march: StepDriver, reason: str) -> None:
        """Save the end of the step; collective."""
        if self._file is not None:
            raise_on_all_ranks(self._comm, self._file.update(last=True), FxcrackError)
        if self._checkpoint is not None:
            self._save(march, reason)

    def _due(self) -> bool:
        """Whether a checkpoint is due, as rank 0 sees it."""
        checkpoint = self._checkpoint
        self._count += 1
        if checkpoint is None or self._comm.rank > 0 or self._count == 1:
            return False
        by_count = checkpoint.every is not None and (self._count - 1) % checkpoint.every == 0
        return by_count or time.monotonic() >= self._last + checkpoint.seconds

    def _save(self, march: StepDriver, reason: str) -> None:
        scene = self._scene
        assert self._checkpoint is not None
        saved = collect(scene, march.carried())
        version = importlib.metadata.version("fxcrack")
        about = {"fxcrack": version, "run": scene.run_id, "finished": reason, "scene": self._print}
        saved.about = {**about, **saved.about}
        write(self._comm, self._checkpoint.file(scene.steps), saved)
        self._last = time.monotonic()

    def _keep_all(self, march: StepDriver) -> str:
        """Save everything; says what and where."""
        kept = []
        if self._file is not None:
            raise_on_all_ranks(self._comm, self._file.update(last=True), FxcrackError)
            kept.append(f"history in {self._file.path}")
        if self._checkpoint is not None:
            self._save(march, "")
            kept.append(f"restart goes on from {self._checkpoint.file(self._scene.steps)}")
        return ", ".join(kept)


def restart_manager(
    scene: Scene,
    step: Any,
    grow: list[bool],
    checkpoint: Checkpoint | None,
    restart: bool,
    save: str | Path | None,
) -> RestartManager:
    """The keeper of the next step of a scene; collective.

    Arguments as for :class:`RestartManager`. Without a checkpoint of its own, a scene takes that of
    :func:`fxcrack.restart.checkpoint.checkpoints`.
    """
    scene.steps += 1
    if scene.steps == 1:
        scene.run_id = scene.mesh.comm.bcast(uuid.uuid4().hex)
        scene.kept = next_of_folder()
    if checkpoint is None and scene.kept is not None:
        checkpoint, path, restart = scene.kept
        save = save or path
    return RestartManager(scene, step, grow, checkpoint=checkpoint, restart=restart, save=save)
