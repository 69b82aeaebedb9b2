"""Meshes of other programs: files that gmsh reads, and DOLFINx meshes with tags."""

from __future__ import annotations

import dolfinx.mesh
import numpy as np
import pytest

import fxcrack as fx
from fxcrack.base.errors import MeshError
from fxcrack.mesh.read import gmsh_model


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("kind", ["unv", "med", "cgns"])
def test_files_of_other_programs_keep_their_groups(comm, shared_path, kind):
    path = shared_path / f"plate.{kind}"
    if comm.rank == 0:
        with gmsh_model("plate") as gmsh:
            if kind.title() not in gmsh.option.getString("General.BuildOptions") and kind != "unv":
                path.with_suffix(".none").touch()
            else:
                gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, 2.0, 1.0)
                gmsh.model.occ.synchronize()
                for dim, tag, name in ((2, 1, "body"), (1, 4, "left")):
                    group = gmsh.model.addPhysicalGroup(dim, [tag])
                    gmsh.model.setPhysicalName(dim, group, name)
                gmsh.model.mesh.generate(2)
                gmsh.write(str(path))
    comm.Barrier()
    if path.with_suffix(".none").exists():
        pytest.skip(f"this gmsh cannot read .{kind}")
    mesh = fx.read_mesh(path, comm)
    assert sorted(mesh.groups) == ["body", "left"]  # .med pads names with blanks
    scene = fx.Scene(
        mesh,
        materials={"body": fx.Isotropic(1.0, 0.0)},
        model=fx.PlaneStress(),
        supports=[fx.Displacement("left", x=0.0, y=0.0)],
        loads=[fx.BodyForce((1.0, 0.0))],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0))).rows[-1]
    assert row["R[left.x]"] == pytest.approx(-2.0)
    scene.close()


@pytest.mark.mpi
@pytest.mark.three
def test_a_dolfinx_mesh_with_tags(comm):
    domain = dolfinx.mesh.create_rectangle(
        comm, [(0.0, 0.0), (2.0, 1.0)], (4, 2), ghost_mode=dolfinx.mesh.GhostMode.shared_facet
    )
    ends = []
    for x in (0.0, 2.0):
        facets = dolfinx.mesh.locate_entities_boundary(domain, 1, lambda p, x=x: p[0] == x)
        ends.append(facets)
    facets = np.concatenate(ends)
    values = np.repeat([3, 4], [len(e) for e in ends]).astype(np.int32)
    order = np.argsort(facets)
    tags = dolfinx.mesh.meshtags(domain, 1, facets[order], values[order])
    mesh = fx.from_dolfinx(domain, facet_tags=tags, names={"left": (1, 3)})
    assert sorted(mesh.groups) == ["group_1_4", "left"]
    count = {
        n: comm.allreduce(int((g.entities < domain.topology.index_map(1).size_local).sum()))
        for n, g in mesh.groups.items()
    }
    assert count == {"left": 2, "group_1_4": 2}
    with pytest.raises(MeshError, match="'top' means tag 7 of dimension 1, but there is none"):
        fx.from_dolfinx(domain, facet_tags=tags, names={"top": (1, 7)})
