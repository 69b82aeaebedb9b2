"""Memory and PETSc objects over hundreds of releases and tens of new factorisations."""

from __future__ import annotations

import gc
import os
import re
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from specimens import dcb, interface_of

import fxcrack as fx
from fxcrack.base import collective_garbage

pytestmark = pytest.mark.memory

PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


def resident_mb() -> float:
    """Memory of this process in RAM."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_MB


def alive(comm: MPI.Intracomm, folder: Path) -> dict[str, int]:
    """PETSc objects by class: made and not yet destroyed since logging began; collective."""
    gc.collect()
    collective_garbage.collect(comm)
    path = folder / "log.txt"
    viewer = PETSc.Viewer().createASCII(str(path), comm=comm)
    PETSc.Log.view(viewer)
    viewer.destroy()
    comm.Barrier()
    text = path.read_text()
    comm.Barrier()
    table = text[text.index("Object Type") :]
    rows = re.findall(r"^ {1,25}(\S[\w ]*\S) +(\d+) +(\d+)\.?\s*$", table, flags=re.M)
    return {name: int(made) - int(gone) for name, made, gone in rows}


@pytest.mark.slow
@pytest.mark.mpi
def test_releases_and_new_retained_sets_leave_nothing_behind(
    comm: MPI.Intracomm, shared_path: Path
) -> None:
    """200 releases with tiny sets of retained jumps; fields asked for after each twenty of them.

    Once the first set has been replaced, every later one must free what the one before made.
    """
    PETSc.Log.begin()
    before = alive(comm, shared_path)
    scene = dcb(comm, dx=0.25, ny=2, contact=True, options=fx.CondensedOptions(rows=0.5))
    objects, memory, rebases = [], [], []
    for count in range(20, 221, 20):
        scene.run(fx.Static(until=fx.Releases(count)))
        scene.solver.displacement().destroy()
        objects.append(alive(comm, shared_path))
        memory.append(resident_mb())
        rebases.append(scene.history.details["factorizations"])
    assert scene.history.rows[-1]["released[bond]"] == 220
    assert np.all(np.diff(rebases) >= 4)
    assert len(objects[0]) >= 3 and objects[0]["Matrix"] > 0  # the table was read
    for later in objects[2:]:
        assert later == objects[1]
    # S, its factor and history grow with the crack: 200 kB of rows and contact unknowns; a leaked
    # factorisation would be 2 MB each time, 60 of them
    assert memory[-1] - memory[2] < 20.0
    scene.close()
    del scene  # and with it S, which on one rank stays in PETSc's array
    # all that belongs to the scene goes with it
    assert {k: n for k, n in alive(comm, shared_path).items() if n != before.get(k, 0)} == {}


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("closed", [True, False], ids=["closed", "dropped"])
def test_scenes_leave_nothing_behind(comm: MPI.Intracomm, shared_path: Path, closed: bool) -> None:
    """Ten scenes made, run, asked for fields, and closed or only no longer used."""
    PETSc.Log.begin()
    objects = []
    for method in ("schur", "columns") * 5:
        scene = dcb(comm, dx=2.0, ny=1, options=fx.CondensedOptions(method=method))
        scene.run(fx.Static(until=fx.CrackLength(interface_of(scene), 34.0)))
        scene.solver.displacement().destroy()
        if closed:
            scene.close()
        del scene
        objects.append(alive(comm, shared_path))
    # the first pair fills caches of DOLFINx
    for before, after in zip(objects[2:], objects[4:], strict=False):
        assert after == before


def free_communicators(comm: MPI.Intracomm) -> int:
    """How many communicators can still be made; collective.

    MPICH has 2048, Open MPI so many that the search ends at 3000.
    """
    made = []
    try:
        while len(made) < 3000:
            made.append(comm.Dup())
    except MPI.Exception:
        pass
    for each in made:
        each.Free()
    return len(made)


@pytest.mark.mpi
def test_scenes_no_longer_used_keep_no_communicators(comm: MPI.Intracomm) -> None:
    """A study in a loop that closes no scene: each would keep 16 communicators on several ranks."""
    free = []
    for _ in range(4):
        scene = dcb(comm, dx=4.0, ny=1, solver="newton")
        scene.run(fx.Static(until=fx.Releases(1)))
        del scene
        gc.collect()
        free.append(free_communicators(comm))
    assert free[3] == free[2] == free[1]
