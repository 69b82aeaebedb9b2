"""Interfaces of a scene as cards of a deck: surfaces, contact pairs, ties, bonds."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.face import Face
from fxcrack.deck.gather import Gathered
from fxcrack.deck.lines import number, set_lines
from fxcrack.deck.write_explicit import explicit_interface
from fxcrack.deck.write_mesh import MeshLines
from fxcrack.deck.write_rigid import rigid_lines
from fxcrack.deck.write_steps import refuse
from fxcrack.interface.definition import Interface
from fxcrack.interface.pair import Pair
from fxcrack.scene import Scene
from fxcrack.steps.debond import Debond


def nodal_toughness(debond: Debond, pair: Pair) -> Array | None:
    """Toughness at the slave nodes where it varies along them, shape (n_nodes, 3)."""
    criterion = debond.criterion
    given = [getattr(criterion, name, None) for name in ("GIc", "GIIc", "GIIIc")]
    if not any(callable(v) or np.ndim(v) > 0 for v in given if v is not None):
        return None
    n = pair.surface.n_nodes
    x = pair.surface.x[:, : pair.frames.shape[1]]
    return np.asarray(criterion.toughness_at(x, np.arange(n), n_slave=n))  # type: ignore[attr-defined]


class InterfaceLines:
    """Writes the interfaces of a scene.

    Args:
        scene: The scene.
        mesh: Its mesh, on rank 0; the others find the same refusals.
        body: Writes the mesh.
        toughness: Of each debond, shape (n_nodes, 3), where it varies along the interface.
        explicit: Whether the steps are explicit.

    Attributes:
        in_step: History data of contact, of explicit steps.
    """

    def __init__(
        self,
        scene: Scene,
        mesh: Gathered | None,
        body: MeshLines,
        toughness: list[Array | None],
        *,
        explicit: bool,
    ) -> None:
        self.scene, self.mesh, self.toughness, self.explicit = scene, mesh, toughness, explicit
        self._body = body
        self.in_step: list[str] = []

    def lines(self) -> list[str]:
        """Model data of all interfaces."""
        out: list[str] = []
        debonds = list(self.scene.debonds)
        for i, pair in enumerate(self.scene.pairs):
            interface = pair.interface
            debond = debonds[i] if i < len(debonds) else None
            out += self._interface(pair, interface, debond is not None)
            rates = self.toughness[i] if debond is not None else None
            if rates is not None:
                out.append("*NODAL ENERGY RATE")
                nodes = self._slave_numbers(pair, np.ones(pair.surface.n_nodes, dtype=bool))
                out += [
                    f"{node + 1}, " + ", ".join(number(g) for g in row)
                    for node, row in zip(nodes, rates, strict=True)
                    if self.mesh is not None and not self._body.dropped[node]
                ]
        return out

    def _interface(self, pair: Pair, interface: Interface, debonds: bool) -> list[str]:
        title = interface.title
        if interface.stiffness is not None:
            refuse(f"interface '{title}': stiffness of bonds")
        if interface.pairing is not None and self.explicit:
            refuse(f"interface '{title}': pairing='{interface.pairing}'")
        if callable(interface.friction):
            refuse(f"interface '{title}': friction as a function of position")
        slave, master = title, f"{title} master"
        out: list[str] = []
        if interface.is_rigid and self.explicit:
            refuse(f"interface '{title}': a rigid master in explicit steps")
        if interface.is_rigid:
            gdim = self.scene.mesh.gdim
            node, _ = self._body.reference_node((title, "rigid master"))
            out += rigid_lines(pair, master, node, gdim, self.scene.input.model)
        if self.mesh is not None:
            for name, face in ((slave, pair.sides[0]), (master, pair.sides[1])):
                if not isinstance(face, str | Face):
                    continue
                out += self._body.named_surface(name, face)
        whole = not debonds and not interface.contact and not interface.is_rigid
        if whole and pair.bonded[pair.paired].all():
            reach = interface.tolerance
            within = "" if reach is None else f", POSITION TOLERANCE={number(float(reach))}"
            head = f'*TIE, NAME="{title}"{within}{_type(interface)}'
            return [*out, head, f'"{slave}", "{master}"']
        if not interface.contact:
            log.warn(
                "write_deck: interface '%s' has no contact, but open faces of a deck touch", title
            )
        if self.explicit:
            return out + self._general(pair, interface)
        adjust = ", ADJUST=0." if interface.gap == "adjust" else ""
        out += [
            f'*SURFACE INTERACTION, NAME="{title}"',
            *([number(pair_thickness)] if (pair_thickness := self._thickness()) else []),
            *(["*FRICTION", number(float(interface.friction))] if interface.friction else []),
            f'*CONTACT PAIR, INTERACTION="{title}", SMALL SLIDING{adjust}{_type(interface)}',
            f'"{slave}", "{master}"',
        ]
        if pair.bonded.any():
            normal = ", NORMAL" if interface.normal_only else ""
            name = f"{title} bonded"
            bonded = np.sort(self._slave_numbers(pair, pair.bonded))
            if self.mesh is not None:
                out += set_lines("NSET", name, bonded[~self._body.dropped[bonded]])
            out += [
                f"*INITIAL CONDITIONS, TYPE=CONTACT{normal}",
                f'"{slave}", "{master}", "{name}"',
            ]
        return out

    def _general(self, pair: Pair, interface: Interface) -> list[str]:
        """Model data of an interface in explicit dynamics; its history data are kept."""
        at = next((i for i, d in enumerate(self.scene.debonds) if d.interface is interface), None)
        debond = None if at is None else self.scene.debonds[at]
        found = explicit_interface(
            interface,
            None if debond is None else debond.criterion,
            None if debond is None else debond.release,
            bonded=bool(pair.bonded.any()),
            nodal=at is not None and self.toughness[at] is not None,
            thickness=self._thickness(),
        )
        self.in_step += found.in_step
        out: list[str] = []
        if pair.bonded.any() and self.mesh is not None:
            bonded = np.sort(self._slave_numbers(pair, pair.bonded))
            out = set_lines(
                "NSET", f"{interface.title} bonded", bonded[~self._body.dropped[bonded]]
            )
        return out + found.in_model

    def _thickness(self) -> float:
        return float(getattr(self.scene.input.model, "thickness", 0.0))

    def _slave_numbers(self, pair: Pair, chosen: Bools) -> Ints:
        """Nodes of the input at some slave nodes, in their order."""
        if self.mesh is None:
            return np.zeros(0, dtype=np.int64)
        face = pair.sides[0]
        if isinstance(face, Face):
            nodes, points = self._body.side_points(face)
        else:
            nodes = self._body.facet_nodes(self.mesh.groups[face][1])
            points = self.mesh.points[nodes]
        gdim = self.mesh.points.shape[1]
        _, at = cKDTree(points).query(pair.surface.x[chosen][:, :gdim])
        return np.asarray(nodes[at])


def _type(interface: Interface) -> str:
    """Parameter of a pair that says how nodes follow the master, where the scene does."""
    words = {"node-to-surface": "NODE TO SURFACE", "surface-to-surface": "SURFACE TO SURFACE"}
    return "" if interface.pairing is None else f", TYPE={words[interface.pairing]}"


__all__ = ["InterfaceLines", "nodal_toughness"]
