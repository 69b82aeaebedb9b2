"""The state of nonlinear bodies and their interfaces as arrays, and back; for checkpoints.

What :mod:`fxcrack.solve.state` holds of a linear model is not enough here: displacements and what
the terms remember decide the forces, and the dense system is that of the last iterate. Fields are
kept as each rank holds them, so a restart needs the same ranks.
"""

from __future__ import annotations

import hashlib

import numpy as np
import numpy.typing as npt

from fxcrack import compat
from fxcrack.errors import InputError
from fxcrack.solve.jump_system import Equilibrium
from fxcrack.solve.newton_model import NewtonModel

Arrays = dict[str, npt.NDArray[np.generic]]

_PAIRING = ("paired", "masters", "weights", "frames", "gap")
"""What changes of a pair where faces slide far."""


def take_bodies(model: NewtonModel) -> Arrays:
    """Everything but what :func:`fxcrack.solve.state.take_states` holds; collective.

    Returns:
        On rank 0, bodies.R.* of every rank R; per pair force[p] and index[p], shape
        (n_nodes, gdim), and pairing.*[p]; conjugate, shape (n_loads,); dense.*; sums.
    """
    comm = model.comm
    model.refresh()
    mine = {"partition": _partition(model), **model.bodies.state()}
    out: Arrays = {"ranks": np.array(comm.size)}
    for rank, state in enumerate(comm.gather(mine) or []):
        out |= {f"bodies.{rank}.{name}": values for name, values in state.items()}
    for p, (pair, index) in enumerate(zip(model.pairs, model.index, strict=True)):
        out[f"index[{p}]"] = index
        out[f"force[{p}]"] = np.where(index >= 0, model.state.force[np.maximum(index, 0)], 0.0)
        out |= {f"pairing.{name}[{p}]": getattr(pair, name) for name in _PAIRING}
    out["conjugate"] = model.state.conjugate
    out |= {f"dense.{name}": values for name, values in model.dense().items()}
    out["sums"] = np.array([model.pairing_energy, model.largest_force])
    return out


def give_bodies(model: NewtonModel, arrays: Arrays, time: float) -> None:
    """Put displacements, terms and pairing into the saved state; before the window is made.

    Collective.

    Args:
        model: The model of the same scene.
        arrays: From :func:`take_bodies`.
        time: Time of the state.

    Raises:
        InputError: The ranks hold other parts of the mesh than when the state was saved.
    """
    comm = model.comm
    start = f"bodies.{comm.rank}."
    mine = {k[len(start) :]: v for k, v in arrays.items() if k.startswith(start)}
    same = int(arrays["ranks"]) == comm.size
    same = same and np.array_equal(mine["partition"], _partition(model))
    if not min(comm.allgather(same)):
        raise InputError(
            f"the checkpoint is of nonlinear bodies on {int(arrays['ranks'])} ranks, whose fields "
            f"fit the same ranks and mesh only; this run has {comm.size} ranks, or divides the "
            f"mesh otherwise. Run on {int(arrays['ranks'])} ranks, or without restart"
        )
    for p, pair in enumerate(model.pairs):
        known = {name: arrays[f"pairing.{name}[{p}]"] for name in _PAIRING}
        model.pair_as(p, {n: v.astype(getattr(pair, n).dtype) for n, v in known.items()})
    model.place({name: values.astype(float) for name, values in mine.items()}, time)
    model.pairing_energy, model.largest_force = (float(x) for x in arrays["sums"])


def give_accepted(model: NewtonModel, arrays: Arrays) -> None:
    """Set contact, given forces and the dense system; after the window was made."""
    system = model.system
    states = {name: np.zeros(system.n_window) for name in system.state_dict()}
    force = np.zeros(system.n_window)
    same = True
    for p, index in enumerate(model.index):
        inside = index >= 0
        same = same and np.array_equal(index, arrays[f"index[{p}]"])
        force[index[inside]] = arrays[f"force[{p}]"][inside]
        for name, values in states.items():
            values[index[inside]] = arrays[f"{name}[{p}]"][inside]
    system.load_state_dict(states)
    loads, conjugate = (np.asarray(arrays[k], dtype=float) for k in ("loads", "conjugate"))
    model.state = Equilibrium(loads, force, model.present_jump(), conjugate)
    model.anchor()
    if same:  # the march goes on as it would have, to round-off
        model.take_dense(
            {name: np.asarray(arrays[f"dense.{name}"], dtype=float) for name in model.dense()}
        )


def _partition(model: NewtonModel) -> npt.NDArray[np.uint8]:
    """Digest of the cells and dofs of this rank."""
    continuum = model.continuum
    parts = [compat.original_cell_index(continuum.mesh.domain), continuum.space.dofmap.list]
    digest = hashlib.sha256()
    for part in parts:
        digest.update(np.ascontiguousarray(part, dtype=np.int64).tobytes())
    return np.frombuffer(digest.digest(), np.uint8)


__all__ = ["give_accepted", "give_bodies", "take_bodies"]
