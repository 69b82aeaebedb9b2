"""Velocity of the nodes at the start of explicit dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.continuum import Continuum

_INSIDE = 1e-9
"""Part of the way to the middle of its cells at which a node's velocity is looked up."""


def starting_velocity(continuum: Continuum, velocity: Sequence[Any] | None) -> Array:
    """Velocity of the owned dofs, shape (n_local,), length/time.

    Directors of shells do not turn at first.

    Args:
        continuum: Displacement space; first order.
        velocity: A number or a function of position per component; ``None`` for bodies at rest.

    Raises:
        InputError: The number of components is not that of the displacement, or a function fails or
            gives other than one number per position.
    """
    gdim = continuum.gdim
    out = np.zeros((continuum.layout.n_owned, continuum.layout.n_unknowns))
    if velocity is None:
        return out.ravel()
    if len(velocity) != gdim:
        raise InputError(f"Inertia: velocity has {len(velocity)} components, {gdim} needed")
    x = _positions_within(continuum)
    for c, value in enumerate(velocity):
        problem = None
        try:
            if callable(value):
                out[:, c] = numbers_at("Inertia", f"velocity[{c}]", value, x)
            else:
                out[:, c] = float(value)
        except InputError as error:  # on this rank, perhaps
            problem = str(error)
        raise_on_all_ranks(continuum.comm, problem)
    return out.ravel()


def _positions_within(continuum: Continuum) -> Array:
    """Positions of the owned nodes, slightly inside their own body, shape (n, 3).

    The two nodes at one place of an interface belong to bodies that may move differently.
    """
    x, cells = continuum.positions(), continuum.space.dofmap.list
    middle, count = np.zeros_like(x), np.zeros(len(x))
    np.add.at(middle, cells, x[cells].mean(axis=1)[:, None])
    np.add.at(count, cells, 1.0)
    n = continuum.layout.n_owned
    inside = middle[:n] / np.maximum(count[:n], 1.0)[:, None]
    return np.asarray(x[:n] + _INSIDE * (inside - x[:n]))


__all__ = ["starting_velocity"]
