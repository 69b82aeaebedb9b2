"""Nodal forces of dead loads at amplitude 1.

    f . v = int t . v w dA,    -int p n . v w dA,    int b . v w dV,    int e(v) : C : e_th w dV

of a traction, a pressure, a body force and a temperature pattern, with the weight w of the
kinematic model; a point force is shared equally by the nodes of its group.
"""

from __future__ import annotations

from typing import Any, Protocol

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import (
    BodyForce,
    Field,
    Load,
    Moment,
    Monitor,
    PointForce,
    PointMoment,
    Pressure,
    Traction,
)
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_forces import shell_load
from fxcrack.continuum.thermal_strain import ThermalLoad, load_form


class NodalLoad(Protocol):
    """A load that knows its nodal forces, such as a pressure on both faces of an interface."""

    title: str

    def vector(self, continuum: Continuum) -> PETSc.Vec:
        """Nodal forces at amplitude 1; collective; the caller destroys the vector."""


class Weights(Protocol):
    """A monitor that knows its weights, such as the strain out of the plane of a section."""

    title: str

    def weights(self, continuum: Continuum) -> Array:
        """Weights of the owned dofs, shape (n_local,)."""


class LoadPattern:
    """Nodal values on the owned dofs, kept where they differ from zero.

    Args:
        values: Shape (n_local,).

    Attributes:
        at: Where they do; everything where most of them do.
        values: The values there.
    """

    def __init__(self, values: Array) -> None:
        found = np.flatnonzero(values)
        self.at: Ints | slice = found if len(found) < len(values) // 4 else slice(None)
        self.values = values[self.at].copy()

    def add(self, total: Array, factor: float) -> None:
        """Add the values times a factor to a vector of the owned dofs, in place."""
        total[self.at] += factor * self.values

    def dense(self, n_local: int) -> Array:
        """All values, shape (n_local,)."""
        out = np.zeros(n_local)
        out[self.at] = self.values
        return out


def load_vector(continuum: Continuum, load: Load | ThermalLoad | NodalLoad) -> PETSc.Vec:
    """Nodal forces of a load at amplitude 1; collective.

    Args:
        continuum: Displacement space, model and groups.
        load: Where and how much.

    Returns:
        Forces on the owned dofs, shape (n_global,), force; the caller destroys the vector.

    Raises:
        InputError: The load has the wrong number of components, or its group does not fit.
    """
    if hasattr(load, "vector"):
        return load.vector(continuum)
    if isinstance(continuum, ShellBodies):
        vector = shell_load(continuum, load)
        if vector is not None:
            return vector
    if isinstance(load, Moment | PointMoment):
        raise InputError(f"load '{load.title}': only shells take moments; apply a couple of forces")
    if isinstance(load, PointForce):
        return _point_force(continuum, load.where, load.value, load.title)
    unknowns = ufl.TestFunction(continuum.space)
    v = continuum.displacement(unknowns)
    if isinstance(load, Traction):
        ds = continuum.surface(load.where)
        form = ufl.inner(_vector(continuum, load.value, load.title), v) * continuum.weight * ds
    elif isinstance(load, Pressure):
        ds = continuum.surface(load.where)
        normal = ufl.FacetNormal(continuum.mesh.domain)
        value = continuum.field(load.value, f"load '{load.title}'")
        along = ufl.as_vector([v[i] for i in range(continuum.mesh.gdim)])
        form = -ufl.inner(value * normal, along) * continuum.weight * ds
    elif isinstance(load, BodyForce):
        value = _vector(continuum, load.value, load.title)
        form = ufl.inner(value, v) * continuum.weight * continuum.volume(load.where)
    else:
        form = load_form(continuum, load, unknowns)
    vector = dolfinx.fem.petsc.assemble_vector(fem.form(form))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector


def monitor_weights(continuum: Continuum, monitor: Monitor | Weights) -> Array:
    """Weights of the owned dofs in a monitored value, shape (n_local,); collective.

    Raises:
        InputError: The direction has another number of components, or the group does not fit.
    """
    if hasattr(monitor, "weights"):
        return np.asarray(monitor.weights(continuum))
    out = np.zeros(continuum.n_local)
    for term in monitor.terms:
        if len(term.direction) not in _components(continuum):
            raise InputError(
                f"Monitor('{term.title}'): direction has {len(term.direction)} components, "
                f"{continuum.gdim} are needed"
            )
        nodes = continuum.owned_nodes(term.where)
        count = continuum.comm.allreduce(len(nodes))
        for i, component in enumerate(term.direction):
            out[continuum.layout.dof(nodes, i)] += component / count
    return out


def _components(continuum: Continuum) -> tuple[int, ...]:
    """Numbers of components a vector may have: those in the plane of a section are enough."""
    return (continuum.gdim, continuum.mesh.gdim)


def _check_components(continuum: Continuum, value: tuple[Field, ...], title: str) -> None:
    given = len(value) if hasattr(value, "__len__") else "no list of"
    if given not in _components(continuum):
        raise InputError(f"load '{title}': {given} components given, {continuum.gdim} needed")


def _vector(continuum: Continuum, value: tuple[Field, ...], title: str) -> Any:
    _check_components(continuum, value, title)
    given = [*value, *[0.0] * (continuum.gdim - len(value))]
    return ufl.as_vector([continuum.field(v, f"load '{title}'") for v in given])


def _point_force(
    continuum: Continuum, where: str, value: tuple[Field, ...], title: str
) -> PETSc.Vec:
    _check_components(continuum, value, title)
    layout = continuum.layout
    nodes = continuum.owned_nodes(where)
    count = continuum.comm.allreduce(len(nodes))
    vector = PETSc.Vec().createMPI((layout.n_local, layout.n_global), comm=continuum.comm)
    for i, component in enumerate(value):
        found: Array | float = 0.0
        problem = None
        try:
            if callable(component):
                x = continuum.positions()[nodes]
                found = numbers_at(f"load '{title}'", f"value[{i}]", component, x)
            else:
                found = float(component)
        except InputError as error:  # on this rank, perhaps
            problem = str(error)
        raise_on_all_ranks(continuum.comm, problem)
        vector.array[layout.dof(nodes, i)] = found / count
    return vector
