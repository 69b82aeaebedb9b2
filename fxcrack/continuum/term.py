"""What every form term has, with the defaults of a conservative one.

A conservative term gives its stored energy W(u) alone; r(u; v) = dW(u; v) and K = d2W follow by
differentiation. Others give the residual, and the tangent if differentiation cannot find it; their
energy may then be any form that has the stored energy as its value.
"""

from __future__ import annotations

from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.thermal_work import ThermalWork


class Term:
    """One effect in the bodies, as UFL forms.

    Attributes:
        name: What :meth:`fxcrack.Scene.explain` calls it.
        symmetric: Whether its tangent is symmetric.
        constant: Whether its tangent does not depend on u (a linear term).
        version: Counts the changes of a constant tangent by :meth:`begin` (another dt or
            temperature): the same number, the same tangent.
        finite: Whether bodies may turn and stretch by any amount.
        dynamic: Whether its forces depend on how long an increment takes.
        path_dependent: Whether its stress depends on the loading history.
        closed: Whether it stores all the work done on it, that of loads and its own
            (:meth:`path_work`).
        energy_name: Name of its stored energy in the energy balance; terms of one name are summed.
        by_cells: Whether it is no form and adds its vectors and matrices of cells itself, by
            :meth:`add_residual`, :meth:`add_tangent` and :meth:`stored`.
    """

    name: str = ""
    symmetric: bool = True
    constant: bool = False
    version: int = 0
    energy_name: str = "strain_energy"
    finite: bool = False
    dynamic: bool = False
    path_dependent: bool = False
    closed: bool = True
    by_cells: bool = False

    def add_residual(self, forces: Array, u: fem.Function) -> None:
        """Add internal minus external forces of the local dofs, ghosts too, by cells.

        Args:
            forces: Shape (n_dofs,), changed in place; the caller sums up over ranks.
            u: Displacement.
        """

    def add_tangent(self, matrix: PETSc.Mat, u: fem.Function) -> None:
        """Add their change with u, by cells; the caller assembles."""

    def stored(self, u: fem.Function) -> float:
        """Energy stored in the cells that this rank owns, by cells, force x length."""
        return 0.0

    def energy(self, u: fem.Function) -> Any:
        """Stored energy as a UFL form, ``None`` if it stores none."""
        return None

    def residual(self, u: fem.Function, v: Any) -> Any:
        """Internal minus external forces, linear in the test function v; a UFL form."""
        return ufl.derivative(self.energy(u), u, v)

    def tangent(self, u: fem.Function, v: Any, du: Any) -> Any:
        """Change of the residual with u in the direction du; a UFL form."""
        return ufl.derivative(self.residual(u, v), u, du)

    def stresses(self, u: fem.Function) -> list[tuple[Any, Any]]:
        """Cauchy stress, components of ``model.stress_labels``, and measure of each part; UFL."""
        return []

    def begin(self, time: float, dt: float) -> None:
        """An increment of dt ends at a time: set what depends on them; collective."""

    def begin_at(self, u: fem.Function) -> None:
        """Bodies with inertia begin their motion at u, which loads at rest brought; collective."""

    def update(self, u: fem.Function) -> None:
        """A new trial u was set: update what is stored at quadrature points; collective."""

    def commit(self, u: fem.Function) -> None:
        """The increment is accepted: its end becomes the state the next one starts from."""

    def spent(self) -> dict[str, float]:
        """Energies dissipated up to the last commit by name, force x length; collective."""
        return {}

    def path_work(self, u: fem.Function) -> float:
        """Work it does on the bodies on the straight path from the last commit to u; collective.

        In force x length.
        """
        return 0.0

    def path_spent(self, u: fem.Function) -> float:
        """Energy it dissipates on the straight path from the last commit to u; collective.

        In force x length.
        """
        return 0.0

    def work(self) -> float:
        """Work done on the bodies through the term up to the last commit; collective.

        In force x length: that of loads that follow the bodies, and of a temperature; the work of
        supports and dead loads is not part of any term.
        """
        return 0.0

    def state(self) -> dict[str, Array]:
        """Committed state of this rank; empty where there is none.

        Returns:
            Arrays by name: of shape (n_dofs,), ghosts too, where :meth:`places` gives a space; cell
            by cell along the first axis where it gives cells; of any shape otherwise.
        """
        return {}

    def places(self) -> dict[str, Place]:
        """Where the arrays of :meth:`state` are defined; those not named: the same on all ranks."""
        return {}

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""


class StoringTerm(Term):
    """A term of some parts that stores all the work done on it and depends on their temperature.

    Args:
        continuum: Materials, model, measures and temperature.
        form: Which parts (:func:`parts_of`).
    """

    def __init__(self, continuum: Continuum, form: str) -> None:
        self._continuum = continuum
        self._parts = parts_of(continuum, form)
        self._thermal: ThermalWork | None = None
        if continuum.temperature is not None:
            self._thermal = ThermalWork(continuum, self.energy)

    def begin(self, time: float, dt: float) -> None:
        """Set the temperature at the end of the increment."""
        if self._thermal is not None:
            self._thermal.begin(time)
            self.version = self._thermal.version

    def begin_at(self, u: fem.Function) -> None:
        """Add the work of the temperature that bodies have at rest before they move."""
        self.commit(u)

    def commit(self, u: fem.Function) -> None:
        """Add the work of the temperature."""
        if self._thermal is not None:
            self._thermal.commit(u)

    def path_work(self, u: fem.Function) -> float:
        """Work of the temperature since the last commit."""
        return 0.0 if self._thermal is None else float(self._thermal.path_work(u))

    def work(self) -> float:
        """Work of the temperature up to the last commit."""
        return 0.0 if self._thermal is None else float(self._thermal.work)

    def state(self) -> dict[str, Array]:
        """State of the work of the temperature, shapes as in :meth:`ThermalWork.state`."""
        return {} if self._thermal is None else dict(self._thermal.state())

    def places(self) -> dict[str, Place]:
        """Where that state is defined."""
        return {} if self._thermal is None else dict(self._thermal.places())

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        if self._thermal is not None:
            self._thermal.restore(state)


def parts_of(continuum: Continuum, form: str) -> list[int]:
    """Parts of a continuum whose material names a form of its own, or "elastic" for the others.

    Those that no form describes, first-order continuum shells, are not among them.
    """
    forms = [getattr(m, "form", "elastic") for m in continuum.part_materials]
    return [i for i, f in enumerate(forms) if f == form and i not in continuum.tied_cells]


__all__ = ["StoringTerm", "Term", "parts_of"]
