"""Settings for every test, and what makes a run on several ranks honest.

On several ranks the same tests run in the same order everywhere. After each phase of a test the
ranks agree on its outcome: a test that fails on one rank fails on all, and a rank that failed while
another is stuck in a collective call ends the job instead of hanging with it.

No test may take longer than its limit, see LIMITS. One that does is named, with the lines at which
each rank stands, and ends the job on all ranks. A failure is named when it happens, so that a run
which is cut short has told what failed until then.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # ranks share the cores
os.environ.setdefault("MPLBACKEND", "Agg")

import faulthandler
import fnmatch
import gc
import signal
import sys
import time
import zlib
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TextIO

import fxcrack  # noqa: F401 - before petsc4py

# isort: split
import hypothesis
import pytest
from mpi4py import MPI

from fxcrack.base import collective_garbage, log
from fxcrack.base.parallel import end_all

# Same examples on every rank and in every run; compilation of forms makes first examples slow.
hypothesis.settings.register_profile("fxcrack", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("fxcrack")

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # A shell gave it to a job in the background; tests send it.
    signal.signal(signal.SIGINT, signal.default_int_handler)

WORLD = MPI.COMM_WORLD
PATIENCE = 30.0  # seconds a failed rank waits for the others: longer than compiling a form

# Its own communicator: a test cut short by an error cannot mix up its messages.
OUTCOMES = WORLD.Dup()

LIMITS = {"quick": 120.0, "slow": 600.0}
"""Seconds one test may take: ten times what the longest ones need. They grow with the load of the
machine; FXCRACK_TEST_PATIENCE, a number, multiplies them on one that is slow by itself."""


class Watchdog:
    """Ends this process, and with it all ranks, when a test exceeds its limit.

    The timer of faulthandler is a thread in C. A timer in Python would wait for the interpreter
    lock, which calls into PETSc and DOLFINx keep, also those that never return.

    The folder FXCRACK_TESTS_RUNNING, if set, holds one file per process: the test it runs and, past
    the limit, where it stands. It tells which test a process that died was running, too.
    """

    def __init__(self, patience: float, folder: str | None) -> None:
        self.patience = patience
        self._file: TextIO
        if folder is None:
            self._file = os.fdopen(os.dup(2), "w")  # 2 itself is captured during tests
        else:
            self._file = (Path(folder) / f"rank{WORLD.rank}-{os.getpid()}").open("w")
        self._named = folder is not None

    def start(self, item: pytest.Item) -> None:
        """Give the test all of its time."""
        kind = "slow" if item.get_closest_marker("slow") else "quick"
        load = os.getloadavg()[0] / (os.cpu_count() or 1)
        limit = LIMITS[kind] * self.patience * max(1.0, load)
        if self._named:
            self._write(f"{item.nodeid} - cut short on rank {WORLD.rank}, limit {limit:.3g} s\n")
        faulthandler.dump_traceback_later(limit, exit=True, file=self._file)

    def stop(self) -> None:
        """The test has ended."""
        faulthandler.cancel_dump_traceback_later()
        if self._named:
            self._write("")

    def _write(self, text: str) -> None:
        self._file.seek(0)
        self._file.truncate()
        self._file.write(text)
        self._file.flush()


WATCHDOG = pytest.StashKey[Watchdog]()


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    config.stash[WATCHDOG] = Watchdog(
        float(os.environ.get("FXCRACK_TEST_PATIENCE", "1")), os.environ.get("FXCRACK_TESTS_RUNNING")
    )
    if WORLD.rank > 0:  # rank 0 speaks for all
        config.pluginmanager.unregister(name="terminalreporter")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    watchdog = item.config.stash[WATCHDOG]
    watchdog.start(item)
    try:
        return (yield)
    finally:
        watchdog.stop()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    item.config.stash[WATCHDOG].start(item)  # pytest stops the timer after a failure


class FailuresAtOnce:
    """Names each failed test when it fails."""

    def __init__(self, terminal: pytest.TerminalReporter) -> None:
        self._terminal = terminal

    @pytest.hookimpl(trylast=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Write one line below the dots."""
        if report.failed:
            crash = getattr(report.longrepr, "reprcrash", None)
            why = (crash.message if crash else str(report.longrepr)).partition("\n")[0]
            word = "FAILED" if report.when == "call" else "ERROR"
            self._terminal.ensure_newline()
            self._terminal.write_line(f"{word} {report.nodeid} - {why}")
            self._terminal.flush()


def pytest_sessionstart(session: pytest.Session) -> None:
    plugins = session.config.pluginmanager
    if terminal := plugins.getplugin("terminalreporter"):
        plugins.register(FailuresAtOnce(terminal))


@pytest.hookimpl(wrapper=True)
def pytest_pycollect_makeitem(
    collector: pytest.Collector,
) -> Generator[None, object, object]:
    """Mark as slow what the mark "quick" of a test leaves out."""
    made = yield
    items = [i for i in made if isinstance(i, pytest.Item)] if isinstance(made, list) else []
    quick = items[0].get_closest_marker("quick") if items else None
    if quick is None:
        return made
    names = [item.name.partition("[")[2].removesuffix("]") for item in items]
    for pattern in quick.args:
        if not fnmatch.filter(names, pattern):
            raise collector.CollectError(f"quick: {pattern!r} is none of {', '.join(names)}")
    for item, name in zip(items, names, strict=True):
        if not any(fnmatch.fnmatchcase(name, pattern) for pattern in quick.args):
            item.add_marker("slow")
    return made


