"""The log: levels, names, what DEBUG says; progress with and without a terminal."""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from mpi4py import MPI
from specimens import dcb

import fxcrack as fx
from fxcrack import step_run
from fxcrack.base import log, machine
from fxcrack.base.machine import threads_share_cores
from fxcrack.history import Row
from fxcrack.steps import progress
from fxcrack.steps.progress import Progress, clock, describe
from fxcrack.steps.share_done import ShareDone

BOND = fx.Interface(slave="up", master="low", bonded=lambda x: x[0] > 1.0, name="bond")


def row(a: float, time: float = 1.0, released: int = 0) -> Row:
    return {
        **{"time": time, "event": "onset", "u[pin.y]": time, "R[pin.y]": 3.0},
        **{"a[bond]": a, "released[bond]": released, "f[bond]": 1.0},
    }


@pytest.mark.parametrize(
    ("step", "last", "part"),
    [
        (fx.Static(fx.CrackLength(BOND, 20.0)), row(12.5), 0.25),
        (fx.Static(fx.Releases(8)), row(11.0, released=2), 0.25),
        (fx.Static(fx.Time(3.0), stepping="increment"), row(10.0, time=2.0), 0.5),
        # the condition that is nearest to be met
        (fx.Static([fx.Time(3.0), fx.CrackLength(BOND, 20.0)]), row(19.0, time=2.0), 0.9),
        # time is a load factor that falls as well
        (fx.Static(fx.Time(3.0), stepping="path"), row(12.0, time=2.0), None),
        (fx.Cycles(n_max=100.0, maximum=1.0, minimum=0.0), row(12.0), None),
    ],
)
def test_the_part_of_a_step_that_is_done(step: Any, last: Row, part: float | None) -> None:
    share = ShareDone(step)
    share.update(row(10.0))
    share.update(last)
    assert share.part == (None if part is None else pytest.approx(part, rel=1e-12))


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As where nobody has configured logging; pytest has handlers at every logger."""
    monkeypatch.setattr(log.progress, "hasHandlers", lambda: False)
    level = log.progress.level
    log.progress.setLevel(logging.NOTSET)
    yield
    log.progress.setLevel(level)


def lines_of(step: fx.Static, rows: list[tuple[float, Row]]) -> None:
    """Show rows that come at given seconds."""
    seconds = [0.0]
    show = Progress(MPI.COMM_SELF, ShareDone(step), number=2, now=lambda: seconds[0])
    with show:
        for at, values in rows:
            seconds[0] = at
            show("onset", values)


GROWTH = [(float(t), row(10.0 + t)) for t in range(9)]


def test_lines_without_a_terminal_become_rarer(
    alone: None, capsys: pytest.CaptureFixture[str]
) -> None:
    lines_of(fx.Static(fx.CrackLength(BOND, 20.0)), GROWTH)
    err = capsys.readouterr().err.splitlines()
    if MPI.COMM_WORLD.rank:
        assert not err
        return
    # after 2 and 6 seconds, and the last row at the end; what is left follows from growth so far
    assert [re.search(r"a\[bond\] = (\d+) of 20", line)[1] for line in err] == ["12", "16", "18"]
    words = "onset  a[bond] = 12 of 20  f[bond] = 1  t = 1  R[pin.y] = 3"
    assert err[0] == f"step 2 after 0:02, about 0:08 left: {words}"
    assert err[1].startswith("step 2 after 0:06, about 0:04 left: onset")


def test_the_time_left_is_not_invented(alone: None, capsys: pytest.CaptureFixture[str]) -> None:
    lines_of(fx.Static(fx.Time(30.0), stepping="path"), GROWTH)
    err = capsys.readouterr().err
    assert "left" not in err
    assert MPI.COMM_WORLD.rank or "step 2 after 0:06: onset" in err


def test_progress_follows_the_levels_of_the_log(
    alone: None, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    step = fx.Static(fx.CrackLength(BOND, 20.0))
    log.progress.setLevel(logging.WARNING)
    lines_of(step, GROWTH)
    assert not capsys.readouterr().err
    log.progress.setLevel(logging.NOTSET)
    handler = logging.StreamHandler(io.StringIO())
    monkeypatch.setattr(log.logger, "handlers", [handler])
    monkeypatch.setattr(log.progress, "hasHandlers", lambda: True)
    lines_of(step, GROWTH)  # a program that wants warnings only
    assert not handler.stream.getvalue()
    log.progress.setLevel(logging.INFO)
    lines_of(step, GROWTH)
    assert len(handler.stream.getvalue().splitlines()) == (0 if MPI.COMM_WORLD.rank else 3)
    assert not capsys.readouterr().err


def test_one_line_on_a_terminal(alone: None, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    assert progress._is_terminal()
    lines_of(fx.Static(fx.CrackLength(BOND, 20.0)), GROWTH)
    shown = terminal.getvalue()
    if MPI.COMM_WORLD.rank == 0:
        assert "step 2 after 0:0" in shown and ": onset  a[bond] = " in shown
        # refreshed lines begin at their first column again, none is left behind at the end
        assert "\x1b[2K" in shown
        assert shown.replace("\r\n", "\n").count("\n") <= 1
    else:
        assert not shown
    monkeypatch.setenv("TERM", "dumb")
    assert not progress._is_terminal()


def test_words_of_a_row() -> None:
    words = describe("cycle", {"time": 1.0, "N": 1200.0, "F[pull]": 2.0, "a[b]": 3.0, "f[b]": 0.5})
    assert words.split() == "cycle a[b] = 3 f[b] = 0.5 N = 1200 F[pull] = 2".split()
    assert [clock(x) for x in (0.4, 75.0, 3671.0)] == ["0:00", "1:15", "1:01:11"]


def test_levels_by_name() -> None:
    assert log.level_of("DEBUG") == logging.DEBUG
    assert log.level_of(25) == 25
    with pytest.raises(fx.InputError, match="log level 'loud': give one of debug, info"):
        fx.show_log("loud")


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("finite", [False, True])
def test_debug_says_what_the_solvers_did(caplog: pytest.LogCaptureFixture, finite: bool) -> None:
    caplog.set_level(logging.DEBUG, logger="fxcrack")
    scene = dcb(MPI.COMM_WORLD, dx=2.0, ny=1)
    if finite:
        scene = scene.rebuilt(effects=[fx.FiniteStrain()])
    history = scene.run(fx.Static(until=fx.Releases(1)))
    records = [r for r in caplog.records if r.name.startswith("fxcrack")]
    if MPI.COMM_WORLD.rank:
        assert not records
        scene.close()
        return
    text = [f"{r.name} {r.levelname} {r.getMessage()}" for r in records]
    rows = [t for t in text if t.startswith("fxcrack.steps.solver_work DEBUG step 1, row ")]
    assert len(rows) == len(history)
    assert all(re.search(r"; [\d.e+-]+ s", t) for t in rows)

    def sums(word: str) -> int:
        return sum(int(m[1]) for t in rows if (m := re.search(rf"\b{word} (\d+)", t)))

    if finite:
        # the rows share out what the solver counted, but for the start before the first row
        counts = scene.solver.counts
        trials = [t for t in text if t.startswith("fxcrack.solvers.trial DEBUG trial at t = ")]
        assert len(trials) == counts.solves + counts.failures
        assert counts.solves - 1 <= sums("trials") <= counts.solves + counts.failures
        assert 0 < sums("iterations") <= counts.iterations
        assert sum(len(t.split("residuals ")[1].split(", ")) for t in trials) >= len(trials)
        assert sums("factorisations") > 0
    assert text[-1] == "fxcrack.step_run INFO step 1 ended: 1 node released"
    scene.close()


def test_ranks_whose_threads_compete_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ranks that may each start several threads slow each other: once a scene, with the remedy."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(machine, "cores", lambda: 4)
    alone, several = SimpleNamespace(size=1), SimpleNamespace(size=2)
    assert threads_share_cores(alone) == ""  # type: ignore[arg-type]
    words = "each of 2 ranks may start 4 threads"
    assert threads_share_cores(several).startswith(words)  # type: ignore[arg-type]
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert threads_share_cores(several) == ""  # type: ignore[arg-type]
    monkeypatch.delenv("OMP_NUM_THREADS")
    before = log.n_warned()
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1)
    monkeypatch.setattr(step_run, "threads_share_cores", lambda comm: words)
    for k in (1, 2):
        scene.run(fx.Static(until=fx.Releases(k)), progress=False)
    assert sum(words in text for text in log.warned_since(before)) == 1
