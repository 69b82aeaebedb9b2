"""The process in which settings run, one at a time.

    python -m fxcrack.accuracy.worker SCENE

It reads a setting per line as JSON, and answers with one line that begins with :data:`MARK`. On
several ranks rank 0 reads and writes. Seconds are those of the slowest rank, from calling the scene
function to the end of the step; the start of Python and the compilation of forms are not in them.
Memory is the highest resident size in a phase, summed over ranks.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import fxcrack  # isort: skip  (orders MPI before DOLFINx)
from mpi4py import MPI

from fxcrack.accuracy.load import load
from fxcrack.accuracy.study import Setting, Study
from fxcrack.base.machine import peak_memory, reset_peak_memory
from fxcrack.base.parallel import all_arrive, slowest
from fxcrack.history import Row

MARK = "@fxcrack-accuracy "
REPEATS = 3
"""A run shorter than the limit is measured so often, and the fastest counts."""
SHORT = 0.5
"""The limit, seconds."""
_COMPILED = 0.05  # seconds: forms found compiled take milliseconds
_POLL = 0.002  # seconds between two looks for a message: waiting ranks leave the cores to others
_PATIENCE = 1.0  # seconds a failed rank waits for the others to fail too
_TAG = 7

Result = dict[str, Any]


@dataclass
class Memory:
    """Highest resident size by phase, MB, summed over ranks; all methods are collective."""

    comm: MPI.Intracomm

    def __post_init__(self) -> None:
        """Give back what earlier runs left, and begin anew."""
        gc.collect()
        trim: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
        self.by_phase: dict[str, float] = {}
        self.separate = self.comm.allreduce(int(reset_peak_memory()), op=MPI.MIN) == 1

    def end(self, phase: str) -> None:
        """A phase ends here."""
        self.by_phase[phase] = peak_memory(self.comm)
        reset_peak_memory()


def run_once(study: Study, setting: Setting, comm: MPI.Intracomm, *, memory: bool) -> Result:
    """Run a setting and measure it; collective."""
    peaks = Memory(comm)
    base = peak_memory(comm)
    comm.Barrier()
    begin = time.perf_counter()
    case = study(setting)
    made = time.perf_counter()
    if memory:
        peaks.end("setup")

    def watch(event: str, row: Row) -> None:
        if event == "start" and memory:
            peaks.end("factor")

    ran = time.perf_counter()
    history = case.scene.run(case.step, progress=False, observers=[watch])
    end = time.perf_counter()
    if memory:
        peaks.end("growth")
    values = case.measure(history).values()
    details = history.details
    phases = dict(details["seconds"])
    compiled = phases.pop("compile", 0.0)
    phases.pop("factor_inner", None)  # part of the phase that asked for it
    seconds = {"setup": made - begin}
    for name, value in phases.items():
        key = "factor" if name.startswith("factor") else name
        seconds[key] = seconds.get(key, 0.0) + value
    total = made - begin + end - ran - compiled
    left = total - sum(seconds.values())
    if left < 0.0 and "growth" in seconds:
        seconds["growth"] += left  # columns of S computed during growth count as columns
    seconds["other"] = max(left, 0.0)
    case.scene.close()
    theory = case.theory
    return {
        "values": values,
        "theory": None
        if theory is None
        else {
            "source": theory.source, "exact": theory.exact, "values": theory.measured.values(),
        },
        "dofs": int(details["dofs"]),
        "retained": int(details["retained"]),
        "releases": int(details["releases"]),
        "factorizations": int(details["factorizations"]),
        "seconds": slowest(comm, total),
        "phases": {k: slowest(comm, v) for k, v in seconds.items()},
        "compile": slowest(comm, compiled),
        "memory": {k: max(v - base, 0.0) for k, v in peaks.by_phase.items()},
        "memory_at_start": base,
        "memory_by_phase": peaks.separate,
    }  # fmt: skip


def run(study: Study, setting: Setting, comm: MPI.Intracomm) -> Result:
    """Run a setting, a short one several times; the fastest counts; collective."""
    result = run_once(study, setting, comm, memory=True)
    if result["compile"] > _COMPILED:  # elements were compiled as well, outside of that phase
        result = run_once(study, setting, comm, memory=True)
    repeats = 1
    if result["seconds"] < SHORT:
        for _ in range(REPEATS - 1):
            again = run_once(study, setting, comm, memory=False)
            repeats += 1
            if again["seconds"] < result["seconds"]:
                result |= {k: again[k] for k in ("seconds", "phases")}
    return {**result, "repeats": repeats}


def _next(comm: MPI.Intracomm, parent: int) -> dict[str, Any] | None:
    """The next setting, on all ranks; ``None`` at the end. Waiting ranks sleep."""
    if comm.rank == 0:
        text = sys.stdin.readline()
        request: dict[str, Any] | None = json.loads(text) if text.strip() else None
        for rank in range(1, comm.size):
            comm.send(request, dest=rank, tag=_TAG)
        return request
    while not comm.Iprobe(source=0, tag=_TAG):
        if os.getppid() != parent:
            os._exit(1)  # the parent process has ended
        time.sleep(_POLL)
    received: dict[str, Any] | None = comm.recv(source=0, tag=_TAG)
    return received


def main() -> None:
    """Serve until the input ends.

    After an error on several ranks the parent process, which reads the answers, ends them all: some
    of them may wait for ever, and an abort from here may overtake the answer.
    """
    comm = MPI.COMM_WORLD
    failures = comm.Dup()  # collectives of failed ranks do not mix with those of the others
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # the output of libraries must not mix with the answers
    parent = os.getppid()
    study = load(sys.argv[1])
    gc.collect()
    gc.freeze()  # collections between runs need not visit what the imports made
    if comm.rank == 0:
        print(MARK + json.dumps({"ready": fxcrack.__version__}), file=answers, flush=True)
    unequal = False
    while (request := _next(comm, parent)) is not None:
        answer: dict[str, Any]
        try:
            answer = {"result": run(study, Setting(**request), comm)}
        except Exception as error:  # a scene function may raise anything: the study continues
            answer = {"error": f"{type(error).__name__}: {error}"}
        if comm.rank == 0 or ("error" in answer and not all_arrive(failures, _PATIENCE)):
            print(MARK + json.dumps(answer), file=answers, flush=True)
        if comm.rank == 0 and "error" in answer:
            unequal = not all_arrive(failures, _PATIENCE)
        gc.collect()
    if unequal:
        comm.Abort(1)


if __name__ == "__main__":
    main()
