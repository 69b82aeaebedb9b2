"""A job to be interrupted: ``python job.py FOLDER [WORD[=NUMBER] ...]``.

A short beam that lets go along many increments. Each rank says in ``pid-RANK`` which process it is;
``started`` appears once rows are on disk. Words:

    restart    go on from the checkpoint
    every=N    increments between two checkpoints
    pause=S    every row lasts so many seconds
    block=N    row N is a computation of a minute that does not look at signals, on rank 0
    room=N     no file of rank 0 may become longer than N bytes: the disk is full
    gmsh       gmsh.initialize() was called on rank 0, as by a script that makes its mesh there
    own        the script has a handler of its own for SIGINT, which prints
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
import time
from pathlib import Path

import gmsh

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d

# isort: split
from mpi4py import MPI

COMM = MPI.COMM_WORLD


def compute(seconds: float) -> None:
    """Work in C with the interpreter unlocked, as a factorisation does."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        ctypes.CDLL(None).usleep(int(1e6 * seconds))  # a signal makes it return early


def main(folder: Path, words: dict[str, str]) -> None:
    pause, block = float(words.get("pause", 0.0)), int(words.get("block", -1))
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 6.0 - 1e-9, name="bond"
    )
    scene = fx.Scene(
        dcb_2d(length=40.0, dx=1.0, ny=1),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=0.25),
            fx.Displacement("pin_bottom", x=0.0, y=-0.25),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2))],
    )
    rows = 0

    def look(event: str, row: dict[str, float | int | str]) -> None:
        nonlocal rows
        rows += 1
        time.sleep(pause)
        if rows == 12 and COMM.rank == 0:
            (folder / "started").touch()
        if rows == block and COMM.rank == 0:
            compute(60.0)
        if rows == 1 and "room" in words and COMM.rank == 0:
            resource.setrlimit(resource.RLIMIT_FSIZE, (int(words["room"]),) * 2)

    if "gmsh" in words and COMM.rank == 0:
        gmsh.initialize()
    if "own" in words:
        signal.signal(signal.SIGINT, lambda number, frame: print("own handler", flush=True))
    folder.joinpath(f"pid-{COMM.rank}").write_text(str(os.getpid()))
    history = scene.run(
        fx.Static(
            until=fx.Releases(20), stepping="increment", initial=0.02, maximum=0.02, max_cutbacks=30
        ),
        observers=[look],
        save=folder / "history.csv",
        checkpoint=fx.Checkpoint(folder / "state.npz", every=int(words.get("every", 4))),
        restart="restart" in words,
    )
    history.to_csv(folder / "final.csv")
    if COMM.rank == 0:
        print(f"done: {len(history)} rows, {rows} of them new", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), dict(word.partition("=")[::2] for word in sys.argv[2:]))
