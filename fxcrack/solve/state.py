"""The state of a condensed model as a dictionary of arrays, and back; for checkpoints.

Arrays belong to slave nodes and not to window components: the window of a model that takes them
may be another one. Components that are outside a window carry 0.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fxcrack.errors import InputError
from fxcrack.solve.condensed import CondensedModel
from fxcrack.solve.rubbing import FrictionMemory
from fxcrack.solve.soft_bond import SoftBond

Array = npt.NDArray[np.float64]
Arrays = dict[str, npt.NDArray[np.generic]]

_FAR = 1e-6
"""Jumps found from the saved states may differ by this fraction from the saved ones: many times
round-off, and less than any other body, mesh or load would give."""


def take_states(model: CondensedModel) -> Arrays:
    """The state of the interfaces and the loads they are in equilibrium with.

    Returns:
        loads, shape (n_loads,); per pair p bonded[p], shape (n_nodes,), and jump[p] and what
        :meth:`JumpSystem.state_dict` holds, shape (n_nodes, gdim); soft.* per softening
        bond;
        friction.* per contact node if there is friction.
    """
    out: Arrays = {"loads": model.state.loads}
    fields = {"jump": model.state.jump, **model.system.state_dict()}
    for p, (front, index) in enumerate(zip(model.fronts, model.index, strict=True)):
        out[f"bonded[{p}]"] = front.bonded
        for name, values in fields.items():
            out[f"{name}[{p}]"] = np.where(index >= 0, values[np.maximum(index, 0)], 0.0)
    if model.system.friction is not None:
        memory = FrictionMemory.of(model.system.friction, model.state)
        out |= {f"friction.{name}": values for name, values in memory.state_dict().items()}
        out["friction.energy"] = np.array(model.friction_energy)
    return out | _take_bonds(model)


def _take_bonds(model: CondensedModel) -> Arrays:
    bonds = model.system.soft.bonds
    rows = [
        (i, b.where[0], node, local)
        for i, b in enumerate(bonds)
        for node, local in zip(*b.where[1:], strict=True)
    ]
    return {
        "soft.where": np.array(rows, dtype=np.int64).reshape(-1, 4),
        "soft.direction": np.concatenate([np.zeros(0), *(b.direction for b in bonds)]),
        "soft.strength": np.array([b.strength for b in bonds], dtype=float),
        "soft.final": np.array([b.final for b in bonds], dtype=float),
        "soft.largest": np.array([np.nan if b.largest is None else b.largest for b in bonds]),
        "soft.finished": np.array(model.system.soft.finished),
    }


def give_bonds(model: CondensedModel, arrays: Arrays) -> None:
    """Open what was open and let soften what softened; before the window is made."""
    pressed = []
    for p, front in enumerate(model.fronts):
        front.release(np.flatnonzero(front.bonded & ~arrays[f"bonded[{p}]"].astype(bool)))
        if not model.pairs[p].interface.contact:
            held = np.flatnonzero(arrays[f"contact[{p}]"].any(axis=1))
            pressed += [(p, int(node)) for node in held]
    model.keep = [*model.keep, *pressed]
    law = (arrays[f"soft.{name}"].astype(float) for name in ("strength", "final", "largest"))
    rows, direction = arrays["soft.where"].astype(np.int64), arrays["soft.direction"].astype(float)
    bonds = []
    for i, (strength, final, largest) in enumerate(zip(*law, strict=True)):
        mine = rows[:, 0] == i
        _, pair, nodes, local = rows[mine].T
        bonds.append(
            SoftBond(
                local, direction[mine], float(strength), float(final), (int(pair[0]), nodes, local),
                None if np.isnan(largest) else float(largest),
            )
        )  # fmt: skip
    model.take_over(bonds, float(arrays["soft.finished"]))
    if "friction.where" in arrays:
        memory = FrictionMemory.from_state_dict(
            {name.split(".")[1]: v for name, v in arrays.items() if name.startswith("friction.")}
        )
        model.take_over_friction(memory, float(arrays["friction.energy"]))


def give_equilibrium(model: CondensedModel, arrays: Arrays, force: Array) -> None:
    """Set contact and find the saved equilibrium again; after the window was made.

    Args:
        model: Prepared model that went through :func:`give_bonds`.
        arrays: From :func:`take_states`.
        force: Given forces of bonds that let go with time, shape (n_window,).

    Raises:
        InputError: The jumps are not those that were saved.
    """
    system, loads = model.system, np.asarray(arrays["loads"], dtype=float)
    states = {name: np.zeros(system.n_window) for name in system.state_dict()}
    saved = np.zeros(system.n_window)
    for p, index in enumerate(model.index):
        inside = index >= 0
        saved[index[inside]] = arrays[f"jump[{p}]"][inside]
        for name, values in states.items():
            values[index[inside]] = arrays[f"{name}[{p}]"][inside]
    system.load_state_dict(states)
    if system.friction is None:
        model.state = system.linear(loads, force)
    else:
        # nothing moves, so what slips and what sticks cannot be told from the equilibrium
        before = system.friction.save()
        model.state = system.equilibrium(loads, force)
        system.friction.restore(before)
    known = saved != 0.0
    size = np.abs(saved).max(initial=0.0)
    off = float(np.abs(model.state.jump - saved)[known].max(initial=0.0))
    if off > _FAR * size:
        raise InputError(
            f"the checkpoint does not fit: jumps differ by {off / size:.1e} of the largest one "
            "from the equilibrium of this scene; bodies or loads are others than when it was "
            "written (a function of position, perhaps). Run without restart, or mend the scene"
        )


__all__ = ["give_bonds", "give_equilibrium", "take_states"]
