"""What must be installed and no package index can promise: DOLFINx and what it is built with."""

from __future__ import annotations

import importlib.util
import sys

HOW = (
    "With Python 3.12 or newer: pip install 'fxcrack[wheel]'. On Debian and Ubuntu: apt install "
    "python3-dolfinx-real, and a virtual environment made with --system-site-packages. With conda: "
    "conda install -c conda-forge fenics-dolfinx. See the section Installation of the README"
)


def is_installed(name: str) -> bool:
    """Whether a module could be imported, without importing it."""
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):  # ValueError: a place holder in sys.modules
        return False


def check() -> None:
    """Refuse to go on without DOLFINx.

    Raises:
        ImportError: Something is missing; the message says what, and how to get it.
    """
    missing = [name for name in ("dolfinx", "petsc4py", "mpi4py") if not is_installed(name)]
    if missing:
        raise ImportError(
            "fxcrack needs DOLFINx 0.9 to 0.11 with PETSc in real numbers, but "
            f"{', '.join(missing)} cannot be found by {sys.executable}. {HOW}"
        )


check()
