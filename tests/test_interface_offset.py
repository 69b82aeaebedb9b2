"""Interfaces between bodies whose nodes have more unknowns than their displacement.

Such as shells: the point of a face moves with the node's displacement and its further unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import STEEL, gathered
from test_interface_pairing import small, three_blocks, tie

import fxcrack as fx
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.jump_coordinates import RETAINED, JumpCoordinates, build_coordinates
from fxcrack.interface.nodes import JumpGather
from fxcrack.interface.pair import Pair
from fxcrack.interface.pairing import make_pair
from fxcrack.interface.supports import Supports, collect_supports
from fxcrack.meshes.dcb import dcb_3d

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-13
OFFSETS = {"b_bottom": -0.3, "a_top": 0.5, "c_left": 0.2, "b_right": -0.4}
OFFSETS |= {"upper_face": -0.75, "lower_face": 0.6}


class OffsetLayout(DofLayout):
    """Nodes whose faces lie at an offset that grows along x: u_point = u + z A w."""

    def __init__(self, continuum: Continuum, n_unknowns: int) -> None:
        layout = continuum.layout
        super().__init__(layout.comm, layout.gdim, layout.n_owned, n_unknowns)
        self._x = continuum.positions()

    def point_maps(self, name: str | fx.Face, nodes: npt.NDArray[np.integer]) -> Array:
        """[1, z A] with A unlike the identity."""
        z = OFFSETS[str(name)] * (1.0 + 0.25 * self._x[nodes, 0])
        further = np.eye(self.gdim, self.n_unknowns - self.gdim) + 0.125
        one = np.broadcast_to(np.eye(self.gdim), (*nodes.shape, self.gdim, self.gdim))
        return np.concatenate([one, z[..., None, None] * further], axis=-1)


def expected(
    layout: DofLayout, pairs: Sequence[Pair], supports: Supports, found: JumpCoordinates
) -> Array:
    """T by its definition, slaves of earlier pairs first, shape (n_global, n_coordinates)."""
    comm, gdim = layout.comm, layout.gdim
    places = comm.allgather((found.inner_dofs + layout.offset, supports.which, supports.value))
    out = np.zeros((layout.n_global, layout.n_global + found.n_last))
    begin, n_columns = 0, 0
    for rank, (inner, which, value) in enumerate(places):
        out[inner, n_columns + np.arange(len(inner))] = 1.0
        held = np.flatnonzero(which >= 0)
        out[begin + held, found.first + found.n_retained + which[held]] = value[held]
        begin += len(which)
        n_columns += len(inner) + (found.n_last if rank == 0 else 0)
    for pair, frames, index in zip(pairs, found.frames, found.index, strict=True):
        slave_maps, master_maps = pair.surface.point_maps, pair.master_maps
        assert slave_maps is not None and master_maps is not None
        for s in np.flatnonzero(pair.paired):
            rows = np.zeros((gdim, out.shape[1]))
            for k, m in enumerate(pair.masters[s]):
                rows += pair.weights[s, k] * master_maps[s, k] @ out[layout.dofs(m)]
            dofs = layout.dofs(pair.surface.dofs[s])
            rows -= slave_maps[s, :, gdim:] @ out[dofs[gdim:]]
            for j in range(gdim):
                assert index[s, j] >= 0
                rows[:, found.first + index[s, j]] += frames[s, :, j]
            out[dofs[:gdim]] = rows
    return out[:, :n_columns]


@pytest.mark.mpi
@pytest.mark.parametrize("case", ["chain of three bodies", "solid"])
def test_rows_of_masters_are_blocks(comm: MPI.Intracomm, case: str) -> None:
    solid = case == "solid"
    if solid:
        mesh = dcb_3d(comm, length=3.0, width=2.0, dx=1.0, dy=1.0, ny=1)
        interfaces = [tie("upper_face", "lower_face")]
        held: list[fx.Displacement] = []
    else:  # b hangs on a, and c on b
        mesh = three_blocks(comm)
        interfaces = [tie("b_bottom", "a_top"), tie("c_left", "b_right")]
        held = [fx.Displacement("a_bottom", x=0.0, y=0.5)]
    continuum = Continuum(mesh, STEEL, fx.Solid() if solid else fx.PlaneStrain())
    layout = continuum.layout = OffsetLayout(continuum, 6 if solid else 5)
    pairs = [
        make_pair(continuum, i, others=[j for j in interfaces if j is not i]) for i in interfaces
    ]
    supports = collect_supports(continuum, held)
    roles = [np.full((p.surface.n_nodes, mesh.gdim), RETAINED, dtype=np.int8) for p in pairs]
    found = build_coordinates(layout, pairs, roles, supports, 1)
    transform = gathered(found.transform).toarray()
    found.transform.destroy()

    wanted = expected(layout, pairs, supports, found)
    assert transform.shape == wanted.shape
    assert np.abs(transform - wanted).max() < ROUND_OFF
    used = np.delete(transform, found.first + found.n_last - 1, axis=1)  # but for the border
    assert np.linalg.matrix_rank(used) == used.shape[1]

    q = np.random.default_rng(7).normal(size=transform.shape[1])
    u = (transform @ q)[layout.offset : layout.offset + layout.n_local]
    reader = JumpGather(layout, pairs)
    values = reader.gather(u)
    for pair, frames, index in zip(pairs, found.frames, found.index, strict=True):
        jump = q[found.first + index]
        jump[~pair.paired] = 0.0
        assert np.abs(reader.jumps(values, pair, frames) - jump).max() < 1e-12


@pytest.mark.mpi
def test_forces_on_masters_do_the_work_of_those_on_slaves(comm: MPI.Intracomm) -> None:
    continuum = Continuum(small(comm), STEEL, fx.PlaneStrain())
    plain = make_pair(continuum, tie("upper_face", "lower_face"))
    continuum.layout = OffsetLayout(continuum, 5)
    pair = make_pair(continuum, tie("upper_face", "lower_face"))
    assert plain.master_maps is None and pair.master_maps is not None
    rng = np.random.default_rng(3)
    forces = rng.normal(size=(pair.surface.n_nodes, 2))
    unknowns = rng.normal(size=(*pair.masters.shape, 5))
    points = np.einsum("nkcj,nkj->nkc", pair.master_maps, unknowns)
    work = np.einsum("nk,nkc,nc->n", pair.weights, points, forces)
    found = np.einsum("nkj,nkj->n", pair.forces_on_masters(forces), unknowns)
    assert np.abs(found - work).max() < ROUND_OFF
    solid = np.einsum("nkj,nkj->n", plain.forces_on_masters(forces), unknowns[..., :2])
    work = np.einsum("nk,nkc,nc->n", pair.weights, unknowns[..., :2], forces)
    assert np.abs(solid - work).max() < ROUND_OFF


def test_dofs_of_nodes(comm: MPI.Intracomm) -> None:
    continuum = Continuum(small(comm), STEEL, fx.PlaneStrain())
    layout = continuum.layout
    index_map = continuum.space.dofmap.index_map
    assert (layout.n_unknowns, layout.n_owned) == (2, index_map.size_local)
    assert layout.first_node == index_map.local_range[0]
    assert (layout.n_local, layout.n_global) == (2 * layout.n_owned, 2 * index_map.size_global)
    nodes = np.array([[3, 0], [7, 2]], dtype=np.int32)
    assert layout.dofs(nodes).tolist() == [[[6, 7], [0, 1]], [[14, 15], [4, 5]]]
    assert layout.dof(nodes, 1).tolist() == [[7, 1], [15, 5]]
    more = OffsetLayout(continuum, 5)
    assert more.dofs(np.array([3])).tolist() == [[15, 16, 17, 18, 19]]
    assert more.displacements(np.arange(10.0)).tolist() == [[0.0, 1.0], [5.0, 6.0]]
    ends = np.array([-1, 0, layout.n_owned - 1, layout.n_owned]) + layout.first_node
    assert layout.is_owned(ends).tolist() == [False, True, True, False]
