"""Checkpoint files: what is in one is not believed, and writing one costs the same at any row."""

from __future__ import annotations

import io
import json
import os
import stat
import struct
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base.files import open_to_append, replacing
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.restart import checkpoint as format_
from fxcrack.restart.growing import GrowingArray, RowTable, rows_of
from fxcrack.restart.scene_state import Packed, collect

Arrays = dict[str, Any]
STEP = fx.Static(until=fx.Releases(2))


def scene() -> fx.Scene:
    bond = fx.Interface("upper_face", "lower_face", bonded=lambda x: x[0] >= 3.0, name="bond")
    return fx.Scene(
        dcb_2d(MPI.COMM_SELF, length=8.0, dx=1.0, ny=1),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2))],
    )


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Arrays]:
    """About and arrays of a sound checkpoint in the middle of a step."""
    path = tmp_path_factory.mktemp("sound") / "state.npz"
    whole = scene()

    def stop(event: str, row: dict[str, Any]) -> None:
        if len(whole.history) == 5:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        whole.run(STEP, checkpoint=fx.Checkpoint(path, every=1), observers=[stop], progress=False)
    with np.load(path) as file:
        arrays = dict(file)
    return json.loads(arrays.pop("about").tobytes()), arrays


def store(path: Path, about: Any, arrays: Arrays, save: Callable[..., None] = np.savez) -> None:
    text = about if isinstance(about, bytes) else json.dumps(about).encode()
    save(path, about=np.frombuffer(text, np.uint8), **arrays)


def go_on(path: Path) -> fx.History:
    made = scene()
    return made.run(STEP, checkpoint=fx.Checkpoint(path), restart=True, progress=False)


def test_the_sound_one_goes_on(content: tuple[dict[str, Any], Arrays], tmp_path: Path) -> None:
    store(tmp_path / "a.npz", *content)
    whole, again = scene().run(STEP, progress=False), go_on(tmp_path / "a.npz")
    assert again.columns == whole.columns
    for a, b in zip(again, whole, strict=True):
        assert a.keys() == b.keys()
        assert [type(v) for v in a.values()] == [type(v) for v in b.values()]
    for name in ("time", "R[pin_top.y]", "strain_energy"):
        assert again[name] == pytest.approx(whole[name], rel=1e-10)


def without(given: dict[str, Any], name: str) -> dict[str, Any]:
    return {k: v for k, v in given.items() if k != name}


