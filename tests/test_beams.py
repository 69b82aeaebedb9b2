"""Corrected beam theory against the numbers of published specimens."""

from __future__ import annotations

import numpy as np
import pytest

from fxcrack.beam_theory import CorrectedBeam

T300 = CorrectedBeam(E=139.4e3, E22=10.16e3, G=4.6e3, h=1.5, b=25.0)
IM7 = CorrectedBeam(E=161.0e3, E22=11.38e3, G=5.2e3, h=2.25, b=25.4)


@pytest.mark.smoke
def test_double_cantilever() -> None:
    """NASA/TM-2008-215123: all digits given."""
    a = np.array([30.0, 31.0, 32.0, 33.0, 34.0, 35.0, 40.0])
    load = T300.dcb_load(a, 0.1703)
    half = 0.5 * T300.dcb_opening(a, load)
    assert load == pytest.approx([62.09, 60.26, 58.53, 56.90, 55.36, 53.90, 47.62], abs=5e-3)
    assert half == pytest.approx([0.7520, 0.7984, 0.8462, 0.8954, 0.9460, 0.9980, 1.2786], abs=5e-5)
    assert T300.dcb_load_at_opening(2.0 * half, 0.1703) == pytest.approx(load, rel=1e-12)


@pytest.mark.smoke
def test_end_notched_flexure() -> None:
    a = np.array([25.4, 30.0, 35.0, 40.0, 45.0])
    load = IM7.enf_load(a, 0.774)
    assert load == pytest.approx([1480.9, 1267.0, 1095.1, 964.2, 861.3], abs=0.05)
    assert IM7.enf_rate(a, load) == pytest.approx(np.full(5, 0.774), rel=1e-12)


@pytest.mark.smoke
def test_mixed_mode_bending() -> None:
    """Ratios do not depend on the load; c = L/3 bends without opening; large c only opens."""
    c, half_span, a, p = 42.0, 50.0, 25.0, 100.0
    one, two = T300.mmb_rates(a, p, c, half_span)
    ae, ae2 = a + T300.chi * 1.5, a + 0.42 * T300.chi * 1.5
    ratio = 4.0 / 3.0 * ((3 * c - half_span) / (c + half_span) * ae / ae2) ** 2
    assert one / two == pytest.approx(ratio, rel=1e-12)
    assert T300.mmb_rates(a, p, half_span / 3.0, half_span)[0] == 0.0
    # as a DCB under P (3c - L)/(4L), and as an ENF under P (c + L)/L
    opening = p * (3 * c - half_span) / (4.0 * half_span)
    assert one == pytest.approx(12.0 * opening**2 * ae**2 / (25.0**2 * 1.5**3 * T300.E), rel=1e-12)
    assert two == pytest.approx(T300.enf_rate(a, p * (c + half_span) / half_span), rel=1e-12)
