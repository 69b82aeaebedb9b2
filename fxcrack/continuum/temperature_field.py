"""The temperature of the bodies on their mesh, and what is tabulated against it.

    T = T_ref + sum_k a_k(t) (T_k - T_ref)

with patterns T_k and their factors a_k in time.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import basix.ufl
import dolfinx.mesh
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fxcrack.base.arrays import Array
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.amplitudes import AmplitudeLike
from fxcrack.continuum.materials import Material
from fxcrack.continuum.temperature import ByTemperature, Spatial, Temperature


class TemperatureField:
    """The temperature of a scene on its mesh.

    It is kept one order below the displacement, as strains are: constant in a first-order cell,
    linear in a second-order one. So a temperature that the displacement can follow freely causes no
    stress.

    Args:
        domain: The mesh.
        order: Order of the displacement.
        effect: What the user gave.

    Attributes:
        rise: T - T_ref at present.
        patterns: T_k - T_ref of the patterns.
        amplitudes: Their factors in time.
        factors: Present factors of the patterns, shape (n_patterns,).
        version: Counts the changes of ``rise``.
    """

    def __init__(self, domain: dolfinx.mesh.Mesh, order: int, effect: Temperature) -> None:
        element = basix.ufl.element(
            "DG",
            domain.basix_cell(),
            order - 1,
            lagrange_variant=basix.LagrangeVariant.legendre,
        )
        space = fem.functionspace(domain, element)
        self.effect = effect
        self.domain = domain
        self.rise = fem.Function(space, name="temperature_rise")
        self.patterns: list[fem.Function] = []
        self.amplitudes: list[AmplitudeLike] = []
        self.version = 0
        for field, amplitude in effect.patterns():
            pattern = fem.Function(space)
            _interpolate(pattern, field, effect.reference)
            self.patterns.append(pattern)
            self.amplitudes.append(amplitude)
        self.factors = np.zeros(len(self.patterns))
        self.set(0.0)

    @property
    def temperature(self) -> Any:
        """Temperature at present, UFL."""
        return self.effect.reference + self.rise

    def set(self, time: float) -> None:
        """Make a time the present one."""
        factors = np.array([a(time) for a in self.amplitudes])
        if np.array_equal(factors, self.factors):
            return
        self.factors = factors
        self.rise.x.array[:] = 0.0
        for factor, pattern in zip(factors, self.patterns, strict=True):
            self.rise.x.array[:] += factor * pattern.x.array
        self.version += 1

    def clear(self) -> None:
        """Take the temperature at which bodies are free of thermal strain, until a time is set."""
        self.factors = np.zeros(len(self.patterns))
        self.rise.x.array[:] = 0.0
        self.version += 1

    def nodal_patterns(self, space: fem.FunctionSpace) -> Array:
        """Patterns at the local nodes of a (vector) Lagrange space, shape (n_patterns, n)."""
        out = []
        for field, _ in self.effect.patterns():
            values = fem.Function(space)
            _interpolate(values, field, self.effect.reference)
            out.append(values.x.array[:: space.dofmap.index_map_bs].copy())
        return np.array(out)


def interpolate_given(
    comm: MPI.Intracomm,
    out: fem.Function,
    owner: str,
    name: str,
    given: Callable[[Array], Array],
    n: int = 1,
    *,
    less: float = 0.0,
) -> None:
    """Interpolate a user's function of position; collective.

    Args:
        comm: Communicator of the mesh.
        out: Where to; all of its components get the same.
        owner: What the function was given to, for messages.
        name: The argument it was given as.
        given: Positions of shape (3, n_points) to numbers of shape (n_points,).
        n: Number of components of ``out``.
        less: What is taken off the numbers.

    Raises:
        InputError: It fails, or gives other than one finite number per position.
    """
    problem: str | None = None

    def values(x: Array) -> Array:
        nonlocal problem
        numbers = np.zeros(x.shape[1])
        try:
            numbers = numbers_at(owner, name, given, x.T)
        except InputError as error:  # on this rank, perhaps: said by all ranks below
            problem = str(error)
        bad = np.flatnonzero(~np.isfinite(numbers))
        if len(bad):
            problem = (
                f"{owner} is not a finite number everywhere: {name} gives {numbers[bad[0]]} at "
                f"{format_point(x[:, bad[0]])}; correct its value"
            )
            numbers = np.where(np.isfinite(numbers), numbers, 0.0)
        numbers = numbers - less
        return np.asarray(numbers if n == 1 else np.tile(numbers, (n, 1)))

    out.interpolate(values)
    raise_on_all_ranks(comm, problem)


def _interpolate(out: fem.Function, field: Spatial, reference: float) -> None:
    """Set a function to (field - reference), all components alike."""
    space = out.function_space
    n = int(np.prod(out.ufl_shape))
    if isinstance(field, fem.Function):
        if field.function_space.mesh is not space.mesh or field.ufl_shape != ():
            raise InputError(
                "Temperature: a DOLFINx Function must be a scalar one on the mesh of the scene "
                "(mesh.domain)"
            )
        value = field - reference
        points = compat.interpolation_points(space)
        out.interpolate(fem.Expression(value if n == 1 else ufl.as_vector([value] * n), points))
    elif callable(field):
        comm = compat.plain_comm(space.mesh.comm)
        interpolate_given(comm, out, "Temperature", "value", field, n, less=reference)
    else:
        rise = float(field) - reference
        out.interpolate(lambda x: np.full(x.shape[1] if n == 1 else (n, x.shape[1]), rise))


def entries(material: Material) -> list[Material]:
    """The elastic materials of a tabulated one in the order of its temperatures, or itself."""
    return material.materials if isinstance(material, ByTemperature) else [material]


def interpolated(
    domain: dolfinx.mesh.Mesh,
    material: Material,
    field: TemperatureField | None,
    quantity: Callable[[Material], Array],
) -> Any:
    """A quantity of a material, linear in the present temperature where it is tabulated; UFL.

    Args:
        domain: The mesh.
        material: An elastic material, or one tabulated against temperature.
        field: Temperature of the bodies; a tabulated material needs one.
        quantity: Of an elastic material, of any one shape.

    Raises:
        InputError: The material is tabulated and there is no temperature.
    """
    values = [fem.Constant(domain, np.asarray(quantity(m))) for m in entries(material)]
    if len(values) == 1:
        return values[0]
    assert isinstance(material, ByTemperature)
    if field is None:
        raise InputError("the continuum has no temperature; give Continuum(..., temperature=...)")
    out = values[0]
    knots = material.temperatures
    for k, (low, high) in enumerate(itertools.pairwise(knots)):
        share = ufl.max_value(0.0, ufl.min_value(1.0, (field.temperature - low) / (high - low)))
        out = out + share * (values[k + 1] - values[k])
    return out
