"""Data reduction of the standards: toughness from measured load, opening and crack length.

Double cantilever beam (ASTM D5528, ISO 15024), C = opening/load, thickness 2h of the specimen::

    modified beam theory (MBT)                     G_I = 3 P opening/(2 b (a + D)),
                                                   C^(1/3) = 0 at a = -D of its regression line
    compliance calibration (CC)                    G_I = n P opening/(2 b a),  n: slope of log C
                                                   against log a
    modified compliance calibration (MCC)          G_I = 3 P^2 C^(2/3)/(2 A b 2h),  A: slope of
                                                   a/(2h) against C^(1/3)

End-notched flexure (ASTM D7905: compliance calibration; Russell 1982 and JIS K 7086: beam theory)::

    compliance calibration   C = A + m a^3,  G_II = 3 m P^2 a^2/(2 b)
    beam theory              G_II = 9 a^2 P deflection/(2 b (2 L^3 + 3 a^3))

Mixed-mode bending (ASTM D6671): see :func:`mmb`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import finite, not_negative, positive
from fxcrack.base.errors import InputError
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.identify.record import Record


@dataclass(frozen=True)
class Reduced:
    """Energy release rates at the measured points, and what was fitted on the way.

    Attributes:
        method: Name of the method.
        G: Energy release rate at each point, shape (n,) [force/length].
        constants: Fitted constants by name.
    """

    method: str
    G: Array
    constants: dict[str, float]

    @property
    def mean(self) -> float:
        """Mean of G [force/length]."""
        return float(self.G.mean())

    def __str__(self) -> str:
        """Method, mean, scatter and constants on one line."""
        spread = float(self.G.std(ddof=1)) if len(self.G) > 1 else 0.0
        known = ", ".join(f"{name} = {value:.5g}" for name, value in self.constants.items())
        return f"{self.method}: G = {self.mean:.5g}, standard deviation {spread:.2g} ({known})"


def dcb(record: Record, *, width: float, thickness: float) -> dict[str, Reduced]:
    """G_I of a double cantilever beam by the three methods of ASTM D5528.

    Args:
        record: Opening of both arms together, load, and the crack length from the line of load.
        width: Width b of the specimen [length].
        thickness: Thickness 2h of the whole specimen [length].

    Returns:
        By the names "MBT", "CC" and "MCC".

    Raises:
        InputError: Crack lengths are missing or all alike, the compliance does not grow with them,
            or a number is not positive.
    """
    positive("identify.reduction.dcb", width=width, thickness=thickness)
    a, c = record.lengths(), record.compliance
    opening, load = record.points
    root = np.cbrt(c)
    slope, start = _line(record, a, root, "C^(1/3)")
    # ISO 15024: no correction where the line meets the axis at a > 0 and would shorten the crack
    delta = max(start / slope, 0.0)
    n, _ = _line(record, np.log(a), np.log(c), "log C")
    calibration, _ = _line(record, root, a / thickness, "a/(2h)")
    return {
        "MBT": Reduced("MBT", 1.5 * load * opening / (width * (a + delta)), {"delta": delta}),
        "CC": Reduced("CC", 0.5 * n * load * opening / (width * a), {"n": n}),
        "MCC": Reduced(
            "MCC",
            1.5 * load**2 * root**2 / (calibration * width * thickness),
            {"A": calibration},
        ),
    }


def large_displacement_factor(record: Record) -> Array:
    """Factor F on G of a double cantilever beam whose arms bend far (ASTM D5528, annex).

    F = 1 - (3/10) (opening/a)^2, for loads through piano hinges whose eccentricity is negligible.

    Returns:
        Shape (n,), without unit.
    """
    return np.asarray(1.0 - 0.3 * (record.points[0] / record.lengths()) ** 2)


def enf(
    record: Record, *, width: float, half_span: float, growth: Record | None = None
) -> dict[str, Reduced]:
    """G_II of an end-notched flexure test by compliance calibration and by beam theory.

    Args:
        record: Deflection, load and crack length of points on elastic loading, at three crack
            lengths at least: they calibrate the compliance.
        width: Width b of the specimen [length].
        half_span: Distance L from a support to the load [length].
        growth: The points at which the crack grew; those of ``record`` by default.

    Returns:
        By the names "CC" and "beam".

    Raises:
        InputError: Crack lengths are missing or all alike, the compliance does not grow with them,
            or a number is not positive.
    """
    positive("identify.reduction.enf", width=width, half_span=half_span)
    at = record if growth is None else growth
    m, start = _line(record, record.lengths() ** 3, record.compliance, "C")
    a, (deflection, load) = at.lengths(), at.points
    simple = 9.0 * a**2 * load * deflection / (2.0 * width * (2.0 * half_span**3 + 3.0 * a**3))
    return {
        "CC": Reduced("CC", 1.5 * m * load**2 * a**2 / width, {"m": m, "A": start}),
        "beam": Reduced("beam", simple, {}),
    }


def mmb(
    beam: CorrectedBeam,
    *,
    a: npt.ArrayLike,
    load: npt.ArrayLike,
    lever: float,
    half_span: float,
    compliance: float | None = None,
    fixture_compliance: float = 0.0,
) -> tuple[Array, Array]:
    """G_I and G_II of a mixed-mode bending test (ASTM D6671).

        E_1f = (8 (a + chi h)^3 (3c - L)^2 + (6 (a + 0.42 chi h)^3 + 4 L^3) (c + L)^2)
               /(16 L^2 b h^3 (C - C_fixture))

    stands for the modulus along the beam where the compliance was measured; G_I and G_II are
    those of :meth:`fxcrack.beam_theory.CorrectedBeam.mmb_rates`.

    Args:
        beam: The specimen; its ``E``, ``E22`` and ``G`` give chi.
        a: Crack lengths at growth, shape (n,) or a number [length].
        load: Loads of the lever at growth, of the same shape [force].
        lever: Length c of the lever [length].
        half_span: Half span L [length].
        compliance: Measured compliance at the first crack length, displacement of the loading
            point over load [length/force]; ``None`` takes the modulus of ``beam``.
        fixture_compliance: Part of it that belongs to the fixture [length/force].

    Raises:
        InputError: A number is not positive, or the fixture is more compliant than the test.
    """
    owner = "identify.reduction.mmb"
    positive(owner, lever=lever, half_span=half_span)
    not_negative(owner, fixture_compliance=fixture_compliance)
    length, force = np.asarray(a, dtype=float), np.asarray(load, dtype=float)
    finite(owner, a=float(length.sum()), load=float(force.sum()))
    one, two = beam.mmb_rates(length, force, lever, half_span)
    modulus = beam.E
    if compliance is not None:
        positive(owner, compliance=compliance)
        if not fixture_compliance < compliance:
            raise InputError(
                f"{owner}: fixture_compliance = {fixture_compliance:g} must be below the measured "
                f"compliance, {compliance:g}"
            )
        first = float(length.flat[0])
        bent, sheared = first + beam.chi * beam.h, first + 0.42 * beam.chi * beam.h
        top = 8.0 * bent**3 * (3.0 * lever - half_span) ** 2
        top += (6.0 * sheared**3 + 4.0 * half_span**3) * (lever + half_span) ** 2
        stiffness = compliance - fixture_compliance
        modulus = top / (16.0 * half_span**2 * beam.b * beam.h**3 * stiffness)
    scale = beam.E / modulus
    return np.asarray(one) * scale, np.asarray(two) * scale


def _line(record: Record, x: Array, y: Array, what: str) -> tuple[float, float]:
    """Slope and start of the regression line y = slope x + start; the slope must be positive."""
    if np.ptp(x) <= 1e-9 * np.abs(x).max(initial=0.0):
        raise InputError(
            f"Record '{record.name}': all crack lengths are alike, and the compliance is "
            "calibrated from its growth with them; give points at several"
        )
    slope, start = np.polyfit(x, y, 1)
    if slope <= 0.0:
        raise InputError(
            f"Record '{record.name}': {what} falls where the crack is longer; look for exchanged "
            "columns or points out of order"
        )
    return float(slope), float(start)
