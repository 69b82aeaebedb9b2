"""A weak elastic foundation under bodies that only contact holds.

    W = 1/2 int k u . u w dV,    k = s c/L^2

with the fraction s that the user gives, c the largest modulus of the materials of the body and L
the longest edge of the box around it. It keeps a body in place until faces touch. What it stores is
a column of its own, so that its share of the energies can be judged.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Ints
from fxcrack.base.checks import as_float, shown
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.term import Term

ENERGY = "stabilising_energy"
"""Column of the energy that a foundation stores."""
Stabilise = float | Mapping[str, float]
"""Fraction s for all bodies, or for those of some cell groups."""


def check_stabilise(value: object) -> None:
    """Refuse what is no fraction, nor one for each of some cell groups.

    Raises:
        InputError: It is not.
    """
    words = (
        "give a small number, 1e-6 for instance, or one for each cell group that only contact "
        "holds, {'pin': 1e-6}"
    )
    entries = value if isinstance(value, Mapping) else {"all": value}
    if not entries:
        raise InputError(f"Scene: stabilise is empty; {words}")
    for name, given in entries.items():
        number = as_float(given)
        if not isinstance(name, str) or number is None or not 0.0 < number < 1.0:
            raise InputError(f"Scene: stabilise = {shown(value)}: {words}")


class Foundation(Term):
    """Springs without mass between the places of some bodies and the ground.

    Args:
        continuum: The bodies; they learn which of their nodes are held.
        stabilise: Fractions s.

    Raises:
        InputError: The bodies are shells, or there is no such cell group.
    """

    name = "stabilising stiffness"
    constant = True
    energy_name = ENERGY

    def __init__(self, continuum: Continuum, stabilise: Stabilise) -> None:
        if isinstance(continuum, ShellBodies):
            raise InputError("Scene: stabilise is not possible with shells; use supports")
        self._continuum = continuum
        groups: dict[str | None, float]
        if isinstance(stabilise, Mapping):
            groups = {name: float(s) for name, s in stabilise.items()}
        else:
            groups = {None: float(stabilise)}
        self._parts = [
            (fem.Constant(continuum.mesh.domain, PETSc.ScalarType(self._stiffness(name, s))),
             continuum.volume(name))
            for name, s in groups.items()
        ]  # fmt: skip
        nodes = [_nodes(continuum, name) for name in groups]
        continuum.weakly_held = np.unique(np.concatenate(nodes))
        continuum.founded = True
        self._form: Any = None

    def _stiffness(self, name: str | None, fraction: float) -> float:
        """K of a group, force/length^4; collective."""
        c = self._continuum
        mine = _cells(c, name)
        moduli = [
            _modulus(m)
            for m, cells in zip(c.part_materials, c.part_cells, strict=True)
            if name is None or np.isin(cells, mine).any()
        ]
        modulus = c.comm.allreduce(max(moduli, default=0.0), op=MPI.MAX)
        x = c.positions()[_nodes(c, name), : c.gdim]
        ends = [-x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf)]
        low, high = (np.max(c.comm.allgather(e), axis=0) for e in ends)
        return float(fraction * modulus / (high + low).max() ** 2)

    def energy(self, u: fem.Function) -> Any:
        """Energy stored."""
        c = self._continuum
        moved = c.displacement(u) if c.layout.shared else u  # of shells the director as well
        return sum(0.5 * k * ufl.inner(moved, moved) * c.weight * dx for k, dx in self._parts)

    def add_to(self, matrix: PETSc.Mat) -> None:
        """Add the stiffness to that of linear bodies; collective."""
        u = fem.Function(self._continuum.space)
        v, du = ufl.TestFunction(u.function_space), ufl.TrialFunction(u.function_space)
        form = fem.form(self.tangent(u, v, du))
        added = dolfinx.fem.petsc.assemble_matrix(form)
        added.assemble()
        matrix.axpy(1.0, added, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        added.destroy()

    def stored_in(self, displacement: PETSc.Vec) -> float:
        """Energy at a displacement of the owned dofs, force x length; collective."""
        if self._form is None:
            u = fem.Function(self._continuum.space)
            self._form = u, fem.form(self.energy(u))
        u, form = self._form
        u.x.array[: self._continuum.n_local] = displacement.array_r
        u.x.scatter_forward()
        return float(self._continuum.comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM))


def _cells(continuum: Continuum, name: str | None) -> Ints:
    """Owned cells of a group."""
    mesh = continuum.mesh
    n_cells = mesh.domain.topology.index_map(mesh.tdim).size_local
    if name is None:
        return np.arange(n_cells)
    cells = np.asarray(mesh.group(name, dim=mesh.tdim).entities)
    return np.asarray(cells[cells < n_cells], dtype=np.int64)


def _nodes(continuum: Continuum, name: str | None) -> Ints:
    """Owned nodes of a group, sorted."""
    if name is None:
        return np.arange(continuum.layout.n_owned)
    return np.unique(np.asarray(continuum.owned_nodes(name), dtype=np.int64))


def _modulus(material: Any) -> float:
    """Largest entry of the stiffness of a material, force/length^2."""
    found = getattr(material, "materials", None) or [material]
    return max(float(np.abs(np.asarray(m.stiffness())).max()) for m in found)


__all__ = ["ENERGY", "Foundation", "Stabilise", "check_stabilise"]
