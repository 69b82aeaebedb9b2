"""Energy release rates along a front of tetrahedra, free of what their arrangement adds.

The extension of one front node shears the cells beside it along the front, so that its integral is

    G_i A_i = int G phi_i ds + F_i+ - F_i-,        F = int s_st u_s,n dA

with the tangent t of the front, the direction of growth n and the flux F through the section of the
front between two nodes. Crack-tip fields have none, but in irregular cells around the front F is of
the order of h G whatever their size: single nodes are off by 5 to 20 %, while their sum is right.
Hence rates g are sought that the values G_i differ from by a small flux, and that are smooth:

    sum_k (F_k/l_k)^2 + mu^2 sum_i (D g)_i^2 -> min,      A_i (G_i - g_i) = F_i+ - F_i-

l_k are the lengths of the segments, D g second differences times the square of the segments; at the
ends of a front, on planes of symmetry or free faces, the front is thought to be reflected. The sum
stays as it is (penalised regression: Eilers and Marx 1996). Since g is linear in G, it is the rate
of one wider extension.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints

MU = 2.0
"""Weight of the second differences. Rates that go up and down over 8 segments lose half of their
amplitude, over 14 segments 3 %, over 20 segments 0.4 %: 1/(1 + mu^2 (2 pi/n)^6)."""

_NEGLIGIBLE = 1e-3
"""Weights below this part of the largest one of a node are left out."""


def smoothing(x: Array, segments: Ints, areas: Array) -> Array:
    """Weights of the rates G_j in the smooth rate g_i, shape (n_tips, n_tips); rows sum to 1.

    Args:
        x: Positions of the tips, shape (n_tips, 3) [length].
        segments: Tips at both ends of each segment in their order along the front, twice the same
            for a point, shape (n_segments, 2).
        areas: Area that the extension of each tip opens, shape (n_tips,) [length^2].
    """
    n = len(x)
    real = segments[segments[:, 0] != segments[:, 1]]
    length = np.linalg.norm(x[real[:, 1]] - x[real[:, 0]], axis=1)
    flux = np.zeros((n, len(real)))
    rows = np.arange(len(real))
    np.add.at(flux, (real[:, 0], rows), 1.0)
    np.add.at(flux, (real[:, 1], rows), -1.0)
    bend = _second_differences(n, real, length)
    if not len(bend):
        return np.eye(n)
    per_flux = flux * length / areas[:, None]
    bent = bend @ per_flux
    system = np.eye(len(real)) + MU**2 * bent.T @ bent
    weights = np.eye(n) - per_flux @ np.linalg.solve(system, MU**2 * bent.T @ bend)
    weights[np.abs(weights) < _NEGLIGIBLE * np.abs(weights).max(axis=1, keepdims=True)] = 0.0
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _second_differences(n: int, segments: Ints, length: Array) -> Array:
    """Second derivatives at the tips times the lengths of both segments, shape (m, n)."""
    before = {int(b): k for k, (_, b) in enumerate(segments)}
    after = {int(a): k for k, (a, _) in enumerate(segments)}
    rows = []
    for tip in sorted(before.keys() | after.keys()):
        row = np.zeros(n)
        row[tip] = -2.0
        if tip in before and tip in after:
            a, b = length[before[tip]], length[after[tip]]
            row[segments[before[tip], 0]] += 2.0 * b / (a + b)
            row[segments[after[tip], 1]] += 2.0 * a / (a + b)
        else:  # half of the reflected front counts
            other = segments[before[tip], 0] if tip in before else segments[after[tip], 1]
            row[other] += 2.0
            row /= np.sqrt(2.0)
        rows.append(row)
    return np.array(rows).reshape(-1, n)
