"""Jobs that end early: a rank killed, Ctrl-C, SIGTERM, a full disk.

Hard: ranks that are left alone wait for ever, files half written are worth nothing. Must hold: the
job ends within 10 s on all ranks, the rows so far are readable, and a restart gives the history of
a job that nobody disturbed. Checked with real processes, signals and limits.
"""

from __future__ import annotations

import csv
import errno
import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from specimens import dcb, grow_to

import fxcrack as fx
from fxcrack.base.parallel import all_arrive
from fxcrack.base.signals import Interrupted, Listener
from fxcrack.demos import dcb as dcb_demo
from fxcrack.restart.history_file import HistoryFile

pytestmark = pytest.mark.stability

ROOT = Path(__file__).parents[2]
JOB = str(Path(__file__).with_name("job.py"))
LIMIT = 10.0  # seconds until all ranks must have ended; asked for by the specification
BUSY = 120.0  # seconds a job may take to begin when many share the machine
NUMBERS = {"time": 1.0, "a[bond]": 1.0, "R[pin_top.y]": 1.0, "GI[bond]": 1.0, "strain_energy": 1.0}


class Job:
    """One run of job.py on some ranks."""

    def __init__(self, folder: Path, ranks: int, *words: str) -> None:
        self.folder, self.ranks = folder, ranks
        (folder / "started").unlink(missing_ok=True)
        python = [sys.executable] if ranks == 1 else [ROOT / ".ci/mpirun", "-n", str(ranks)]
        python += [] if ranks == 1 else ["python3"]
        self.process = subprocess.Popen(
            [*python, JOB, str(folder), *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )

    def wait_for_rows(self) -> None:
        end = time.monotonic() + BUSY
        while not (self.folder / "started").exists():
            assert self.process.poll() is None and time.monotonic() < end, self.finish(1.0)
            time.sleep(0.05)

    def signal(self, number: int, rank: int | None) -> None:
        """Send a signal to a rank, or to what started them."""
        pid = self.process.pid
        if rank is not None:
            pid = int((self.folder / f"pid-{rank}").read_text())
        os.kill(pid, number)

    def finish(self, limit: float = BUSY) -> tuple[int, str]:
        """Exit code and what was printed; fails when a rank is still there after the limit."""
        end = time.monotonic() + limit
        try:
            out, _ = self.process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            out, _ = self.process.communicate()
            pytest.fail(f"the job had not ended after {limit} s:\n{out}")
        pids = [int(path.read_text()) for path in self.folder.glob("pid-*")]
        while any(alive(pid) for pid in pids):
            assert time.monotonic() < end, "the launcher has ended, ranks have not"
            time.sleep(0.05)
        return self.process.returncode, out


def alive(pid: int) -> bool:
    """Whether a process runs (one that waits to be buried does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def rows_of(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file, all of them whole."""
    with path.open(newline="") as stream:
        found = list(csv.DictReader(stream))
    for row in found:
        assert None not in row and None not in row.values()
    return found


def assert_continues(folder: Path, expected: Sequence[dict[str, str]], ranks: int = 1) -> None:
    """A restart on some ranks ends with the expected rows and computes only what was missing."""
    code, out = Job(folder, ranks, "restart").finish()
    assert code == 0, out
    found = rows_of(folder / "final.csv")
    assert [r["event"] for r in found] == [r["event"] for r in expected]
    for name in NUMBERS:
        a, b = (np.array([float(r[name] or 0.0) for r in rows]) for rows in (found, expected))
        assert np.abs(a - b).max() <= 1e-10 * np.abs(b).max(), name
    assert rows_of(folder / "history.csv") == found
    new = int(out.split("rows, ")[1].split()[0])
    assert 0 < new < len(expected) - 4


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    folder = tmp_path_factory.mktemp("undisturbed")
    code, out = Job(folder, 1).finish()
    assert code == 0, out
    assert not (folder / "history.csv").read_bytes() != (folder / "final.csv").read_bytes()
    return rows_of(folder / "final.csv")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ranks", "number", "rank", "again"),
    [
        pytest.param(2, signal.SIGKILL, 1, 1, id="a worker is killed"),
        pytest.param(2, signal.SIGKILL, 0, 0, id="rank 0 is killed"),
        pytest.param(1, signal.SIGINT, 0, 2, id="Ctrl-C"),
        pytest.param(2, signal.SIGINT, None, 0, id="Ctrl-C on the launcher"),
        pytest.param(2, signal.SIGTERM, 1, 0, id="SIGTERM on a worker"),
    ],
)
def test_all_ranks_end_and_a_restart_continues(
    ranks: int,
    number: int,
    rank: int | None,
    again: int,
    tmp_path: Path,
    undisturbed: list[dict[str, str]],
) -> None:
    """And, where ``again`` says on how many ranks, a restart continues."""
    job = Job(tmp_path, ranks, "pause=0.05")
    job.wait_for_rows()
    job.signal(number, rank)
    code, out = job.finish(LIMIT)
    assert code != 0
    found = rows_of(tmp_path / "history.csv")
    assert 12 <= len(found) < len(undisturbed)
    assert [r["event"] for r in found] == [r["event"] for r in undisturbed[: len(found)]]
    if number != signal.SIGKILL:
        name = signal.Signals(number).name
        assert out.count(f"fxcrack: stopped by {name}; history in") == 1  # rank 0 speaks for all
        assert "state.npz" in out and "Traceback" not in out
        if rank is not None:
            assert code == 128 + number
    if again:
        assert_continues(tmp_path, undisturbed, again)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ranks", "rank"),
    [
        pytest.param(1, 0, id="one rank"),
        pytest.param(2, 0, id="the rank that made the mesh"),
    ],
)
def test_ctrl_c_saves_a_run_whose_script_called_gmsh(
    ranks: int, rank: int, tmp_path: Path, undisturbed: list[dict[str, str]]
) -> None:
    """gmsh.initialize() makes SIGINT end the process at once; the run takes it over."""
    job = Job(tmp_path, ranks, "pause=0.05", "gmsh")
    job.wait_for_rows()
    job.signal(signal.SIGINT, rank)
    code, out = job.finish(LIMIT)
    assert out.count("fxcrack: stopped by SIGINT; history in") == 1
    assert code == 130
    assert 12 <= len(rows_of(tmp_path / "history.csv")) < len(undisturbed)
    if ranks == 1:
        assert_continues(tmp_path, undisturbed)


