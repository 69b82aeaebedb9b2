"""Fields around the tip of a crack, in one anisotropic material or between two of them.

Stroh's formalism (Stroh 1958; Ting 1996): in the axes (growth direction, normal, front) every
field that does not change along the front is

    u = 2 Re sum_j a_j f_j(z_j),    (sigma_12, sigma_22, sigma_32) = 2 Re sum_j l_j f_j'(z_j)

with z_j = x_1 + p_j x_2 and (p_j, a_j, l_j) from the stiffness alone. Around the tip of a crack
between material 1 (above) and 2 (below), with Y = i A L^-1 and H = Y_1 + conj(Y_2) (Suo 1990),

    h(z) = (e^{pi eps} K w z^{i eps} + e^{-pi eps} conj(K w) z^{-i eps})
           /(2 sqrt(2 pi z) cosh pi eps) + K_3 w_3/(2 sqrt(2 pi z)),
    f'(z) = L_1^-1 h(z) above,    L_2^-1 conj(H)^-1 H h(z) below,
    conj(H) w = e^{2 pi eps} H w,    H real on w_3.

The traction ahead of the tip is K r^{i eps} w + conj + K_3 w_3 over sqrt(2 pi r). Where eps is not
zero it turns with the distance: modes belong to a reference length (Rice 1988; Suo and Hutchinson
1990). Here the intensity factors are the components (growth direction, normal, front) of

    k = traction at the reference length l, times sqrt(2 pi l)

so that in one material, and wherever eps = 0, they are K_II, K_I and K_III.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg

from fxcrack.base.arrays import Array
from fxcrack.continuum.materials import strain_rotation

_NO_OSCILLATION = 1e-5
"""Oscillation indices below this are zero: what they would turn in any ratio of lengths is less
than the perturbation below."""
_REPEATED = 1e-6
"""Relative change of a stiffness that separates its repeated roots p_j, as isotropy has them; the
fields change by as much."""
_SEPARATE = 1e-4
"""Roots that are nearer to each other are repeated."""

VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


class HalfSpace:
    """Stroh's eigenvalues and eigenvectors of one material.

    Args:
        stiffness: In axes (growth direction, normal, front), shape (6, 6) [force/length^2].

    Attributes:
        p: Roots with positive imaginary part, shape (3,).
        a: Columns a_j, shape (3, 3).
        l: Columns l_j, shape (3, 3).
        y: Y = i A L^-1, Hermitian and positive definite, shape (3, 3) [length^2/force].
    """

    def __init__(self, stiffness: Array) -> None:
        p, vectors = _roots(stiffness)
        gaps = np.abs(p[:, None] - p[None]) + np.eye(3)
        # the root of sliding along the front has an eigenvector of its own in any case
        if gaps.min() < _SEPARATE:
            changed = stiffness.copy()
            changed[0, 0] *= 1.0 + _REPEATED
            changed[4, 4] *= 1.0 - 3.0 * _REPEATED
            p, vectors = _roots(changed)
        self.p = p
        self.a, self.l = vectors[:3], vectors[3:]
        self.y = 1j * self.a @ np.linalg.inv(self.l)


def _roots(stiffness: Array) -> tuple[Array, Array]:
    """The three roots with positive imaginary part, and columns (a_j, l_j), shape (6, 3)."""
    c = np.empty((3, 3, 3, 3))
    index = {pair: k for k, pair in enumerate(VOIGT)}
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    row = index[min(i, j), max(i, j)]
                    c[i, j, k, m] = stiffness[row, index[min(k, m), max(k, m)]]
    size = float(np.abs(stiffness).max())
    q, r, t = (x / size for x in (c[:, 0, :, 0], c[:, 0, :, 1], c[:, 1, :, 1]))
    inverse = np.linalg.inv(t)
    n1 = -inverse @ r.T
    matrix = np.block([[n1, inverse], [r @ inverse @ r.T - q, n1.T]])
    values, vectors = np.linalg.eig(matrix)
    above = np.argsort(-values.imag)[:3]
    chosen = vectors[:, above]
    chosen = np.vstack([chosen[:3] / size, chosen[3:]])
    return np.asarray(values[above]), np.asarray(chosen)


class TipFields:
    """Crack-tip fields of a pair of materials.

    Args:
        above: Stiffness of the material on the side the normal points to, in global axes, shape
            (6, 6) [force/length^2].
        below: Stiffness of the other, likewise.
        frame: Columns normal, growth direction, front tangent, shape (3, 3).
        length: Reference length of the modes [length].

    Attributes:
        axes: Rows growth direction, normal, their vector product, shape (3, 3).
        oscillation: Oscillation index eps.
        energy: M of G = k . M k, shape (3, 3) [length^2/force].
        span: What makes real and imaginary part of K, and K_3, of k, shape (3, 3).
    """

    def __init__(self, above: Array, below: Array, frame: Array, length: float) -> None:
        normal, growth = frame[:, 0], frame[:, 1]
        self.axes = np.array([growth, normal, np.cross(growth, normal)])
        self.length = length
        back = np.linalg.inv(strain_rotation(self.axes))
        self._spin: Any = None
        self._third = np.zeros(3)
        self._sides = [HalfSpace(back.T @ c @ back) for c in (above, below)]
        h = self._sides[0].y + self._sides[1].y.conj()
        self._across: Any = np.linalg.solve(h.conj(), h)
        self._set_modes(0.5 * (h + h.conj().T))

    def _set_modes(self, h: Any) -> None:
        """The oscillation index, what spans the modes, and the energy of each."""
        values, vectors = scipy.linalg.eigh(h.conj(), h)
        eps = float(np.log(values[2] / values[0]) / (4.0 * np.pi))
        self.oscillation = 0.0
        if eps < _NO_OSCILLATION:
            self.span = np.eye(3)
            self._across = np.eye(3)
            self.energy = 0.25 * h.real
            return
        w, third = vectors[:, 2], vectors[:, 1]
        w = 0.5 * w / w[1]
        if w[0].imag > 0.0:
            w, eps = w.conj(), -eps
        third = (third / third[np.argmax(np.abs(third))]).real
        self.oscillation = eps
        self._spin = w
        self.span = np.linalg.inv(np.stack([2.0 * w.real, -2.0 * w.imag, third], axis=1))
        twice = 2.0 * h.real
        pair = float((w.conj() @ twice @ w).real) / (4.0 * np.cosh(np.pi * eps) ** 2)
        alone = float(third @ twice @ third) / 8.0
        self.energy = self.span.T @ np.diag([pair, pair, alone]) @ self.span
        self._third = third

    def gradients(self, x: Array, side: int) -> Array:
        """Displacement gradients of unit intensity factors.

        Args:
            x: Positions from the tip, global components, shape (n, 3) [length]; not the tip itself.
            side: 0 above the interface, 1 below.

        Returns:
            d u_i/d x_j in global axes for k along the growth direction, the normal and the front,
            shape (3, n, 3, 3) [1/length per force/length^1.5].
        """
        half, log_z = self._sides[side], self._logarithms(x, side)
        out = np.empty((3, len(x), 3, 3))
        for mode in range(3):
            slope = sum(part for part, _ in self._functions(side, mode, log_z))
            along = 2.0 * (slope @ half.a.T).real
            across = 2.0 * ((slope * half.p) @ half.a.T).real
            gradient = np.stack([along, across, np.zeros_like(along)], axis=2)
            out[mode] = np.einsum("ai,nab,bj->nij", self.axes, gradient, self.axes)
        return out

    def displacements(self, x: Array, side: int) -> Array:
        """Displacements of unit intensity factors, zero at the tip; arguments as above.

        Returns:
            Global components, shape (3, n, 3) [length per force/length^1.5].
        """
        half, log_z = self._sides[side], self._logarithms(x, side)
        out = np.empty((3, len(x), 3))
        for mode in range(3):
            parts = self._functions(side, mode, log_z)
            value = sum(part * np.exp(log_z) / (1.0 + power) for part, power in parts)
            out[mode] = 2.0 * (value @ half.a.T).real @ self.axes
        return out

    def _logarithms(self, x: Array, side: int) -> Any:
        """Logarithms of z_j on the branch of a side, shape (n, 3)."""
        local = x @ self.axes.T
        z = local[:, :1] + self._sides[side].p * local[:, 1:2]
        angle = np.angle(z)
        # one branch on each side, also for points a little beyond the plane of the crack
        if side == 0:
            angle = np.where(angle < -0.5 * np.pi, angle + 2.0 * np.pi, angle)
        else:
            angle = np.where(angle > 0.5 * np.pi, angle - 2.0 * np.pi, angle)
        return np.asarray(np.log(np.abs(z)) + 1j * angle)

    def _functions(self, side: int, mode: int, log_z: Any) -> list[tuple[Any, complex]]:
        """f_j'(z_j) of a unit intensity factor, as terms that go with a power of z_j each.

        Args:
            side: As above.
            mode: Which factor.
            log_z: Logarithms of z_j, shape (n, 3).

        Returns:
            Terms of shape (n, 3), and their powers.
        """
        root = np.exp(-0.5 * log_z) / (2.0 * np.sqrt(2.0 * np.pi))
        inverse = np.linalg.inv(self._sides[side].l)
        if side == 1:
            inverse = inverse @ self._across
        unit = np.eye(3)[mode]
        if self._spin is None:
            return [(root * (inverse @ unit), -0.5)]
        a, b, c = self.span @ unit
        eps, k = self.oscillation, a + 1j * b
        turn = np.exp(1j * eps * (log_z - np.log(self.length)))
        scale = root / np.cosh(np.pi * eps)
        first = np.exp(np.pi * eps) * k * turn * scale * (inverse @ self._spin)
        second = np.exp(-np.pi * eps) * np.conj(k) / turn * scale * (inverse @ self._spin.conj())
        return [
            (first, -0.5 + 1j * eps),
            (second, -0.5 - 1j * eps),
            (root * c * (inverse @ self._third), -0.5),
        ]