FOREIGN: dict[str, Callable[[dict[str, Any], Arrays], tuple[Any, Arrays]]] = {
    "no text": lambda about, arrays: (b"\xff\xfe", arrays),
    "a number": lambda about, arrays: (b"3", arrays),
    "nested": lambda about, arrays: (b"[" * 100_000, arrays),
    "no version": lambda about, arrays: (without(about, "version"), arrays),
    "version": lambda about, arrays: (about | {"version": [5]}, arrays),
    "NaN jump": lambda about, arrays: (about, arrays | {"jump[0]": arrays["jump[0]"] * np.nan}),
    "infinite load": lambda about, arrays: (about, arrays | {"loads": arrays["loads"] + np.inf}),
    "NaN time": lambda about, arrays: (
        about | {"balance": about["balance"] | {"time": float("nan")}},
        arrays,
    ),
    "a balance of words": lambda about, arrays: (
        about | {"balance": dict.fromkeys(about["balance"], "word")},
        arrays,
    ),
    "a shape": lambda about, arrays: (about, arrays | {"jump[0]": np.zeros((1, 1))}),
    "indices": lambda about, arrays: (about, arrays | {"index[0]": arrays["index[0]"] + 10**12}),
    "texts for numbers": lambda about, arrays: (about, arrays | {"loads": np.array(["a", "b"])}),
    "no rows": lambda about, arrays: (about | {"rows": {}}, arrays),
    "rows of words": lambda about, arrays: (
        about | {"rows": {"columns": 3, "texts": None}},
        arrays,
    ),
    "kinds": lambda about, arrays: (
        about,
        arrays | {"rows.kinds": np.full_like(arrays["rows.kinds"], 77)},
    ),
    "ramps": lambda about, arrays: (about | {"ramps": [{"kind": "none"}]}, arrays),
    **{
        f"no {name}": lambda about, arrays, name=name: (without(about, name), arrays)  # type: ignore[misc]
        for name in ("run", "finished", "scene", "progress", "balance", "ramps", "fatigue", "rows")
    },
    **{
        f"without {name}": lambda about, arrays, name=name: (about, without(arrays, name))  # type: ignore[misc]
        for name in ("jump[0]", "index[0]", "loads", "record.node[0]", "rows.values")
    },
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_content_is_named(
    kind: str, content: tuple[dict[str, Any], Arrays], tmp_path: Path
) -> None:
    path = tmp_path / "a.npz"
    store(path, *FOREIGN[kind](*content))
    with pytest.raises(fx.InputError, match=r"a\.npz (is no|has version)|a.npz belongs|not fit"):
        go_on(path)


def bytes_of(header: str, data: bytes = b"") -> bytes:
    text = header.encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


def zipped(path: Path, compression: int, **parts: bytes) -> None:
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, data in parts.items():
            file.writestr(f"{name}.npy", data)


MALFORMED: dict[str, Callable[[Path], Any]] = {
    "claims 8 TB": lambda p: zipped(
        p, zipfile.ZIP_STORED,
        about=bytes_of("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,)}"),
    ),
    "negative": lambda p: zipped(
        p, zipfile.ZIP_STORED,
        about=bytes_of("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, -1)}", bytes(8)),
    ),
    "objects": lambda p: zipped(
        p, zipfile.ZIP_STORED,
        about=bytes_of("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", bytes(8)),
    ),
    "no array": lambda p: zipped(p, zipfile.ZIP_STORED, about=b"rubbish"),
    "a header of code": lambda p: zipped(
        p, zipfile.ZIP_STORED, about=bytes_of("__import__('os').abort()")
    ),
    "nothing": lambda p: zipped(p, zipfile.ZIP_STORED),
    "text": lambda p: p.write_text("rubbish"),
    "empty": lambda p: p.write_bytes(b""),
    "a folder": lambda p: p.mkdir(),
    "a link to nothing": lambda p: p.symlink_to("nowhere"),
    "an array": lambda p: np.save(p.open("wb"), np.zeros(3)),
}  # fmt: skip


@pytest.mark.parametrize("kind", MALFORMED)
def test_malformed_files_are_named(kind: str, tmp_path: Path) -> None:
    MALFORMED[kind](tmp_path / "a.npz")
    with pytest.raises(fx.InputError, match=r"a\.npz is no checkpoint of fxcrack"):
        format_.read(MPI.COMM_SELF, tmp_path / "a.npz")


def test_nothing_is_unpacked_that_is_larger_than_the_file(tmp_path: Path) -> None:
    """128 MB of zeros in 130 kB are refused before a byte of them is made."""
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        with file.open("about.npy", "w", force_zip64=True) as part:
            for _ in range(8):
                part.write(bytes(2**24))
    assert path.stat().st_size < 2**20
    start = time.perf_counter()
    with pytest.raises(fx.InputError, match="compressed"):
        format_.read(MPI.COMM_SELF, path)
    assert time.perf_counter() - start < 0.5


def test_a_stored_part_that_claims_more_than_the_file_holds(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    zipped(path, zipfile.ZIP_STORED, about=bytes(1000))
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\x01\x02")
    data[at + 24 : at + 28] = struct.pack("<I", 2**31)  # size in the central directory
    path.write_bytes(bytes(data))
    with pytest.raises(fx.InputError, match="larger than the file"):
        format_.read(MPI.COMM_SELF, path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes by name")
def test_a_pipe_does_not_block(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.npz")
    with pytest.raises(fx.InputError, match="no regular file"):
        format_.read(MPI.COMM_SELF, tmp_path / "a.npz")


def test_any_damage_is_named_or_harmless(
    content: tuple[dict[str, Any], Arrays], tmp_path: Path
) -> None:
    """Bytes turned at random places: an error with a name, or a file that reads as before."""
    path = tmp_path / "a.npz"
    store(path, *content)
    sound = path.read_bytes()
    random = np.random.default_rng(3)
    refused = 0
    for _ in range(300):
        data = bytearray(sound)
        for at in random.integers(0, len(data), 3):
            data[at] ^= 1 << int(random.integers(8))
        path.write_bytes(bytes(data[: random.integers(1, len(data) + 1)] if _ % 3 == 0 else data))
        try:
            format_.read(MPI.COMM_SELF, path)
        except fx.InputError as error:
            refused += 1
            assert "a.npz" in str(error)
    assert refused > 200


# -- writing ---------------------------------------------------------------------------------------


def test_writing_costs_the_same_at_row_3000_as_at_row_10(tmp_path: Path) -> None:
    """Only what is new since the last checkpoint is converted; measured as processor time."""
    made = scene()
    made.run(STEP, progress=False)
    analysis = made.analysis
    row, record = analysis.history.rows[-1], analysis.cracks[0].records[-1]

    def seconds(n: int) -> float:
        """Least of several checkpoints, one row apart, that begin at row n."""
        rows, records = analysis.history.rows, analysis.cracks[0].records
        rows[:], records[:] = [dict(row) for _ in range(n)], [record] * n
        packed = Packed()
        collect(analysis, packed)  # as the checkpoints before have done
        best = np.inf
        for _ in range(9):
            rows.append(dict(row))
            records.append(record)
            start = time.process_time()
            saved = collect(analysis, packed)
            saved.about |= {"run": "", "finished": "", "scene": {}, "progress": {}}
            format_.write(MPI.COMM_SELF, tmp_path / "a.npz", saved)
            best = min(best, time.process_time() - start)
        return best

    early, late = seconds(10), seconds(3000)
    assert late < 2.0 * early + 2e-3  # 3000 rows as text took 60 times as long
    assert len(format_.read(MPI.COMM_SELF, tmp_path / "a.npz").arrays["rows.values"]) == 3009  # type: ignore[union-attr]


def test_rows_come_back_as_they_were() -> None:
    rows: list[dict[str, Any]] = [
        {"event": "start", "time": 0.0},
        {"event": "onset", "time": 1.0, "f": float("nan"), "node": 3, "open": True},
        {"event": "end", "f": float("inf"), "node": -(2**40), "b": False, "time": 1e-300},
    ]
    rows += [{"event": f"e{i}", f"c{i}": i} for i in range(40)]
    table = RowTable()
    for n in (1, 1, 2, 7, len(rows)):
        table.update(rows[:n])
    again = rows_of(json.loads(json.dumps(table.names())), table.arrays("t"), "t")
    for a, b in zip(again, rows, strict=True):
        assert {k: repr(v) for k, v in a.items()} == {k: repr(v) for k, v in b.items()}


def test_growing_arrays_hold_every_row() -> None:
    grown = GrowingArray()
    assert grown.array().tolist() == []
    for i in range(50):
        grown.append((float(i), -1.0))
    assert grown.array().tolist() == [[float(i), -1.0] for i in range(50)]


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of POSIX")
def test_files_follow_the_umask_and_no_link(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with replacing(tmp_path / "a.txt") as temporary:
            assert stat.S_IMODE(temporary.stat().st_mode) == 0o640
            name = temporary.name
        assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640
        with replacing(tmp_path / "a.txt") as temporary:
            assert temporary.name != name
    finally:
        os.umask(before)
    (tmp_path / "kept.txt").write_text("kept")
    (tmp_path / "link.txt").symlink_to("kept.txt")
    with replacing(tmp_path / "link.txt") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "kept.txt").read_text() == "kept"
    assert not (tmp_path / "link.txt").is_symlink()
    (tmp_path / "other.txt").symlink_to("kept.txt")
    with pytest.raises(OSError, match=r"symbolic link|[Ll]ink"):
        open_to_append(tmp_path / "other.txt")
    with open_to_append(tmp_path / "a.txt") as stream:
        assert isinstance(stream, io.RawIOBase)
