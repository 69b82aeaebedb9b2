"""User input for the temperature: a field in the bodies, materials tabulated against it.

    T(x, t) = T_ref + a(t) (T(x) - T_ref),    or fields at some times, linear in between

Pure data; :mod:`fxcrack.continuum.temperature_field` puts it on a mesh and
:mod:`fxcrack.continuum.thermal_strain` makes forms of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    finite,
    keep,
    keep_floats,
    list_of,
    number_or_function,
    numbers,
    shown,
)
from fxcrack.base.errors import InputError
from fxcrack.continuum.amplitudes import Amplitude, AmplitudeLike, Ramp
from fxcrack.continuum.materials import Material

Spatial = float | Callable[[Array], Array] | Any
"""A number, a function of positions, shape (3, n) to (n,), or a scalar DOLFINx Function."""


@dataclass(frozen=True, eq=False)
class Temperature:
    """Temperature of the bodies: thermal strain, and properties tabulated against it.

    Args:
        value: The temperature: a number, a function of positions of shape (3, n) that returns shape
            (n,), a scalar DOLFINx Function on the mesh of the scene, or a sequence of (time, one of
            these) with increasing times, linear in time between them and constant outside.
        reference: Temperature at which the bodies are free of thermal strain.
        amplitude: Factor in time of (value - reference); the time itself by default. A sequence
            has none.
    """

    value: Spatial | Sequence[tuple[float, Spatial]]
    reference: float = 0.0
    amplitude: AmplitudeLike | None = None

    def __post_init__(self) -> None:
        """Check times and numbers."""
        finite("Temperature", reference=self.reference)
        keep_floats(self, "reference")
        if self.amplitude is not None and (
            isinstance(self.amplitude, type) or not hasattr(self.amplitude, "breaks")
        ):
            raise InputError(
                f"Temperature: amplitude is {type(self.amplitude).__name__}; give "
                "Amplitude(times, values), or None for the time itself"
            )
        series = self._series
        if series is not None:
            if self.amplitude is not None:
                raise InputError(
                    "Temperature: fields at given times take no amplitude; give one or the other"
                )
            if not len(series) or any(len(list_of(entry) or ()) != 2 for entry in series):
                raise InputError("Temperature: a field per time is a list of (time, field)")
            times = numbers("Temperature", "times", [t for t, _ in series])
            if np.any(np.diff(times) <= 0.0):
                raise InputError(f"Temperature: times {list(times)} must be finite and increase")
            keep(self, value=tuple((t, f) for t, (_, f) in zip(times, series, strict=True)))
        for field, _ in self.patterns():
            number_or_function("Temperature", "value", field)

    @property
    def _series(self) -> Sequence[tuple[float, Spatial]] | None:
        found = list_of(self.value)
        return None if found is None else found

    def patterns(self) -> list[tuple[Spatial, AmplitudeLike]]:
        """Fields T_k and factors a_k with T - T_ref = sum_k a_k(t) (T_k - T_ref)."""
        series = self._series
        if series is None:
            return [(self.value, Ramp() if self.amplitude is None else self.amplitude)]
        times = tuple(float(t) for t, _ in series)
        if len(times) == 1:
            return [(series[0][1], Amplitude((times[0],), (1.0,)))]
        out: list[tuple[Spatial, AmplitudeLike]] = []
        for k, (_, field) in enumerate(series):
            near = slice(max(k - 1, 0), k + 2)
            hat = tuple(1.0 if t == times[k] else 0.0 for t in times[near])
            out.append((field, Amplitude(times[near], hat)))
        return out

    @property
    def steady(self) -> bool:
        """Whether the temperature never changes."""
        factors = [a for _, a in self.patterns()]
        return all(isinstance(a, Amplitude) and len(set(a.values)) == 1 for a in factors)


@dataclass(frozen=True, eq=False)
class ByTemperature:
    """An elastic material tabulated against temperature.

    Stiffness and expansion are linear between the entries and constant beyond the first and last.
    The expansion is the secant one: the thermal strain is expansion(T) (T - T_ref).

    Args:
        table: Material at each temperature, e.g. ``{20.0: hot, -50.0: cold}``.

    Raises:
        InputError: There is no entry, a temperature is not finite, densities differ, or an entry is
            no linear elastic material.
    """

    table: Mapping[float, Material]

    def __post_init__(self) -> None:
        """Check the table."""
        if not isinstance(self.table, Mapping) or not self.table:
            raise InputError(
                "ByTemperature: give a material for each of one or more finite temperatures, "
                "{20.0: Isotropic(...), -50.0: Isotropic(...)}"
            )
        for temperature, material in self.table.items():
            finite(
                "ByTemperature: give a material for each of one or more finite temperatures",
                **{"a temperature": temperature},
            )
            if isinstance(material, type) or not hasattr(material, "stiffness"):
                raise InputError(
                    f"ByTemperature: {shown(material)} is not a material; give one, e.g. "
                    "Isotropic(E=70e3, nu=0.3)"
                )
            if hasattr(material, "form"):
                raise InputError(
                    f"ByTemperature: {type(material).__name__} cannot be tabulated against "
                    "temperature; Isotropic and Orthotropic can"
                )
        if len({getattr(m, "density", None) for m in self.table.values()}) > 1:
            raise InputError("ByTemperature: the density of the undeformed body is one number")

    @property
    def temperatures(self) -> tuple[float, ...]:
        """The temperatures, increasing."""
        return tuple(sorted(self.table))

    @property
    def materials(self) -> list[Material]:
        """The materials in the order of :attr:`temperatures`."""
        return [self.table[t] for t in self.temperatures]

    @property
    def density(self) -> float | None:
        """Mass per volume."""
        return getattr(self.materials[0], "density", None)

    def stiffness(self) -> Array:
        """Refuse: the stiffness, shape (6, 6), needs a temperature.

        Raises:
            InputError: Always: the scene has no temperature.
        """
        raise InputError(
            "ByTemperature: the scene has no temperature; add Temperature(...) to its effects or "
            "give a material that does not depend on it"
        )


def expansion_of(material: Material) -> Array:
    """Thermal strain per degree of a material, 0 where it has none, shape (6,), 1/temperature."""
    expand = getattr(material, "thermal_expansion", None)
    return np.zeros(6) if expand is None else np.asarray(expand(), dtype=np.float64)
