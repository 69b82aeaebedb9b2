"""Modes of crack closure between two materials, for a stated length of closure.

Around a crack between two materials the tractions ahead and the openings behind turn with the
distance from the tip, both as r^{i eps} (Rice 1988). The split of crack closure by modes is
therefore that of the length d of its elements, and does not converge with the mesh (Sun and Jih
1987). Its sum does, and the way in which the split depends on d is known. With the oscillating pair
of traction and opening written as complex numbers F and w
(:mod:`fxcrack.criteria.crack_tip_fields`),

    G = Re(F conj(w)),    D = F w = |D| e^{2 i psi(d)},    psi(l) = psi(d) + eps ln(l/d)

so that the angle psi of one mesh gives that of any other length l (Toya 1992; Beuth 1996), and

    G_I = G cos^2 psi(l),    G_II = G sin^2 psi(l)

for materials with a plane of symmetry in the crack. Dividing by |D| leaves out the constant angle
between force and opening, 1 - G/|D| of the order of eps^2: no mode is negative, and at l = d the
rates are those of plain crack closure to that order.

Crack closure over a length d sees the fields nearer to the tip on the whole. In the asymptotic
field, with K l^{i eps} of angle psi_K(l), its integral gives

    psi(d) = psi_K(d) + arg Gamma(1/2 + i eps) - 1/2 arg Gamma(2 + 2 i eps)

which for small eps is the angle of K at the length d exp(digamma(1/2) - digamma(2)) = 0.092 d
(:func:`closure_angle`).
"""

from __future__ import annotations

import numpy as np
from scipy.special import loggamma

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.temperature import ByTemperature
from fxcrack.criteria.cell_laws import law_of
from fxcrack.criteria.closure_lengths import length_of_force
from fxcrack.criteria.crack_tip_fields import TipFields
from fxcrack.criteria.evaluator import at_rows
from fxcrack.criteria.probe import FrontProbe
from fxcrack.interface.front import Front
from fxcrack.interface.tips import Tips

_TURN = 1.0
"""Degrees by which the modes may turn with elements half as long before it is told."""


def closure_angle(oscillation: float) -> float:
    """Angle of the modes of crack closure over a length beyond that of K at this length.

    Args:
        oscillation: Oscillation index eps.

    Returns:
        Angle [radians]; about -2.386 eps.
    """
    pair = loggamma(0.5 + 1j * oscillation) - 0.5 * loggamma(2.0 + 2j * oscillation)
    return float(pair.imag)


