"""Dofs that follow others: rows of the transformation for couplings and equations.

A coupled set moves with its reference as a rigid body. With the motions q of the reference of which
some (p) are prescribed and the others (f) free, the displacement of its dofs is

    u = R_p q_p + R_f q_f

A basis W of the free motions, shape (n, k), is chosen that is the identity at k dofs of the set
(:func:`fxcrack.interface.set_motions.motion_basis`); these dofs keep their own displacement, and
every other one follows them:

    u_i = sum_k W_ik u_k + (R_p,i - sum_k W_ik R_p,k) q_p

so that no unknown is added. Where the mean motion follows, q = (R^t w R)^-1 R^t w u = A u with the
weights w, one dof follows for each prescribed motion, u_i = (A_pi)^-1 (q_p - A_pk u_k). q_p are
columns like those of supports; the forces conjugate to them
are the resultants on the reference. Where supports hold dofs of the set at zero, W spans the
motions alone that leave them at rest. An equation sum_i a_i u_i = 0 is such a row already; rows
whose dofs follow others in turn are composed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.couplings import MOTIONS, Constraint, Coupling, Equation
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.interface.set_motions import FREE, coupled_motions, motion_basis

_SAME = 1e-6
"""Distance of nodes that an equation matches, over the size of their group."""


@dataclass(frozen=True)
class Prescribed:
    """A prescribed motion of a reference, or side of an equation: a column of the transformation.

    Attributes:
        title: Name in the history, e.g. "block.rz".
        constraint: The coupling or equation it belongs to.
        value: At amplitude 1, length or radians.
    """

    title: str
    constraint: Constraint
    value: float


@dataclass(frozen=True)
class Following:
    """All dofs that follow others; the same on every rank.

    Attributes:
        dofs: Global dofs that follow, ascending, shape (n,).
        masters: Global dofs that are followed, ascending, shape (m,).
        matrix: What a dof takes of each followed one, shape (n, m).
        prescribed: What a dof takes of each prescribed motion, shape (n, n_prescribed).
        sets: Number of the constraint of each dof that follows or is followed, by global dof.
    """

    dofs: Ints
    masters: Ints
    matrix: sp.csr_matrix
    prescribed: sp.csr_matrix
    sets: dict[int, int]

    def mine(self, layout: DofLayout) -> tuple[slice, Ints]:
        """Which followers this rank owns, and their numbers among its own dofs."""
        low, high = np.searchsorted(self.dofs, [layout.offset, layout.offset + layout.n_local])
        return slice(int(low), int(high)), self.dofs[low:high] - layout.offset

    def share_masters(self, layout: DofLayout, owned: Array) -> Array:
        """Values of followed dofs on all ranks; collective.

        Args:
            layout: Unknowns of nodes and their numbers.
            owned: Values of the dofs that this rank owns, shape (n_local, ...).
        """
        low, high = np.searchsorted(self.masters, [layout.offset, layout.offset + layout.n_local])
        here = owned[self.masters[low:high] - layout.offset]
        return np.concatenate(layout.comm.allgather(here))

    def residual(self, layout: DofLayout, owned: Array) -> Array:
        """u_i - sum_k W_ik u_k of this rank's followers, shape (n_mine, ...); collective.

        Args:
            layout: Unknowns of nodes and their numbers.
            owned: Values of the dofs that this rank owns, shape (n_local, m).
        """
        rows, local = self.mine(layout)
        masters = self.share_masters(layout, owned)
        return np.asarray(owned[local] - self.matrix[rows] @ masters)

    def marks(self, dofs: Ints) -> Bools:
        """Which of some global dofs follow or are followed, shape of ``dofs``."""
        return np.asarray(np.isin(dofs, self.dofs) | np.isin(dofs, self.masters))


class _Rows:
    """Collects the rows of all constraints, the same on every rank.

    Args:
        continuum: The bodies.
        held: Support column of each owned dof, -1 where free, shape (n_local,).
        value: Entry of that column, shape (n_local,).
        moves: Whether the value of each of these columns ever differs from zero.
        titles: Their names.
    """

    def __init__(
        self,
        continuum: Continuum,
        held: Ints,
        value: Array,
        moves: Bools,
        titles: Sequence[str],
    ) -> None:
        self._continuum = continuum
        self._layout = continuum.layout
        self._held, self._value, self._moves, self._titles = held, value, moves, titles
        self.prescribed: list[Prescribed] = []
        self.rows: dict[int, dict[int, float]] = {}
        self.shares: dict[int, dict[int, float]] = {}
        self.sets: dict[int, int] = {}
        self._owner: dict[int, str] = {}

    def _nodes(self, where: str) -> tuple[Ints, Array, Array, Ints, Array]:
        """Global nodes of a group with positions, directors, support columns and their entries.

        Collective.
        """
        continuum, layout = self._continuum, self._layout
        local = continuum.owned_nodes(where).astype(np.int64)
        x = continuum.positions()[local]
        directors = np.zeros_like(x)
        if isinstance(continuum, ShellBodies):
            directors = continuum.directors[local]
        dofs = layout.dofs(local)
        mine = local + layout.first_node, x, directors, self._held[dofs], self._value[dofs]
        parts = layout.comm.allgather(mine)
        nodes, x, directors, columns, values = (np.concatenate(p) for p in zip(*parts, strict=True))
        return nodes, x, directors, columns, values

    def _claim(self, title: str, dof: int, number: int) -> None:
        if dof in self._owner:
            raise InputError(
                f"constraints '{self._owner[dof]}' and '{title}' both move the same node; let only "
                "one of them hold it"
            )
        self._owner[dof] = title
        self.sets[dof] = number

    # -- rigid couplings -----------------------------------------------------------------

    def couple(self, couplings: Sequence[Coupling], number: int) -> None:
        """Rows of couplings of one group with one point."""
        first = couplings[0]
        layout, gdim = self._layout, self._layout.gdim
        owner = f"Coupling('{first.title}')"
        # a point of a section lies at z = 0
        dim = self._continuum.mesh.gdim
        if len(first.point) not in (dim, gdim):
            raise InputError(
                f"{owner}: point has {len(first.point)} coordinates in {dim} dimensions"
            )
        nodes, x, directors, columns, _ = self._nodes(first.where)
        unknowns, motions, dofs = coupled_motions(layout, first, nodes, x, directors)
        given: dict[int, int] = {}
        names = MOTIONS if gdim == 3 else ("x", "y", "rz")
        for coupling in couplings:
            for name, value in coupling.prescribed.items():
                if name not in names:
                    raise InputError(f"{owner}: there is no motion {name} in {gdim} dimensions")
                if names.index(name) in given:
                    raise InputError(f"{owner}: motion {name} is prescribed twice")
                given[names.index(name)] = len(self.prescribed)
                title = f"{coupling.title}.{name}"
                self.prescribed.append(Prescribed(title, coupling, value))
        at = np.searchsorted(nodes, dofs // layout.n_unknowns)
        support = columns[at, unknowns]
        if first.mean:
            self._follow_mean(first, number, dofs, motions, support, at, x, given)
            return
        self._check_supports(first, couplings, support, x[at])
        for dof in dofs[support < 0]:
            self._claim(first.title, int(dof), number)
        free = [i for i in range(motions.shape[1]) if i not in given]
        chosen = np.flatnonzero(support < 0)
        slots, basis = motion_basis(motions[:, free], support >= 0)
        slot_rows = chosen[slots]
        moved = motions[:, list(given)]
        rest = moved[chosen] - basis @ moved[slot_rows]
        followed = dofs[slot_rows].tolist()
        is_slot = np.zeros(len(chosen), dtype=bool)
        is_slot[slots] = True
        for i in np.flatnonzero(~is_slot):
            dof = int(dofs[chosen[i]])
            self.rows[dof] = dict(zip(followed, basis[i].tolist(), strict=True))
            self.shares[dof] = dict(zip(given.values(), rest[i].tolist(), strict=True))

    def _follow_mean(
        self,
        coupling: Coupling,
        number: int,
        dofs: Ints,
        motions: Array,
        support: Ints,
        at: Ints,
        x: Array,
        given: dict[int, int],
    ) -> None:
        """One dof for each prescribed motion follows the mean and the others."""
        owner = f"Coupling('{coupling.title}')"
        weight = np.full(len(x), 1.0)
        if callable(coupling.weight):
            weight = numbers_at(owner, "weight", coupling.weight, x)
        if not weight.min(initial=np.inf) > 0.0:
            raise InputError(f"{owner}: the weights of the nodes must be positive")
        root = np.sqrt(weight / weight.sum())[at]
        size = np.abs(motions).max(axis=0, initial=0.0)
        scaled = root[:, None] * motions / np.where(size > 0.0, size, 1.0)
        n, k = scaled.shape
        u, s, vectors = np.linalg.svd(np.vstack([scaled, np.zeros((k, k))]), full_matrices=False)
        u = u[:n]
        seen = s > FREE * max(float(s.max(initial=0.0)), 1e-300)
        chosen = list(given)
        # a motion that moves no node, or that others undo, is no mean of them
        lost = [i for i in chosen if (vectors[~seen][:, i] ** 2).sum() > 1e-12]
        if lost:
            names = ("x", "y", "rz") if motions.shape[1] == 3 else MOTIONS
            raise InputError(
                f"{owner}: the nodes have no mean motion {names[lost[0]]} of their own (they lie "
                "on a line, or do not follow along it); leave it free"
            )
        mean = (vectors[seen].T / s[seen]) @ u[:, seen].T * root
        mean = mean[chosen] / size[chosen][:, None]
        free = np.flatnonzero(support < 0)
        if len(free) < len(chosen):
            raise InputError(f"{owner}: supports hold all of its nodes already")
        _, r, order = scipy.linalg.qr(mean[:, free], mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(r))
        if diagonal.min(initial=np.inf) <= FREE * diagonal.max(initial=0.0):
            raise InputError(f"{owner}: supports hold its mean motion already; leave it free")
        slots = np.sort(free[order[: len(chosen)]])
        rest = np.setdiff1d(np.arange(len(dofs)), slots)
        solved = np.linalg.solve(mean[:, slots], np.hstack([mean[:, rest], np.eye(len(chosen))]))
        for row, slot in zip(solved, slots, strict=True):
            dof = int(dofs[slot])
            self._claim(coupling.title, dof, number)
            self.rows[dof] = dict(zip(dofs[rest].tolist(), (-row[: len(rest)]).tolist(),
                                      strict=True))  # fmt: skip
            self.shares[dof] = dict(zip(given.values(), row[len(rest) :].tolist(), strict=True))

    def _check_supports(
        self, first: Coupling, couplings: Sequence[Coupling], support: Ints, x: Array
    ) -> None:
        """Refuse supports that move the nodes of a coupling, or hold them where it moves."""
        held = np.flatnonzero(support >= 0)
        if not len(held):
            return
        moving = [i for i in held if self._moves[support[i]]]
        pushed = any(v != 0.0 for c in couplings for v in c.prescribed.values())
        if moving or pushed:
            i = moving[0] if moving else held[0]
            raise InputError(
                f"support '{self._titles[support[i]]}' holds the node at {format_point(x[i])} of "
                f"Coupling('{first.title}'), which moves it as well; end one of them before the "
                "other"
            )

    # -- equations -----------------------------------------------------------------------

    def equate(self, equation: Equation, number: int) -> None:
        """Rows of a linear equation."""
        layout = self._layout
        owner = f"Equation('{equation.title}')"
        columns: list[tuple[Ints, Ints, Array, float]] = []
        base: Array | None = None
        for group, axis, factor in equation.terms:
            c = "xyz".index(axis)
            if c >= layout.gdim:
                raise InputError(f"{owner}: there is no axis {axis} in {layout.gdim} dimensions")
            nodes, x, _, support, value = self._nodes(group)
            if base is None:
                base, order = x, np.arange(len(x))
            elif len(nodes) == 1:
                order = np.zeros(len(base), dtype=np.int64)
            elif len(nodes) == len(base):
                order = _matched(owner, group, base, x)
            else:
                raise InputError(
                    f"{owner}: group '{group}' has {len(nodes)} nodes; give one, or as many as the "
                    f"first group has, {len(base)}"
                )
            dofs = layout.dof(nodes[order], c)
            columns.append((dofs, support[order, c], value[order, c], factor))
        assert base is not None
        column: int | None = None
        if equation.value is not None:
            column = len(self.prescribed)
            title = f"{equation.title}.value"
            self.prescribed.append(Prescribed(title, equation, equation.value))
        for i in range(len(base)):
            terms: dict[int, float] = {}
            held: dict[int, tuple[int, float]] = {}
            for dofs, support, value, factor in columns:
                dof = int(dofs[i])
                terms[dof] = terms.get(dof, 0.0) + factor
                held[dof] = int(support[i]), float(value[i])
            self._equate_nodes(equation, owner, terms, held, number, column)

    def _equate_nodes(
        self,
        equation: Equation,
        owner: str,
        terms: dict[int, float],
        held: dict[int, tuple[int, float]],
        number: int,
        column: int | None,
    ) -> None:
        """The row of an equation between single dofs: the first that no support holds follows."""
        terms = {dof: factor for dof, factor in terms.items() if factor != 0.0}
        if not terms and equation.value:
            raise InputError(
                f"{owner}: its terms cancel, so that its value {equation.value:g} cannot be "
                "reached; let them name different nodes or axes"
            )
        free = [dof for dof in terms if held[dof][0] < 0]
        if free:
            dof = free[0]
            self._claim(equation.title, dof, number)
            scale = -terms.pop(dof)
            self.rows[dof] = {k: factor / scale for k, factor in terms.items()}
            self.shares[dof] = {} if column is None else {column: -1.0 / scale}
            return
        left: dict[int, float] = {}  # of the equation for each support that moves
        for dof, factor in terms.items():
            column, entry = held[dof]
            if self._moves[column]:
                left[column] = left.get(column, 0.0) + factor * entry
        size = max((abs(f * held[dof][1]) for dof, f in terms.items()), default=0.0)
        if equation.value or any(abs(rest) > 1e-12 * size for rest in left.values()):
            titles = ", ".join(sorted({f"'{self._titles[held[dof][0]]}'" for dof in terms}))
            raise InputError(
                f"{owner}: supports {titles} prescribe all displacements of the equation, which do "
                "not fulfil it; let it hold between nodes of which one is free"
            )

    # -- all of them ---------------------------------------------------------------------

    def following(self) -> Following:
        """All rows, those that follow followers composed.

        Raises:
            InputError: Dofs follow each other in a circle.
        """
        dofs = np.array(sorted(self.rows), dtype=np.int64)
        named = [*dofs.tolist(), *(k for row in self.rows.values() for k in row)]
        every = np.unique(np.array(named, dtype=np.int64))
        place = {int(d): i for i, d in enumerate(every)}
        number = {int(d): i for i, d in enumerate(dofs)}
        i = [number[d] for d, row in self.rows.items() for _ in row]
        j = [place[k] for row in self.rows.values() for k in row]
        v = [w for row in self.rows.values() for w in row.values()]
        matrix = sp.csr_matrix((v, (i, j)), shape=(len(dofs), len(every)))
        i = [number[d] for d, row in self.shares.items() for _ in row]
        j = [k for row in self.shares.values() for k in row]
        v = [w for row in self.shares.values() for w in row.values()]
        share = sp.csr_matrix((v, (i, j)), shape=(len(dofs), len(self.prescribed)))
        follows = np.isin(every, dofs)
        chain = matrix[:, follows]
        own = matrix[:, ~follows]
        composed, shares = own, share
        for depth in range(len(dofs) + 1):
            if not chain.nnz:
                break
            if depth == len(dofs):
                titles = ", ".join(sorted(f"'{self._owner[int(d)]}'" for d in dofs[:3]))
                raise InputError(f"constraints {titles} follow each other in a circle")
            composed = composed + chain @ own
            shares = shares + chain @ share
            chain = sp.csr_matrix(chain @ matrix[:, follows])
            chain.eliminate_zeros()
        for dof in every[~follows].tolist():
            self.sets.setdefault(int(dof), -1)
        composed = sp.csr_matrix(composed)
        return Following(dofs, every[~follows], composed, sp.csr_matrix(shares), self.sets)


def _matched(owner: str, group: str, x: Array, other: Array) -> Ints:
    """Nodes of a group that stand to each other as those of the first group, in its order."""
    a, b = x - x.mean(axis=0), other - other.mean(axis=0)
    distance, found = cKDTree(b).query(a)
    size = float(np.ptp(a, axis=0).max(initial=0.0))
    if distance.max(initial=0.0) > _SAME * size or len(np.unique(found)) != len(found):
        raise InputError(
            f"{owner}: the nodes of '{group}' do not stand to each other as those of the first "
            "group; give equations between single nodes"
        )
    return np.asarray(found, dtype=np.int64)


def collect_following(
    continuum: Continuum,
    constraints: Sequence[Constraint],
    held: Ints,
    value: Array,
    moves: Bools,
    titles: Sequence[str],
) -> tuple[Following | None, list[Prescribed]]:
    """Rows of all couplings and equations, and the prescribed motions of references; collective.

    Args:
        continuum: The bodies.
        constraints: Couplings and equations.
        held: Support column of each owned dof, -1 where free, shape (n_local,).
        value: Entry of that column, shape (n_local,).
        moves: Whether the value of each of these columns ever differs from zero.
        titles: Their names.

    Raises:
        InputError: Constraints contradict each other or the supports; the same on every rank.
    """
    if not constraints:
        return None, []
    rows = _Rows(continuum, held, value, moves, titles)
    groups: dict[tuple[object, ...], list[Coupling]] = {}
    for constraint in constraints:
        if isinstance(constraint, Coupling):
            mark = (
                constraint.where, constraint.point, constraint.components, constraint.rotations,
                constraint.mean, repr(constraint.weight),
            )  # fmt: skip
            groups.setdefault(mark, []).append(constraint)
    for number, couplings in enumerate(groups.values()):
        rows.couple(couplings, number)
    equations = [c for c in constraints if isinstance(c, Equation)]
    for number, equation in enumerate(equations, start=len(groups)):
        rows.equate(equation, number)
    following, layout = rows.following(), continuum.layout
    joints = layout.joints.nodes
    if len(joints) and following.marks(layout.dofs(joints)).any():
        raise InputError(
            "couplings and equations cannot move nodes at which shells meet at a kink or in a T; "
            "leave them out of their groups"
        )
    return following, rows.prescribed


__all__ = ["Following", "Prescribed", "collect_following"]
