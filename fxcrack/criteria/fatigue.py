"""Fatigue growth by a law of the energy release rates of one stabilised cycle.

One stabilised cycle is solved per release, at the beginning of each element. It is at the same time
the end of the element before, and in between log dG and log G_max are linear in a: the cycles of an
element are the integral

    dN = int da/(da/dN)

of the law (:mod:`fxcrack.criteria.element_cycles`). At constant amplitude N(a) is so the integral
of the law over G(a).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base.checks import flag, keep, shown
from fxcrack.base.errors import InputError
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.criteria.fatigue_law import FatigueLaw, UserFunction
from fxcrack.criteria.growth_function import fatigue_law_of
from fxcrack.criteria.mixed_mode import clip, total
from fxcrack.criteria.paris import Paris


@dataclass(frozen=True, eq=False, kw_only=True)
class Fatigue(RateCriterion):
    """Growth under cyclic load. Toughness, mode mix and method as for VCCT.

    Attributes:
        paris: Constants of a Paris law in energy release rates; or
        growth: Another law of growth: :class:`ParisK`, :class:`Blanco`, :class:`KenaneBenzeggagh`,
            an object with the members of :class:`~fxcrack.criteria.fatigue_law.FatigueLaw`, or
            da/dN as a function of a :class:`CycleRates`, see
            :class:`~fxcrack.criteria.growth_function.GrowthFunction`.
        credit: Whether growth of front nodes that are not released is kept for later cycles; else
            each of them starts its element anew.
        partial: Whether every front node advances through its element cycle by cycle, its bond
            fading in proportion (:mod:`fxcrack.criteria.ligaments`), so that a front in 3-D stays
            smooth. Otherwise bonds fail one after the other, each at the end of its element.
            ``None``: in 3-D on linear solids of first order with ``method="vcct"``, without
            friction and without ``credit``.
    """

    paris: Paris | None = None
    growth: FatigueLaw | UserFunction | None = None
    credit: bool = field(default=False)
    partial: bool | None = field(default=None)

    grows_in_cycles: ClassVar[bool] = True

    def life_exponent(self, toughness: float) -> float:
        """Exponent of growth."""
        return self.growth_law.life_exponent(toughness)

    @property
    def growth_law(self) -> FatigueLaw:
        """The law of growth, whichever way it was given."""
        return cast(FatigueLaw, self.growth)

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        super().__post_init__()
        if self.paris is not None and not isinstance(self.paris, Paris):
            raise InputError(
                f"Fatigue: paris = {shown(self.paris)} must be a Paris(c1, c2, c3, c4); give other "
                "laws as growth="
            )
        if (self.paris is None) == (self.growth is None) and self.growth is not self.paris:
            raise InputError("Fatigue: paris and growth are both given; give one law of growth")
        if self.paris is None and self.growth is None:
            raise InputError(
                "Fatigue: a law of growth is missing; give paris=Paris(c1, c2, c3, c4) or "
                "growth=ParisK(...), Blanco(...), KenaneBenzeggagh(...) or a function"
            )
        given = self.paris if self.growth is None else self.growth
        keep(self, growth=fatigue_law_of("Fatigue", cast(FatigueLaw, given)))
        keep(self, credit=flag("Fatigue", "credit", self.credit))
        if self.partial is not None:
            keep(self, partial=flag("Fatigue", "partial", self.partial))
        if self.partial and self.method != "vcct":
            raise InputError(
                f"Fatigue: partial=True needs method='vcct', not '{self.method}': the energy of "
                "releasing a whole node says nothing of a part of it"
            )

    def cycle(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> CycleRates:
        """What a law needs from one stabilised cycle.

        Args:
            rates: Energy release rates by mode at m instants of the cycle, its extremes among
                them, shape (m, n, 3) [force/length].
            toughness: Toughness by mode, shape (n, 3) or (3,) [force/length].

        Returns:
            Its values at n front nodes; G_c and the mode mix are those at G_max.
        """
        g = np.asarray(rates, dtype=np.float64)
        totals = total(g)
        worst = totals.argmax(axis=0)
        at_worst = np.take_along_axis(g, worst[None, :, None], axis=0)[0]
        top = totals.max(axis=0)
        modes = clip(at_worst)
        shear = modes[:, 1] + modes[:, 2]
        none = np.zeros(len(top))
        return CycleRates(
            top - totals.min(axis=0),
            top,
            self.critical(at_worst, toughness),
            np.divide(shear, top, out=none.copy(), where=top > 0.0),
            np.divide(modes[:, 2], shear, out=none.copy(), where=shear > 0.0),
        )
