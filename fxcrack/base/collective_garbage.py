"""PETSc objects that are no longer used, freed on all ranks together.

Freeing an object that belongs to several ranks is collective, while Python drops objects on each
rank at a time of its own. PETSc therefore keeps dropped objects until
:func:`petsc4py.PETSc.garbage_cleanup` is called with their communicator. Each mesh has a
communicator of its own, so that nobody calls it once the mesh is gone: the objects and their
communicators, of which MPICH has 2048, would never be freed.
"""

from __future__ import annotations

import gc
import weakref
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc


@dataclass(frozen=True)
class _Entry:
    """One mesh.

    Attributes:
        owner: What uses the objects.
        parent: Communicator on which the mesh was made; the ranks are the same.
        inner: PETSc's own communicator of the mesh's, kept alive until the owner is gone.
    """

    owner: weakref.ref[object]
    parent: MPI.Intracomm
    inner: PETSc.Comm


_entries: list[_Entry] = []

_MANY = 16
"""Meshes in use at once that are unusual: Python is then asked to look for what is unused."""


def watch(owner: object, parent: MPI.Intracomm, comm: MPI.Intracomm) -> None:
    """Free what lies on a communicator once its owner is gone; collective.

    Args:
        owner: Whoever makes PETSc objects on ``comm``.
        parent: Communicator of the same ranks, on which :func:`collect` will be called.
        comm: The mesh's own communicator.
    """
    if parent.size > 1:
        inner = PETSc.Comm(comm).duplicate()
        _entries.append(_Entry(weakref.ref(owner), parent, inner))


def collect(parent: MPI.Intracomm) -> None:
    """Free the PETSc objects that no rank uses any more; collective.

    Args:
        parent: Communicator whose ranks call. What was made by other groups of ranks stays.
    """
    if parent.size == 1:
        return  # freed at once
    if len(_entries) > _MANY:
        gc.collect()
    same = (MPI.IDENT, MPI.CONGRUENT)
    mine = [e for e in _entries if MPI.Comm.Compare(parent, e.parent) in same]
    used = [e.owner() is not None for e in mine]
    PETSc.garbage_cleanup(PETSc.Comm(parent))
    for entry, somewhere in zip(
        mine, parent.allreduce(used, op=_either) if mine else [], strict=True
    ):
        PETSc.garbage_cleanup(entry.inner)
        if not somewhere:
            entry.inner.destroy()
            _entries.remove(entry)


def _either(left: list[bool], right: list[bool]) -> list[bool]:
    return [a or b for a, b in zip(left, right, strict=True)]
