"""What an analysis costs: seconds and memory by phase, from laws whose constants were measured.

    direct:     t = a n + b n^1.5 (2-D), a n + b n^2 (3-D);   memory  b n log2 n, a n + b n^(4/3)
                S: c w^2, w retained components, at most 2 GB of them per factorisation
    iterative:  set-up a n; w columns of k iterations, b n each; memory a n + 4 w n bytes
    dense:      c w^2/3 per release, on every rank
    ranks:      t(P) = t(1) / P^g, 2^g what 2 ranks gained; messages of the iteration by latency
                and bandwidth

The exponents are those of nested dissection (George 1973). The constants come from
`fxcrack bench scale --store FILE`; what lies outside the sizes measured there is extrapolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fxcrack.base.errors import InputError
from fxcrack.condensation.cost_laws import Constants, shipped

METHODS = ("direct", "iterative")

_BLOCK = 32  # columns solved together
_S_BYTES = 16.0  # S and its growing factor, per entry
_S_MOST = 2e9  # bytes of them, the default of CondensedOptions.retained_mb
_REDUCTIONS, _EXCHANGES = 3, 7  # per iteration; the latter per level
_MOST_RANKS = 65536


@dataclass(frozen=True)
class Task:
    """What is to be computed.

    Attributes:
        dofs: Displacement dofs.
        dim: 2 or 3.
        retained: Number of retained jumps, components that open or are watched.
        releases: Events.
        shape: "block" (compact) or "plate" (slender arms), which decides the iterations.

    Raises:
        InputError: A number makes no sense.
    """

    dofs: float
    dim: int = 3
    retained: float = 2000.0
    releases: float = 500.0
    shape: str = "block"

    def __post_init__(self) -> None:
        if self.dim not in (2, 3):
            raise InputError(f"dim = {self.dim}: choose 2 or 3")
        if self.shape not in ("block", "plate"):
            raise InputError(f"shape = '{self.shape}': choose block or plate")
        for name in ("dofs", "retained", "releases"):
            value = getattr(self, name)
            if not 1.0 <= value <= 1e13:
                raise InputError(f"{name} = {value}: choose a number of at least 1")


@dataclass(frozen=True)
class CostEstimate:
    """Expected cost of a task.

    Attributes:
        method: "direct" or "iterative".
        ranks: Number of ranks.
        seconds: By phase.
        memory: Bytes by part, all ranks together.
        measured: By phase or part, whether the size lies among those measured.
    """

    method: str
    ranks: int
    seconds: dict[str, float]
    memory: dict[str, float]
    measured: dict[str, bool] = field(default_factory=dict)

    @property
    def total_seconds(self) -> float:
        """Seconds in all."""
        return sum(self.seconds.values())

    @property
    def total_memory(self) -> float:
        """Bytes in all, over all ranks."""
        return sum(self.memory.values())


def estimate(
    task: Task, method: str, ranks: int = 1, constants: Constants | None = None
) -> CostEstimate:
    """Expected seconds and memory.

    Args:
        task: What.
        method: "direct" or "iterative".
        ranks: Number of ranks.
        constants: Measured constants; the shipped ones by default.

    Raises:
        InputError: The method is unknown, ranks is not positive, or iterative in 2-D.
    """
    if method not in METHODS:
        raise InputError(f"method = '{method}': choose direct or iterative")
    if ranks < 1:
        raise InputError(f"ranks = {ranks}: choose at least 1")
    if method == "iterative" and task.dim == 2:
        raise InputError("the iterative method is not modelled in 2-D: the direct one always wins")
    c = shipped() if constants is None else constants
    n, w, d = task.dofs, task.retained, str(task.dim)
    share = float(ranks ** -c.gain[f"{method}_{d}"])
    base = c.laws[f"base_seconds_{d}"]
    seconds = {"mesh, assembly, T": base(n) / ranks}
    dense = task.releases * c.release * w**2 / 3.0
    few = ranks <= 2
    if method == "direct":
        law, memory_law = c.laws[f"direct_seconds_{d}"], c.laws[f"direct_memory_{d}"]
        times = max(math.ceil(math.sqrt(_S_BYTES / _S_MOST) * w), 1)
        part = w / times
        seconds["factorisation"] = times * law(n) * share
        seconds["retained jumps"] = times * c.per_entry[d] * part**2 * share
        memory = {"matrix and factor": memory_law(n), "S": _S_BYTES * part**2 * ranks}
    else:
        setup, law = c.laws["setup_seconds_3"], c.laws["iteration_seconds_3"]
        memory_law = c.laws["iterative_memory_3"]
        k = c.iterations[task.shape]
        seconds["multigrid"] = setup(n) * share
        seconds["columns"] = w * k * law(n) * share
        seconds["messages"] = math.ceil(w / _BLOCK) * k * _message_seconds(n, ranks, c)
        memory = {
            "matrices and blocks": memory_law(n), "columns": 4.0 * w * n,
            "S": _S_BYTES * w**2 * ranks,
        }  # fmt: skip
    seconds["growth on S"] = dense
    measured = {phase: few and law.measured(n) for phase in seconds}
    measured |= {"mesh, assembly, T": few and base.measured(n), "growth on S": True}
    measured |= {part: few and memory_law.measured(n) for part in memory}
    return CostEstimate(method, ranks, seconds, memory, measured)


def _message_seconds(n: float, ranks: int, c: Constants) -> float:
    """Seconds of the messages of one iteration of a block."""
    if ranks == 1:
        return 0.0
    levels = max(math.log(n / 400.0, 20.0), 1.0)
    latency = c.latency * (_REDUCTIONS * math.log2(ranks) + _EXCHANGES * levels)
    surface = 6.0 * 3.0 ** (1.0 / 3.0) * (n / ranks) ** (2.0 / 3.0)
    return float(latency + c.per_byte * 4.0 * _BLOCK * surface * _EXCHANGES)


def advise(
    task: Task,
    *,
    bytes_per_rank: float,
    ranks: int | None = None,
    constants: Constants | None = None,
) -> list[CostEstimate]:
    """Estimates of all methods that fit, the best first; on as many ranks as their memory needs.

    Args:
        task: What.
        bytes_per_rank: Memory a rank may take.
        ranks: Number of ranks; by default the smallest power of 2 whose memory is enough.
        constants: Measured constants; the shipped ones by default.

    Returns:
        Empty if no method fits.
    """
    fit = []
    for method in METHODS if task.dim == 3 else METHODS[:1]:
        p = 1 if ranks is None else ranks
        while True:
            found = estimate(task, method, p, constants)
            if found.total_memory <= bytes_per_rank * p:
                fit.append(found)
                break
            if ranks is not None or p >= _MOST_RANKS:
                break
            p *= 2
    # ranked by core time: seconds times ranks
    return sorted(fit, key=lambda e: e.total_seconds * e.ranks)
