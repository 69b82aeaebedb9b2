"""Elastic bodies: W = 1/2 int (e - e_th) : C : (e - e_th) w dV, for small or finite strain.

With e the small strain the term is linear; with e the Green-Lagrange strain it is the
St. Venant-Kirchhoff material, for isotropic and orthotropic stiffness alike. The thermal strain of
the latter is that of the stretch 1 + expansion (T - T_ref): e_th = A + A^2/2.
"""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem

from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import (
    deformation_gradient,
    green_lagrange,
    green_lagrange_change,
    labelled,
    tensor,
)
from fxcrack.continuum.stress import small_stress
from fxcrack.continuum.term import StoringTerm
from fxcrack.continuum.thermal_strain import (
    at_rise,
    expansion,
    square_expansion,
    whole,
    whole_stiffness,
)


class Elastic(StoringTerm):
    """Elastic bodies of a continuum: all parts whose material names no other form.

    Args:
        continuum: Materials, model, measures and temperature.
        finite: Green-Lagrange strain instead of the small one.
    """

    def __init__(self, continuum: Continuum, *, finite: bool = False) -> None:
        super().__init__(continuum, "elastic")
        self.finite = finite
        self.name = "finite strain" if finite else "elasticity"
        self.constant = not finite

    def energy(self, u: fem.Function) -> Any:
        """Strain energy."""
        c = self._continuum
        strain = green_lagrange(c.model, u, c.x) if self.finite else c.model.strain(u, c.x)
        total = 0
        for i in self._parts:
            dx = c.parts[i][2]
            if i in c.shell_cells and c.temperature is not None:
                total += self._shell_energy(i, strain) * c.weight * dx
                continue
            stiffness, e = self._elastic_part(i, strain)
            total += 0.5 * ufl.inner(ufl.dot(stiffness, e), e) * c.weight * dx
        return total

    def _elastic_part(self, i: int, strain: Any) -> tuple[Any, Any]:
        """Stiffness of a part and its elastic strain at the present temperature, UFL."""
        c = self._continuum
        if c.temperature is None:
            return c.parts[i][0], strain
        rise = c.temperature.rise
        e = whole(c.model, strain) - rise * expansion(c, i)
        if self.finite:
            e -= rise**2 / 2 * square_expansion(c, i)
        return whole_stiffness(c, i), e

    def mean_residual(
        self, u: fem.Function, begin: fem.Function, v: Any, rise: fem.Function | None = None
    ) -> Any:
        """Forces over an increment whose work is the change of the strain energy, UFL.

        The mean of the second Piola-Kirchhoff stress of both ends acts on the strain of the middle
        (Simo and Tarnow 1992); that of both stiffnesses on the mean of both elastic strains where
        the temperature changes. Finite strain.

        Args:
            u: Displacement at the end.
            begin: Displacement at the beginning.
            v: Test function.
            rise: T - T_ref at the beginning, where the bodies have a temperature.
        """
        c = self._continuum
        change = green_lagrange_change(c.model, 0.5 * (u + begin), v, c.x)
        first, last = (green_lagrange(c.model, x, c.x) for x in (begin, u))
        total = 0
        for i in self._parts:
            if i in c.shell_cells and c.temperature is not None:
                held = self._shell_held(i)
                stress = ufl.dot(c.shell_cells[i].stiffness, 0.5 * (first + last))
                stress -= 0.5 * (held + at_rise(c, held, rise))
                total += ufl.inner(stress, change) * c.weight * c.parts[i][2]
                continue
            (c1, e1), start = self._elastic_part(i, last), self._elastic_part(i, first)
            c0, e0 = (at_rise(c, x, rise) for x in start)
            stress = ufl.dot(c1 if c.temperature is None else 0.5 * (c0 + c1), 0.5 * (e0 + e1))
            test = change if c.temperature is None else whole(c.model, change)
            total += ufl.inner(stress, test) * c.weight * c.parts[i][2]
        return total

    def _shell_held(self, i: int) -> Any:
        """Stress that holds a continuum shell at a temperature, UFL."""
        c = self._continuum
        assert c.temperature is not None
        first, second, _ = c.shell_cells[i].thermal
        rise = c.temperature.rise
        return rise * first + rise**2 / 2 * second if self.finite else rise * first

    def _shell_energy(self, i: int, strain: Any) -> Any:
        """Strain energy per volume of a continuum shell at a temperature, UFL.

        (e - e_th) : C : (e - e_th)/2 multiplied out: the moments of the plies are those of C, C a
        and a C a.
        """
        c = self._continuum
        assert c.temperature is not None
        cells, rise = c.shell_cells[i], c.temperature.rise
        _, _, products = cells.thermal
        stored = rise**2 * products[0]
        if self.finite:
            stored += rise**3 * products[1] + rise**4 / 4 * products[2]
        elastic = 0.5 * ufl.inner(ufl.dot(cells.stiffness, strain), strain)
        return elastic - ufl.inner(self._shell_held(i), strain) + 0.5 * stored

    def stresses(self, u: fem.Function) -> list[tuple[Any, Any]]:
        """Cauchy stress; of a finite strain F S F^t/J.

        The sheet of plane stress is taken as thick as it was, which is right to the order of the
        strain.
        """
        c = self._continuum
        small = c.model.strain(u, c.x)
        if not self.finite:
            return [(small_stress(c, i, small), c.parts[i][2]) for i in self._parts]
        f = deformation_gradient(c.model, u, c.x)
        out = []
        for i in self._parts:
            strain = green_lagrange(c.model, u, c.x)
            second = tensor(c.model, small_stress(c, i, strain))
            out.append((labelled(c.model, f * second * f.T / ufl.det(f)), c.parts[i][2]))
        return out
