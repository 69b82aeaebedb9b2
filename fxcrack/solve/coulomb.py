"""Unilateral contact with Coulomb friction on a small dense system: pure numpy.

m nodes, each with a normal and 1 or 2 tangential jumps, node after node:

    K delta = g + p,      delta_n >= -gap,   p_n >= 0,   p_n (delta_n + gap) = 0,
    |p_t| <= mu p_n,      p_t = -mu p_n v/|v| where a closed node slips with velocity v.

p are the forces of the contact on the slave side. An increment of backward Euler has the slip
delta_t - reference in the place of v. It is solved by the semismooth Newton method of Alart and
Curnier (1991), in the form of Hueeber, Stadler and Wohlmuth (2008): with one tangential jump this
is an active set method, each step of which solves a linear system. Where it does not settle, node
by node relaxation (Jean 1999), which lowers the energy at given friction bounds, brings it nearer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

from fxcrack.errors import ConvergenceError

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

OPEN, STICK, SLIP = 0, 1, 2
"""What a node does; a node without friction that is closed slips."""

_STEPS = 40
"""Newton steps before relaxation; an active set that settles does so in about ten."""
_ROUNDS = 8
_SWEEPS = 30
ROUND_OFF = 1e-11
"""Gaps, slips and forces below this fraction of the largest one count as zero."""
_SINGULAR = 1e-13
"""A pivot below this fraction of the largest one: nothing holds a body."""


class Sliding(ArithmeticError):
    """With these states nothing holds a body any more."""


@dataclass(frozen=True)
class ContactBlock:
    """The contact problem at given loads.

    Attributes:
        stiffness: K, shape (m d, m d), positive semidefinite.
        gap: Initial gaps, shape (m,), length.
        mu: Friction coefficients, shape (m,).
    """

    stiffness: Array
    gap: Array
    mu: Array

    @property
    def dim(self) -> int:
        """d, jumps per node."""
        return len(self.stiffness) // max(len(self.mu), 1)

    def forces(self, jump: Array, load: Array) -> Array:
        """P of given jumps, shape (m, d)."""
        return np.asarray(self.stiffness @ jump.ravel() - load).reshape(jump.shape)


@dataclass(frozen=True)
class NodeStates:
    """What the nodes do.

    Attributes:
        status: OPEN, STICK or SLIP, shape (m,).
        direction: Unit vector of the slip where a node slips, shape (m, d - 1).
    """

    status: Ints
    direction: Array

    def key(self) -> bytes:
        """Equal for equal states."""
        signs = np.sign(self.direction) * (self.status == SLIP)[:, None]
        return self.status.tobytes() + (signs + 0.0).tobytes()

    def switched(self, nodes: Ints, status: Ints, direction: Array) -> NodeStates:
        """Other states at some nodes."""
        new = NodeStates(self.status.copy(), self.direction.copy())
        new.status[nodes], new.direction[nodes] = status, direction
        return new


def jumps_of(
    block: ContactBlock,
    load: Array,
    states: NodeStates,
    place: Array,
    lean: tuple[Array, Array] | None = None,
) -> Array:
    """Jumps with given states, which may violate what contact and friction ask for.

    Args:
        block: The problem.
        load: g, shape (m d,).
        states: What each node does.
        place: Tangential jumps of the nodes that stick, shape (m, d - 1).
        lean: Per node, beta and r of the rows (1 - beta P) p_t + beta r P u = mu p_n e of nodes
            that slip, P the projection across e and u the slip from ``place``; beta = 0 by default.

    Returns:
        Shape (m, d).

    Raises:
        Sliding: The system is singular.
    """
    m, d = len(block.mu), block.dim
    k = block.stiffness
    closed, slips = states.status != OPEN, states.status == SLIP
    jump = np.zeros((m, d))
    jump[closed, 0] = -block.gap[closed]
    jump[states.status == STICK, 1:] = place[states.status == STICK]
    unknown = np.zeros((m, d), dtype=bool)
    unknown[~closed] = True
    unknown[slips, 1:] = True
    rows = np.flatnonzero(unknown)
    if not len(rows):
        return jump
    matrix, right = k[rows], load[rows].copy()
    nodes = np.flatnonzero(slips)
    if len(nodes):
        at = np.searchsorted(rows, (nodes * d)[:, None] + np.arange(1, d))
        tangential, given = matrix[at], right[at]
        if lean is not None and d == 3:
            beta, r = lean[0][nodes], lean[1][nodes]
            e = states.direction[nodes]
            across = beta[:, None, None] * (np.eye(d - 1) - e[:, :, None] * e[:, None, :])
            tangential = tangential - np.einsum("nij,njk->nik", across, tangential)
            given = given - np.einsum("nij,nj->ni", across, given)
            own = r[:, None, None] * across
            columns = (nodes * d)[:, None] + np.arange(1, d)
            for i in range(d - 1):
                for j in range(d - 1):
                    tangential[np.arange(len(nodes)), i, columns[:, j]] += own[:, i, j]
            given = given + np.einsum("nij,nj->ni", own, place[nodes])
        drag = block.mu[nodes, None] * states.direction[nodes]
        matrix[at] = tangential + drag[:, :, None] * k[nodes * d][:, None, :]
        right[at] = given + drag * load[nodes * d][:, None]
    right -= matrix @ jump.ravel()
    jump.ravel()[rows] = _solve(matrix[:, rows], right)
    return jump


def _solve(matrix: Array, right: Array) -> Array:
    lu, pivots, info = lapack.dgetrf(matrix)
    diagonal = np.abs(np.diagonal(lu))
    # a body that can slide leaves a row of round-off
    if info != 0 or diagonal.min() <= _SINGULAR * diagonal.max():
        raise Sliding
    x, _ = lapack.dgetrs(lu, pivots, right)
    return np.asarray(x)


@dataclass(frozen=True)
class Increment:
    """Result of an increment of backward Euler.

    Attributes:
        jump: Shape (m, d), length.
        force: P, shape (m, d).
        states: What each node did.
        steps: Linear systems solved.
    """

    jump: Array
    force: Array
    states: NodeStates
    steps: int


def backward_euler(
    block: ContactBlock, load: Array, reference: Array, states: NodeStates, start: Array
) -> Increment:
    """One increment of backward Euler from committed tangential jumps.

    Args:
        block: The problem.
        load: g at the end of the increment, shape (m d,).
        reference: Tangential jumps at its beginning, shape (m, d - 1).
        states: What the nodes do to begin with.
        start: Jumps to begin with, shape (m, d).

    Raises:
        ConvergenceError: No solution was found.
    """
    found, steps, jump = None, 0, start
    slid = False
    for _ in range(_ROUNDS):
        try:
            found, done = _newton(block, load, reference, states)
            steps += done
        except Sliding:
            slid = True
        if found is not None:
            return replace(found, steps=steps)
        jump, states = _relax(block, load, reference, jump)
    force = block.forces(jump, load)
    raise ConvergenceError(
        f"friction: no equilibrium found for {len(block.mu)} contact nodes "
        f"({int((states.status == STICK).sum())} stick, {int((states.status == SLIP).sum())} slip, "
        f"largest pressure force {force[:, 0].max(initial=0.0):.3g})"
        + (
            "; a body that friction alone should hold slides: support it, or pull it by a "
            "prescribed displacement"
            if slid
            else "; take smaller increments"
        )
    )


def _newton(
    block: ContactBlock, load: Array, reference: Array, states: NodeStates
) -> tuple[Increment | None, int]:
    """Semismooth Newton steps from given states; ``None`` if they do not settle."""
    m, d = len(block.mu), block.dim
    r = np.diagonal(block.stiffness).reshape(m, d).max(axis=1)
    lean: tuple[Array, Array] | None = None
    seen: set[bytes] = set()
    for step in range(1, _STEPS + 1):
        jump = jumps_of(block, load, states, reference, lean)
        force = block.forces(jump, load)
        new, lean, error = _next_states(block, jump, force, reference, states, r)
        # a direction that turns is no new state but has to settle as well
        settled = np.array_equal(new.status, states.status) and error <= 1e-10
        if settled:
            return Increment(jump, force, new, step), step
        states = new
        if d == 2:
            key = states.key()
            if key in seen:
                return None, step
            seen.add(key)
    return None, _STEPS


def _next_states(
    block: ContactBlock, jump: Array, force: Array, reference: Array, old: NodeStates, r: Array
) -> tuple[NodeStates, tuple[Array, Array], float]:
    """States by the projections of Alart and Curnier; beta and r; error of the slip law."""
    was_closed, stuck = old.status != OPEN, old.status == STICK
    small = ROUND_OFF * max(np.abs(force).max(initial=0.0), float(np.abs(r * block.gap).max()))
    normal = force[:, 0] - r * (jump[:, 0] + block.gap)
    # on the edge a node stays what it was
    closed = normal >= np.where(was_closed, -small, small)
    closed &= was_closed | (normal > 0.0)
    slip = jump[:, 1:] - reference
    trial = force[:, 1:] - r[:, None] * slip
    size = np.linalg.norm(trial, axis=1)
    bound = block.mu * np.maximum(normal, 0.0)
    sticks = closed & (block.mu > 0.0) & (size <= bound + np.where(stuck, small, -small))
    # without pressure and slip nothing tells stick from slip
    sticks |= closed & stuck & (size <= small)
    slips = closed & ~sticks
    status = np.where(sticks, STICK, np.where(slips, SLIP, OPEN))
    turned = slips & (size > small)
    direction = np.where(
        turned[:, None], -trial / np.where(turned, size, 1.0)[:, None], old.direction
    )
    away = force[:, 1:] + block.mu[:, None] * force[:, :1] * direction
    error = np.abs(away[slips]).max(initial=0.0)
    scale = np.abs(force).max(initial=0.0)
    beta = np.where(turned, np.minimum(bound / np.where(turned, size, 1.0), 1.0), 0.0)
    relative = float(error / scale) if error > 0.0 else 0.0
    return NodeStates(status, direction), (beta, r), relative


def _relax(
    block: ContactBlock, load: Array, reference: Array, jump: Array
) -> tuple[Array, NodeStates]:
    """Solve node by node, the others held, in sweeps."""
    m, d = len(block.mu), block.dim
    k = block.stiffness
    jump = jump.copy()
    flat = jump.ravel()
    status = np.zeros(m, dtype=np.int64)
    direction = np.zeros((m, d - 1))
    direction[:, 0] = 1.0
    residual = load - k @ flat
    for _ in range(_SWEEPS):
        for i in range(m):
            own = slice(i * d, (i + 1) * d)
            here = ContactBlock(k[own, own], block.gap[i : i + 1], block.mu[i : i + 1])
            right = residual[own] + here.stiffness @ flat[own]
            new, status[i], direction[i] = _alone(here, right, reference[i : i + 1], direction[i])
            change = new - flat[own]
            if np.any(change):
                residual -= k[:, own] @ change
                flat[own] = new
    return jump, NodeStates(status, direction)


def _alone(
    block: ContactBlock, load: Array, reference: Array, direction: Array
) -> tuple[Array, int, Array]:
    """Jump, status and slip direction of a single node."""
    jump = np.linalg.solve(block.stiffness, load)
    if jump[0] + block.gap[0] >= 0.0:
        return jump, OPEN, direction
    stuck = np.concatenate([-block.gap, reference[0]])
    force = block.stiffness @ stuck - load
    size = float(np.linalg.norm(force[1:]))
    if size <= block.mu[0] * force[0]:
        return stuck, STICK, direction
    e = -force[1:] / size if size > 0.0 else direction
    for _ in range(20):
        states = NodeStates(np.array([SLIP]), e[None])
        jump = jumps_of(block, load, states, reference)[0]
        slip = jump[1:] - reference[0]
        length = float(np.linalg.norm(slip))
        if length == 0.0 or len(e) == 1:
            break
        turned = slip / length
        if np.abs(turned - e).max() < 1e-12:
            break
        e = turned
    return jump, SLIP, e
