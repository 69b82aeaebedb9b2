"""The state of nonlinear bodies and their interfaces as arrays, and back; for checkpoints.

What :mod:`fxcrack.solve.state` holds of a linear model is not enough here: displacements and what
the terms remember decide the forces, and the dense system is that of the last iterate.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fxcrack.interface.sliding import CHANGING, changing, with_changing
from fxcrack.solve.jump_system import Equilibrium
from fxcrack.solve.newton_model import NewtonModel

Arrays = dict[str, npt.NDArray[np.generic]]


def take_bodies(model: NewtonModel) -> Arrays:
    """Everything but what :func:`fxcrack.solve.state.take_states` holds; collective.

    Returns:
        On rank 0, bodies.* of :meth:`Bodies.state`; per pair force[p] and index[p], shape
        (n_nodes, gdim), and pairing.*[p] where faces slide far; conjugate, shape (n_loads,);
        dense.*; sums.
    """
    out: Arrays = {f"bodies.{name}": values for name, values in model.bodies.state().items()}
    for p, index in enumerate(model.index):
        out[f"index[{p}]"] = index
        out[f"force[{p}]"] = np.where(index >= 0, model.state.force[np.maximum(index, 0)], 0.0)
    for p, (pair, master) in enumerate(zip(model.pairs, model.masters, strict=True)):
        known = {} if master is None else changing(pair, master)
        out |= {f"pairing.{name}[{p}]": values for name, values in known.items()}
    out["conjugate"] = model.state.conjugate
    out |= {f"dense.{name}": values for name, values in model.dense().items()}
    sums = model.pairing_energy, model.largest_force, model.largest_energy, model.drift
    out["sums"] = np.array(sums)
    return out


def give_bodies(model: NewtonModel, arrays: Arrays, time: float) -> None:
    """Put displacements, terms and pairing into the saved state; before the window is made.

    Collective.

    Args:
        model: The model of the same scene, on any number of ranks.
        arrays: From :func:`take_bodies`.
        time: Time of the state.

    Raises:
        InputError: The mesh has its cells in another order than when the state was saved.
    """
    for p, master in enumerate(model.masters):
        if master is not None:
            known = {name: arrays[f"pairing.{name}[{p}]"] for name in CHANGING}
            model.pairs[p] = with_changing(model.pairs[p], master, known)
    bodies = {k.split(".", 1)[1]: v for k, v in arrays.items() if k.startswith("bodies.")}
    model.place({name: values.astype(float) for name, values in bodies.items()}, time)
    sums = (float(x) for x in arrays["sums"])
    model.pairing_energy, model.largest_force, model.largest_energy, _ = sums


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
        model.drift = float(arrays["sums"][3])


__all__ = ["give_accepted", "give_bodies", "take_bodies"]
