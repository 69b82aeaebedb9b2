"""Energy and forces of first-order continuum shells without their tangent, for explicit dynamics.

Each sampled strain is the product of two of 24 tangent vectors g = sum N,i r of a cell:

    E = (g_a . g_b - G_a . G_b)/2,    s = D E,    r_i = sum of N,i of g_a times s g_b/2, and of g_b

Cells lie along the last axis, so that every operation runs over all of them.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.continuum.shell_hexahedron import Samples


class TiedForces:
    """Cells of one continuum shell.

    Args:
        vectors: Positions of the nodes, shape (n_cells, 8, 3).
        samples: Sampled strains of the element.
        moduli: D, shape (n_cells, n_samples, n_samples).
    """

    def __init__(self, vectors: Array, samples: Samples, moduli: Array) -> None:
        self._slopes = np.stack(samples.tangents)
        self._first = np.array([a for a, _ in samples.pairs])
        self._second = np.array([b for _, b in samples.pairs])
        both = np.concatenate([self._slopes[self._first], self._slopes[self._second]])
        self._back = 0.5 * both.T
        self._moduli = moduli
        self._undeformed = self._tangents(vectors)

    def _tangents(self, r: Array) -> Array:
        """Tangent vectors, shape (n_tangents, 3, n_cells)."""
        flat = r.transpose(1, 2, 0).reshape(r.shape[1], -1)
        return np.asarray((self._slopes @ flat).reshape(len(self._slopes), 3, len(r)))

    def __call__(self, q: Array, *, finite: bool) -> tuple[Array, Array]:
        """Energy and forces.

        Args:
            q: Displacements of the nodes, shape (n_cells, 8, 3).
            finite: Strains for any rotation; otherwise linear in q.

        Returns:
            Energies, shape (n_cells,), force x length, and forces of each cell, shape (n_cells,
            24), force.
        """
        n = len(q)
        change = self._tangents(q)
        before = self._undeformed
        middle = before + 0.5 * change if finite else before
        after = before + change if finite else before
        a, b = self._first, self._second
        strain = 0.5 * (middle[a] * change[b] + middle[b] * change[a]).sum(axis=1)
        stress = np.matmul(self._moduli, strain.T[..., None])[..., 0].T
        energy = 0.5 * (strain * stress).sum(axis=0)
        back = np.concatenate([stress[:, None] * after[b], stress[:, None] * after[a]])
        forces = self._back @ back.reshape(len(back), -1)
        return energy, np.ascontiguousarray(forces.reshape(24, n).T)


__all__ = ["TiedForces"]
