"""Cells whose strains are quadratic in vectors of their nodes, integrated and condensed in numpy.

Let r be the vectors of a cell's nodes, shape (n_vectors, 3): positions in a continuum shell, and
positions and directors in a shell. Every covariant strain at an integration point is

    E_k = 1/2 r . M_k r - 1/2 R . M_k R,      R: the vectors of the undeformed body

with matrices M_k, shape (n_vectors, n_vectors), made of shape functions only: they are the same in
all cells. A strain that is sampled at other points and interpolated (tied strains: MITC, ANS) is
such a strain too, its M the same combination of those of the samples; so tying needs no unknowns.

    e = L E + N a,       W = sum over points of (1/2 e . C e - s . e)

with local strains e, enhanced strains a of the cell alone (EAS), stiffness C and given stress s,
the weight of the point in both. W is quadratic in a, whose minimum is found cell by cell:

    a = -(N^t C N)^-1 N^t (C L E - s)

What is left is the energy on the nodes alone, its residual and its tangent, symmetric and, in the
undeformed body, positive semi-definite:

    r_i = (M_k r)_i sigma_k,    K = B^t (C - C N (N^t C N)^-1 N^t C) B + sigma_k M_k,    B = L M r

Sources: Dvorkin and Bathe 1984; Simo and Rifai 1990; Betsch and Stein 1995.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array

_CHUNK = 200
"""Cells handled together: their B fit the cache and little memory."""


@dataclass(frozen=True)
class Response:
    """Energy of cells and its derivatives.

    Attributes:
        energy: Stored energy, shape (n_cells,), force x length.
        residual: Its derivative, shape (n_cells, 3 n_vectors).
        tangent: Its second derivative, shape (n_cells, 3 n_vectors, 3 n_vectors).
    """

    energy: Array
    residual: Array
    tangent: Array


@dataclass(frozen=True)
class StrainCells:
    """Cells of one kind: one reference element, one integration rule.

    Attributes:
        vectors: R of each cell, shape (n_cells, n_vectors, 3).
        matrices: M of each point and covariant strain, shape (n_points, n_covariant, n_vectors,
            n_vectors), symmetric.
        local: L, shape (n_cells, n_points, n_strains, n_covariant); ``None`` where the strains e
            are the covariant ones themselves.
        enhanced: N, shape (n_cells, n_points, n_strains, n_enhanced).
        moduli: C with the weights, shape (n_cells, n_points, n_strains, n_strains).
    """

    vectors: Array
    matrices: Array
    local: Array | None
    enhanced: Array
    moduli: Array

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.vectors)

    def _chunks(self) -> list[slice]:
        return [slice(k, k + _CHUNK) for k in range(0, self.n_cells, _CHUNK)]

    def _products(self, r: Array) -> Array:
        """M r, shape (n_cells, n_points, n_covariant, 3 n_vectors)."""
        p, k, m, _ = self.matrices.shape
        out = self.matrices.reshape(p * k * m, m) @ r
        return np.asarray(out.reshape(len(r), p, k, 3 * m))

    def _flat(self, at: slice, b: Array) -> tuple[Array, Array, Array]:
        """B, C B and N of some cells, rows of all points together."""
        n = len(b)
        if self.local is not None:
            b = self.local[at] @ b
        cb = self.moduli[at] @ b
        enhanced = self.enhanced[at]
        return (
            b.reshape(n, -1, b.shape[-1]),
            cb.reshape(n, -1, b.shape[-1]),
            enhanced.reshape(n, b.shape[1] * b.shape[2], enhanced.shape[-1]),
        )

    def _condensed(self, at: slice, b: Array) -> Array:
        """Material tangent with the enhanced strains eliminated, of B in covariant strains."""
        rows, stress, enhanced = self._flat(at, b)
        tangent = rows.transpose(0, 2, 1) @ stress
        if enhanced.shape[-1]:
            coupling = enhanced.transpose(0, 2, 1) @ stress
            inner = self._inner(at)
            tangent -= coupling.transpose(0, 2, 1) @ np.linalg.solve(inner, coupling)
        return np.asarray(tangent)

    def _inner(self, at: slice) -> Array:
        """N^t C N, shape (n, n_enhanced, n_enhanced)."""
        enhanced = self.enhanced[at]
        return np.asarray(
            np.einsum("cpsa,cpst,cptb->cab", enhanced, self.moduli[at], enhanced, optimize=True)
        )

    def stiffness(self) -> Array:
        """Tangent in the undeformed body, shape (n_cells, 3 n_vectors, 3 n_vectors)."""
        size = 3 * self.vectors.shape[1]
        out = np.empty((self.n_cells, size, size))
        for at in self._chunks():
            out[at] = self._condensed(at, self._products(self.vectors[at]))
        return out

    def covariant(self, q: Array, *, finite: bool) -> Array:
        """Covariant strains.

        Args:
            q: Changes of the vectors, shape (n_cells, n_vectors, 3).
            finite: Quadratic, for any rotation; otherwise linear in q.

        Returns:
            Shape (n_cells, n_points, n_covariant).
        """
        out = np.empty((self.n_cells, *self.matrices.shape[:2]))
        for at in self._chunks():
            middle = self.vectors[at] + (0.5 * q[at] if finite else 0.0)
            flat = q[at].reshape(len(middle), -1)
            out[at] = np.einsum("cpkj,cj->cpk", self._products(middle), flat)
        return out

    def strains(self, q: Array, stress: Array | None = None, *, finite: bool) -> Array:
        """Local strains, enhanced ones included.

        Args:
            q: Changes of the vectors, shape (n_cells, n_vectors, 3).
            stress: Given stress s with the weights, shape (n_cells, n_points, n_strains).
            finite: As in :meth:`covariant`.

        Returns:
            Shape (n_cells, n_points, n_strains).
        """
        e = self._to_local(slice(None), self.covariant(q, finite=finite))
        return self._with_enhanced(slice(None), e, None if stress is None else stress)

    def _to_local(self, at: slice, covariant: Array) -> Array:
        if self.local is None:
            return covariant
        return np.asarray(np.einsum("cpsk,cpk->cps", self.local[at], covariant))

    def _with_enhanced(self, at: slice, e: Array, stress: Array | None) -> Array:
        enhanced = self.enhanced[at]
        if not enhanced.shape[-1]:
            return e
        force = np.einsum("cpst,cpt->cps", self.moduli[at], e)
        if stress is not None:
            force = force - stress
        right = np.einsum("cpsa,cps->ca", enhanced, force)
        a = -np.linalg.solve(self._inner(at), right[..., None])[..., 0]
        return np.asarray(e + np.einsum("cpsa,ca->cps", enhanced, a))

    def respond(
        self, q: Array, stress: Array | None = None, *, finite: bool, tangent: bool = True
    ) -> Response:
        """Energy, residual and tangent.

        Args:
            q: Changes of the vectors, shape (n_cells, n_vectors, 3).
            stress: Given stress s with the weights, shape (n_cells, n_points, n_strains).
            finite: As in :meth:`covariant`.
            tangent: Whether the tangent is wanted; it is empty otherwise.
        """
        size = 3 * self.vectors.shape[1]
        energy, residual = np.empty(self.n_cells), np.empty((self.n_cells, size))
        second = np.empty((self.n_cells if tangent else 0, size, size))
        for at in self._chunks():
            r0, change = self.vectors[at], q[at]
            n = len(r0)
            middle = self._products(r0 + (0.5 * change if finite else 0.0))
            covariant = np.einsum("cpkj,cj->cpk", middle, change.reshape(n, -1))
            e = self._to_local(at, covariant)
            given = None if stress is None else stress[at]
            e = self._with_enhanced(at, e, given)
            force = np.einsum("cpst,cpt->cps", self.moduli[at], e)
            energy[at] = 0.5 * np.einsum("cps,cps->c", e, force)
            if given is not None:
                energy[at] -= np.einsum("cps,cps->c", e, given)
                force = force - given
            b = self._products(r0 + change) if finite else middle
            back = force
            if self.local is not None:
                back = np.einsum("cpsk,cps->cpk", self.local[at], force)
            residual[at] = np.einsum("cpkj,cpk->cj", b, back)
            if tangent:
                second[at] = self._condensed(at, b)
                if finite:
                    second[at] += self._geometric(back)
        return Response(energy, residual, second)

    # -- parts of the strains, for what linear cells leave out ----------------------------

    def linear_part(self, at: slice, q: Array) -> Array:
        """Covariant strains linear in the changes q of some cells, (n, n_points, n_covariant)."""
        return self._pairing(self.vectors[at], q)

    def quadratic_part(self, q: Array) -> Array:
        """Covariant strains quadratic in the changes q of some cells, likewise."""
        return 0.5 * self._pairing(q, q)

    def _pairing(self, r: Array, q: Array) -> Array:
        """Products r . M q, shape (n, n_points, n_covariant)."""
        return np.asarray(np.einsum("cpkj,cj->cpk", self._products(r), q.reshape(len(q), -1)))

    def stress(self, at: slice, covariant: Array, given: Array | None) -> Array:
        """Stresses with the weights, conjugate to covariant strains, enhanced strains eliminated.

        Args:
            at: The cells.
            covariant: Their covariant strains, shape (n, n_points, n_covariant).
            given: Given stress s with the weights, shape (n, n_points, n_strains).

        Returns:
            Shape (n, n_points, n_covariant).
        """
        e = self._with_enhanced(at, self._to_local(at, covariant), given)
        force = np.einsum("cpst,cpt->cps", self.moduli[at], e)
        if given is not None:
            force = force - given
        if self.local is None:
            return np.asarray(force)
        return np.asarray(np.einsum("cpsk,cps->cpk", self.local[at], force))

    def forces(self, r: Array, stress: Array) -> Array:
        """sigma_k M_k r of some cells, shape (n, 3 n_vectors).

        Args:
            r: Vectors: those of the undeformed cells for the forces of a stress, changes of them
                for those of its geometric stiffness; shape (n, n_vectors, 3).
            stress: From :meth:`stress`.
        """
        return np.asarray(np.einsum("cpkj,cpk->cj", self._products(r), stress))

    def _geometric(self, stress: Array) -> Array:
        """sigma_k M_k on the components of all vectors, of covariant stresses with the weights."""
        p, k, m, _ = self.matrices.shape
        n = len(stress)
        g = (stress.reshape(n, p * k) @ self.matrices.reshape(p * k, m * m)).reshape(n, m, m)
        return np.asarray(np.einsum("cij,xy->cixjy", g, np.eye(3)).reshape(n, 3 * m, 3 * m))


__all__ = ["Response", "StrainCells"]
