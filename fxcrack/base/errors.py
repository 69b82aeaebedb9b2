"""One exception family, and the means to raise the same exception on every rank together.

Every message says what is wrong, where, and how to correct it.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import NoReturn

from mpi4py import MPI


class FxcrackError(Exception):
    """Base of all errors that fxcrack raises itself."""


class InputError(FxcrackError, ValueError):
    """The scene, the mesh or an argument asks for something that cannot be done."""


class MeshError(InputError):
    """A mesh file, a gmsh model or a named group cannot be used as asked."""


class InterfaceError(InputError):
    """Slave and master surfaces, the bonded set or the supports on them contradict each other."""


class SolverError(FxcrackError, RuntimeError):
    """A factorisation or an iteration failed; the message carries the reason in words."""


class ConvergenceError(SolverError):
    """An iteration ended without meeting its tolerance."""


class ComesApart(SolverError):
    """Total separation: the load exceeds what the remaining interface carries."""


class EnergyImbalance(SolverError):
    """Work and energies of an increment do not balance: it is too large."""


NO_EQUILIBRIUM = (ConvergenceError, ComesApart, EnergyImbalance)
"""What is raised where there is no equilibrium at the end of an increment, or none is found."""


class EnergyError(FxcrackError, RuntimeError):
    """The energies of a step do not balance; the history is kept.

    Attributes:
        imbalance: The part of the largest energy that is missing, or that came out of nothing.
    """

    def __init__(self, message: str, imbalance: float) -> None:
        super().__init__(message)
        self.imbalance = imbalance


def raise_on_all_ranks(
    comm: MPI.Comm, problem: str | None, error: type[FxcrackError] = InputError
) -> None:
    """Raise on all ranks if any rank found a problem; collective.

    Args:
        comm: Communicator on which all ranks call.
        problem: What this rank found, ``None`` if nothing.
        error: Exception class to raise.

    Raises:
        FxcrackError: ``error`` with the message of the lowest rank that found a problem.
    """
    found = [p for p in comm.allgather(problem) if p]
    if found:
        raise error(found[0])


def unknown_name(kind: str, name: str, known: list[str]) -> NoReturn:
    """Raise an :class:`InputError` that lists the names that would have worked."""
    meant = did_you_mean(name, known)
    raise InputError(
        f"there is no {kind} '{name}'{meant}; known: {', '.join(sorted(known)) or 'none'}"
    )


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Words that propose the known name closest to a misspelt one, empty if none is close."""
    close = get_close_matches(name, list(known), n=1, cutoff=0.75)
    return f" (did you mean '{close[0]}'?)" if close else ""
