"""Local frames of slave nodes: the normal first, then the tangents."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array


def local_frames(normals: Array, gdim: int) -> Array:
    """Orthonormal frames whose first column is the normal.

    Args:
        normals: Unit normals, shape (n, 3).
        gdim: 2 or 3.

    Returns:
        Shape (n, gdim, gdim); in 3-D the first tangent is the global axis most nearly in the
        tangent plane, projected.
    """
    if gdim == 2:
        n = normals[:, :2]
        return np.stack([n, np.stack([-n[:, 1], n[:, 0]], axis=1)], axis=2)
    axis = np.argmin(np.abs(normals) - 1e-6 * np.array([2.0, 1.0, 0.0]), axis=1)
    reference = np.eye(3)[axis]
    t1 = reference - np.einsum("ni,ni->n", reference, normals)[:, None] * normals
    t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
    return np.stack([normals, t1, np.cross(normals, t1)], axis=2)
