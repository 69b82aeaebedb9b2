"""What fxcrack runs on: versions, solvers, ranks and threads."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import platform

import fxcrack  # isort: skip  (orders MPI before DOLFINx)
import dolfinx
import petsc4py
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.machine import cores
from fxcrack.condensation.mumps_schur import library

_PACKAGES = ("mumps", "superlu_dist", "superlu", "umfpack", "strumpack", "hypre", "ml", "ptscotch")


def information() -> dict[str, str]:
    """Versions, solvers and ranks, one line each."""
    petsc = ".".join(str(n) for n in PETSc.Sys.getVersion())
    kind = f"{PETSc.ScalarType.__name__}, {PETSc.IntType.__name__}"
    solvers = [p for p in _PACKAGES if PETSc.Sys.hasExternalPackage(p)]
    schur = "taken out of MUMPS through PETSc's C interface"
    if library() is None:
        schur = "by back-solves (PETSc's C interface with MUMPS cannot be reached)"
    mpi = MPI.Get_library_version().replace("\0", "").split("\n")[0].split(",")[0]
    return {
        "fxcrack": fxcrack.__version__,
        "python": f"{platform.python_version()}, {platform.system()} {platform.machine()}",
        "dolfinx": dolfinx.__version__,
        "PETSc": f"{petsc} ({kind})",
        "petsc4py": petsc4py.__version__,
        "mpi4py": f"{importlib.metadata.version('mpi4py')}, {' '.join(mpi.split())}",
        "gmsh": _gmsh(),
        **{p: importlib.metadata.version(p) for p in ("numpy", "scipy")},
        "solvers": ", ".join([*solvers, "gamg"]),
        "Schur complement": schur,
        "ranks": str(MPI.COMM_WORLD.size),
        "threads": f"{os.environ.get('OMP_NUM_THREADS', 'not limited')} "
        f"(OMP_NUM_THREADS), {cores()} cores",
    }


def _gmsh() -> str:
    """Version of gmsh, or why it does not load."""
    try:
        return str(importlib.import_module("gmsh").__version__)
    except (ImportError, OSError, AttributeError) as error:
        return f"does not load: {error}"


__all__ = ["information"]
