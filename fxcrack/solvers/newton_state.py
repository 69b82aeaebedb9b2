"""Accepted states of nonlinear bodies to return to, and those of a checkpoint with its tangent.

The dense system need not be that of the accepted displacement: a resumed step goes on with the
same one, so that it does what it would have done, to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.equilibrium.contact import ContactSystem
from fxcrack.equilibrium.interface_state import Arrays, InterfaceState
from fxcrack.interface.jump_coordinates import JumpCoordinates
from fxcrack.interface.pair import Pair
from fxcrack.solvers.deformed_interfaces import DeformedInterfaces
from fxcrack.solvers.tangent import CondensedTangent


@dataclass(frozen=True)
class NewtonState:
    """An accepted state to return to.

    Attributes:
        interfaces: State of the interfaces.
        pairs: Their pairing.
        u: Displacement, dofs owned by this rank.
        terms: States of the form terms.
        at: Time.
        pairing_energy: Energy that new pairings have taken so far.
    """

    interfaces: InterfaceState
    pairs: list[Pair]
    u: Array
    terms: list[dict[str, Array]]
    at: float
    pairing_energy: float


class Sums(NamedTuple):
    """Numbers that a computation carries from one accepted state to the next.

    Attributes:
        pairing_energy: Energy that new pairings have taken so far.
        largest_force: Largest norm of the internal forces of an accepted state, force.
        largest_energy: :attr:`StoredEnergy.largest`.
        drift: That of the tangent, see :class:`CondensedTangent`.
        most_energy: :attr:`StoredEnergy.most`.
        energy_noise: Work of round-off, see :class:`~fxcrack.solvers.newton.NewtonSolver`.
    """

    pairing_energy: float
    largest_force: float
    largest_energy: float
    drift: float
    most_energy: float
    energy_noise: float = 0.0

    @classmethod
    def of(cls, values: Array) -> Sums:
        """From an array of shape (6,), or less of checkpoints before the last ones were known."""
        pairing, force, largest, drift, *more = (float(x) for x in values)
        most = more[0] if more else largest
        return cls(pairing, force, largest, drift, most, more[1] if len(more) > 1 else 0.0)


@dataclass(frozen=True)
class ResumedTangent:
    """The condensed tangent of a checkpoint.

    Attributes:
        numbers: Number of each retained jump per pair, shape (n_nodes, gdim).
        schur: S with its borders, shape (n_last, n_last).
        offset: Forces at no jump and no load, shape (n_last,), force.
        face_loads: Forces of the loads on retained jumps, shape (n_retained, n_forces), force.
        drift: That of the tangent, see :class:`CondensedTangent`.
        origin: State of the bodies in which it was made, ``None`` where it is constant.
        began: End and length of the increment in which it was made, time.
    """

    numbers: list[Ints]
    schur: Array
    offset: Array
    face_loads: Array
    drift: float
    origin: dict[str, Array] | None
    began: tuple[float, float]

    @classmethod
    def from_arrays(cls, arrays: Arrays, numbers: list[Ints], drift: float) -> ResumedTangent:
        """What :func:`tangent_arrays` gave."""
        schur, offset, faces = (
            arrays[f"dense.{name}"].astype(float) for name in ("schur", "offset", "faces")
        )
        origin, began = None, (0.0, 0.0)
        if "began" in arrays:
            origin = part_of(arrays, "tangent.")
            end, dt = (float(x) for x in arrays["began"])
            began = end, dt
        return cls(numbers, schur, offset, faces, drift, origin, began)

    def condense(self, tangent: CondensedTangent, coordinates: JumpCoordinates, at: float) -> None:
        """Condense the bodies where the tangent was made; collective.

        It serves on while it is not far off, so that it need not be that of the accepted state.

        Args:
            tangent: Made again; its bodies are in the accepted state, before and after.
            coordinates: The retained jumps.
            at: Time of the accepted state.
        """
        if self.origin is None:
            tangent.condense(coordinates)
            return
        bodies = tangent.bodies
        accepted = bodies.snapshot()
        bodies.begin(*self.began)
        bodies.restore(self.origin)
        tangent.condense(coordinates)
        if not bodies.dynamic:
            bodies.begin(at, 0.0)
        bodies.reset(accepted)

    def fits(self, index: list[Ints]) -> bool:
        """Whether it belongs to retained jumps of these numbers, shape (n_nodes, gdim) each."""
        return all(map(np.array_equal, self.numbers, index))


def body_arrays(bodies: WeakForm, interfaces: DeformedInterfaces, sums: Sums) -> Arrays:
    """The accepted bodies as plain arrays; collective.

    Returns:
        bodies.* of :meth:`WeakForm.state`, on rank 0; pairing.*[p] where faces slide far; sums,
        shape (6,).
    """
    out: Arrays = {f"bodies.{name}": values for name, values in bodies.state().items()}
    for p, known in enumerate(interfaces.pairing()):
        out |= {f"pairing.{name}[{p}]": values for name, values in known.items()}
    out["sums"] = np.array(sums)
    return out


def restore_bodies(
    arrays: Arrays, bodies: WeakForm, interfaces: DeformedInterfaces, time: float
) -> Sums:
    """Take over what :func:`body_arrays` gave, of any number of ranks; collective.

    Args:
        arrays: Its arrays, the same on all ranks.
        bodies: The form terms.
        interfaces: The interfaces.
        time: Time of the state.

    Returns:
        The sums.

    Raises:
        InputError: The mesh has its cells in another order than when the state was saved.
    """
    interfaces.restore_pairing(arrays, "pairing.{}[{}]")
    if bodies.continuum.temperature is not None:
        bodies.continuum.temperature.set(time)
    bodies.restore(part_of(arrays, "bodies."))
    return Sums.of(arrays["sums"].astype(float))


def tangent_arrays(tangent: CondensedTangent, system: ContactSystem, face_loads: Array) -> Arrays:
    """The present tangent as plain arrays; collective.

    Returns:
        dense.*, the dense system: schur, shape (n_last, n_last), offset, shape (n_last,), faces,
        shape (n_retained, n_forces); where it is not constant tangent.*, the state in which it was
        made, as :meth:`WeakForm.state` gives it, and began, shape (2,).
    """
    assert system.offset is not None
    out: Arrays = {
        "dense.schur": system.schur,
        "dense.offset": system.offset,
        "dense.faces": face_loads,
    }
    origin = tangent.origin
    if origin is not None:
        made = tangent.bodies.state(origin.local)
        out |= {f"tangent.{name}": values for name, values in made.items()}
        out["began"] = np.array(origin.began)
    return out


def part_of(arrays: Arrays, prefix: str) -> dict[str, Array]:
    """Arrays whose names begin with a prefix, without it."""
    return {
        k.removeprefix(prefix): v.astype(float) for k, v in arrays.items() if k.startswith(prefix)
    }


__all__ = [
    "NewtonState",
    "ResumedTangent",
    "Sums",
    "body_arrays",
    "part_of",
    "restore_bodies",
    "tangent_arrays",
]
