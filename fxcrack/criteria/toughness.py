"""Toughness as a constant, per slave node, a function of position or of temperature.

Whatever the user gave is resolved here to one positive number per front node and mode.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import is_function, list_of, number, positive, table
from fxcrack.base.errors import InputError
from fxcrack.base.positions import numbers_at


@dataclass(frozen=True)
class Tabulated:
    """A property against temperature: linear between entries, constant beyond the first and last.

    Attributes:
        temperatures: Increasing temperatures, shape (n_entries,).
        values: The property at each of them, positive, shape (n_entries,).
    """

    temperatures: Sequence[float]
    values: Sequence[float]

    def __post_init__(self) -> None:
        """Check the table."""
        t, v = table("Tabulated", ("temperatures", "values"), self.temperatures, self.values)
        for i, value in enumerate(v):
            positive("Tabulated", **{f"values[{i}]": value})
        object.__setattr__(self, "temperatures", t)
        object.__setattr__(self, "values", v)

    def at(self, temperature: npt.ArrayLike) -> Array:
        """Property at the given temperatures, of their shape."""
        return np.asarray(
            np.interp(np.asarray(temperature, dtype=np.float64), self.temperatures, self.values)
        )


Property = float | Sequence[float] | Array | Callable[[Array], npt.ArrayLike] | Tabulated
"""A number, one value per slave node, a function of position, or a table against temperature.

A function is given positions of shape (3, n), so ``x[0]`` is the first coordinate, and returns n
values (:mod:`fxcrack.base.positions`). The values per slave node are in the order of the slave
nodes of the interface.
"""


def check_property(owner: str, name: str, value: Property, n_slave: int | None = None) -> None:
    """Check what can be known of a property before the analysis.

    Args:
        owner: Criterion it belongs to, for messages.
        name: Its name, for messages.
        value: The property.
        n_slave: Number of slave nodes, where known.

    Raises:
        InputError: A number is not positive, or values per slave node are too few, too many, NaN or
            not positive; the message names the nodes.
    """
    if isinstance(value, Tabulated) or is_function(value):
        return
    if list_of(value) is None:
        positive(owner, **{name: value})
        return
    array = _per_node(owner, name, value)
    if n_slave is not None and array.size != n_slave:
        if array.size < n_slave:
            where = f"without one: {_listed(np.arange(array.size, n_slave))}"
        else:
            where = f"entries {n_slave} to {array.size - 1} are too many"
        raise InputError(
            f"{owner}: {name} has {array.size} values for {n_slave} slave nodes: {where}; "
            "give one value for every slave node, in the order of the interface's slave nodes"
        )
    _check_values(owner, name, array, np.arange(array.size))


def resolve(
    owner: str,
    name: str,
    value: Property,
    *,
    x: Array,
    nodes: npt.NDArray[np.integer],
    temperature: npt.ArrayLike | None,
    n_slave: int,
) -> Array:
    """Values of a property at front nodes.

    Args:
        owner: Criterion it belongs to, for messages.
        name: Its name, for messages.
        value: The property.
        x: Positions of the front nodes, shape (n, gdim) [length].
        nodes: Their numbers among the slave nodes of the interface, shape (n,).
        temperature: Temperature there, shape (n,) or one number; None without temperatures.
        n_slave: Number of slave nodes of the interface.

    Returns:
        Values, shape (n,).

    Raises:
        InputError: Values are missing, NaN, infinite, zero or negative, the temperature is missing,
            or a function returned the wrong shape; the message names the nodes.
    """
    n = len(nodes)
    if isinstance(value, Tabulated):
        if temperature is None:
            raise InputError(
                f"{owner}: {name} depends on temperature, but the debond has none; "
                "give Debond(temperature=...), or the property as a number"
            )
        result = np.broadcast_to(value.at(temperature), (n,))
    elif is_function(value):
        result = numbers_at(owner, name, value, np.asarray(x, dtype=np.float64))
    elif list_of(value) is None:
        result = np.full(n, number(owner, name, value))
    else:
        check_property(owner, name, value, n_slave)
        result = _per_node(owner, name, value)[nodes]
    _check_values(owner, name, result, nodes)
    return np.array(result)


def _per_node(owner: str, name: str, value: object) -> Array:
    try:
        array = np.asarray(value)
        array = array.astype(np.float64) if array.dtype.kind in "fiu" else np.empty((0, 0))
    except (TypeError, ValueError):
        array = np.empty((0, 0))
    if array.ndim != 1 or not array.size:
        raise InputError(
            f"{owner}: {name} must be a number, a flat list of one number per slave node, a "
            "function of position or a Tabulated, but it is a "
            f"{type(value).__name__} of shape {np.shape(array)}"
        )
    return array


def _check_values(owner: str, name: str, values: Array, nodes: npt.NDArray[np.integer]) -> None:
    bad = np.flatnonzero(~((values > 0.0) & (values < np.inf)))
    if bad.size:
        raise InputError(
            f"{owner}: {name} = {values[bad[0]]} at slave node {nodes[bad[0]]}; it must be "
            f"positive and finite everywhere, but is not at {_listed(nodes[bad])}; correct it there"
        )


def _listed(nodes: npt.NDArray[np.integer], most: int = 8) -> str:
    """'slave nodes 3, 5, 8' with an ellipsis when there are many."""
    text = ", ".join(str(i) for i in nodes[:most].tolist())
    more = f" and {nodes.size - most} more" if nodes.size > most else ""
    return f"slave node{'s' if nodes.size > 1 else ''} {text}{more}"
