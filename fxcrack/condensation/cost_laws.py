"""Laws for the seconds and bytes of a condensation, with constants that were measured.

The constants come from ``fxcrack bench scale --store FILE``; :mod:`fxcrack.bench.cost` makes
estimates of whole analyses of them, and a factorisation that memory cannot hold is refused.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from fxcrack.base.errors import InputError

CONSTANTS = Path(__file__).with_name("cost_constants.json")
_USABLE = 0.9  # of a machine's memory


@dataclass(frozen=True)
class Law:
    """a n + b n^e (log2 n)^l, measured for n from ``low`` to ``high``."""

    linear: float
    power: float
    exponent: float
    log: float
    low: float
    high: float

    def __call__(self, n: float) -> float:
        """Its value at n."""
        growth = float(n**self.exponent) * float(math.log2(n) ** self.log)
        return self.linear * n + self.power * growth

    def measured(self, n: float) -> bool:
        """Whether n is among the sizes measured."""
        return self.low * 0.9 <= n <= self.high * 1.1


@dataclass(frozen=True)
class Constants:
    """Measured constants of the laws.

    Attributes:
        date: When they were measured.
        machine: Where.
        laws: By name, such as "direct_seconds_3" (s) or "direct_memory_3" (bytes).
        iterations: Iterations of a block of columns, by shape.
        per_entry: Seconds per entry of S in a factorisation, by dimension.
        release: Seconds per w^2 of a release.
        latency: Seconds of a small message.
        per_byte: Seconds per byte of a large one.
        gain: Exponent g of the ranks, 1 if 2 ranks halve the time, by method and dimension.
    """

    date: str
    machine: str
    laws: dict[str, Law]
    iterations: dict[str, float]
    per_entry: dict[str, float]
    release: float
    latency: float
    per_byte: float
    gain: dict[str, float]

    @classmethod
    def read(cls, path: Path) -> Constants:
        """From a file that `fxcrack bench scale --store` wrote.

        Raises:
            InputError: It is not such a file.
        """
        try:
            values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            values["laws"] = {k: Law(**v) for k, v in values["laws"].items()}
            return cls(**values)
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise InputError(
                f"{path} holds no cost constants ({error}); write it by "
                "'fxcrack bench scale --store FILE'"
            ) from error


@cache
def shipped() -> Constants:
    """The constants that come with fxcrack."""
    return Constants.read(CONSTANTS)


def too_large_for_direct(dofs: int, memory: float) -> str | None:
    """Why a 3-D model of some dofs should not be factored in a memory, ``None`` if it may.

    Args:
        dofs: Displacement dofs.
        memory: Bytes of all machines together.
    """
    needed = shipped().laws["direct_memory_3"](dofs)
    if needed <= _USABLE * memory:
        return None
    return (
        f"a factorisation of {dofs} dofs would take about {needed / 1e9:.0f} GB of the "
        f"{memory / 1e9:.0f} GB there are"
    )
