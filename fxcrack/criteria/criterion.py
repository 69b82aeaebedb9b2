"""Properties every criterion defines; the analysis uses these and never the class of it.

A new criterion, one of the package's or a user's own, is a class derived from :class:`Criterion`,
usually a frozen dataclass of its material constants. It must give :meth:`Criterion.evaluator`;
everything else has a default that a class attribute, a field or a property replaces.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol

from fxcrack.base.errors import InputError
from fxcrack.criteria.evaluator import Evaluator
from fxcrack.criteria.interface_temperature import InterfaceTemperature
from fxcrack.criteria.probe import FrontProbe
from fxcrack.criteria.release_laws import Driver
from fxcrack.criteria.toughness import Tabulated


class Criterion(Protocol):
    """A criterion for growth: f = 1 at the tips that debond.

    A class that does not derive from it must have all of its members.

    Attributes:
        tolerance: f_tol of increment stepping, see :attr:`release_range`.
    """

    tolerance: float = 0.1

    @abstractmethod
    def evaluator(
        self, probe: FrontProbe, temperature: InterfaceTemperature | None, *, softens: bool = False
    ) -> Evaluator:
        """The criterion on one interface; collective.

        Args:
            probe: The interface, with its front in the initial state.
            temperature: Temperature of its slave nodes; None where the debond gives none, and that
                of the bodies is not needed (:attr:`needs_temperature`) or does not exist.
            softens: Whether bonds are released softening with their opening.

        Raises:
            InputError: The criterion does not fit the interface.
        """

    @property
    def release_range(self) -> tuple[float, float]:
        """Lower and upper limit of f at which a node may debond."""
        return 1.0 - self.tolerance, 1.0 + self.tolerance

    @property
    def unstable_tolerance(self) -> float | None:
        """f_tol of unstable growth, where several nodes may debond at one load; None: off."""
        return None

    @property
    def viscosity(self) -> float:
        """Viscous regularisation mu of released nodes [time]; 0: none."""
        return 0.0

    @property
    def degree(self) -> float | None:
        """Power of a proportional load with which f grows, None where it does not grow by a power.

        Where it is known, f = 1 is found in closed form; otherwise by bracketing f itself.
        """
        return None

    @property
    def depends_on_load(self) -> bool:
        """Whether f grows with the load, and not with time alone."""
        return True

    @property
    def grows_in_cycles(self) -> bool:
        """Whether it grows in cycles, and only there.

        Such a criterion has all members of :class:`~fxcrack.Fatigue`.
        """
        return False

    def life_exponent(self, toughness: float) -> float:
        """Power of the range of G with which a crack grows per cycle; 0 outside cycles.

        Args:
            toughness: Mode I toughness [force/length], for laws that are no powers.
        """
        return 0.0

    @property
    def needs_exact_S(self) -> bool:
        """Whether the condensed stiffness must be that of the present state, not an older tangent.

        So it is where the criterion computes equilibria with it (exact crack closure).
        """
        return False

    @property
    def needs_free_faces(self) -> bool:
        """Whether bonds must lose their force at once, so that none acts behind the tips."""
        return False

    @property
    def needs_wake_openings(self) -> bool:
        """Whether the openings at the wake nodes must be known at every tip."""
        return False

    @property
    def needs_temperature(self) -> bool:
        """Whether a property is tabulated against temperature."""
        return any(isinstance(value, Tabulated) for value in vars(self).values())

    @property
    def smallest_increment_when_met(self) -> bool:
        """What increment stepping does where f is in its range when an increment begins.

        So it is right after other nodes were released. True: the increment is the smallest one, and
        at its end the nodes debond whatever their f is. False: it is cut back until f does not
        exceed the range.
        """
        return True

    @property
    def knows_toughness(self) -> bool:
        """Whether the energy that a released bond dissipates is known.

        Then bonds may soften with their opening, and the evaluator is a
        :class:`~fxcrack.criteria.evaluator.SofteningEvaluator`.
        """
        return False

    @property
    def release_drivers(self) -> frozenset[Driver]:
        """What the force of released bonds may fall with: drivers of the release laws allowed."""
        drivers: frozenset[Driver] = frozenset(("once", "increments", "time"))
        return drivers | {"opening"} if self.knows_toughness else drivers

    @property
    def softens(self) -> bool:
        """Whether bonds soften with their opening whatever the release law is."""
        return False

    @property
    def allows_normal_only(self) -> bool:
        """Whether a bond in the normal direction only is possible."""
        return False

    def check_bond(self, *, normal_only: bool) -> None:
        """Check the criterion against the bond it is used on.

        Args:
            normal_only: Whether the bond holds in the normal direction only.

        Raises:
            InputError: They are not compatible.
        """
        if normal_only and not self.allows_normal_only:
            raise InputError(
                f"bonds in the normal direction only are not possible with {type(self).__name__}; "
                "bond in all directions, or use a critical stress, opening or crack length "
                "criterion"
            )
