"""Write golden histories, or compare with written ones; a script that needs no pytest.

    python tests/golden/make.py                                   # the stored ones, on one rank
    python tests/golden/make.py --out DIR                         # a reference of this machine
    python tests/golden/make.py --compare DIR --tolerance 1e-12   # after a change
    .ci/mpirun -n 2 .venv/bin/python tests/golden/make.py --out DIR

Names of scenes after the options choose some of them. It ends with status 1 if one deviates.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import fxcrack  # noqa: F401  (orders MPI before DOLFINx)

# isort: split
from mpi4py import MPI

from fxcrack.base.parallel import end_all
from golden.histories import FOLDER, deviation, read, text_of
from golden.scenes import SCENES, run


def main() -> int:
    """Run the scenes; returns how many of them deviate."""
    parser = argparse.ArgumentParser(description=__doc__, add_help=True)
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder to write to")
    parser.add_argument("--compare", type=Path, help="folder to compare with; nothing is written")
    parser.add_argument("--tolerance", type=float, default=1e-12, help="of a kind of column")
    parser.add_argument("names", nargs="*", help="scenes; all by default")
    given = parser.parse_args()
    comm = MPI.COMM_WORLD
    wrong, whole = 0, time.process_time()
    for name in given.names or SCENES:
        begun = time.process_time()
        result = run(name, comm)
        seconds = time.process_time() - begun
        if comm.rank != 0:
            continue
        note = f"{len(result.rows)} rows, {result.ends['reason']}"
        if given.compare is None:
            given.out.mkdir(parents=True, exist_ok=True)
            (given.out / f"{name}.csv").write_text(text_of(result))
        else:
            try:
                off, where = deviation(read(given.compare / f"{name}.csv"), result)
                note = f"deviates by {off:.1e} in {where or 'nothing'}"
                bad = not off <= given.tolerance
            except AssertionError as error:
                note, bad = f"differs: {str(error)[:300]}", True
            wrong += bad
            note = ("WRONG " if bad else "") + note
        print(f"{name:22s} {seconds:6.2f} s  {note}", flush=True)
    if comm.rank == 0:
        print(f"{'together':22s} {time.process_time() - whole:6.2f} s of this rank, {wrong} wrong")
    return comm.bcast(wrong)


if __name__ == "__main__":
    try:
        status = min(main(), 1)
    except Exception:  # a rank that fails must end the others too
        traceback.print_exc()
        end_all(MPI.COMM_WORLD, 2)
    sys.exit(status)
