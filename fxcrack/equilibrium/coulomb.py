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

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import lapack

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import ConvergenceError

OPEN, STICK, SLIP = 0, 1, 2
"""What a node does; a node without friction that is closed slips."""

_STEPS = 25
"""Newton steps in a row; an active set that settles does so in about ten."""
_SETTLED = 1e-11
"""Largest error of the laws, relative to the largest force."""
_SHORTEST = 1.0 / 64.0
"""Shortest part of a Newton step that is tried."""
_OFTEN = 4
"""So many systems that nothing holds are proof that a body slides."""
_ROUNDS = 6
_SWEEPS = 20
"""Sweeps of the first relaxation; each further one has twice as many."""
ROUND_OFF = 1e-11
"""Gaps, slips and forces below this fraction of the largest one count as zero."""
_FEW = 0.2
"""Part of the jumps up to which products with the others left out are faster."""
_SINGULAR = 1e-13
"""A pivot below this fraction of the largest one: nothing holds a body."""


class Sliding(ArithmeticError):
    """With these states nothing holds a body any more."""


@dataclass(frozen=True)
class ContactBlock:
    """The contact problem at given loads.

    Attributes:
        stiffness: K, shape (m d, m d), positive semidefinite, force/length.
        gap: Initial gaps, shape (m,), length.
        mu: Friction coefficients, shape (m,).
        factored: The last matrix in the plane with its factor, by the key of its states.
    """

    stiffness: Array
    gap: Array
    mu: Array
    factored: dict[bytes, tuple[Array, tuple[Array, Ints]]] = field(
        default_factory=dict, compare=False
    )

    @property
    def dim(self) -> int:
        """d, jumps per node."""
        return len(self.stiffness) // max(len(self.mu), 1)

    def forces(self, jump: Array, load: Array) -> Array:
        """Contact forces p, shape (m, d), of jumps, shape (m, d), at a load g, shape (m d,)."""
        flat = jump.ravel()
        moved = np.flatnonzero(flat)
        if len(moved) <= _FEW * len(flat):
            # K is symmetric: only the rows of what has moved
            return np.asarray(flat[moved] @ self.stiffness[moved] - load).reshape(jump.shape)
        return np.asarray(self.stiffness @ flat - load).reshape(jump.shape)


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
        return bytes(self.status.tobytes() + (signs + 0.0).tobytes())

    def switched(self, nodes: Ints, status: Ints, direction: Array) -> NodeStates:
        """Other states at some nodes.

        Args:
            nodes: Which nodes, shape (k,).
            status: Their new OPEN, STICK or SLIP, shape (k,).
            direction: Their new slip directions, shape (k, d - 1).
        """
        new = NodeStates(self.status.copy(), self.direction.copy())
        new.status[nodes], new.direction[nodes] = status, direction
        return new


@dataclass(frozen=True)
class FrictionState:
    """What the contact nodes with friction remember.

    Attributes:
        where: Pair and slave node, shape (m, 2).
        states: Open, stick or slip, with slip directions.
        reference: Tangential jumps of the last accepted state, shape (m, d - 1), length.
        error: Difference of the two ways to compute the dissipation so far, energy.
    """

    where: Ints
    states: NodeStates
    reference: Array
    error: float


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
    right = load[rows].copy()
    nodes = np.flatnonzero(slips)
    key = states.key() if d == 2 else b""
    if key in block.factored:
        matrix, factor = block.factored[key]
        right[np.searchsorted(rows, nodes * d + 1)] += (
            block.mu[nodes] * states.direction[nodes, 0] * load[nodes * d]
        )
        right -= matrix @ jump.ravel()
        jump.ravel()[rows] = _back(factor, right)
        return jump
    matrix = k[rows]
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
    factor = _factor(matrix[:, rows])
    if key:
        block.factored.clear()
        block.factored[key] = matrix, factor
    jump.ravel()[rows] = _back(factor, right)
    return jump


def _factor(matrix: Array) -> tuple[Array, Ints]:
    lu, pivots, info = lapack.dgetrf(matrix)
    diagonal = np.abs(np.diagonal(lu))
    # a body that can slide leaves a row of round-off
    if info != 0 or diagonal.min() <= _SINGULAR * diagonal.max():
        raise Sliding
    return lu, pivots