@pytest.mark.slow
def test_a_handler_of_the_script_stays_in_charge(
    tmp_path: Path, undisturbed: list[dict[str, str]]
) -> None:
    """It is called, and the run goes on: what Ctrl-C means is for the script to say."""
    job = Job(tmp_path, 1, "pause=0.05", "gmsh", "own")
    job.wait_for_rows()
    job.signal(signal.SIGINT, 0)
    code, out = job.finish()
    assert code == 0
    assert out.count("own handler") == 1 and "stopped by" not in out
    assert rows_of(tmp_path / "history.csv") == undisturbed


@pytest.mark.slow
def test_a_signal_inside_a_long_computation_ends_all_ranks(tmp_path: Path) -> None:
    """Rank 0 computes for a minute, rank 1 waits for it: neither looks at signals."""
    job = Job(tmp_path, 2, "pause=0.05", "block=14")
    job.wait_for_rows()
    time.sleep(1.0)  # it is in row 14 by now
    job.signal(signal.SIGTERM, 0)
    code, out = job.finish(LIMIT)
    assert code == 143
    assert "stopped by SIGTERM inside a computation" in out
    assert len(rows_of(tmp_path / "history.csv")) >= 12


@pytest.mark.slow
@pytest.mark.parametrize(
    ("every", "room", "file"), [(1, 25_000, "state.npz"), (100_000, 9_000, "history.csv")]
)
def test_a_full_disk_ends_all_ranks_and_leaves_what_was_there(
    every: int, room: int, file: str, tmp_path: Path, undisturbed: list[dict[str, str]]
) -> None:
    """The system refuses to let a file of rank 0 grow; rank 1 hears of it."""
    job = Job(tmp_path, 2, f"every={every}", f"room={room}")
    code, out = job.finish()
    assert code != 0
    assert "of 2:\nTraceback" in out  # the rank that is first to say so ends the others
    assert f"writing {'the checkpoint ' if file == 'state.npz' else ''}{tmp_path / file}" in out
    assert os.strerror(errno.EFBIG) in out
    found = rows_of(tmp_path / "history.csv")
    assert 0 < len(found) < len(undisturbed)
    assert not list(tmp_path.glob(".*"))  # nothing half written lies about
    if file == "state.npz":
        assert_continues(tmp_path, undisturbed)


@pytest.mark.slow
def test_no_space_left_on_a_small_disk(tmp_path: Path, undisturbed: list[dict[str, str]]) -> None:
    """ENOSPC from a real file system of 96 kB; needs root to mount it."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", str(disk)]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("no permission to mount a file system")
    try:
        code, out = Job(disk, 1, "every=1").finish()
        assert code == 1
        assert os.strerror(errno.ENOSPC) in out
        assert 0 < len(rows_of(disk / "history.csv")) < len(undisturbed)
        for path in disk.iterdir():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)
    assert_continues(tmp_path, undisturbed)


STOP_DEMO = """
import os, signal
from fxcrack import cli
from fxcrack.steps import progress
rows = 0
def look(self, event, row):
    global rows
    rows += 1
    if rows == 20:
        os.kill(os.getpid(), signal.SIGTERM)
