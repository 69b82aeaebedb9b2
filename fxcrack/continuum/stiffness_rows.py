"""Products with some rows of a symmetric stiffness, for bodies whose forces are linear.

Products are bound by what they read. A stiffness is symmetric: among the nodes all of whose dofs
are wanted, the blocks on the diagonal and right of it say everything, and each of them is read once
for both nodes. All other entries, those of nodes on other ranks among them, are stored as they are.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.sparse import Product
from fxcrack.continuum.block_product import SIZES, BlockProduct, shared_kernels


class StiffnessRows:
    """Forces at some dofs by the displacements of all nodes.

    Args:
        stiffness: Of the rows of this rank, shape (n, m), node by node; its first n columns belong
            to the same dofs and are symmetric.
        wanted: Dofs whose forces are wanted, shape (n,); forces at all others are zero.
        size: Unknowns of a node.
        comm: Communicator of the rows.
    """

    def __init__(
        self, stiffness: sp.csr_matrix, wanted: Bools, size: int, comm: MPI.Intracomm
    ) -> None:
        self._n = int(stiffness.shape[0])
        self._forces = np.zeros(self._n)
        self._compiled = shared_kernels(comm)
        self._products: list[BlockProduct | Product]
        if self._compiled is None or size not in SIZES:
            rows = sp.csr_matrix(sp.diags(wanted.astype(float)) @ stiffness)
            rows.eliminate_zeros()
            self._products = [Product(rows)]
            return
        blocks = stiffness.tobsr((size, size))
        n_nodes, column = self._n // size, blocks.indices
        row = np.repeat(np.arange(n_nodes), np.diff(blocks.indptr))
        by_node = wanted.reshape(-1, size)
        whole = by_node.all(axis=1)
        on_diagonal = np.zeros(n_nodes, dtype=bool)
        on_diagonal[row[column == row]] = True
        whole &= on_diagonal
        # columns of other ranks come behind those of this one
        paired = whole[row] & np.append(whole, False)[np.minimum(column, n_nodes)]
        triangle = paired & (column >= row)
        rest = by_node.any(axis=1)[row] & ~paired
        self._products = []
        for keep, symmetric in ((triangle, True), (rest, False)):
            if not keep.any():
                continue
            data = blocks.data[keep]
            if not symmetric:
                data *= by_node[row[keep]][:, :, None]
            starts = np.concatenate([[0], np.cumsum(np.bincount(row[keep], minlength=n_nodes))])
            kept = sp.bsr_matrix((data, column[keep], starts), shape=stiffness.shape)
            self._products.append(BlockProduct(kept, size, self._compiled, triangle=symmetric))

    def add(self, u: Array, forces: Array) -> None:
        """Add the forces of a displacement.

        Args:
            u: Shape (m,), length, contiguous.
            forces: Added to, shape (n,), force, contiguous.
        """
        for product in self._products:
            product.add(u, forces)

    def __call__(self, u: Array) -> Array:
        """The forces of a displacement as a new array; shapes as for :meth:`add`."""
        out = np.zeros(self._n)
        self.add(u, out)
        return out

    def push(self, u: Array, factors: Array, velocity: Array) -> None:
        """Add the forces, dof by dof times factors, to a velocity.

        Args:
            u: Displacement, shape (m,), length, contiguous.
            factors: Shape (n,), time/mass.
            velocity: Added to, shape (n,), length/time, contiguous.
        """
        forces = self._forces
        self.add(u, forces)
        if self._compiled is None:
            forces *= factors
            velocity += forces
            forces.fill(0.0)
            return
        view = self._compiled.ffi.from_buffer
        self._compiled.lib.spread(
            self._n, view("double[]", factors), view("double[]", forces),
            view("double[]", velocity),
        )  # fmt: skip


__all__ = ["StiffnessRows"]
