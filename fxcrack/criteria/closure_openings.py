"""The openings that virtual crack closure multiplies bond forces with, on even and uneven spacing.

On uneven spacing they are those at the length of which the force would be that of even spacing
(:mod:`fxcrack.criteria.closure_lengths`).
"""

from __future__ import annotations

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import format_point
from fxcrack.criteria.closure_lengths import LARGEST_RATIO, opening_shares, uneven
from fxcrack.criteria.probe import FrontProbe, State, further_openings, openings
from fxcrack.interface.tips import Tips


class ClosureOpenings:
    """Openings at equal lengths on one interface.

    Args:
        probe: The interface.
    """

    def __init__(self, probe: FrontProbe) -> None:
        self._probe = probe
        self._shared: tuple[Tips, Array | None, Ints] | None = None
        self._uneven_said = False

    def measure(self, tips: Tips, state: State) -> Array:
        """Openings that the forces at tips are multiplied with, shape (n, k, 3), length."""
        opening = openings(self._probe, tips, state)
        shares, rows = self._shares_of(tips)
        if shares is None:
            return opening
        far = np.zeros((len(tips), 1, 3))
        far[rows, 0] = further_openings(self._probe, tips, rows, state)
        return np.asarray(np.einsum("nkj,njc->nkc", shares, np.concatenate([opening, far], axis=1)))

    def needs(self, tips: Tips) -> Ints:
        """On uneven spacing the second corner node behind each tip, shape (m,)."""
        _, rows = self._shares_of(tips)
        return np.unique(tips.further_nodes[rows])

    def _shares_of(self, tips: Tips) -> tuple[Array | None, Ints]:
        """Shares of the measured openings, None where spacing is even; tips that need the further.

        The second has shape (m,).
        """
        if self._shared is None or self._shared[0] is not tips:
            behind, none = tips.d_behind, np.zeros(0, dtype=np.int64)
            # an opening that does not lie behind the force on one line stays where it is
            ahead = np.where(tips.straight, tips.d_ahead, behind)
            if not uneven(ahead, behind).any():
                self._shared = tips, None, none
            else:
                self._look_at_lengths(tips)
                shares = opening_shares(ahead, behind, tips.d_further, tips.force_nodes.shape[1])
                rows = np.flatnonzero(np.any(shares[:, :, -1] != 0.0, axis=1))
                self._shared = tips, shares, rows
        return self._shared[1:]

    def _look_at_lengths(self, tips: Tips) -> None:
        """Warn once where lengths behind and ahead differ by more than is calibrated."""
        on = (tips.d_ahead > 0.0) & tips.straight
        ratio = np.divide(tips.d_ahead, tips.d_behind, out=np.ones(len(tips)), where=on)
        far = np.maximum(ratio, 1.0 / ratio)
        i = int(np.argmax(far))
        if self._uneven_said or far[i] <= LARGEST_RATIO * (1.0 + 1e-6):
            return
        self._uneven_said = True
        log.warn(
            "interface '%s': at the tip at %s the elements are %.4g long behind it and %.4g "
            "ahead, a ratio of %.3g; virtual crack closure is calibrated for ratios up to %g, and "
            "G may be off by more than 5 %% there: grade the mesh in several steps, or take "
            "method='closure'",
            self._probe.pair.title,
            format_point(self._probe.pair.surface.x[tips.node[i]]),
            tips.d_behind[i],
            tips.d_ahead[i],
            far[i],
            LARGEST_RATIO,
        )
