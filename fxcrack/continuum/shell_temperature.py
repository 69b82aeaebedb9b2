"""Thermal strain of shells, with a temperature that may vary over the thickness.

    T - T_ref = sum_k a_k(t) (T0_k + z T1_k),    s_k = int (1, z) C expansion (T0_k + z T1_k) dz

A function of position is taken at the bottom and at the top of each section, X + z D at the corners
of the cells, and is linear between. As in solids the temperature is one order below the
displacement: one T0 and T1 in a first-order cell, linear in a second-order one.

    W = sum over points of (1/2 e . C e - a_k s_k . e) + 1/2 int a_k a_l e_k . C e_l,

e_k the thermal strain; the energy includes that of the thermal strain that the section holds.
"""

from __future__ import annotations

from collections.abc import Callable

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fxcrack.base.arrays import Array
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.input_order import Place
from fxcrack.continuum.shell_bodies import ShellBodies, ShellPart
from fxcrack.continuum.temperature import Spatial
from fxcrack.continuum.temperature_field import TemperatureField

Stored = Callable[[fem.Function], float]


class ShellTemperature:
    """Thermal stresses and energies of shells.

    Args:
        shell: The shells, with a temperature.

    Attributes:
        field: The temperature of the scene.
        stresses: s_k with the weights of the points, of each pattern and part, shape (n_cells,
            n_points, 12).
    """

    def __init__(self, shell: ShellBodies) -> None:
        assert shell.temperature is not None
        self._shell = shell
        self.field: TemperatureField = shell.temperature
        self._values = [
            [self._at_points(p, given, pattern) for p in shell.shell_parts]
            for (given, _), pattern in zip(
                self.field.effect.patterns(), self.field.patterns, strict=True
            )
        ]
        self.stresses = [
            [_stress(part, t) for part, t in zip(shell.shell_parts, values, strict=True)]
            for values in self._values
        ]

    def _at_points(self, part: ShellPart, given: Spatial, pattern: fem.Function) -> Array:
        """T0 - T_ref and T1 at the points of a part, shape (n_cells, n_points, 2); collective."""
        element, reference = self._shell.element, self.field.effect.reference
        n_corners = 3 if self._shell.mesh.domain.topology.cell_name() == "triangle" else 4
        corners = element.corners
        out = np.zeros((len(part.cells), len(element.points), 2))
        if isinstance(given, fem.Function):
            values = pattern.x.array[pattern.function_space.dofmap.list[part.cells]]
            # one value in a first-order cell; Legendre polynomials in a second-order one
            table = pattern.function_space.element.basix_element.tabulate(0, element.points)[0]
            out[..., 0] = np.einsum("pk,ck->cp", table[:, :, 0], values)
            return out
        if not callable(given):
            out[..., 0] = float(given) - reference
            return out
        low, high = part.section.face("bottom"), part.section.face("top")
        nodes = part.nodes[:, :n_corners]
        x, d = self._shell.positions()[nodes], self._shell.directors[nodes]
        problem, faces = None, np.zeros((2, *nodes.shape))
        try:
            for face, z in zip(faces, (low, high), strict=True):
                at = (x + z * d).reshape(-1, 3)
                face[:] = numbers_at("Temperature", "value", given, at).reshape(nodes.shape)
                bad = np.flatnonzero(~np.isfinite(face.ravel()))
                if len(bad):
                    problem = (
                        "Temperature is not a finite number everywhere: value gives "
                        f"{face.ravel()[bad[0]]} at {format_point(at[bad[0]])}; correct its value"
                    )
                    face[~np.isfinite(face)] = 0.0
        except InputError as error:  # on this rank, perhaps
            problem = str(error)
        raise_on_all_ranks(self._shell.comm, problem)
        slope = (faces[1] - faces[0]) / (high - low)
        middle = faces[0] - reference - low * slope
        # mean over the corners, and the linear part by least squares
        basis = np.column_stack([np.ones(n_corners), corners - corners.mean(axis=0)])
        terms = 1 if self._shell.order == 1 else 3
        fit = np.linalg.pinv(basis)[:terms]
        at_points = np.column_stack(
            [np.ones(len(element.points)), element.points - corners.mean(axis=0)]
        )[:, :terms]
        for k, value in enumerate((middle, slope)):
            out[..., k] = np.einsum("pt,tn,cn->cp", at_points, fit, value)
        return out

    def stress(self, part: int) -> Array:
        """Sum over the patterns at their present factors, with the weights of the points."""
        return np.asarray(
            sum(f * s[part] for f, s in zip(self.field.factors, self.stresses, strict=True))
        )

    def values(self, part: int) -> Array:
        """Present T0 - T_ref and T1 of a part, shape (n_cells, n_points, 2)."""
        return np.asarray(
            sum(f * t[part] for f, t in zip(self.field.factors, self._values, strict=True))
        )

    def square(self, part: int) -> float:
        """1/2 int e_T . C e_T of this rank's cells at the present temperature."""
        return _square(self._shell.shell_parts[part], self.values(part))

    def forces(self, pattern: int) -> list[Array]:
        """Nodal forces of a pattern of the cells of each part, enhanced strains eliminated."""
        out = []
        for part, stress in zip(self._shell.shell_parts, self.stresses[pattern], strict=True):
            at_rest = np.zeros_like(part.strain_cells.vectors)
            found = part.strain_cells.respond(at_rest, stress=stress, finite=False, tangent=False)
            out.append(-found.residual)
        return out

    def held_energies(self) -> Array:
        """Energies E_kl of undeformed shells, 1/2 a_k a_l E_kl, (n_patterns, n_patterns).

        Collective; as :func:`fxcrack.continuum.thermal_strain.held_energies`.
        """
        n = len(self.stresses)
        single = np.array([self._held([k]) for k in range(n)])
        out = np.zeros((n, n))
        for k in range(n):
            for m in range(k, n):
                both = 4.0 * single[k] if k == m else self._held([k, m])
                out[k, m] = out[m, k] = both - single[k] - single[m]
        return np.asarray(self._shell.comm.allreduce(out, op=MPI.SUM))

    def _held(self, patterns: list[int]) -> float:
        """Energy of this rank's undeformed cells at the sum of some patterns."""
        total = 0.0
        for i, part in enumerate(self._shell.shell_parts):
            stress = np.asarray(sum(self.stresses[k][i] for k in patterns))
            values = np.asarray(sum(self._values[k][i] for k in patterns))
            at_rest = np.zeros_like(part.strain_cells.vectors)
            found = part.strain_cells.respond(at_rest, stress=stress, finite=False, tangent=False)
            total += float(found.energy.sum()) + _square(part, values)
        return total


