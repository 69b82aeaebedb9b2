"""The check of the energy balance that every step ends with.

    work + energy there before any load = stored + released + dissipated + balance

The column "balance" is what is left over: an error of the run, whatever its cause. It is compared
with the largest energy of the history, since errors add up over all of it. Energy that the time
integration has made (a negative "numerical_dissipation") is warned of by the end of a step only:
generalised alpha does not let a motion lose energy at every instant, but over some increments.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base import log
from fxcrack.base.errors import EnergyError
from fxcrack.continuum.foundation import ENERGY
from fxcrack.history import History, Row

WARNED = 1e-3
"""Part of the largest energy beyond which a step warns of its balance. Beside round-off, increments
that are too long leave less: those of nonlinear bodies are divided at 1e-5 of the stored energy
each (:class:`~fxcrack.solvers.options.NewtonOptions`), and friction in 3-D, plastic strain and the
motion of bodies at finite strain are integrated to about 1e-4 to 1e-3."""
REFUSED = 1e-2
"""Part beyond which a step ends with an error."""
_ROUND_OFF = 1e-6
"""Energies below this part of the products of loads and their conjugates are differences of large
numbers (a body that expands freely stores nothing), and no measure for what is missing."""
_STORED = ("strain_energy", "kinetic_energy")
_STABILISED = 1e-2
"""Part of the strain energy beyond which a foundation is more than a help."""
_GIVEN = ("external_work", "initial_energy", "initial_kinetic_energy", "overlap_energy")
_ADVICE = (
    "the increments are too long for the contact, friction or finite strain of the scene (give "
    "maximum=, minimum= or dt=), or the run has left the equilibrium path"
)


def check_energy(
    history: History, first: int, *, refused: float = REFUSED, round_off: float = 0.0
) -> None:
    """Warn of, or refuse, a step whose energies do not balance; collective.

    Args:
        history: All rows so far; they are kept.
        first: Number of the first row of the step.
        refused: Part of the largest energy beyond which the step is refused; infinite where the
            user has asked for increments without a bound on their balance.
        round_off: Round-off of the work of the bodies' forces, force times length.

    Raises:
        EnergyError: More than ``refused`` of the largest energy is missing, or an energy is no
            finite number.
    """
    comm = history.comm
    part, made, time = comm.bcast(
        _errors(history.rows, first, round_off) if comm.rank == 0 else None
    )
    if part == np.inf:
        raise EnergyError(
            f"an energy of the step is no finite number at time {time:g}: loads or displacements "
            "are too large for floating-point numbers; check their units and amplitudes. The rows "
            "are kept: scene.history",
            part,
        )
    if part > refused:
        raise EnergyError(
            f"the energy balance of the step is off by {part:.2g} of the largest energy at time "
            f"{time:g}, more than {refused:.0%}, so the results are wrong from there on or before: "
            f"{_ADVICE}. They are kept: scene.history",
            part,
        )
    if part > WARNED:
        log.warn(
            "the energy balance of the step is off by %.2g of the largest energy at time %g: %s",
            part, time, _ADVICE,
        )  # fmt: skip
    held = max((float(r.get(ENERGY, 0.0)) for r in history.rows[first:]), default=0.0)
    whole = max((float(r["strain_energy"]) for r in history.rows[first:]), default=0.0)
    if held > _STABILISED * whole:
        log.warn(
            "the stabilising stiffness stores up to %.2g, and the bodies up to %.2g: it carries "
            "part of the loads; lower stabilise, or hold the bodies by supports",
            held, whole,
        )  # fmt: skip
    if made > REFUSED:
        log.warn(
            "the time integration has made energy, %.2g of the largest one, by the end of the "
            "step: take smaller increments (dt=), or rho_inf=1, which makes none",
            made,
        )


def _errors(rows: Sequence[Row], first: int, round_off: float) -> tuple[float, float, float]:
    """Errors of some rows in parts of the largest energy, or of round-off if that is larger.

    Returns:
        The largest imbalance, infinite if one is not a number; the energy that time integration
        has made in the end; the time of the imbalance.
    """
    size = max((max(_energy(r), _ROUND_OFF * _products(r)) for r in rows), default=0.0)
    size = max(size, round_off)
    if not size > 0.0 or first >= len(rows):
        return 0.0, 0.0, 0.0
    # what round-off alone may make is no error, however small the energies are
    off = np.array([max(abs(float(r["balance"])) - round_off, 0.0) for r in rows[first:]])
    parts = off / size
    parts[np.isnan(parts)] = np.inf
    i = int(np.argmax(parts))
    made = -float(rows[-1].get("numerical_dissipation", 0.0)) / size
    return float(parts[i]), made, float(rows[first + i]["time"])


def _energy(row: Row) -> float:
    """Largest of the energies given to the bodies and stored in them."""
    stored = sum(float(row.get(name, 0.0)) for name in _STORED)
    return max(abs(stored), *(abs(float(row.get(name, 0.0))) for name in _GIVEN))


def _products(row: Row) -> float:
    """Sum of loads times their conjugates."""
    out = 0.0
    for name, value in row.items():
        other = {"u": "R", "F": "v"}.get(name[:1])
        if other is not None and name[1:2] == "[" and other + name[1:] in row:
            out += abs(float(value) * float(row[other + name[1:]]))
    return out


__all__ = ["REFUSED", "WARNED", "check_energy"]
