"""Thermal strain: the strain that a temperature causes and what it adds to the forms.

    W = 1/2 int (e - e_th) : C : (e - e_th) w dV,    e_th = expansion (T - T_ref)

In plane strain and in a ring e is the whole strain, out of the plane too, where thermal strain is
constrained and stores energy; in plane stress it is that of the plane: the thickness is free to
change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.continuum.amplitudes import AmplitudeLike
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import Axisymmetric, Model, PlaneStress
from fxcrack.continuum.materials import Material
from fxcrack.continuum.ply import square_strain
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_temperature import ShellTemperature
from fxcrack.continuum.temperature import ByTemperature, expansion_of
from fxcrack.continuum.temperature_field import TemperatureField, entries


@dataclass(frozen=True, eq=False)
class ThermalLoad:
    """Nodal forces int B^t C e_th w dV of one temperature pattern: what holds a clamped body.

    Args:
        pattern: Position among the patterns of the temperature.
        amplitude: Factor in time.
        title: Name in the history.
    """

    pattern: int
    amplitude: AmplitudeLike
    title: str


def thermal_loads(continuum: Continuum) -> list[ThermalLoad]:
    """The temperature of a linear continuum as loads; none where nothing expands."""
    field = continuum.temperature
    if field is None or not expands(continuum):
        return []
    names = ["temperature"]
    if len(field.patterns) > 1:
        names = [f"temperature_{k}" for k in range(len(field.patterns))]
    return [
        ThermalLoad(k, amplitude, name)
        for k, (amplitude, name) in enumerate(zip(field.amplitudes, names, strict=True))
    ]


def expands(continuum: Continuum) -> bool:
    """Whether any material of a continuum has thermal strain."""
    return any(np.any(expansion_of(m)) for part in continuum.part_materials for m in entries(part))


def is_linear(continuum: Continuum) -> bool:
    """Whether stiffness stays and thermal forces follow the amplitudes as time goes on."""
    tabulated = any(isinstance(m, ByTemperature) for m in continuum.part_materials)
    return not tabulated or (
        continuum.temperature is not None and continuum.temperature.effect.steady
    )


def load_form(continuum: Continuum, load: ThermalLoad, v: Any) -> Any:
    """Forces of a temperature pattern, as a form linear in the test function v."""
    field = _field_of(continuum)
    strain = whole(continuum.model, continuum.model.strain(v, continuum.x))
    total = 0
    for i, (_, _, dx) in enumerate(continuum.parts):
        stress = thermal_stress(continuum, i)
        total += field.patterns[load.pattern] * ufl.inner(stress, strain) * continuum.weight * dx
    return total


def held_energies(continuum: Continuum) -> Array:
    """Energies E_kl = int e_k : C : e_l w dV of the patterns' thermal strains; collective.

    With nodal forces f_k and factors a_k the energy stored in a linear continuum is
    1/2 u K u - sum_k a_k f_k u + 1/2 sum_kl a_k a_l E_kl.

    Returns:
        The symmetric matrix E, shape (n_patterns, n_patterns), force x length.
    """
    if isinstance(continuum, ShellBodies):
        return ShellTemperature(continuum).held_energies()
    field = _field_of(continuum)
    n = len(field.patterns)
    out = np.zeros((n, n))
    first, second = (fem.Function(field.rise.function_space) for _ in range(2))
    total = 0
    for i, (_, _, dx) in enumerate(continuum.parts):
        if i in continuum.shell_cells:
            density = continuum.shell_cells[i].thermal[2][0]
        else:
            e = expansion(continuum, i)
            density = ufl.inner(ufl.dot(whole_stiffness(continuum, i), e), e)
        total += first * second * density * continuum.weight * dx
    form = fem.form(total)
    for k in range(n):
        for m in range(k, n):
            first.x.array[:] = field.patterns[k].x.array
            second.x.array[:] = field.patterns[m].x.array
            out[k, m] = out[m, k] = continuum.comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM)
    return out


def _field_of(continuum: Continuum) -> TemperatureField:
    if continuum.temperature is None:
        raise InputError("the continuum has no temperature; give Continuum(..., temperature=...)")
    return continuum.temperature


# -- strain and stiffness in which thermal strain is complete ------------------------------------


def whole(model: Model, strain: Any) -> Any:
    """A model's Voigt strain with all six components; plane stress keeps its three."""
    e = strain
    if isinstance(model, PlaneStress) or model.gdim == 3:
        return e
    if isinstance(model, Axisymmetric):
        return ufl.as_vector([e[0], e[1], e[2], 0, 0, e[3]])
    return ufl.as_vector([e[0], e[1], 0, 0, 0, e[2]])


def at_rise(continuum: Continuum, expression: Any, rise: fem.Function | None) -> Any:
    """A UFL expression at another temperature than the present one.

    Args:
        continuum: Where the present temperature is.
        expression: Contains it, or does not.
        rise: T - T_ref instead; ``None`` leaves the present one, or none.
    """
    if continuum.temperature is None or rise is None:
        return expression
    return ufl.replace(expression, {continuum.temperature.rise: rise})


def whole_stiffness(continuum: Continuum, i: int) -> Any:
    """Stiffness of a part on :func:`whole` strains, UFL."""
    return continuum.by_temperature(i, lambda m: _whole_matrix(continuum.model, m.stiffness()))


def expansion(continuum: Continuum, i: int) -> Any:
    """Thermal strain per degree of a part, components of :func:`whole`, UFL."""
    keep = [0, 1, 5] if isinstance(continuum.model, PlaneStress) else list(range(6))
    return continuum.by_temperature(i, lambda m: expansion_of(m)[keep])


def thermal_stress(continuum: Continuum, i: int) -> Any:
    """Stress per degree that holds a part, components of :func:`whole`, UFL."""
    if i in continuum.shell_cells:
        return continuum.shell_cells[i].thermal[0]
    return ufl.dot(whole_stiffness(continuum, i), expansion(continuum, i))


def square_expansion(continuum: Continuum, i: int) -> Any:
    """Square of the expansion as a tensor, components of :func:`whole`, UFL."""
    keep = [0, 1, 5] if isinstance(continuum.model, PlaneStress) else list(range(6))

    def square(m: Material) -> Array:
        return square_strain(expansion_of(m))[keep]

    return continuum.by_temperature(i, square)


def _whole_matrix(model: Model, c: Array) -> Array:
    return model.reduce(c) if isinstance(model, PlaneStress) else c


def whole_stress(continuum: Continuum, i: int, strain: Any) -> Any:
    """All stresses (``model.stress_labels``) of a part at a small strain and the present field."""
    field = _field_of(continuum)
    model = continuum.model
    if i in continuum.shell_cells:
        cells = continuum.shell_cells[i]
        return ufl.dot(cells.stiffness, strain) - field.rise * cells.thermal[0]
    elastic = whole(model, strain) - field.rise * expansion(continuum, i)
    s = ufl.dot(whole_stiffness(continuum, i), elastic)
    if isinstance(model, PlaneStress):
        return ufl.as_vector([s[0], s[1], 0, s[2]])
    if model.gdim == 3:
        return s
    return ufl.as_vector([s[0], s[1], s[2], s[5]])
