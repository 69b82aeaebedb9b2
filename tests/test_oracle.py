"""The condensed model against one sparse solve of the whole problem, gathered in scipy.

The oracle knows nothing of jump coordinates: displacements of all nodes, and a multiplier for each
condition (bonded: u_s = sum W u_m; closed contact: n . (u_s - sum W u_m) = -gap; supports), from

    [K  C^t] [u      ]   [f]
    [C  0  ] [-force ] = [d]

Multipliers of bonds are bond forces, those of supports are reactions.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg
from mpi4py import MPI
from specimens import bond, gathered, gathered_vector
from test_interface_pairing import three_blocks, tie, turn

import fxcrack as fx
from fxcrack.continuum.load_vectors import load_vector
from fxcrack.mesh import Mesh
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.penny import penny

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

CARBON = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
STEEL = fx.Isotropic(70e3, 0.3)
RTOL = 1e-8  # of the largest value; condition numbers up to 1e7


def dcb_with_loads(comm: MPI.Intracomm) -> fx.Scene:
    """Meshes that do not match, loads on crack faces, supports that share nodes with slaves."""
    mesh = dcb_2d(comm, length=12.0, dx=0.5, ny=2, nx_lower=17, ny_lower=3)
    return fx.Scene(
        mesh,
        materials={"upper": STEEL, "lower": fx.Isotropic(40e3, 0.2)},
        model=fx.PlaneStrain(thickness=3.0),
        supports=[
            fx.Displacement("end_upper", y=lambda x: 0.2 + 0.05 * x[1]),
            fx.Displacement("far_upper", x=0.02, y=0.0),
            fx.Displacement("far_lower", x=0.02, y=0.0),
        ],
        loads=[
            fx.Traction("top", (0.3, lambda x: 0.1 * x[0])),
            fx.Pressure("upper_face", 0.4, name="on upper"),
            fx.Pressure("lower_face", lambda x: np.where(x[0] < 6.0, 0.4, 0.0), name="on lower"),
            fx.PointForce("pin_bottom", (1.0, -5.0)),
            fx.BodyForce((0.0, -0.01), where="lower"),
        ],
        debonds=[fx.Debond(bond(6.0), fx.VCCT(GIc=0.2))],
        monitors=[fx.Monitor("top", (0.6, 0.8)), fx.Monitor("pin_bottom", (0.0, 1.0))],
    )


def second_order(comm: MPI.Intracomm) -> fx.Scene:
    mesh = dcb_2d(comm, length=12.0, dx=1.0, ny=1, order=2, nx_lower=8)
    return fx.Scene(
        mesh,
        materials=CARBON,
        model=fx.PlaneStress(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("end_lower", x=0.0, y=0.0),
        ],
        loads=[fx.Traction("bottom", (0.0, -0.2))],
        debonds=[fx.Debond(bond(6.0), fx.VCCT(GIc=0.2))],
        monitors=[fx.Monitor("far_upper", (0.0, 1.0))],
    )


def solid(comm: MPI.Intracomm) -> fx.Scene:
    """A symmetry plane holds slaves sideways, the far end holds them wholly."""
    mesh = dcb_3d(comm, length=8.0, width=4.0, dx=1.0, dy=1.0, ny=1, nx_lower=5)
    symmetry = fx.Displacement("side_0", z=0.0)
    return fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.Solid(),
        supports=[
            symmetry,
            fx.Displacement("far_upper", x=0.0, y=0.0, z=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0, z=0.0),
            fx.Displacement("end_upper", y=1.0),
            fx.Displacement("end_lower", y=-1.0),
        ],
        loads=[fx.Traction("side_w", (0.1, 0.0, -0.3))],
        debonds=[fx.Debond(bond(4.0), fx.VCCT(GIc=0.2), fx.StepRelease())],
        monitors=[fx.Monitor("mid_top", (0.0, 1.0, 0.0))],
    )


def turned(comm: MPI.Intracomm) -> fx.Scene:
    """No frame along an axis."""
    mesh = dcb_2d(comm, length=12.0, dx=0.75, ny=2, nx_lower=11)
    turn(mesh, 30.0)
    along = np.array([np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)])
    interface = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: along @ x[:2] > 5.9, name="bond"
    )
    return fx.Scene(
        mesh,
        materials=CARBON,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=-0.5, y=0.9),
            fx.Displacement("pin_bottom", x=0.5, y=-0.9),
        ],
        loads=[fx.Traction("top", (0.1, 0.2))],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=0.2))],
        monitors=[],
    )


def chain(comm: MPI.Intracomm) -> fx.Scene:
    """Three blocks: one crack, one tie, and a slave of one that is a master of the other."""
    crack = fx.Interface(
        slave="c_left", master="b_right", bonded=lambda x: x[1] < 0.55, name="bond"
    )
    return fx.Scene(
        three_blocks(comm),
        materials=STEEL,
        model=fx.PlaneStress(),
        supports=[
            fx.Displacement("a_bottom", x=0.0, y=0.0),
            fx.Displacement("c_top", x=1.0, y=0.0),
        ],
        loads=[fx.Traction("c_bottom", (0.0, 0.5))],
        debonds=[fx.Debond(crack, fx.VCCT(GIc=0.2))],
        bonds=[tie("b_bottom", "a_top")],
        monitors=[fx.Monitor("c_bottom", (1.0, 0.0))],
    )


def ring(comm: MPI.Intracomm) -> fx.Scene:
    mesh = penny(comm, a=2.0, radius=8.0, half_height=6.0, dr=0.25)
    return fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("bottom", y=0.0),
        ],
        loads=[
            fx.Pressure(f"{side}_face", lambda x: 1.0 * (x[0] < 2.0)) for side in ("upper", "lower")
        ],
        debonds=[fx.Debond(bond(2.0), fx.VCCT(GIc=0.2))],
        monitors=[fx.Monitor("top", (0.0, 1.0))],
    )


def bending_with_contact(comm: MPI.Intracomm) -> fx.Scene:
    mesh = enf_2d(comm, half_span=10.0, height=1.0, dx=0.5, ny=2)
    return fx.Scene(
        mesh,
        materials=CARBON,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
            fx.Displacement("load", y=-1.0),
        ],
        loads=[fx.Pressure("top", lambda x: np.where(x[0] < 3.0, 2.0, 0.0))],
        debonds=[fx.Debond(bond(7.0, contact=True), fx.VCCT(GIc=0.2))],
        monitors=[fx.Monitor("load", (0.0, 1.0))],
    )


SCENES: dict[str, Callable[[MPI.Intracomm], fx.Scene]] = {
    f.__name__: f
    for f in (dcb_with_loads, second_order, solid, turned, chain, ring, bending_with_contact)
}


class Oracle:
    """The whole problem at the present states and loads of a scene, on every rank."""

    def __init__(self, scene: fx.Scene) -> None:
        self.scene = scene
        continuum, model = scene.continuum, scene.solver
        self.gdim = continuum.gdim
        comm = scene.mesh.comm
        stiffness = continuum.stiffness()
        self.k = gathered(stiffness)
        stiffness.destroy()
        self.f = np.zeros(self.k.shape[0])
        self.patterns = []
        for load in scene.loads:
            vector = load_vector(continuum, load)
            self.patterns.append(gathered_vector(vector))
            self.f += load.amplitude(scene.time) * self.patterns[-1]
            vector.destroy()

        n_owned = continuum.n_local // self.gdim
        x = continuum.positions()
        rows, values = [], []
        held: dict[int, float] = {}
        self.held_by: list[tuple[Ints, Array]] = []  # per support column: dofs, values at 1
        taken: set[int] = set()
        for support in scene.supports.columns:
            nodes = continuum.owned_nodes(support.support.where)
            assert np.all(nodes < n_owned)
            component = "xyz".index(support.title[-1])
            field = getattr(support.support, support.title[-1])
            at_one = np.broadcast_to(field(x[nodes].T) if callable(field) else field, len(nodes))
            dofs = continuum.offset + self.gdim * nodes.astype(np.int64) + component
            dofs, at_one = (np.concatenate(comm.allgather(a)) for a in (dofs, at_one))
            mine = np.array([d not in taken for d in dofs], dtype=bool)
            taken |= set(dofs.tolist())
            self.held_by.append((dofs[mine], at_one[mine]))
            held |= dict(
                zip(dofs.tolist(), (support.support.amplitude(scene.time) * at_one), strict=True)
            )
        self.support_dofs = np.array(sorted(held))
        for dof in self.support_dofs:
            rows.append(([dof], [1.0]))
            values.append(held[int(dof)])

        self.bonds: list[tuple[int, int, int]] = []  # pair, node, component of each condition
        for p, (pair, front) in enumerate(zip(scene.pairs, model.fronts, strict=True)):
            index = model.index[p]
            for node in range(pair.surface.n_nodes):
                slave = self.gdim * pair.surface.dofs[node]
                masters = self.gdim * pair.masters[node]
                w = pair.weights[node]
                if front.bonded[node]:
                    for c in range(self.gdim):
                        if slave + c in held:
                            continue  # the masters are held alike
                        rows.append(([slave + c, *(masters + c)], [1.0, *-w]))
                        values.append(0.0)
                        self.bonds.append((p, node, c))
                elif index[node, 0] >= 0 and model.system.closed[index[node, 0]]:
                    n = pair.frames[node][:, 0]
                    places = [slave + c for c in range(self.gdim)]
                    entries = list(n)
                    for m, weight in zip(masters, w, strict=True):
                        places += [m + c for c in range(self.gdim)]
                        entries += list(-weight * n)
                    rows.append((places, entries))
                    values.append(-pair.gap[node])
                    self.bonds.append((p, node, -1))
        conditions = sp.csr_matrix(
            (
                np.concatenate([r[1] for r in rows]),
                (
                    np.repeat(np.arange(len(rows)), [len(r[0]) for r in rows]),
                    np.concatenate([r[0] for r in rows]),
                ),
            ),
            shape=(len(rows), self.k.shape[0]),
        )
        # K is scaled so that pivoting sees conditions and stiffness alike
        scale = self.k.diagonal().mean()
        whole = sp.bmat([[self.k / scale, conditions.T], [conditions, None]]).tocsc()
        found = scipy.sparse.linalg.spsolve(whole, np.concatenate([self.f / scale, values]))
        self.u = found[: len(self.f)]
        forces = -scale * found[len(self.f) :]
        n = len(self.support_dofs)
        self.reaction = dict(zip(self.support_dofs.tolist(), forces[:n], strict=True))
        self.bond_force = forces[n:]

    def interface_forces(self) -> Array:
        """What the model calls forces: on slaves, in their frames, per retained component."""
        model = self.scene.solver
        out = np.zeros(model.system.n_retained)
        for (p, node, c), force in zip(self.bonds, self.bond_force, strict=True):
            index = model.index[p][node]
            local = [1.0, 0.0, 0.0][: self.gdim] if c < 0 else model.frames[p][node][c]
            for j in np.flatnonzero(index >= 0):
                out[index[j]] += local[j] * force
        return out

    def jumps(self) -> Array:
        """Jumps of the retained components."""
        model = self.scene.solver
        u = self.u.reshape(-1, self.gdim)
        out = np.zeros(model.system.n_retained)
        for pair, index, frames in zip(self.scene.pairs, model.index, model.frames, strict=True):
            apart = u[pair.surface.dofs] - np.einsum("nk,nkc->nc", pair.weights, u[pair.masters])
            local = np.einsum("ncj,nc->nj", frames, apart)
            out[index[index >= 0]] = local[index >= 0]
        return out

    def conjugates(self) -> Array:
        """Reactions and displacements of the force patterns."""
        out = []
        for column, (dofs, at_one) in zip(self.scene.supports.columns, self.held_by, strict=True):
            reactions = np.array([self.reaction[d] for d in dofs.tolist()])
            uniform = not column.moves or len(set(at_one.tolist())) == 1
            out.append(reactions.sum() if uniform else reactions @ at_one)
        return np.array(out + [f @ self.u for f in self.patterns])


def close(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max(initial=0.0) <= RTOL * max(np.abs(b).max(initial=0.0), 1e-300))


def run(name: str, comm: MPI.Intracomm) -> fx.Scene:
    scene = SCENES[name](comm)
    scene.run(fx.Static(until=fx.Releases(2)))
    return scene


@pytest.mark.quick("chain", "bending_with_contact")
@pytest.mark.mpi
@pytest.mark.parametrize("name", SCENES)
def test_state_is_that_of_the_whole_problem(comm: MPI.Intracomm, name: str) -> None:
    scene = run(name, comm)
    model = scene.solver
    oracle = Oracle(scene)
    vector = model.displacement()
    u = gathered_vector(vector)
    vector.destroy()
    assert close(u, oracle.u)
    state = model.state
    assert close(state.jump, oracle.jumps())
    forces = model.system.forces(state, np.arange(model.system.n_retained))
    assert close(forces, oracle.interface_forces())
    expected, n = oracle.conjugates(), len(scene.supports.columns)
    assert close(state.conjugate[:n], expected[:n])
    assert close(state.conjugate[n:], expected[n:])
    assert model.system.strain_energy(state) == pytest.approx(
        0.5 * oracle.u @ oracle.k @ oracle.u, rel=RTOL
    )
    row = scene.history.rows[-1]
    nodes = scene.continuum
    for monitor in model.monitors:
        found = nodes.owned_nodes(monitor.where).astype(np.int64)
        where = np.concatenate(comm.allgather(nodes.offset // nodes.gdim + found))
        mean = oracle.u.reshape(-1, nodes.gdim)[where].mean(axis=0)
        assert row[f"m[{monitor.title}]"] == pytest.approx(
            mean @ np.array(monitor.direction), rel=RTOL, abs=RTOL * np.abs(oracle.u).max()
        )
    scene.close()


@pytest.mark.quick("chain", "bending_with_contact")
@pytest.mark.mpi
@pytest.mark.parametrize("name", SCENES)
def test_transformed_matrix_with_its_borders(comm: MPI.Intracomm, name: str) -> None:
    """T^t K T, and T^t times minus the force patterns and the monitors, in their places."""
    scene = run(name, comm)
    found = scene.solver.condensation
    t = gathered(found.coordinates.transform)
    oracle = Oracle(scene)
    expected = (t.T @ oracle.k @ t).toarray()
    borders = [-f for f in oracle.patterns]
    for monitor in scene.solver.monitors:
        nodes = scene.continuum.owned_nodes(monitor.where).astype(np.int64)
        blocks = np.concatenate(comm.allgather(scene.continuum.offset // oracle.gdim + nodes))
        row = np.zeros((t.shape[0] // oracle.gdim, oracle.gdim))
        row[blocks] = np.array(monitor.direction) / len(blocks)
        borders.append(row.ravel())
    first = found.coordinates.first + found.coordinates.n_retained + found.coordinates.n_supports
    for i, border in enumerate(borders):
        expected[first + i] += t.T @ border
        expected[:, first + i] += t.T @ border
    matrix = gathered(found.matrix).toarray()
    assert np.abs(matrix - expected).max() < 1e-13 * np.abs(expected).max()  # round-off of sums
    assert scene.solver.face_loads == pytest.approx(
        -np.stack([t.T @ b for b in borders[: len(scene.loads)]], axis=1)[
            found.coordinates.first : found.coordinates.first + found.coordinates.n_retained
        ],
        abs=1e-12,
    )
    scene.close()


@pytest.mark.quick("chain", "second_order")
@pytest.mark.mpi
@pytest.mark.parametrize("name", SCENES)
def test_displacements_meet_their_conditions(comm: MPI.Intracomm, name: str) -> None:
    """Equilibrium off supports and interfaces, supports met, bonds closed, contact one-sided."""
    scene = run(name, comm)
    oracle = Oracle(scene)
    vector = scene.solver.displacement()
    u = gathered_vector(vector)
    vector.destroy()
    residual = oracle.k @ u - oracle.f
    loaded = set(oracle.support_dofs.tolist())
    for pair in scene.pairs:
        blocks = np.concatenate([pair.surface.dofs, pair.masters.ravel()])
        loaded |= {int(oracle.gdim * b + c) for b in blocks for c in range(oracle.gdim)}
    inside = np.setdiff1d(np.arange(len(u)), sorted(loaded))
    size = np.abs(residual).max()
    assert np.abs(residual[inside]).max() < RTOL * size
    for column, (dofs, at_one) in zip(scene.supports.columns, oracle.held_by, strict=True):
        prescribed = column.support.amplitude(scene.time) * at_one
        assert np.abs(u[dofs] - prescribed).max() <= 1e-12 * np.abs(u).max()
    blocks = u.reshape(-1, oracle.gdim)
    for p, (pair, front) in enumerate(zip(scene.pairs, scene.solver.fronts, strict=True)):
        follow = np.einsum("nk,nkc->nc", pair.weights, blocks[pair.masters])
        apart = blocks[pair.surface.dofs] - follow
        local = np.einsum("nci,nc->ni", scene.solver.frames[p], apart)
        if pair.surface_to_surface:
            # supports hold both faces there, which are equal on the mean only
            local[scene.solver.held_by_supports[p]] = 0.0
        assert np.abs(local[front.bonded]).max() <= 1e-12 * np.abs(u).max()
        if pair.interface.contact:
            opening = np.einsum("nc,nc->n", apart, pair.frames[:, :, 0])
            assert opening.min() > -1e-10 * np.abs(u).max()
            closed = ~front.bonded & (opening < 1e-10 * np.abs(u).max())
            assert 0 < closed.sum() < (~front.bonded).sum()  # the case has both
            pressure = scene.solver.system.forces(
                scene.solver.state, scene.solver.index[0][closed, 0]
            )
            assert pressure.min() > 0.0
    # reactions balance the loads, save for radial forces, of which a ring balances its own
    for c in range(name == "ring", oracle.gdim):
        reactions = sum(r for d, r in oracle.reaction.items() if d % oracle.gdim == c)
        assert reactions + oracle.f[c :: oracle.gdim].sum() == pytest.approx(0.0, abs=RTOL * size)
    scene.close()


def test_mesh_of_the_chain_is_a_chain() -> None:
    """The case is the one meant: a slave of one interface is a master of the other."""
    scene = chain(MPI.COMM_SELF)
    crack, base = scene.pairs
    used: Mesh = crack.masters[crack.weights != 0.0]
    assert np.isin(base.surface.dofs, used).sum() == 1
