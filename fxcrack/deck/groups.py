"""Named groups of the mesh: the deck's sets and surfaces, and what the scene needs beside them."""

from __future__ import annotations

import contextlib

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.base.errors import MeshError
from fxcrack.continuum.face import Face
from fxcrack.deck.cards import Card, DeckError
from fxcrack.deck.flat import Flat
from fxcrack.mesh.raw import RawGroup, RawMesh, check_shapes


class Groups:
    """Collects the groups of a mesh and gives each of them a name of its own.

    A set of nodes keeps its name; a surface or a set of elements of the same name gets
    " (surface)" or " (elements)" behind it. Sets inside an instance are "instance.set".

    Args:
        flat: The model in one numbering.
    """

    def __init__(self, flat: Flat) -> None:
        self._flat = flat
        self._found: dict[str, tuple[str, Ints]] = {}
        self._taken: set[str] = set()
        for kind in ("nsets", "surfaces", "elsets"):
            for place, placed in flat.placed.items():
                prefix = f"{placed.space.name}." if place else ""
                for found in getattr(placed.space, kind).values():
                    if not found.card.has("INTERNAL"):
                        with contextlib.suppress(DeckError):  # unless it is used
                            self._add_named(kind, found.card, prefix + found.name)

    def _add_named(self, kind: str, card: Card, name: str) -> None:
        if kind == "nsets":
            self.support(card, name, self._flat.nodes(card, name))
        elif kind == "surfaces":
            if not self._flat.kind.shell:
                self.facets(name, self._flat.surface(card, name))
        else:
            cells = self._flat.elements(card, name)
            if len(cells):
                self.cells(name, cells)

    def _add(self, name: str, kind: str, words: str, members: Ints) -> str:
        """Name of the group with these members, made if there is none."""
        for candidate in (name, f"{name} ({words})"):
            known = self._found.get(candidate)
            if known is not None and known[0] == kind and np.array_equal(known[1], members):
                return candidate
        new, i = name, 1
        while new.upper() in self._taken:
            new = f"{name} ({words})" if i == 1 else f"{name} ({words} {i})"
            i += 1
        self._taken.add(new.upper())
        self._found[new] = (kind, members)
        return new

    def nodes(self, name: str, nodes: Ints, *, words: str = "nodes") -> str:
        """Name of a group of exactly these nodes."""
        return self._add(name, "nodes", words, nodes)

    def support(self, card: Card, name: str, nodes: Ints, *, words: str = "nodes") -> str:
        """Name of a group of nodes with the added centres between them.

        Raises:
            DeckError: No element has one of the nodes.
        """
        nodes = nodes[self._flat.used[nodes]]
        if not len(nodes):
            card.fail(f"no element has a node of '{name}'")
        return self._add(name, "nodes", words, self._flat.with_centres(nodes))

    def facets(self, name: str, rows: Ints, *, words: str = "surface") -> str:
        """Name of a group of facets, rows of :meth:`Flat.faces`."""
        return self._add(name, "facets", words, rows)

    def surface(
        self, card: Card, name: str, index: int | None = None, *, whole: bool = True
    ) -> str | Face:
        """Group of facets of a surface of the deck, or the side of shells that it is.

        Args:
            card: For messages.
            name: Of the surface.
            index: Data line, for messages.
            whole: As of :meth:`Flat.surface`.

        Raises:
            DeckError: There is no such surface, or it is none of facets.
        """
        if self._flat.kind.shell:
            cells, side = self._flat.shell_side(card, name, index)
            return Face(self.cells(name, cells, words="surface"), side)
        return self.facets(name, self._flat.surface(card, name, index, whole=whole))

    def cells(self, name: str, cells: Ints, *, words: str = "elements") -> str:
        """Name of a group of cells."""
        return self._add(name, "cells", words, cells)

    def cells_of(self, name: str) -> Ints:
        """Cells of a group of cells that has been made."""
        return self._found[name][1]

    def raw_mesh(self) -> RawMesh:
        """The mesh with all groups; nodes that no cell has are dropped.

        Raises:
            DeckError: Cells are degenerate.
        """
        flat = self._flat
        number = np.cumsum(flat.used) - 1
        gdim, tdim = flat.kind.gdim, flat.kind.tdim
        raw = RawMesh(
            flat.kind.cell,
            flat.kind.order,
            np.ascontiguousarray(flat.points[flat.used][:, :gdim]),
            number[flat.dolfinx_cells()].astype(np.int64),
        )
        try:
            check_shapes(raw)
        except MeshError as error:
            raise DeckError(f"the elements of the deck: {error}") from error
        for name, (kind, members) in self._found.items():
            if kind == "cells":
                raw.cell_groups[name] = members
            else:
                rows = members[:, None] if kind == "nodes" else members
                raw.groups[name] = RawGroup(0 if kind == "nodes" else tdim - 1, number[rows])
        return raw
