"""Compiler flags for element kernels that are run again and again.

FFCx writes C; DOLFINx compiles it with ``-O2``. The flags here let the compiler use all vector
instructions of the processor and reorder sums, which makes the forces of a brick four times as
fast. ``-ffast-math`` itself is not among them: a library linked with it turns subnormal numbers off
for the whole process. ``-march=native`` belongs to one kind of processor, so compiled kernels are
kept in a folder per processor: machines of different kinds may share a home.
"""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from pathlib import Path
from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.jit
from dolfinx import fem
from mpi4py import MPI

from fxcrack.base import log

FLAGS = (
    *("-O3", "-g0", "-march=native", "-fno-math-errno", "-fno-trapping-math"),
    *("-fno-signed-zeros", "-fassociative-math", "-ffp-contract=fast"),
)
"""Flags of kernels; sums in them depend on the processor in the last digits."""

_failed: set[str] = set()


def processor() -> str:
    """Short name of this kind of processor, from its model and its instructions."""
    about = platform.machine() + platform.processor()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        lines = info.read_text(encoding="utf-8", errors="replace").splitlines()
        named = ("model name", "flags", "Features", "CPU part")
        about += "".join(dict.fromkeys(x for x in lines if x.startswith(named)))
    return hashlib.sha256(about.encode()).hexdigest()[:12]


@cache
def jit_options() -> dict[str, Any]:
    """Options for ``fem.form`` with :data:`FLAGS` and a cache of their own."""
    folder = Path(dolfinx.jit.get_options()["cache_dir"]) / f"fxcrack-{processor()}"
    return {"cffi_extra_compile_args": list(FLAGS), "cache_dir": folder}


def fast_form(comm: MPI.Comm, form: Any) -> Any:
    """Compile a form with :data:`FLAGS`, or as DOLFINx does where the compiler refuses them.

    Collective.

    Args:
        comm: Communicator of the mesh.
        form: UFL form.
    """
    if not _failed:
        try:
            return fem.form(form, jit_options=jit_options())
        except Exception as error:  # whatever a compiler may raise; all ranks raise together
            _failed.add(str(error))
            log.warn(
                "the compiler refuses the flags of fast kernels (%s); forces are assembled with "
                "those of DOLFINx, which takes up to four times as long",
                str(error).splitlines()[0] if str(error) else type(error).__name__,
            )
    return fem.form(form)


__all__ = ["FLAGS", "fast_form", "jit_options", "processor"]