@pytest.hookimpl(trylast=True)  # after those that -m leaves out
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With FXCRACK_TEST_SPREAD, leave some tests to the run on another number of ranks.

    "quick" has the tests marked "three" that are not slow: of those without parameters every other
    one runs on 2 ranks and the rest on 3, and so do the parameters of a test. "slow" has what is
    left: tests of the quick run without parameters, on the number of ranks they did not have, and
    the slow ones. Of these, 3 ranks have every fourth test of a file that has no parameters, and
    every fourth parameter (of two the first): they share the two cores of a small machine and take
    three times as long as 2 ranks, which have all tests without parameters and the other
    parameters. What bears the mark "each" is not spread.
    """
    spread = os.environ.get("FXCRACK_TEST_SPREAD")
    if spread is None or WORLD.size not in (2, 3):
        return
    here: set[pytest.Item] = set()
    files: dict[str, dict[str, list[pytest.Item]]] = {}
    for item in items:
        file, _, name = item.nodeid.partition("::")
        functions = files.setdefault(file, {})
        if item.get_closest_marker("each"):
            here.add(item)
        else:
            functions.setdefault(name.partition("[")[0], []).append(item)
    for functions in files.values():
        singles = 0
        for same in functions.values():
            quick = [item for item in same if _is_quick_on_ranks(item)]
            if spread == "quick":
                here |= {item for i, item in enumerate(quick) if _is_here_when_quick(item, i)}
                continue
            if len(quick) == 1 and not _is_here_when_quick(quick[0], 0):
                here |= set(quick)
            slow = [item for item in same if not _is_quick_on_ranks(item)]
            if len(slow) == 1:
                here |= set(slow) if WORLD.size == 2 or singles % 4 == 0 else set()
                singles += 1
            else:
                every = 2 if len(slow) == 2 else 4
                here |= {x for i, x in enumerate(slow) if (i % every == 0) == (WORLD.size == 3)}
    config.hook.pytest_deselected(items=[item for item in items if item not in here])
    items[:] = [item for item in items if item in here]


def _is_quick_on_ranks(item: pytest.Item) -> bool:
    return bool(item.get_closest_marker("three")) and not item.get_closest_marker("slow")


def _is_here_when_quick(item: pytest.Item, i: int) -> bool:
    """For the i-th parameter of a test; the same whatever else is collected."""
    name = item.nodeid.partition("[")[0]
    return 2 + (zlib.crc32(name.encode()) + i) % 2 == WORLD.size


def pytest_collection_finish(session: pytest.Session) -> None:
    gc.freeze()  # collections between tests need not visit what the imports made
    names = [item.nodeid for item in session.items]
    if len({tuple(n) for n in OUTCOMES.allgather(names)}) > 1:
        pytest.exit("the ranks collected different tests", returncode=3)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if WORLD.size > 1:
        _wait_for_all(item, report)
        outcomes = OUTCOMES.allgather((report.outcome, report.longreprtext))
        if any(outcome != report.outcome for outcome, _ in outcomes):
            report.outcome = "failed"
            heading = ", ".join(f"{outcome} on rank {r}" for r, (outcome, _) in enumerate(outcomes))
            report.longrepr = "\n".join([heading, *(text for _, text in outcomes if text)])
    return report


def _wait_for_all(item: pytest.Item, report: pytest.TestReport) -> None:
    """Wait until all ranks end this phase; a failed rank ends the job when they do not."""
    deadline = time.monotonic() + PATIENCE
    arrived = OUTCOMES.Ibarrier()
    while not arrived.Test():
        if report.failed and time.monotonic() > deadline:
            with item.config.pluginmanager.getplugin(
                "capturemanager"
            ).global_and_fixture_disabled():
                print(f"\n{item.nodeid} failed on rank {WORLD.rank}, others hang", file=sys.stderr)
                print(report.longreprtext, file=sys.stderr, flush=True)
            end_all(WORLD, 1)
        time.sleep(0.001)  # leave the core to ranks that still work


@pytest.fixture
def comm() -> MPI.Comm:
    """Communicator of all ranks."""
    return WORLD


@pytest.fixture
def shared_path(comm: MPI.Comm, tmp_path: Path) -> Path:
    """Empty folder, the same on all ranks."""
    return Path(comm.bcast(str(tmp_path)))


@pytest.fixture(autouse=True)
def _free_petsc_objects() -> Iterator[None]:
    """Free the PETSc objects of a test on all ranks together: freeing them is collective."""
    yield
    gc.collect()
    collective_garbage.collect(WORLD)
    WORLD.Barrier()


@pytest.fixture(autouse=True)
def _log_is_as_before() -> Iterator[None]:
    """Give the log back the level and the handlers that a test has changed."""
    level, handlers = log.logger.level, log.logger.handlers[:]
    yield
    log.logger.setLevel(level)
    log.logger.handlers[:] = handlers
