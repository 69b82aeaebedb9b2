"""A distributed mesh together with its named groups of cells, facets, edges and nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import dolfinx.mesh
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.errors import MeshError, did_you_mean


@dataclass(frozen=True)
class Group:
    """A named set of mesh entities of one dimension, as this rank sees it.

    Attributes:
        dim: Topological dimension of the entities (0 nodes, ..., tdim cells).
        entities: Local indices, owned and ghost, sorted, shape (n_entities,).
        points: Of a group of nodes that holds midside nodes, which are no entities of DOLFINx: the
            local geometry nodes of all of it, owned and ghost, sorted, shape (n_points,); ``None``
            where the entities say all.
    """

    dim: int
    entities: npt.NDArray[np.int32]
    points: npt.NDArray[np.int32] | None = None


@dataclass(frozen=True)
class Mesh:
    """A DOLFINx mesh and its named groups.

    Attributes:
        domain: The DOLFINx mesh.
        groups: Named groups, the same names on every rank.
        name: What messages and files call the mesh.
        joints: Nodes of a surface mesh at which smooth parts with nodes of their own meet (kinks, T
            joints): number of the node in the input (``geometry.input_global_indices``), and
            number of its joint, sorted by it, the same on every rank, shape (n_nodes, 2).
    """

    domain: dolfinx.mesh.Mesh
    groups: dict[str, Group]
    name: str = "mesh"
    joints: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 2), np.int64))

    def __repr__(self) -> str:
        """Name, dimension, order and groups."""
        return (
            f"Mesh '{self.name}', {self.gdim}-D, order {self.order}, groups: "
            f"{self._listing() or 'none'}"
        )

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        """Refuse copying and pickling: the parts of a DOLFINx mesh can be neither.

        Raises:
            MeshError: Always.
        """
        raise MeshError(
            f"mesh '{self.name}' is distributed by DOLFINx and cannot be copied or pickled; "
            "several scenes may share one mesh, and another process reads it anew"
        )

    def _listing(self) -> str:
        return ", ".join(f"{n} (dim {g.dim})" for n, g in sorted(self.groups.items()))

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the mesh."""
        return compat.plain_comm(self.domain.comm)

    @property
    def gdim(self) -> int:
        """Geometric dimension, 2 or 3."""
        return int(self.domain.geometry.dim)

    @property
    def tdim(self) -> int:
        """Topological dimension of the cells."""
        return int(self.domain.topology.dim)

    @property
    def order(self) -> int:
        """Order of the geometry, 1 or 2."""
        return int(compat.coordinate_map(self.domain).degree)

    def joined(self, name: str, parts: Sequence[str]) -> Mesh:
        """The same mesh with a further group that holds what some groups of one dimension hold.

        Surfaces that share a node or a line at their ends so become one surface, on which a crack
        passes from the one to the other; their toughness is a function of position there.

        Args:
            name: Name of the further group.
            parts: Names of the groups.

        Returns:
            A mesh on the same DOLFINx mesh.

        Raises:
            MeshError: There are no parts, a name is unknown or taken, or dimensions differ.
        """
        if not isinstance(name, str) or not name:
            raise MeshError(f"joined: name = {name!r} must be a text; give the name of the group")
        if not parts or isinstance(parts, str):
            raise MeshError(f"joined('{name}'): give a list of names of groups, ['west', 'east']")
        if name in self.groups:
            raise MeshError(f"mesh '{self.name}' has a group '{name}' already; give another name")
        found = [self.group(parts[0]), *(self.group(p) for p in parts[1:])]
        if len({g.dim for g in found}) > 1:
            each = ", ".join(f"'{p}' {g.dim}" for p, g in zip(parts, found, strict=True))
            raise MeshError(
                f"joined('{name}'): the groups have different dimensions ({each}); join facets "
                "with facets, cells with cells"
            )
        entities = np.unique(np.concatenate([g.entities for g in found]))
        points = None
        if any(g.points is not None for g in found):
            raise MeshError(
                f"joined('{name}'): groups of nodes with midside nodes cannot be joined"
            )
        group = Group(found[0].dim, entities.astype(np.int32), points)
        return replace(self, groups={**self.groups, name: group})

    def group(self, name: str, *, dim: int | None = None) -> Group:
        """The group called ``name``.

        Args:
            name: Name of a physical group.
            dim: Dimension the group must have; ``None`` accepts any.

        Raises:
            MeshError: The name is unknown or its dimension is another one.
        """
        if name not in self.groups:
            raise MeshError(
                f"mesh '{self.name}' has no group '{name}'{did_you_mean(name, self.groups)}; it "
                f"has: {self._listing() or 'none'}"
            )
        found = self.groups[name]
        if dim is not None and found.dim != dim:
            raise MeshError(
                f"group '{name}' of mesh '{self.name}' holds entities of dimension {found.dim}, "
                f"but dimension {dim} is needed here"
            )
        return found