def _back(factor: tuple[Array, Ints], right: Array) -> Array:
    x, _ = lapack.dgetrs(*factor, right)
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
    newton = _Newton(block, load, reference)
    slid = 0
    try:
        newton.try_jump(jumps_of(block, load, states, reference), states)
    except Sliding:
        slid += 1
        newton.try_jump(start, states)
    for attempt in range(_ROUNDS):
        for damped in (False, True):
            try:
                found = newton.run(damped=damped)
            except Sliding:
                slid, found = slid + 1, None
            if found is not None:
                return found
        if slid > _OFTEN:
            break
        relaxed, states = _relax(block, load, reference, newton.best, _SWEEPS * 2**attempt)
        newton.least = np.inf
        newton.try_jump(relaxed, states)
    states = newton.states
    raise ConvergenceError(
        f"friction: no equilibrium found for {len(block.mu)} contact nodes "
        f"({int((states.status == STICK).sum())} stick, {int((states.status == SLIP).sum())} slip, "
        f"forces out of balance by {newton.least:.1e} of the largest one)"
        "; take smaller increments. If friction alone should hold a body it slides now: support "
        "it, or pull it by a prescribed displacement"
    )


class _Newton:
    """Semismooth Newton steps; the best jumps so far are kept.

    Attributes:
        jump: Present jumps.
        best: Jumps of the least error so far.
        states: What the nodes do there.
        least: That error, relative to the forces.
    """

    def __init__(self, block: ContactBlock, load: Array, reference: Array) -> None:
        self.block, self.load, self.reference = block, load, reference
        m, d = len(block.mu), block.dim
        self.r = np.diagonal(block.stiffness).reshape(m, d).max(axis=1)
        self.scale = max(np.abs(load).max(initial=0.0), np.abs(self.r * block.gap).max(initial=0.0))
        self.least = np.inf
        self.steps = 0

    def try_jump(self, jump: Array, states: NodeStates) -> float:
        """Go to jumps and find the states the projections give; the error there."""
        force = self.block.forces(jump, self.load)
        new, self.lean, error = _project(
            self.block, jump, force, self.reference, states, self.r, self.scale
        )
        self.jump, self.force, self.states, self.error = jump, force, new, error
        if error < self.least:
            self.least, self.best, self.best_states = error, jump, new
        return error

    def run(self, *, damped: bool) -> Increment | None:
        """Steps from the best jumps; ``None`` if they do not settle."""
        error = self.try_jump(self.best, self.best_states)
        seen: set[bytes] = set()
        for _ in range(_STEPS):
            if error <= _SETTLED:
                return Increment(self.jump, self.force, self.states, self.steps)
            key = self.states.key()
            if not damped and self.block.dim == 2 and key in seen:
                return None
            seen.add(key)
            self.steps += 1
            old, states = self.jump, self.states
            new = jumps_of(self.block, self.load, states, self.reference, self.lean)
            before, error = error, self.try_jump(new, states)
            part = 1.0
            while damped and error > (1.0 - 0.1 * part) * before:
                part *= 0.5
                if part < _SHORTEST:
                    return None
                error = self.try_jump(old + part * (new - old), states)
        return None


def _project(
    block: ContactBlock,
    jump: Array,
    force: Array,
    reference: Array,
    old: NodeStates,
    r: Array,
    scale: float,
) -> tuple[NodeStates, tuple[Array, Array], float]:
    """States by the projections of Alart and Curnier; beta and r; the largest error of the laws."""
    was_closed, stuck = old.status != OPEN, old.status == STICK
    small = ROUND_OFF * scale
    normal = force[:, 0] - r * (jump[:, 0] + block.gap)
    # on the edge a node stays what it was
    closed = np.where(was_closed, normal >= -small, normal > small)
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
    length = np.where(turned, size, 1.0)
    direction = np.where(turned[:, None], -trial / length[:, None], old.direction)
    beta = np.where(turned, np.minimum(bound / length, 1.0), 0.0)
    inside = np.where(size > bound, bound / np.where(size > 0.0, size, 1.0), 1.0)
    off = np.maximum(
        np.abs(force[:, 0] - np.maximum(normal, 0.0)),
        np.linalg.norm(force[:, 1:] - inside[:, None] * trial, axis=1),
    ).max(initial=0.0)
    return NodeStates(status, direction), (beta, r), float(off / scale) if off > 0.0 else 0.0


def _relax(
    block: ContactBlock, load: Array, reference: Array, jump: Array, sweeps: int
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
    for _ in range(sweeps):
        for i in range(m):
            own = slice(i * d, (i + 1) * d)
            here = ContactBlock(k[own, own], block.gap[i : i + 1], block.mu[i : i + 1])
            right = residual[own] + here.stiffness @ flat[own]
            try:
                new, status[i], direction[i] = _alone(
                    here, right, reference[i : i + 1], direction[i]
                )
            except (Sliding, np.linalg.LinAlgError):
                continue  # nothing holds it but its neighbours
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
