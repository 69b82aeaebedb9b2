"""Temperature of the slave nodes of an interface at any time.

T(t) = T_ref + sum_k a_k(t) (T_k - T_ref),    linear in time between the amplitudes' corners
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import format_point, number
from fxcrack.base.errors import InputError
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.amplitudes import AmplitudeLike
from fxcrack.continuum.continuum import Continuum
from fxcrack.criteria.probe import FrontProbe
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair

Given = float | Callable[[Array], npt.ArrayLike] | None


@dataclass(frozen=True)
class InterfaceTemperature:
    """Fields on the slave nodes and their factors in time.

    Attributes:
        base: Temperature without any of them, shape (n_nodes,).
        patterns: What each adds, shape (n_patterns, n_nodes).
        amplitudes: Factors in time.
    """

    base: Array
    patterns: Array
    amplitudes: tuple[AmplitudeLike, ...] = ()

    def __call__(self, time: float) -> Array:
        """Temperature of the slave nodes at a time, shape (n_nodes,)."""
        factors = np.array([a(time) for a in self.amplitudes])
        return np.asarray(self.base + factors @ self.patterns)

    @property
    def steady(self) -> bool:
        """Whether it never changes."""
        return not self.amplitudes

    def breaks(self) -> tuple[float, ...]:
        """Times at which it bends."""
        return tuple(b for a in self.amplitudes for b in a.breaks())


def steady(
    temperature: InterfaceTemperature | None, probe: FrontProbe, criterion: object
) -> Array | None:
    """Temperature of the slave nodes, shape (n_nodes,), which never changes; None without.

    Args:
        temperature: That of the interface.
        probe: The interface.
        criterion: The criterion that needs it.

    Raises:
        InputError: It changes in time.
    """
    if temperature is None:
        return None
    if not temperature.steady:
        raise InputError(
            f"interface '{probe.pair.title}': {type(criterion).__name__} cannot follow a "
            "temperature that changes in time; give Debond(temperature=...), or a criterion by "
            "energy release rates"
        )
    return temperature(0.0)


def given_temperature(pair: Pair, gdim: int, temperature: Given) -> InterfaceTemperature | None:
    """Temperature a user gave for an interface; None without.

    Raises:
        InputError: The function returned another shape, or a temperature is not finite.
    """
    if temperature is None:
        return None
    x = pair.surface.x[:, :gdim]
    where = f"interface '{pair.title}'"
    if callable(temperature):
        values = numbers_at(where, "temperature", temperature, x)
    else:
        values = np.full(len(x), number(where, "temperature", temperature))
    if not np.isfinite(values).all():
        i = int(np.argmin(np.isfinite(values)))
        raise InputError(
            f"{where}: temperature is {values[i]} at {format_point(x[i])}; give a number"
        )
    return InterfaceTemperature(values, np.zeros((0, len(x))))


def scene_temperature(pair: Pair, continuum: Continuum) -> InterfaceTemperature | None:
    """That of the bodies at an interface, None where they have none; collective."""
    field = continuum.temperature
    if field is None:
        return None
    nodes = InterfaceNodes(continuum.layout, pair.surface.dofs)
    rows = nodes.find(pair.surface.dofs)

    def at_nodes(values: Array) -> Array:
        return np.asarray(nodes.share(values[nodes.local])[rows])

    patterns = np.array([at_nodes(p) for p in field.nodal_patterns(continuum.space)])
    base = np.full(len(rows), field.effect.reference)
    if field.effect.steady:
        factors = np.array([a(0.0) for a in field.amplitudes])
        return InterfaceTemperature(base + factors @ patterns, patterns[:0])
    return InterfaceTemperature(base, patterns, tuple(field.amplitudes))
