"""Critical stress at a distance ahead of the tip, measured along the slave surface.

    f = sqrt((s_n/s_f)^2 + (t_1/t1_f)^2 + (t_2/t2_f)^2),    s_n = max(normal stress, 0)

Typical for brittle materials. A shear strength not given has no effect.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import not_negative, number, positive
from fxcrack.base.errors import InputError
from fxcrack.criteria.at_distance import TipStencils, at_nodes, on_face
from fxcrack.criteria.criterion import Criterion
from fxcrack.criteria.evaluator import Evaluator
from fxcrack.criteria.interface_temperature import InterfaceTemperature, steady
from fxcrack.criteria.probe import FrontProbe, State
from fxcrack.criteria.release_laws import Driver
from fxcrack.criteria.toughness import Tabulated
from fxcrack.interface.tips import Tips

_ROUND_OFF = 1e-11
"""Tractions below this fraction of the largest one count as zero."""


@dataclass(frozen=True)
class CriticalStress(Criterion):
    """Growth when the stress at a distance ahead of the tip reaches the strength.

    Attributes:
        sigma_f: Normal strength [stress], a number or a table against temperature.
        tau1_f: Shear strength in the growth direction [stress], likewise; None or 0: no effect.
        tau2_f: Shear strength along the front [stress], likewise; None or 0: no effect; 3-D only.
        distance: Distance ahead of the tip along the slave surface [length]; three elements or
            more (two at least, below which a warning is given).
        tolerance: f_tol; growth is accepted while 1 - f_tol <= f <= 1 + f_tol.
    """

    sigma_f: float | Tabulated
    tau1_f: float | Tabulated | None = None
    tau2_f: float | Tabulated | None = None
    distance: float = field(kw_only=True)
    tolerance: float = field(default=0.1, kw_only=True)

    degree: ClassVar[float] = 1.0
    allows_normal_only: ClassVar[bool] = True
    release_drivers: ClassVar[frozenset[Driver]] = frozenset(("once", "time"))

    def __post_init__(self) -> None:
        """Check the numbers."""
        owner = "CriticalStress"
        not_negative(owner, distance=self.distance, tolerance=self.tolerance)
        if not isinstance(self.sigma_f, Tabulated):
            positive(owner, sigma_f=self.sigma_f)
        for name, value in (("tau1_f", self.tau1_f), ("tau2_f", self.tau2_f)):
            if value is None or isinstance(value, Tabulated):
                continue
            if number(owner, name, value) < 0.0:
                raise InputError(
                    f"{owner}: {name} = {value} must be positive; None or 0 for no effect"
                )

    def evaluator(
        self, probe: FrontProbe, temperature: InterfaceTemperature | None, *, softens: bool = False
    ) -> StressEvaluator:
        """The criterion on one interface; arguments as for :meth:`Criterion.evaluator`."""
        return StressEvaluator(probe, self, steady(temperature, probe, self))

    def strength(self, temperature: npt.ArrayLike | None = None) -> Array:
        """Strengths (normal, along growth, along the front), infinite where there is no effect.

        Args:
            temperature: Temperature at the front nodes, shape (n,) or one number; None without.

        Returns:
            Strengths, shape (3,), or (n, 3) with n temperatures [stress].

        Raises:
            InputError: A strength depends on temperature and none is given.
        """
        columns = []
        for name in ("sigma_f", "tau1_f", "tau2_f"):
            value = getattr(self, name)
            if isinstance(value, Tabulated):
                if temperature is None:
                    raise InputError(
                        f"CriticalStress: {name} depends on temperature, but the debond has none; "
                        "give Debond(temperature=...), or the strength as a number"
                    )
                columns.append(value.at(temperature))
            else:
                columns.append(np.asarray(value if value else np.inf, dtype=np.float64))
        return np.stack(np.broadcast_arrays(*columns), axis=-1)

    def value(self, traction: npt.ArrayLike, temperature: npt.ArrayLike | None = None) -> Array:
        """Value f of the criterion.

        Args:
            traction: Bond traction at the distance ahead of the tip, tension positive, as (normal,
                growth direction, front tangent), shape (n, 3) [stress].
            temperature: Temperature there, shape (n,) or one number; None without temperatures.

        Returns:
            Values, shape (n,). Compression does not count.

        Raises:
            InputError: A strength depends on temperature and none is given.
        """
        t = np.array(traction, dtype=np.float64)
        t[..., 0] = np.maximum(t[..., 0], 0.0)
        relative = t / self.strength(temperature)
        return np.asarray(np.hypot(np.hypot(relative[..., 0], relative[..., 1]), relative[..., 2]))


class StressEvaluator(Evaluator):
    """Critical stress at a distance ahead of the tip, measured along the slave surface.

    Where fewer bonded nodes than that lie ahead (the end of the surface or another crack is
    near), the last of them counts.

    Args:
        probe: The interface, with its front in the initial state.
        criterion: Strengths and distance.
        temperature: Temperature of the slave nodes, shape (n_nodes,); None without.

    Raises:
        InputError: The distance lies outside the bonded part ahead of an initial tip on a line
            (a warning on a surface), or a strength depends on temperature and there is none.
    """

    degree: ClassVar[float] = 1.0

    def __init__(
        self,
        probe: FrontProbe,
        criterion: CriticalStress,
        temperature: Array | None = None,
    ) -> None:
        self.probe, self.criterion, self.temperature = probe, criterion, temperature
        self.stencils = TipStencils(probe, self._part)
        criterion.strength(temperature)
        self.ahead = criterion.distance + self.stencils.paths.longest
        self._starting = True
        tips = probe.front.tips()
        if len(tips):
            self.stencils.at(tips)  # a wrong distance shows here
            owner, distance = type(criterion).__name__, criterion.distance
            self.stencils.look_at_elements(tips, owner, distance, tips.d_ahead)
        self._starting = False

    def _part(self, tips: Tips, i: int) -> tuple[Ints, Array]:
        distance, stencils = self.criterion.distance, self.stencils
        way = stencils.paths.ahead(tips, i, distance * (1.0 - 1e-12))
        reach = float(way.s[-1])
        if distance > reach * (1.0 + 1e-12) and self._starting:
            problem = (
                f"{stencils.where(int(tips.node[i]))}: CriticalStress distance {distance:g} lies "
                f"outside the bonded part, which ends {reach:g} ahead of the tip"
            )
            if stencils.surface.dim == 1:
                raise InputError(f"{problem}; give a smaller distance")
            # the direction of growth may point out of the side of a body
            log.warn("%s; the stress at its last node is used", problem)
        if len(way.nodes) == 1:
            return way.nodes, np.ones(1)
        return on_face(way, way.s[:, None], min(distance, reach), stencils.surface.order)

    def measure(self, tips: Tips, state: State, time: float) -> Array:
        """Traction in the tip frame (normal, growth direction, front), shape (n, 3) [stress]."""
        stencil = self.stencils.at(tips)
        traction = self.probe.bond_forces(stencil.nodes, state)
        traction = stencil(traction / self.stencils.surface.areas[stencil.nodes][..., None])
        out = np.asarray(np.einsum("nci,nc->ni", tips.frame, traction))
        # a component that symmetry makes vanish must not become a cause of growth by its round-off
        out[np.abs(out) < _ROUND_OFF * np.abs(out).max(initial=0.0)] = 0.0
        return out

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """Values f and the stresses s11 (normal), s12 (growth direction) and in 3-D s13 (front).

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`, shape (n, 3) [stress].

        Returns:
            f, shape (n,), and the stresses, each of shape (n,) [stress].
        """
        names = ("s11", "s12", "s13")[: self.probe.gdim]
        f = self.criterion.value(measured, at_nodes(self.temperature, tips.node))
        return f, dict(zip(names, measured.T, strict=False))

    def needs(self, tips: Tips) -> Ints:
        """The slave nodes whose forces are used, shape (m,)."""
        return np.asarray(self.stencils.at(tips).nodes.ravel())
