"""Ranks: a front that crosses their borders, more of them than interface nodes, one without cells.

Hard: slave and master of one pair on different ranks, a front whose nodes belong to several of them
and move from one to the next, ranks that own nothing of the interface or nothing at all. Must hold:
the history is that of one rank, and nobody waits for anybody for ever. Checked by running the same
problem alone and together; the run is under the time limit of the suite.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import CLAMPED_3D, assert_same, specimen

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_3d
from fxcrack.output.fields import write_fields
from stability.beams import SELF, arms

pytestmark = [pytest.mark.stability, pytest.mark.mpi, pytest.mark.three]

UNEVEN = (0.0, 1.5, 4.0, 6.0, 8.0)
"""Across the width: of two nodes that are alike round-off would choose which goes first."""
SAME = 1e-8  # of the largest value: round-off of another order of elimination


def owners(scene: fx.Scene) -> npt.NDArray[np.int64]:
    """Rank that owns each slave node."""
    comm = scene.mesh.comm
    first = np.array(comm.allgather(scene.continuum.offset // scene.mesh.gdim))
    return np.searchsorted(first, scene.pairs[0].surface.dofs, side="right") - 1


@pytest.mark.quick("release0")
@pytest.mark.parametrize("release", [fx.StepRelease(), fx.ProgressiveRelease()])
def test_front_crosses_borders(
    comm: MPI.Intracomm, release: fx.StepRelease | fx.ProgressiveRelease
) -> None:
    """A front across the width and the length of a beam that is spread over all ranks."""
    # by exact closure a softening bond is neutral when it begins: round-off decides what it does
    method = "closure" if isinstance(release, fx.StepRelease) else "vcct"
    histories = []
    for where in (SELF, comm):
        scene = specimen(
            # unequal arms: on two ranks the border runs through the one with more elements, and
            # somewhere across the way of the crack, which goes to the end
            dcb_3d(where, length=12.0, width=8.0, dx=1.0, z_spacing=UNEVEN, ny=4, ny_lower=1),
            a0=2.0,
            supports=CLAMPED_3D,
            criterion=fx.VCCT(GIc=0.2, method=method),
            release=release,
        )
        histories.append(scene.run(fx.Static(until=fx.Releases(60)), progress=False))
        if where is comm and comm.size > 1:
            gone = [r.node for r in scene.cracks[0].records]
            assert len(set(owners(scene)[gone].tolist())) > 1  # it did cross one
        scene.close()
    assert_same(*histories, SAME)


@pytest.mark.parametrize("contact", [False, True])
def test_fewer_interface_nodes_than_ranks(comm: MPI.Intracomm, contact: bool) -> None:
    """Two elements in each arm: three interface nodes, on any number of ranks."""
    histories = []
    for where in (SELF, comm):
        scene = specimen(
            arms(where, length=3.0, upper=np.array([0.0, 1.0, 3.0]), ny=1),
            a0=1.0,
            contact=contact,
            criterion=fx.VCCT(GIc=0.2, method="closure"),
            supports=[
                fx.Displacement("end_upper", x=0.0, y=1.0),
                fx.Displacement("end_lower", x=0.0, y=-1.0),
            ],
        )
        histories.append(scene.run(fx.Static(until=fx.Releases(9)), progress=False))
        scene.close()
    assert histories[0].reason == "total separation: no crack tip is left"
    assert histories[0].rows[-1]["released[bond]"] == 2
    assert_same(*histories, SAME)


def test_rank_without_cells(comm: MPI.Intracomm, shared_path: object) -> None:
    """One element in each arm: from three ranks on, one has nothing; fields are written as well."""
    histories = []
    for where in (SELF, comm):
        mesh = arms(where, length=1.0, upper=np.array([0.0, 1.0]), ny=1)
        cells = where.allgather(mesh.domain.topology.index_map(2).size_local)
        if where.size > 2:
            assert min(cells) == 0
        scene = specimen(
            mesh,
            a0=0.5,
            contact=True,
            criterion=fx.VCCT(GIc=0.2, method="closure"),
            supports=[
                fx.Displacement("end_upper", x=0.0, y=1.0),
                fx.Displacement("end_lower", x=0.0, y=-1.0),
            ],
            loads=[fx.Pressure("top", -1.0)],
            monitors=[fx.Monitor("far_upper", (0.0, 1.0))],
        )
        histories.append(scene.run(fx.Static(until=fx.Releases(9)), progress=False))
        if where is comm:
            write_fields(scene, f"{shared_path}/small.pvd")
        scene.close()
    assert_same(*histories, SAME)


def test_same_refusal_on_every_rank(comm: MPI.Intracomm) -> None:
    """What is wrong on the rank that owns it is raised by all, in the same words."""
    words = []
    try:
        specimen(
            arms(comm, length=6.0),
            a0=3.0,
            loads=[fx.Traction("top", (0.0, lambda x: np.where(x[0] > 5.0, np.nan, 1.0)))],
        ).run(fx.Static(until=fx.Releases(1)), progress=False)
    except fx.InputError as error:
        words.append(str(error))
    every = comm.allgather(words)
    assert every == [every[0]] * comm.size
    (message,) = every[0]
    assert message.startswith("load 'top'") and message.endswith("; correct its value")
