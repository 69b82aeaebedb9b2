"""Settings for every test, and what makes a run on several ranks honest.

On several ranks the same tests run in the same order everywhere. After each phase of a test the
ranks agree on its outcome: a test that fails on one rank fails on all, and a rank that failed while
another is stuck in a collective call ends the job instead of hanging with it.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # ranks share the cores
os.environ.setdefault("MPLBACKEND", "Agg")

import gc
import sys
import time
from collections.abc import Generator, Iterator
from pathlib import Path

import fxcrack  # noqa: F401 - before petsc4py

# isort: split
import hypothesis
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.parallel import end_all

# Same examples on every rank and in every run; compilation of forms makes first examples slow.
hypothesis.settings.register_profile("fxcrack", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("fxcrack")

WORLD = MPI.COMM_WORLD
PATIENCE = 30.0  # seconds a failed rank waits for the others: longer than compiling a form

# Its own communicator: a test cut short by an error cannot mix up its messages.
OUTCOMES = WORLD.Dup()


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    if WORLD.rank > 0:  # rank 0 speaks for all
        config.pluginmanager.unregister(name="terminalreporter")


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
    PETSc.garbage_cleanup()
    WORLD.Barrier()
