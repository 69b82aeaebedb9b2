"""Critical crack opening displacement at a distance behind the tip.

    f = d/d_c

d is the normal distance between the two faces, between the points of slave and master surface
that lie on a circle of the given radius around the current tip. Typical for ductile materials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import flag, keep, list_of, not_negative, positive, table
from fxcrack.base.errors import InputError
from fxcrack.criteria.at_distance import Stencil, TipStencils, at_nodes, on_face
from fxcrack.criteria.criterion import Criterion
from fxcrack.criteria.evaluator import Evaluator
from fxcrack.criteria.interface_temperature import InterfaceTemperature, steady
from fxcrack.criteria.probe import FrontProbe, State
from fxcrack.criteria.release_laws import Driver
from fxcrack.criteria.toughness import Tabulated
from fxcrack.interface.tips import Tips


@dataclass(frozen=True)
class CrackOpening(Criterion):
    """Growth when the opening at a distance behind the tip reaches a critical one.

    Attributes:
        critical: Critical opening [length]: a number; a table (lengths, values) against the
            cumulative crack length, linear between entries and not extrapolated: before the first
            and beyond the last length the value there holds; or a table against temperature.
        distance: Straight-line distance behind the current tip [length]; three elements or more
            (two at least, below which a warning is given).
        symmetry: The faces lie on a symmetry plane: half the critical opening is used. Needs a
            bond in the normal direction only.
        tolerance: f_tol; growth is accepted while 1 - f_tol <= f <= 1 + f_tol.
    """

    critical: float | tuple[Sequence[float], Sequence[float]] | Tabulated
    distance: float = field(kw_only=True)
    symmetry: bool = field(default=False, kw_only=True)
    tolerance: float = field(default=0.1, kw_only=True)

    degree: ClassVar[float] = 1.0
    allows_normal_only: ClassVar[bool] = True
    release_drivers: ClassVar[frozenset[Driver]] = frozenset(("once", "time"))

    def __post_init__(self) -> None:
        """Check the numbers and the table."""
        owner = "CrackOpening"
        positive(owner, distance=self.distance)
        not_negative(owner, tolerance=self.tolerance)
        keep(self, symmetry=flag(owner, "symmetry", self.symmetry))
        if isinstance(self.critical, Tabulated):
            return
        parts = list_of(self.critical)
        if parts is None:
            positive(owner, critical=self.critical)
            return
        if len(parts) != 2:
            raise InputError(
                f"{owner}: critical has {len(parts)} parts; give one number, or a table as "
                "(crack lengths, critical openings)"
            )
        lengths, values = table(owner, ("crack lengths", "critical openings"), *parts)
        for i, value in enumerate(values):
            positive(owner, **{f"critical openings[{i}]": value})
        object.__setattr__(self, "critical", (lengths, values))

    def check_bond(self, *, normal_only: bool) -> None:
        """Refuse symmetry with a bond in all directions.

        Argument and error as for :meth:`Criterion.check_bond`.
        """
        if self.symmetry and not normal_only:
            raise InputError(
                "CrackOpening: symmetry needs a bond in the normal direction only; bond the "
                "interface so, or model both halves and leave symmetry out"
            )

    def evaluator(
        self, probe: FrontProbe, temperature: InterfaceTemperature | None, *, softens: bool = False
    ) -> OpeningEvaluator:
        """The criterion on one interface; arguments as for :meth:`Criterion.evaluator`."""
        return OpeningEvaluator(probe, self, steady(temperature, probe, self))

    def critical_at(
        self, crack_length: npt.ArrayLike, temperature: npt.ArrayLike | None = None
    ) -> Array:
        """Critical opening, halved for symmetry [length].

        Args:
            crack_length: Length along the slave surface from initial to current tip, shape (n,)
                or one number [length].
            temperature: Temperature at the tips, shape (n,) or one number; None without.

        Raises:
            InputError: It depends on temperature and none is given.
        """
        grown = np.asarray(crack_length, dtype=np.float64)
        if isinstance(self.critical, Tabulated):
            if temperature is None:
                raise InputError(
                    "CrackOpening: critical depends on temperature, but the debond has none; give "
                    "Debond(temperature=...), or the critical opening as a number"
                )
            values = self.critical.at(temperature) + 0.0 * grown
        elif isinstance(self.critical, tuple):
            values = np.interp(grown, *self.critical)
        else:
            values = np.full(grown.shape, self.critical)
        return np.asarray(values / 2.0 if self.symmetry else values)

    def value(
        self,
        opening: npt.ArrayLike,
        crack_length: npt.ArrayLike = 0.0,
        temperature: npt.ArrayLike | None = None,
    ) -> Array:
        """Value f of the criterion.

        Args:
            opening: Opening at the distance behind each tip, shape (n,) [length].
            crack_length: As for :meth:`critical_at`.
            temperature: Likewise.

        Returns:
            Values, shape (n,). Closed faces (negative openings) give 0.
        """
        critical = self.critical_at(crack_length, temperature)
        return np.asarray(np.maximum(opening, 0.0) / critical)


class OpeningEvaluator(Evaluator):
    """Critical opening at a straight-line distance behind the tip.

    The critical value belongs to the length grown from the initial tip along the slave surface.

    Args:
        probe: The interface, with its front in the initial state.
        criterion: Critical openings and distance.
        temperature: Temperature of the slave nodes, shape (n_nodes,); None without.

    Raises:
        InputError: The distance lies outside the end points of the pair, or the critical opening
            depends on temperature and there is none.
    """

    degree: ClassVar[float] = 1.0

    def __init__(
        self,
        probe: FrontProbe,
        criterion: CrackOpening,
        temperature: Array | None = None,
    ) -> None:
        self.probe, self.criterion, self.temperature = probe, criterion, temperature
        self.stencils = TipStencils(probe, self._part)
        criterion.critical_at(0.0, temperature)
        self.behind = criterion.distance + self.stencils.paths.longest
        self._grown = np.zeros(self.stencils.surface.n_nodes)
        self._warned = False
        tips = probe.front.tips()
        if len(tips):
            self._stencil(tips)  # a wrong distance shows here
            owner, distance = type(criterion).__name__, criterion.distance
            self.stencils.look_at_elements(tips, owner, distance, tips.d_behind)

    def _part(self, tips: Tips, i: int) -> tuple[Ints, Array]:
        paired = self.probe.pair.paired
        distance, stencils = self.criterion.distance, self.stencils
        way = stencils.paths.behind(tips, i, distance * (1.0 - 1e-12), paired)
        reach = float(way.radius.max())
        if distance > reach * (1.0 + 1e-12):
            raise InputError(
                f"{stencils.where(int(tips.node[i]))}: CrackOpening distance {distance:g} lies "
                f"outside the end points of the pair, {reach:g} behind the tip; give a smaller "
                "distance, or extend both surfaces"
            )
        nodes, weights = on_face(way, way.x, min(distance, reach), stencils.surface.order)
        bonded = stencils.front.bonded[nodes] & (nodes != tips.node[i])
        if bonded[np.abs(weights) > 1e-9].any() and not self._warned:
            self._warned = True
            log.warn(
                "%s: CrackOpening distance %g reaches back to bonded nodes behind the crack, "
                "which do not open; give a smaller distance",
                stencils.where(int(tips.node[i])),
                distance,
            )
        return nodes, weights

    def _stencil(self, tips: Tips) -> Stencil:
        """Stencil of the tips; the lengths they have grown are found with it."""
        if not self.stencils.is_known(tips):
            self._grown[tips.node] = self.stencils.paths.origins(tips).grown
        return self.stencils.at(tips)

    def measure(self, tips: Tips, state: State, time: float) -> Array:
        """Opening, and length grown so far, shape (n, 2), length."""
        stencil = self._stencil(tips)
        pair = self.probe.pair
        jump = self.probe.jumps(stencil.nodes, state)
        normal = np.zeros((*stencil.nodes.shape, 3))
        if self.stencils.front.placed:  # the arms turn to both sides of the normal at the tip
            normal[:] = tips.frame[:, None, :, 0]
        else:
            normal[..., : self.probe.gdim] = pair.frames[stencil.nodes, :, 0]
        gap = pair.interface.opening_factor * pair.gap
        opening = np.einsum("nkc,nkc->nk", normal, jump) + gap[stencil.nodes]
        return np.stack([stencil(opening), self._grown[tips.node]], axis=1)

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """Values f, the opening and the length the tip has grown.

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`, shape (n, 2) [length].

        Returns:
            f, shape (n,), and "cod" and "grown", each of shape (n,) [length].
        """
        opening, grown = measured.T
        f = self.criterion.value(opening, grown, at_nodes(self.temperature, tips.node))
        return f, {"cod": opening, "grown": grown}

    def needs(self, tips: Tips) -> Ints:
        """The open slave nodes whose openings are used, shape (m,)."""
        nodes = self._stencil(tips).nodes.ravel()
        return np.asarray(nodes[~self.stencils.front.bonded[nodes]])