progress.Progress.__call__ = look
cli.main(["demo", "dcb", "--checkpoint", "--out", {out!r}])
"""


@pytest.mark.slow
def test_a_demo_is_stopped_and_restarted_from_the_command_line(tmp_path: Path) -> None:
    out = str(tmp_path / "stopped")
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}

    def python(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, *words]
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=BUSY, check=False
        )

    stopped = python("-c", STOP_DEMO.format(out=out))
    assert stopped.returncode == 143
    assert stopped.stderr.startswith("fxcrack: stopped by SIGTERM; history in")
    assert len(rows_of(tmp_path / "stopped/checkpoints/scene-1.csv")) in (
        20,
        21,
    )  # onset and release
    cli = ["-c", "from fxcrack import cli; cli.main()", "demo", "dcb", "--out"]
    again = python(*cli, out, "--restart")
    assert again.returncode == 0, again.stderr
    dcb_demo.main(tmp_path / "whole")
    found, expected = (rows_of(tmp_path / f"{name}/dcb.csv") for name in ("stopped", "whole"))
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert a["event"] == b["event"]
        assert float(a["R[pin_top.y]"]) == pytest.approx(float(b["R[pin_top.y]"]), rel=1e-10)


# -- in this process -------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("ending", ["csv", "json"])
def test_the_history_on_disk_follows_the_run(
    ending: str, comm: MPI.Intracomm, shared_path: Path
) -> None:
    path = shared_path / f"history.{ending}"
    scene = dcb(comm, dx=2.0, ny=1)
    seen: list[int] = []

    def look(event: str, row: object) -> None:
        if comm.rank == 0 and path.exists():
            if ending == "csv":
                seen.append(len(rows_of(path)))
            else:
                seen.append(len(json.loads(path.read_text())["rows"]))

    history = scene.run(
        fx.Static(until=fx.Releases(6)), observers=[look], save=path, progress=False
    )
    comm.Barrier()
    if ending == "csv":
        expected = shared_path / "expected.csv"
        history.to_csv(expected)
        assert path.read_bytes() == expected.read_bytes()
        if comm.rank == 0:
            # rows are there after every increment, one release later at most
            assert seen == sorted(seen) and seen[-1] >= len(history) - 4
    else:
        assert json.loads(path.read_text())["rows"] == history.rows
        assert json.loads(path.read_text())["reason"] == "6 nodes released"
    scene.close()
    with pytest.raises(fx.InputError, match=r"must end in \.csv or \.json"):
        HistoryFile(history, shared_path / "history.txt")


def test_columns_that_appear_late_and_half_rows(tmp_path: Path) -> None:
    history = fx.History(MPI.COMM_SELF)
    file = HistoryFile(history, tmp_path / "history.csv")
    for i in range(3):
        history.append({"time": float(i), "event": "increment"})
        assert file.update() is None
    history.append({"time": 3.0, "event": "release", "snap_energy": 1.0})
    assert file.update() is None
    assert [r["snap_energy"] for r in rows_of(file.path)] == ["", "", "", "1.0"]
    before = file.path.read_bytes()

    # the disk takes three bytes of the next row and is full then
    history.append({"time": 4.0, "event": "increment", "snap_energy": 1.0})
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 3, hard))
    try:
        problem = file.update()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert problem is not None
    assert f"{os.strerror(errno.EFBIG)}; 4 rows of the history are in it" in problem
    assert file.path.read_bytes() == before
    # there is room again: the row that was refused is not lost
    assert file.update(last=True) is None
    assert [r["time"] for r in rows_of(file.path)] == ["0.0", "1.0", "2.0", "3.0", "4.0"]


@pytest.mark.mpi
@pytest.mark.parametrize("what", ["checkpoint", "history"])
def test_a_failed_write_on_rank_0_is_an_error_on_all_ranks(
    what: str, comm: MPI.Intracomm, shared_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(number: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    checkpoint = fx.Checkpoint(shared_path / "state.npz", every=3)
    scene = dcb(comm, dx=2.0, ny=1)
    scene.run(fx.Static(until=fx.Releases(3)), checkpoint=checkpoint)
    scene.close()
    before = checkpoint.file(1).read_bytes()
    comm.Barrier()
    scene = dcb(comm, dx=2.0, ny=1)
    if what == "checkpoint":
        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(fx.FxcrackError, match=r"writing the checkpoint .*No space left"):
            scene.run(fx.Static(until=fx.Releases(3)), checkpoint=checkpoint)
    else:
        monkeypatch.setattr(fx.History, "write_csv", lambda self, path: full(0))
        with pytest.raises(fx.FxcrackError, match=r"writing .*No space left.*0 rows"):
            scene.run(fx.Static(until=fx.Releases(3)), save=shared_path / "history.csv")
    assert checkpoint.file(1).read_bytes() == before
    assert [p.name for p in shared_path.iterdir() if p.name.startswith(".")] == []
    scene.close()


@pytest.mark.mpi
def test_a_signal_on_any_rank_stops_all_of_them_at_the_same_row(
    comm: MPI.Intracomm, shared_path: Path
) -> None:
    scene = dcb(comm, dx=2.0, ny=1)
    rows = 0

    def look(event: str, row: object) -> None:
        nonlocal rows
        rows += 1
        if rows == 7 and comm.rank == comm.size - 1:
            os.kill(os.getpid(), signal.SIGTERM)

    with pytest.raises(
        Interrupted, match=r"stopped by SIGTERM; history in .*restart goes on"
    ) as end:
        scene.run(
            fx.Static(until=fx.Releases(6)),
            observers=[look],
            save=shared_path / "history.csv",
            checkpoint=fx.Checkpoint(shared_path / "state.npz"),
        )
    assert end.value.code == 143
    assert isinstance(end.value, KeyboardInterrupt)  # "except Exception" does not swallow it
    assert set(comm.allgather(len(scene.history))) == {len(scene.history)}
    assert 7 <= len(scene.history) <= 9
    assert len(rows_of(shared_path / "history.csv")) == len(scene.history)
    # handlers are the usual ones again
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    scene.close()


def test_without_save_or_checkpoint_signals_are_left_alone() -> None:
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1)
    found = []
    scene.run(
        fx.Static(until=fx.Releases(2)),
        observers=[lambda event, row: found.append(signal.getsignal(signal.SIGTERM))],
    )
    assert set(found) == {signal.SIG_DFL}
    scene.close()


def test_a_listener_leaves_the_handlers_of_a_program_and_other_threads_alone() -> None:
    def mine(number: int, frame: object) -> None: ...

    before = signal.signal(signal.SIGTERM, mine)
    try:
        with Listener() as listener:
            assert signal.getsignal(signal.SIGTERM) is mine
            assert signal.getsignal(signal.SIGINT) not in (mine, signal.default_int_handler)
            os.kill(os.getpid(), signal.SIGINT)
            assert listener.signum == signal.SIGINT
    finally:
        signal.signal(signal.SIGTERM, before)
    seen = []

    def elsewhere() -> None:
        with Listener():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join(10.0)
    assert seen == [signal.default_int_handler]


@pytest.mark.parametrize(
    ("number", "disposition"),
    [
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGINT, signal.SIG_DFL),
        (signal.SIGTERM, signal.SIG_DFL),
    ],
    ids=["SIGINT of Python", "SIGINT of the system, as gmsh leaves it", "SIGTERM"],
)
def test_a_listener_takes_a_default_disposition_and_puts_it_back(
    number: signal.Signals, disposition: signal.Handlers
) -> None:
    before = signal.signal(number, disposition)
    try:
        with Listener() as listener:
            os.kill(os.getpid(), number)
            assert listener.signum == number
        assert signal.getsignal(number) == disposition
    finally:
        signal.signal(number, before)


def test_a_listener_leaves_a_signal_alone_that_is_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with Listener() as listener:
            os.kill(os.getpid(), signal.SIGINT)
            assert listener.signum == 0
            assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.mpi
def test_ranks_wait_for_each_other_only_so_long(comm: MPI.Intracomm) -> None:
    own = comm.Dup()
    assert all_arrive(own, 60.0)
    if comm.size > 1 and comm.rank == 0:
        assert not all_arrive(own, 0.1)  # the others come later
    else:
        time.sleep(0.5)
        all_arrive(own, 60.0)
    comm.Barrier()
    own.Free()


@pytest.mark.mpi
def test_a_scene_within_a_folder_of_checkpoints(comm: MPI.Intracomm, shared_path: Path) -> None:
    def both() -> list[fx.History]:
        out = []
        for contact in (False, True):
            scene = dcb(comm, dx=2.0, ny=1, contact=contact)
            out.append(grow_to(scene, 36.0))
            scene.close()
        return out

    with fx.checkpoints(shared_path):
        first = both()
    comm.Barrier()
    names = sorted(p.name for p in shared_path.iterdir())
    assert names == ["scene-1.csv", "scene-1.npz", "scene-2.csv", "scene-2.npz"]
    with fx.checkpoints(shared_path, restart=True):
        second = both()
    for a, b in zip(first, second, strict=True):
        assert a.rows == b.rows  # read, not computed
        assert "growth" not in b.details["seconds"] or b.details["releases"] == len(
            [r for r in b if r["event"] == "release"]
        )
    grow_to(dcb(comm, dx=2.0, ny=1), 32.0)  # outside nothing is kept
    assert len(list(shared_path.iterdir())) == 4
