"""How the bodies are condensed onto their interfaces."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

from fxcrack.base.checks import keep, number, shown
from fxcrack.base.errors import InputError

METHODS = ("auto", "schur", "columns", "iterative")


@dataclass(frozen=True, init=False)
class CondensedOptions:
    """How the condensation is done.

    Args:
        method: "schur", "columns" (both factor the bodies, see
            :class:`~fxcrack.condensation.direct.DirectCondensation`), "iterative" (columns by
            conjugate gradients with multigrid, no factorisation: for 3-D models too large for one)
            or "auto": "schur" where it is available, "iterative" where the factors of a 3-D model
            would not fit the memory of the machine.
        retained_mb: Memory the dense matrices of the retained jumps may take, and the stored
            columns of "iterative" before old ones are dropped, MB.
        rows: Let the retained jumps reach at most this distance ahead of the front (length);
            ``None`` lets the cost model decide.
        rtol: "iterative" only: energy norm of a column's error over that of the column. The error
            of S is its square.
        window_mb: Former name of ``retained_mb``, deprecated.

    Raises:
        InputError: The method is unknown or the tolerance makes no sense.
    """

    method: str
    retained_mb: float
    rows: float | None
    rtol: float

    def __init__(
        self,
        method: str = "auto",
        retained_mb: float = 2000.0,
        rows: float | None = None,
        rtol: float = 1e-6,
        *,
        window_mb: float | None = None,
    ) -> None:
        if window_mb is not None:
            _warn_of_former_name()
            retained_mb = window_mb
        keep(self, method=method, retained_mb=retained_mb, rows=rows, rtol=rtol)
        owner = "CondensedOptions"
        if not isinstance(self.method, str) or self.method not in METHODS:
            names = ", ".join(f"'{m}'" for m in METHODS)
            raise InputError(f"method = {shown(self.method)}: choose one of {names}")
        if not number(owner, "retained_mb", self.retained_mb) > 0.0:
            raise InputError(f"{owner}: retained_mb = {self.retained_mb} must be positive")
        if self.rows is not None and not number(owner, "rows", self.rows) >= 0.0:
            raise InputError(f"{owner}: rows = {self.rows} must not be negative; None to decide")
        if not 1e-12 <= number(owner, "rtol", self.rtol) <= 1e-2:
            raise InputError(f"rtol = {self.rtol}: choose a tolerance from 1e-12 to 1e-2")

    @property
    def window_mb(self) -> float:
        """Former name of :attr:`retained_mb`, deprecated."""
        _warn_of_former_name()
        return self.retained_mb


def _warn_of_former_name() -> None:
    """Warn of ``window_mb``."""
    warnings.warn(
        "CondensedOptions: window_mb is now called retained_mb; the former name will be removed",
        DeprecationWarning,
        stacklevel=3,
    )
