"""Modules of this package run in processes of their own, on any number of ranks."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

# what a launcher tells its processes must not reach the processes of another launcher
_LAUNCHER = ("PMI", "HYD", "MPIR_", "MPICH_", "OMPI_", "PRTE_", "OPAL_", "ORTE_", "MPI_LOCAL")
_KEPT = ("OMPI_MCA_btl", "OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM")


def launcher() -> str | None:
    """The mpiexec that belongs to this Python's environment, else the one on PATH, if any."""
    near = Path(sys.executable).parent / "mpiexec"
    return str(near) if near.exists() else shutil.which("mpiexec")


def command(module: str, words: list[str], ranks: int) -> list[str] | None:
    """Command line that runs a module with this Python.

    Returns:
        ``None`` if several ranks are asked for and no launcher is there.
    """
    # -P: a file of the present folder that is called as a module of Python is not imported
    python = [sys.executable, "-P", "-m", module, *words]
    if ranks == 1:
        return python
    found = launcher()
    return None if found is None else [found, "-n", str(ranks), *python]


def environment() -> dict[str, str]:
    """This process's environment, without what its own launcher left in it.

    More ranks than cores are allowed, also in Open MPI (4 and 5). Linear algebra runs on one thread
    per rank unless OMP_NUM_THREADS says otherwise: ranks share the cores.
    """
    found = {k: v for k, v in os.environ.items() if k in _KEPT or not k.startswith(_LAUNCHER)}
    found.setdefault("OMP_NUM_THREADS", "1")
    found["OMPI_MCA_rmaps_base_oversubscribe"] = "1"
    found["PRTE_MCA_rmaps_default_mapping_policy"] = ":oversubscribe"
    return found


def run_module(module: str, words: list[str], ranks: int, limit: float) -> dict[str, Any]:
    """Run a module to its end and read the JSON object in the last line it prints.

    Args:
        module: Name of the module; it prints on rank 0 only.
        words: Its arguments.
        ranks: Number of ranks.
        limit: Seconds it may take.

    Returns:
        What it printed, or {"failed": reason}.
    """
    line = command(module, words, ranks)
    if line is None:
        return {"failed": "there is no mpiexec"}
    try:
        done = subprocess.run(
            line, env=environment(), capture_output=True, text=True, check=True, timeout=limit,
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
        found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except subprocess.TimeoutExpired:
        return {"failed": f"not finished after {limit:g} s"}
    except subprocess.CalledProcessError as error:
        return {"failed": f"code {error.returncode}: {error.stderr.strip()[-200:]}"}
    except (OSError, ValueError, LookupError) as error:
        return {"failed": f"{type(error).__name__}: {error}"}
    return found