def _stress(part: ShellPart, temperature: Array) -> Array:
    """Thermal stress resultants with the weights of the points, shape (n_cells, n_points, 12)."""
    resultants = temperature @ part.section.thermal_forces()
    out = np.empty_like(resultants)
    out[..., :6] = resultants[..., :6] * part.soft[..., None]
    # couples about the middle, with the rule of bending; forces act there
    arm = part.section.offset * resultants[..., :6]
    out[..., 6:] = (resultants[..., 6:] - arm) * part.area[..., None] + arm * part.soft[..., None]
    return out


def _square(part: ShellPart, temperature: Array) -> float:
    """1/2 int (T0 + z T1)^2 expansion . C expansion over the cells of this rank."""
    moments = part.section.thermal_squares()
    t0, t1 = temperature[..., 0], temperature[..., 1]
    density = t0**2 * moments[0] + 2.0 * t0 * t1 * moments[1] + t1**2 * moments[2]
    return 0.5 * float((density * part.area).sum())


class ShellThermalWork:
    """Work that a changing temperature does on shells, as in :mod:`.thermal_work`.

    Args:
        shell: The shells.
        temperature: Their thermal stresses.
        stored: Energy of this rank's cells at a displacement and the present temperature.

    Attributes:
        work: Work up to the last commit, force x length, the same on all ranks.
    """

    def __init__(self, shell: ShellBodies, temperature: ShellTemperature, stored: Stored) -> None:
        self._shell, self._field, self._stored = shell, temperature.field, stored
        self._last = np.zeros_like(fem.Function(shell.space).x.array)
        self._last_factors = np.zeros_like(self._field.factors)
        self.work = 0.0

    def begin(self, time: float) -> None:
        """Set the temperature."""
        self._field.set(time)

    def path_work(self, u: fem.Function) -> float:
        """Work since the last commit, by the trapezoidal rule; collective."""
        now = self._field.factors.copy()
        step = now - self._last_factors
        if not step.any():  # factors are the same on all ranks
            return 0.0
        at = fem.Function(self._shell.space)
        total = 0.0
        for values, factors in ((u.x.array, now), (self._last, self._last_factors)):
            at.x.array[:] = values
            for sign in (1.0, -1.0):  # the energy is quadratic in the factors
                self._field.factors = factors + sign * step
                total += 0.25 * sign * self._stored(at)
        self._field.factors = now
        return float(self._shell.comm.allreduce(total, op=MPI.SUM))

    def commit(self, u: fem.Function) -> None:
        """Add the work since the last commit; collective."""
        self.work += self.path_work(u)
        self._last[:] = u.x.array
        self._last_factors = self._field.factors.copy()

    def state(self) -> dict[str, Array]:
        """Displacement of the local dofs and factors of the last commit, and the work so far."""
        return {
            "last": self._last.copy(),
            "factors": self._last_factors.copy(),
            "work": np.array([self.work]),
        }

    def places(self) -> dict[str, Place]:
        """The space of the displacement."""
        return {"last": self._shell.space}

    def restore(self, state: dict[str, Array]) -> None:
        """Set the committed state from :meth:`state`, arrays of the same shapes."""
        self._last[:] = state["last"]
        self._last_factors = state["factors"].copy()
        self.work = float(state["work"][0])


__all__ = ["ShellTemperature", "ShellThermalWork"]
