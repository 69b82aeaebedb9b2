"""The whole model in one numbering: nodes, cells, sets and surfaces of all instances together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import did_you_mean
from fxcrack.deck.cards import Card, DeckError, key
from fxcrack.deck.element_checks import one_kind, repetitions
from fxcrack.deck.elements import face_nodes, to_dolfinx
from fxcrack.deck.model import Model
from fxcrack.deck.numbering import number_spaces
from fxcrack.deck.raising import raise_order
from fxcrack.deck.spaces import HOME, NamedSet, SurfaceDef, distinct, missing
from fxcrack.mesh.raw import row_ids

_PLANE = 1e-9


class Flat:
    """Nodes, cells, sets and surfaces of a model in one numbering.

    Args:
        model: What the deck describes.
        order: Order the elements are raised to; their own by default.

    Attributes:
        kind: Shape, order and kinematic model of all cells.
        given_kind: The same as the deck gives it.
        points: Positions of all nodes, those that no cell uses and added ones (last) included,
            shape (n_nodes, 3).
        cells: Nodes of each cell in the deck's order, centres last, shape (n_cells, n_cell_nodes).
        used: Whether a cell has the node, shape (n_nodes,).
        parents: Nodes of which each added node is made, shape (n_added, k), -1 for none; and
            their weights, same shape.

    Raises:
        DeckError: There are no elements, or of several shapes, orders or kinematic models; an
            element names a node that does not exist, or one node twice.
    """

    def __init__(self, model: Model, order: int | None = None) -> None:
        self.model = model
        spaces = {HOME: model.root, **model.instances}
        if model.parts and not model.instances:
            part = next(iter(model.parts.values()))
            raise DeckError(
                f"part '{part.name}' has no *INSTANCE, so the model has no body; add *ASSEMBLY "
                "with an *INSTANCE of each part"
            )
        self.kind = one_kind(list(spaces.values()))
        numbering = number_spaces(spaces)
        self.placed = numbering.placed
        self.points, self.cells = numbering.points, numbering.cells
        self.n_given = len(self.points)
        self.parents = np.zeros((0, 8), dtype=np.int64)
        self.weights = np.zeros((0, 8))
        self.given_kind = self.kind
        if order is not None and not self.kind.order <= order <= 2:
            raise DeckError(
                f"order = {order} is not possible with {self.kind.name} elements; 2 is, and "
                f"{self.kind.order}, their own"
            )
        if self.kind.serendipity or (order == 2 and self.kind.order == 1):
            raised = raise_order(self.kind, self.points, self.cells)
            self.points, self.cells = raised.points, raised.cells
            self.parents, self.weights = raised.parents, raised.weights
            self.kind = replace(self.kind, order=2)
        self.used = np.zeros(len(self.points), dtype=bool)
        self.used[self.cells] = True
        self._check_plane()
        self._faces: tuple[Ints, Ints] | None = None
        self._combining: list[Card] = []
        self._said: set[str] = set()

    def _check_plane(self) -> None:
        """Refuse plane elements off the plane z = 0."""
        if self.kind.gdim == 3:
            return
        x = self.points[self.used]
        size = float(np.ptp(x[:, :2], axis=0).max(initial=0.0))
        z = x[:, 2]
        if np.any(np.abs(z - z[0]) > _PLANE * size):
            raise DeckError(
                f"{self.kind.model} elements must lie in one plane z = constant, but z varies from "
                f"{z.min():g} to {z.max():g}"
            )

    # -- names ---------------------------------------------------------------------------

    def _resolve(self, card: Card, name: str, kind: str, index: int | None) -> tuple[str, NamedSet]:
        """The space and the set that a name means."""
        text, root = key(name), self.model.root
        own = self.model.instances.get(card.home)
        if own is not None and text in getattr(own, kind):
            return card.home, getattr(own, kind)[text]
        if text in getattr(root, kind):
            return "", getattr(root, kind)[text]
        words = text.split(".")
        for i in range(1, len(words)):
            inner = ".".join(words[i:])
            for j in range(i):  # the assembly's name may stand before that of the instance
                place = ".".join(words[j:i])
                space = self.model.instances.get(place)
                if space is not None and inner in getattr(space, kind):
                    return place, getattr(space, kind)[inner]
            if inner in getattr(root, kind):
                return "", getattr(root, kind)[inner]
        known = dict(getattr(root, kind))
        for place, space in self.model.instances.items():
            known |= {f"{place}.{k}": s for k, s in getattr(space, kind).items()}
        what = {"nsets": "node set", "elsets": "element set", "surfaces": "surface"}[kind]
        return card.fail(f"there is no {what} '{name}'{did_you_mean(text, known)}", index)

    def _of_set(self, place: str, found: NamedSet, kind: str) -> Ints:
        """Global members of a set."""
        out = []
        for space_name, labels in found.members.items():
            placed = self.placed[space_name or place]
            if kind == "nsets":
                at = placed.space.nodes.find(labels)
                at = self._existing(found, labels, at, "nodes") + placed.first_node
            else:
                at = placed.cell_of(labels)
                keep = (at >= 0) | ~np.isin(labels, placed.space.rigid_labels)
                labels, at = labels[keep], at[keep]
                at = self._existing(found, labels, at, "elements")
            out.append(at)
        return distinct(np.concatenate(out)) if out else np.zeros(0, dtype=np.int64)

    def _existing(self, found: NamedSet, labels: Ints, at: Ints, what: str) -> Ints:
        """Positions of the members of a set that exist; the others are warned of once."""
        self._warn_once(missing(found.card, found.name, labels, at, what))
        return at[at >= 0]

    def _warn_once(self, text: str | None) -> None:
        if text is not None and text not in self._said:
            self._said.add(text)
            log.warn("%s", text)

    def _member(self, card: Card, name: str, index: int | None, kind: str) -> Ints:
        """One node or element, "12" or "inst.12"."""
        first, _, number = key(name).rpartition(".")
        first = first or card.home
        place = first if first in self.placed else first.rpartition(".")[2]
        if place not in self.placed:
            card.fail(f"there is no instance '{first}'", index)
        placed, labels = self.placed[place], np.array([int(number)])
        at = placed.space.nodes.find(labels) if kind == "nsets" else placed.cell_of(labels)
        if at[0] < 0:
            card.fail(f"{'node' if kind == 'nsets' else 'element'} {name} does not exist", index)
        return at + placed.first_node if kind == "nsets" else at

    def nodes(self, card: Card, name: str, index: int | None = None) -> Ints:
        """Nodes of a set, or one node by its number; ascending, shape (n,).

        Args:
            card: For messages.
            name: "set", "12", "instance.set" or "instance.12".
            index: Data line, for messages.

        Raises:
            DeckError: There is no such set or node.
        """
        if key(name).rpartition(".")[2].isdigit():
            return self._member(card, name, index, "nsets")
        try:
            found = self._resolve(card, name, "nsets", index)
        except DeckError:
            cells = self._cells_of_name(card, name)
            if cells is None:
                raise
            self._warn_once(
                f"{card.place}: there is no node set '{name}'; the nodes of the element set of "
                "this name are meant"
            )
            return distinct(self.cells[cells].ravel())
        return self._of_set(*found, "nsets")

    def _cells_of_name(self, card: Card, name: str) -> Ints | None:
        """Cells of an element set, ``None`` where there is none."""
        try:
            return self._of_set(*self._resolve(card, name, "elsets", None), "elsets")
        except DeckError:
            return None

    def ordered_nodes(self, card: Card, name: str, index: int | None = None) -> Ints:
        """As :meth:`nodes`, in the order of their numbers, or of the deck in UNSORTED sets."""
        if key(name).rpartition(".")[2].isdigit():
            return self._member(card, name, index, "nsets")
        place, found = self._resolve(card, name, "nsets", index)
        if not found.card.has("UNSORTED"):
            return self._of_set(place, found, "nsets")
        parts = []
        for space_name, labels in found.members.items():
            placed = self.placed[space_name or place]
            at = self._existing(found, labels, placed.space.nodes.find(labels), "nodes")
            parts.append(at + placed.first_node)
        return np.concatenate(parts)

    def elements(self, card: Card, name: str, index: int | None = None) -> Ints:
        """Cells of an element set, or one element; arguments and error as for :meth:`nodes`."""
        if key(name).rpartition(".")[2].isdigit():
            return self._member(card, name, index, "elsets")
        return self._of_set(*self._resolve(card, name, "elsets", index), "elsets")

    def element_set(self, card: Card, name: str) -> tuple[str, NamedSet]:
        """The space and the element set that a name means."""
        return self._resolve(card, name, "elsets", None)

    def in_space(self, space: str, card: Card, elset: str) -> Ints:
        """Cells of an element set of one space (sections of instances)."""
        sets = self.placed[space].space.elsets
        if key(elset) not in sets:
            card.fail(f"there is no element set '{elset}'{did_you_mean(key(elset), sets)}")
        return self._of_set(space, sets[key(elset)], "elsets")

    # -- faces ---------------------------------------------------------------------------

    @property
    def _face_ids(self) -> tuple[Ints, Ints]:
        """Nodes of every face of every cell, and how many cells have each; by cell, then face."""
        if self._faces is None:
            table = face_nodes(self.kind.cell, self.kind.order)
            n_corners = 2 if self.kind.tdim == 2 else {"tetrahedron": 3}.get(self.kind.cell, 4)
            rows = self.cells[:, table]
            corners = np.sort(rows[:, :, :n_corners].reshape(-1, n_corners), axis=1)
            self._faces = rows, repetitions(corners).reshape(len(self.cells), -1)
        return self._faces

    def faces(self, card: Card, cells: Ints, face: int, index: int | None = None) -> Ints:
        """Nodes of a face of some cells, rows of a group of facets, shape (n, n_face_nodes).

        Args:
            card: For messages.
            cells: The cells, shape (n,).
            face: Number of the face, from 1.
            index: Data line, for messages.

        Raises:
            DeckError: The cells have no such face, or it lies inside the body.
        """
        rows, count = self._face_ids
        if self.kind.shell:
            card.fail("faces of shells are SPOS and SNEG of a *SURFACE; load it by *DSLOAD", index)
        if not 1 <= face <= rows.shape[1]:
            card.fail(f"a {self.kind.cell} has faces 1 to {rows.shape[1]}, not {face}", index)
        inside = count[cells, face - 1] > 1
        if np.any(inside):
            card.fail(
                f"face {face} of {int(inside.sum())} of {len(cells)} elements lies inside; only "
                "faces on its outside can be loaded or paired",
                index,
            )
        return np.asarray(rows[cells, face - 1])

    def outer_side(self, cells: Ints, face: int) -> Ints:
        """Nodes of a face of some cells where it lies on the outside; rows as of :meth:`faces`."""
        rows, count = self._face_ids
        return np.asarray(rows[cells, face - 1][count[cells, face - 1] == 1])

    def outside(self, cells: Ints) -> Ints:
        """Nodes of the faces of some cells that no other cell has; rows as of :meth:`faces`."""
        rows, count = self._face_ids
        return np.asarray(rows[cells][count[cells] == 1])

    def surface(
        self, card: Card, name: str, index: int | None = None, *, whole: bool = True
    ) -> Ints:
        """Nodes of the facets of a surface, rows as of :meth:`faces`.

        Args:
            card: For messages.
            name: Of the surface.
            index: Data line, for messages.
            whole: Refuse a surface of nodes that has nodes beside its facets; else they are warned
                of and left out.

        Raises:
            DeckError: There is no such surface, or it is none of facets.
        """
        return self.facets_of(*self.surface_def(card, name, index), whole=whole)

    def surface_def(self, card: Card, name: str, index: int | None) -> tuple[str, SurfaceDef]:
        """The space and the definition of a surface.

        Raises:
            DeckError: There is no such surface.
        """
        place, found = self._resolve(card, name, "surfaces", index)
        assert isinstance(found, SurfaceDef)
        return place, found

    def facets_of(self, place: str, surface: SurfaceDef, *, whole: bool = True) -> Ints:
        """Nodes of the facets of a surface of a space; rows as of :meth:`faces`."""
        card = surface.card
        kind = card.word("TYPE", "ELEMENT")
        if self.kind.shell:
            return np.asarray(self.cells[self._side_of(place, surface)[0]])
        if kind == "NODE":
            return self._node_surface(card, place, whole=whole)
        if kind != "ELEMENT":
            card.fail(
                f"TYPE={kind} is not available here; define surfaces by element faces "
                "(TYPE=ELEMENT) or nodes (TYPE=NODE): analytical rigid surfaces are masters of "
                "*CONTACT PAIR, the second of its two surfaces"
            )
        if card.has("COMBINE"):
            return self._combined(place, card)
        parts = []
        for row in card.need_rows("element set, face"):
            side = row.text(1).upper()
            if not row.text(0):
                cells = np.arange(len(self.cells))
            else:
                cells = self._in(card, place, row.text(0), row.index, "elsets")
            if not side:
                parts.append(self.outside(cells))
            elif side[:1] == "S" and side[1:].isdigit():
                parts.append(self.faces(card, cells, int(side[1:]), row.index))
            else:
                row.fail(
                    f"face {side} is not available on {self.kind.name} elements; S1, S2, ... are"
                )
        return self._once(card, parts)

    @staticmethod
    def _once(card: Card, parts: list[Ints]) -> Ints:
        """Facets of all parts, each once."""
        rows = np.concatenate(parts)
        if not len(rows):
            card.fail("the surface has no face")
        ids = row_ids(np.sort(rows, axis=1))
        return np.asarray(rows[np.sort(np.unique(ids, return_index=True)[1])])

    def _combined(self, place: str, card: Card) -> Ints:
        """Facets of a surface that is the union of others."""
        card.choose("COMBINE", ("UNION",), "UNION")
        if card in self._combining:
            card.fail("the surface is a part of itself")
        self._combining.append(card)
        own = self.placed[place].space.surfaces
        parts = []
        for row in card.need_rows("names of surfaces"):
            for name in (row.text(i) for i, text in enumerate(row.fields) if text):
                inside = own.get(key(name))
                parts.append(
                    self.surface(card, name, row.index)
                    if inside is None
                    else self.facets_of(place, inside)
                )
        self._combining.remove(card)
        return self._once(card, parts)

    def shell_side(self, card: Card, name: str, index: int | None = None) -> tuple[Ints, str]:
        """Shell elements of a surface, and "top" or "bottom".

        Raises:
            DeckError: There is no such surface, or it is no side of shells.
        """
        return self._side_of(*self.surface_def(card, name, index))

    def _side_of(self, place: str, surface: SurfaceDef) -> tuple[Ints, str]:
        card = surface.card
        if card.word("TYPE", "ELEMENT") != "ELEMENT":
            card.fail("a surface of nodes has no side of a shell; name elements with SPOS or SNEG")
        parts, sides = [], set()
        for row in card.need_rows("element set, SPOS or SNEG"):
            side = row.text(1).upper()
            if side not in ("SPOS", "SNEG"):
                row.fail(
                    f"'{row.text(1)}' is no side of a shell; give SPOS or SNEG behind the elements"
                )
            sides.add("top" if side == "SPOS" else "bottom")
            parts.append(self._in(card, place, row.text(0), row.index, "elsets"))
        if len(sides) > 1:
            card.fail("the surface has SPOS and SNEG sides; make it two surfaces")
        return distinct(np.concatenate(parts)), sides.pop()

    def _edge_nodes(self, place: str, card: Card) -> Ints:
        """Nodes of a surface of shells by sides, edges E1, E2, ..., or whole elements."""
        n = 3 if self.kind.cell == "triangle" else 4
        table = face_nodes(self.kind.cell, self.kind.order)
        parts = []
        for row in card.need_rows("element set, side or edge"):
            cells = self._in(card, place, row.text(0), row.index, "elsets")
            side = row.text(1).upper()
            if side[:1] == "E" and side[1:].isdigit() and 1 <= int(side[1:]) <= n:
                parts.append(self.cells[cells][:, table[int(side[1:]) - 1]].ravel())
            elif side in ("", "SPOS", "SNEG"):
                parts.append(self.cells[cells].ravel())
            else:
                row.fail(f"'{row.text(1)}' is no side and no edge of a shell")
        return distinct(np.concatenate(parts))

    def _in(self, card: Card, place: str, name: str, index: int, kind: str) -> Ints:
        """Members of a set that a card inside a space names."""
        if place:
            sets = getattr(self.placed[place].space, kind)
            if key(name) in sets:
                return self._of_set(place, sets[key(name)], kind)
            if name.isdigit():
                return self._member(card, f"{place}.{name}", index, kind)
        return self.nodes(card, name, index) if kind == "nsets" else self.elements(
            card, name, index
        )  # fmt: skip

    def surface_is_nodes(self, card: Card, name: str) -> bool:
        """Whether a surface is one of nodes."""
        _, found = self._resolve(card, name, "surfaces", None)
        return bool(found.card.word("TYPE") == "NODE")

    def surface_nodes(self, card: Card, name: str, index: int | None = None) -> Ints:
        """Nodes of a surface of faces or of nodes, ascending."""
        place, found = self.surface_def(card, name, index)
        if found.card.word("TYPE") == "NODE":
            return self._surface_node_list(found.card, place)
        if self.kind.shell:
            return self._edge_nodes(place, found.card)
        return distinct(self.facets_of(place, found).ravel())

    def _surface_node_list(self, card: Card, place: str) -> Ints:
        parts = [
            self._in(card, place, row.text(0), row.index, "nsets")
            for row in card.need_rows("node set")
        ]
        return distinct(np.concatenate(parts))

    def _node_surface(self, card: Card, place: str, *, whole: bool) -> Ints:
        """Faces of a surface of nodes: those on the outside all of whose nodes belong to it."""
        nodes = self._surface_node_list(card, place)
        inside = np.zeros(len(self.points), dtype=bool)
        inside[nodes] = True
        inside[len(self.points) - len(self.parents) :] = True  # centres belong to their face
        rows = self.outside(np.arange(len(self.cells)))
        rows = rows[inside[rows].all(axis=1)]
        lost = np.setdiff1d(nodes[self.used[nodes]], rows)
        text = (
            f"{len(lost) or len(nodes)} of {len(nodes)} nodes of this surface belong to no element "
            "face whose other nodes belong to it as well"
        )
        if not len(rows) or (len(lost) and whole):
            card.fail(f"{text}; define the surface by element faces, TYPE=ELEMENT")
        if len(lost):
            self._warn_once(f"{card.place}: {text}; they are not tied")
        return np.asarray(rows)

    def node_names(self, nodes: Ints) -> tuple[str, ...]:
        """Names of nodes in the deck, "12" or "instance.12"; "-" of nodes that were added."""
        out = ["-"] * len(nodes)
        for placed in self.placed.values():
            labels = placed.space.nodes.labels
            prefix = f"{placed.space.name}." if placed.space is not self.model.root else ""
            mine = (nodes >= placed.first_node) & (nodes < placed.first_node + len(labels))
            for i in np.flatnonzero(mine):
                out[i] = f"{prefix}{int(labels[nodes[i] - placed.first_node])}"
        return tuple(out)

    # -- sets for supports ---------------------------------------------------------------

    def with_centres(self, nodes: Ints) -> Ints:
        """Nodes with the added centres whose parents all are among them, ascending."""
        if not len(self.parents):
            return distinct(nodes)
        inside = np.zeros(len(self.points) + 1, dtype=bool)
        inside[nodes] = True
        inside[-1] = True  # parent -1: none
        whole = inside[self.parents].all(axis=1)
        return distinct(np.concatenate((nodes, self.n_given + np.flatnonzero(whole))))

    def dolfinx_cells(self) -> Ints:
        """Nodes of the cells in DOLFINx order, shape (n_cells, n_cell_nodes)."""
        return np.asarray(self.cells[:, to_dolfinx(self.kind.cell, self.kind.order)])

    def nodal(self, values: Array) -> Array:
        """Values at the deck's nodes extended to the added centres, shape (n_nodes,)."""
        added = (self.weights * values[np.maximum(self.parents, 0)]).sum(axis=1)
        return np.concatenate((values, added))
