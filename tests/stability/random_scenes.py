"""Run the random scenes of some seeds; say what fails, and write the table of the documentation.

    python tests/stability/random_scenes.py 0:500 --table docs/combinations.md

Each scene runs with its invariants, and once more in another description of itself that its seed
picks.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
import traceback
from collections import defaultdict
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from stability.combinations import Combination
from stability.invariants import Result, faults, run_scene
from stability.relations import broken, relations_of


def check(c: Combination, pick: int) -> tuple[Result, list[str]]:
    """Run a scene with its invariants and one of its relations; what does not hold, in words."""
    result = run_scene(c)
    bad = faults(c, result)
    possible = relations_of(c)
    if not bad:
        bad = broken(c, result, possible[pick % len(possible)])
    return result, bad


def seeds_of(text: str) -> range:
    """The seeds of "first:last", last not among them."""
    first, last = text.split(":")
    return range(int(first), int(last))


def _too_long(*_: object) -> None:
    raise TimeoutError("not done within the limit: " + " < ".join(_stack()))


def _stack() -> list[str]:
    frames = traceback.extract_stack()[:-2]
    ours = [f"{Path(f.filename).name}:{f.lineno}" for f in frames if "/fxcrack/" in f.filename]
    return ours[::-1][:8]


def main() -> int:
    """Run the scenes; the number of those that fail."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", type=seeds_of)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="end after so long")
    parser.add_argument("--log", type=Path, help="append one line per scene")
    parser.add_argument("--limit", type=int, default=60, help="seconds one scene may take")
    given = parser.parse_args()
    signal.signal(signal.SIGALRM, _too_long)
    rows: dict[str, list[tuple[float, bool]]] = defaultdict(list)
    begun, count, refused, failed = time.monotonic(), 0, 0, 0
    for seed in given.seeds:
        if time.monotonic() - begun > given.seconds:
            break
        c, start = Combination.of(seed), time.process_time()
        signal.alarm(given.limit)
        try:
            result, bad = check(c, seed)
        except Exception as error:
            result, bad = Result("failed", {}, None), [f"{type(error).__name__}: {error}"]
        signal.alarm(0)
        spent = time.process_time() - start
        count += 1
        refused += result.reason.startswith("refused")
        failed += bool(bad)
        if bad:
            print(seed, c, bad, result.reason, flush=True)
        if given.log:
            with given.log.open("a") as stream:
                line = [seed, c.kind, result.worst.get("balance"), bad, round(spent, 2)]
                stream.write(json.dumps([*line, result.reason]) + "\n")
        if "balance" in result.worst:
            rows[c.kind].append((result.worst["balance"], bool(bad)))
    print(f"{count} scenes, {refused} refused, {failed} failed, {time.monotonic() - begun:.0f} s")
    if given.table:
        given.table.write_text(
            table(rows, f"{given.seeds.start} to {given.seeds.start + count - 1}")
        )
    return min(failed, 1)


def table(rows: dict[str, list[tuple[float, bool]]], seeds: str) -> str:
    """The table of the documentation."""
    lines = [
        "# Which combination holds to what",
        "",
        f"Random scenes of seeds {seeds} (`tests/stability/combinations.py`): per",
        "combination the number of scenes, the largest error of the energy balance over the",
        "largest energy, and in how many scenes an invariant or a relation did not hold.",
        "",
        "Invariants: energy balance, no penetration, no force on what is released, nothing bonds",
        "again, dissipation never falls, f at onset and f at accepted states. Relations, one per",
        "scene: other numbers of nodes and cells, everything turned, everything mirrored, other",
        "units, slaves and masters exchanged, restart at some row, event against path and",
        "increment stepping. `make random SEEDS=0:500` runs them and writes this table.",
        "",
        "| bodies | faces | release | scenes | balance | not held |",
        "|---|---|---|---|---|---|",
    ]
    for kind in sorted(rows):
        values = rows[kind]
        worst, bad = max(v for v, _ in values), sum(b for _, b in values)
        bodies, faces, release = kind.split("; ")
        lines.append(f"| {bodies} | {faces} | {release} | {len(values)} | {worst:.0e} | {bad} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