class ModesAtLength:
    """Splits rates of crack closure on one interface by modes at a stated length.

    Args:
        probe: The interface.
        length: Length of closure [length].

    Raises:
        InputError: The bodies are shells, or their stiffness changes with the temperature.
    """

    def __init__(self, probe: FrontProbe, length: float) -> None:
        self._probe, self._length = probe, length
        self._title = probe.pair.title
        continuum = probe.bodies.continuum
        refused = ""
        if isinstance(continuum, ShellBodies) or continuum.shell_cells:
            refused = "shells"
        elif any(isinstance(m, ByTemperature) for m in continuum.part_materials):
            refused = "stiffness tabulated against temperature"
        if refused:
            raise InputError(
                f"interface '{self._title}': mode_length does not cover {refused}, as the "
                "crack-tip fields of the two materials must be known; leave it out"
            )
        self._stiffness = [law_of(continuum, i).whole for i in range(len(continuum.part_materials))]
        self._above = continuum.parts_at(probe.pair.surface.dofs)
        below = continuum.parts_at(probe.pair.masters.ravel())
        held = np.abs(probe.pair.weights)[..., None] > 1e-9
        self._below = (below.reshape(*held.shape[:2], -1) & held).any(axis=1)
        self._said = False
        self._fields: dict[bytes, tuple[Array, float]] = {}
        self._front: tuple[int, Front] | None = None
        self._known: dict[int, tuple[Array, float]] = {}

    def split(
        self, tips: Tips, force: Array, opening: Array, weights: Array, plain: Array, lengths: Array
    ) -> Array:
        """Rates by mode at the stated length.

        Args:
            tips: Front nodes.
            force: Bond forces in their frames, shape (n, k, 3) [force].
            opening: Openings they are multiplied with, likewise [length].
            weights: What the products are multiplied with, shape (n, k) [1/length^2].
            plain: Rates by crack closure, shape (n, 3) [force/length]. They stay where the faces
                are closed, between materials without oscillation, and at the last node between two
                open parts.
            lengths: Length of closure of each tip, shape (n,) [length].

        Returns:
            Shape (n, 3) [force/length]; each row has the sum that it had.
        """
        spans, eps = self._of(tips)
        rows = np.flatnonzero((eps != 0.0) & ~tips.ligament & (plain[:, 0] != 0.0))
        rows = rows[(opening[rows, :, 0] >= 0.0).all(axis=1)]
        if not len(rows):
            return plain
        span, w, f = spans[rows], opening[rows], force[rows]
        back = np.linalg.inv(span)
        pulled = np.einsum("nij,nkj->nki", span, f)
        opened = np.einsum("nji,nkj->nki", back, w)
        pair_f, pair_w = (x[..., 0] + 1j * x[..., 1] for x in (pulled, opened))
        share = weights[rows]
        whole = (share * (pair_f * pair_w.conj()).real).sum(axis=1)
        third = (share * pulled[..., 2] * opened[..., 2]).sum(axis=1)
        twice = np.angle((share * pair_f * pair_w).sum(axis=1))
        angle = 0.5 * twice + eps[rows] * np.log(self._length / lengths[rows])
        unit = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(rows))], axis=1)
        # traction and opening of one unit of energy in the pair, component by component
        parts = np.einsum("nij,nj->ni", back, unit) * np.einsum("nji,nj->ni", span, unit)
        alone = back[:, :, 2] * span[:, 2]
        out = plain.copy()
        good = whole > 0.0
        out[rows[good]] = (whole[:, None] * parts + third[:, None] * alone)[good]
        return out

    def oscillation(self, tips: Tips) -> Array:
        """Oscillation index of each tip, shape (n,); collective.

        Where cells of several materials meet on one side, that of the first of them.
        """
        self._said, said = True, self._said
        eps = self._of(tips)[1]
        self._said = said
        return eps

    def _of(self, tips: Tips) -> tuple[Array, Array]:
        """What takes tractions to the oscillating pair and the third, and eps, of each tip."""
        front = self._probe.front
        if self._front is None or self._front[0] != front.version:
            self._front = front.version, front.undeformed()
            self._known = {}
        spans, eps = np.empty((len(tips), 3, 3)), np.empty(len(tips))
        for i, node in enumerate(tips.node.tolist()):
            found = self._known.get(node)
            if found is None:
                found = self._known[node] = self._at(node, self._front[1].tip(node).frame)
            spans[i], eps[i] = found
        return spans, eps

    def _at(self, node: int, frame: Array) -> tuple[Array, float]:
        """The same of one node in components (normal, growth direction, front tangent)."""
        parts = [self._part(node, on[node]) for on in (self._above, self._below)]
        key = np.array(parts).tobytes() + np.round(frame, 9).tobytes()
        if key not in self._fields:
            above, below = (self._stiffness[p] for p in parts)
            fields = TipFields(above, below, frame, self._length)
            axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
            self._fields[key] = fields.span @ axes, fields.oscillation
        return self._fields[key]

    def _part(self, node: int, on: Bools) -> int:
        """Part of the continuum on one side of a node."""
        if on.sum() > 1 and not self._said:
            self._said = True
            log.warn(
                "interface '%s': cells of several materials meet on one side of the tip at %s; "
                "the modes at mode_length are those of the first of them there",
                self._title,
                format_point(self._probe.pair.surface.x[node]),
            )
        return int(np.argmax(on))


def lengths_of_closure(tips: Tips, order: int, method: str) -> Array:
    """Lengths over which cracks are closed, shape (n,) [length].

    Args:
        tips: Front nodes.
        order: Products of force and opening per node, as there are orders of elements.
        method: "vcct", which takes force and opening of even spacing, or "closure", the element
            ahead.
    """
    on = tips.d_ahead > 0.0
    if method == "closure":
        return np.where(on, tips.d_ahead, tips.d_behind)
    ahead = np.where(on & tips.straight, tips.d_ahead, tips.d_behind)
    return length_of_force(ahead, tips.d_behind, min(order, 2))


def warn_of_turning_modes(probe: FrontProbe) -> None:
    """Warn where a mode mix decides between two materials and belongs to the element length.

    Nothing is said where :class:`ModesAtLength` does not know the fields (shells, moduli tabulated
    against temperature, explicit dynamics). First, middle and last tip are looked at; collective.

    Args:
        probe: The interface, with its front in the initial state.
    """
    tips = probe.front.tips()
    if probe.pair.rigid is not None or not len(tips):
        return
    try:
        if len(probe.bodies.continuum.part_materials) < 2:
            return
        modes = ModesAtLength(probe, 1.0)
    except InputError:
        return
    some = np.unique([0, len(tips) // 2, len(tips) - 1])
    eps = modes.oscillation(at_rows(tips, some))
    turn = float(np.degrees(np.log(2.0) * np.abs(eps).max()))
    if turn > _TURN:
        log.warn(
            "interface '%s' lies between two materials, where the modes of crack closure belong to "
            "the length of the elements: they turn by %.2g degrees of phase each time elements "
            "become half as long (oscillation index %.2g), and toughness at the mode mix changes "
            "with them; state the length for which the toughness was found, mode_length=...",
            probe.pair.title,
            turn,
            float(np.abs(eps).max()),
        )
