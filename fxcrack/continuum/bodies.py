"""Bodies: parts of the mesh that cells and joints of shells connect, without interfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.continuum import Continuum


class Bodies:
    """The bodies of a continuum; collective.

    Args:
        continuum: Displacement space and mesh.

    Attributes:
        count: Number of bodies.
        of_node: Number of the body of each local node, owned first, then ghosts, shape (n_nodes,).
        centre: Middle of the box around each body, shape (count, gdim), length.
        size: Longest edge of this box, shape (count,), length.
        far: Largest coordinate of each body by absolute value, shape (count,), length.
    """

    def __init__(self, continuum: Continuum) -> None:
        self._continuum = continuum
        self.of_node = self._connected()
        self.count = int(max(continuum.comm.allgather(self.of_node.max(initial=-1)))) + 1
        gdim, n_owned = continuum.gdim, continuum.layout.n_owned
        x, body = continuum.positions()[:n_owned, :gdim], self.of_node[:n_owned]
        low, high = np.full((2, self.count, gdim), np.inf)
        np.minimum.at(low, body, x)
        np.minimum.at(high, body, -x)
        low, high = (np.min(continuum.comm.allgather(v), axis=0) for v in (low, high))
        high = -high
        self.centre: Array = 0.5 * (low + high)
        self.size: Array = np.maximum((high - low).max(axis=1), 1e-300)
        self.far: Array = np.maximum(np.abs(low), np.abs(high)).max(axis=1)

    def _connected(self) -> Ints:
        """Number of the body of each local node."""
        space, comm = self._continuum.space, self._continuum.comm
        cells = np.asarray(space.dofmap.list, dtype=np.int64)
        index_map = space.dofmap.index_map
        n = index_map.size_local + index_map.num_ghosts
        first, others = np.repeat(cells[:, 0], cells.shape[1]), cells.ravel()
        graph = sp.coo_matrix((np.ones(len(others)), (first, others)), shape=(n, n))
        count, label = connected_components(graph, directed=False)
        counts = comm.allgather(int(count))
        label = label.astype(np.int64) + sum(counts[: comm.rank])
        # ghosts learn what their owner calls their part: the same part of the mesh
        values = fem.Function(space)
        by_node = values.x.array.reshape(n, -1)
        by_node[:, 0] = label  # a double holds whole numbers up to 2^53
        values.x.scatter_forward()
        same = np.unique(np.stack([label, by_node[:, 0].astype(np.int64)], axis=1), axis=0)
        joined = self._joined(label)
        a, b = np.concatenate([*comm.allgather(same), joined]).T
        total = sum(counts)
        whole = sp.coo_matrix((np.ones(len(a)), (a, b)), shape=(total, total))
        _, group = connected_components(whole, directed=False)
        used = np.unique(np.concatenate(comm.allgather(np.unique(group[label]))))
        return np.asarray(np.searchsorted(used, group[label]))

    def _joined(self, label: Ints) -> Ints:
        """Labels of the parts that joints of shells connect, shape (n, 2); collective."""
        joints, layout = self._continuum.layout.joints, self._continuum.layout
        owned = layout.is_owned(joints.nodes)
        found = np.zeros(len(joints.nodes), dtype=np.int64)
        found[owned] = label[layout.to_local(joints.nodes[owned])]
        self._continuum.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.SUM)
        pairs = [np.stack([np.full(len(r), found[r[0]]), found[r]], 1) for r in joints.groups()]
        return np.concatenate(pairs) if pairs else np.zeros((0, 2), dtype=np.int64)

    def names(self) -> list[str]:
        """What to call each body: the cell groups that make it up, or where it is; collective."""
        continuum, comm = self._continuum, self._continuum.comm
        mesh, cells = continuum.mesh, np.asarray(continuum.space.dofmap.list)
        n_cells = mesh.domain.topology.index_map(mesh.tdim).size_local
        body = self.of_node[cells[:n_cells, 0]] if n_cells else np.zeros(0, dtype=np.int64)
        whole = comm.allreduce(np.bincount(body, minlength=self.count))
        parts: list[list[tuple[int, str]]] = [[] for _ in range(self.count)]
        for name, group in sorted(mesh.groups.items()):
            if group.dim != mesh.tdim:
                continue
            mine = group.entities[group.entities < n_cells]
            inside = comm.allreduce(np.bincount(body[mine], minlength=self.count))
            (touched,) = np.nonzero(inside)
            if len(touched) == 1:
                parts[int(touched[0])].append((int(inside[touched[0]]), name))
        out = []
        for b in range(self.count):
            found = sorted(parts[b], reverse=True)
            if not found:
                at = ", ".join(f"{v:.4g}" for v in self.centre[b])
                out.append(f"the body around ({at})")
            elif found[0][0] == whole[b]:
                out.append(f"body '{found[0][1]}'")
            else:
                names = "', '".join(name for _, name in found[:3])
                out.append(f"the body of '{names}'")
        return out


__all__ = ["Bodies"]
