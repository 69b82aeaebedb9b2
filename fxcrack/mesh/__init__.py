"""Meshes with named groups: gmsh files and models, and splitting along an internal surface."""

from fxcrack.mesh.domain import from_dolfinx, mesh_from_domain
from fxcrack.mesh.mesh import Group, Mesh
from fxcrack.mesh.read import mesh_from_gmsh, read_mesh
from fxcrack.mesh.split import Split

__all__ = [
    "Group",
    "Mesh",
    "Split",
    "from_dolfinx",
    "mesh_from_domain",
    "mesh_from_gmsh",
    "read_mesh",
]
