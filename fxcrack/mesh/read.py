"""Meshes from gmsh: models in memory and mesh files, with every physical group a named group.

gmsh is touched on rank 0 only; what goes wrong there is raised on every rank.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI

from fxcrack.base.checks import check_list, communicator, file_path, text
from fxcrack.base.errors import MeshError
from fxcrack.base.together import check_same_call
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.extract import extract
from fxcrack.mesh.mesh import Mesh
from fxcrack.mesh.raw import RawMesh, check_shapes, on_root
from fxcrack.mesh.split import Split, in_order, split_surface

_READABLE = (".msh", ".unv", ".med", ".cgns")
"""Mesh files that gmsh reads with their groups."""


def read_mesh(
    path: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    gdim: int | None = None,
    split: Sequence[Split] = (),
) -> Mesh:
    """Read a mesh file through gmsh; collective.

    Args:
        path: A .msh file of any version, or a .unv, .med or .cgns file, whose groups become named
            groups as well; opened on rank 0 only.
        comm: Communicator to distribute the mesh over.
        gdim: Geometric dimension; ``None`` takes that of the cells, 3 keeps surface cells in space
            (the reference surface of shells).
        split: Internal surfaces to split into slave and master sides, in this order.

    Returns:
        The mesh, named after the file.

    Raises:
        MeshError: The file is missing or of another kind, or as :func:`mesh_from_gmsh`.
    """
    path = file_path("read_mesh", "path", path)
    communicator("read_mesh", comm)
    split = check_list("read_mesh", "split", split, Split)
    check_same_call(comm, f"read_mesh('{path.name}')", {"path": path, "gdim": gdim, "split": split})

    def work() -> RawMesh:
        if path.suffix.lower() not in _READABLE:
            if path.suffix.lower() == ".inp":
                raise MeshError(
                    f"'{path}' is a keyword deck; read it with read_deck('{path}'), which gives a "
                    "scene"
                )
            raise MeshError(
                f"'{path}' is not a .msh file; write one with gmsh.write('{path.stem}.msh'), give "
                "a .unv, .med or .cgns file, or read it by DOLFINx and take from_dolfinx(...)"
            )
        if not path.is_file():
            raise MeshError(f"there is no mesh file '{path}' (looked in {Path.cwd()})")
        with gmsh_model(path.stem) as gmsh:
            try:
                gmsh.merge(str(path))
            except Exception as error:  # gmsh raises nothing more special
                raise MeshError(f"gmsh cannot read '{path}': {error}") from error
            return prepare(gmsh.model, path.stem, gdim, split)

    return distribute(on_root(comm, work), comm, path.stem)


def mesh_from_gmsh(
    model: Any,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    gdim: int | None = None,
    split: Sequence[Split] = (),
    name: str = "mesh",
) -> Mesh:
    """Make a mesh from the current, already meshed gmsh model; collective.

    Physical groups become named groups, those without a name are called ``group_<dim>_<tag>``.
    The cells are all elements of the highest dimension, in a group or not.

    Args:
        model: ``gmsh.model`` on rank 0; what the other ranks pass is not looked at.
        comm: Communicator to distribute the mesh over.
        gdim: Geometric dimension; ``None`` takes that of the cells, 3 keeps surface cells in space
            (the reference surface of shells).
        split: Internal surfaces to split into slave and master sides, in this order.
        name: What messages and files call the mesh.

    Raises:
        MeshError: No cells, several cell shapes, incomplete second order, a plane mesh out of
            z = 0, coordinates that are not numbers, degenerate cells, a name used in two
            dimensions, a group without elements or off the cells, a surface that cannot be split.
    """
    communicator("mesh_from_gmsh", comm)
    text("mesh_from_gmsh", "name", name)
    split = check_list("mesh_from_gmsh", "split", split, Split)
    check_same_call(comm, f"mesh_from_gmsh('{name}')", {"name": name, "gdim": gdim, "split": split})

    def work() -> RawMesh:
        if model is None:
            raise MeshError(
                f"mesh '{name}': rank 0 got no gmsh model; build it there, None elsewhere"
            )
        return prepare(model, name, gdim, split)

    return distribute(on_root(comm, work), comm, name)


@contextmanager
def gmsh_model(name: str) -> Iterator[Any]:
    """A fresh gmsh model for the time of the block; yields the gmsh module.

    A gmsh session the caller has opened is left open, with its model current again.
    """
    import gmsh

    started = not gmsh.isInitialized()
    before = None if started else gmsh.model.getCurrent()
    others = [] if started else gmsh.model.list()
    if started:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
    try:
        gmsh.model.add(name)
        yield gmsh
    finally:
        if started:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            for left in set(gmsh.model.list()) - set(others):  # a .med file makes one of its own
                gmsh.model.setCurrent(left)
                gmsh.model.remove()
            gmsh.model.setCurrent(before)


def prepare(model: Any, name: str, gdim: int | None = None, split: Sequence[Split] = ()) -> RawMesh:
    """Read the current gmsh model, check it and split its surfaces; on the rank that holds it.

    Args:
        model: ``gmsh.model``, meshed.
        name: What messages call the mesh.
        gdim: Geometric dimension, 3 for surface cells in space; ``None`` for that of the cells.
        split: Internal surfaces to split, in this order.

    Raises:
        MeshError: As :func:`mesh_from_gmsh`.
    """
    try:
        raw = extract(model, gdim)
        check_shapes(raw)
        if split and raw.gdim != raw.tdim:
            raise MeshError(
                "a surface mesh in space has no internal surfaces to split; mesh the two shells of "
                "an interface apart, each with its own nodes, and leave split out"
            )
        for one in in_order(raw, split):
            raw = split_surface(raw, one)
    except MeshError as error:
        raise MeshError(f"mesh '{name}': {error}") from error
    return raw
