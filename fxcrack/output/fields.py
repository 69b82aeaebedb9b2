"""Fields for ParaView: the bodies, and each interface as a surface of its own.

Jumps and bond forces are taken from the displacement field, so they are known on the whole
interface and not only in the window:

    jump_s = u_s - sum_m W_sm u_m,        r = K u - sum_i lambda_i f_i,        t_s = -f_s / area_s

with f_s the bond or contact force on slave node s, its row of T^t r: the residual there, plus that
of the slaves it carries as a master.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from fxcrack import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.plot
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from fxcrack.continuum import Continuum
from fxcrack.errors import InputError
from fxcrack.interface.pairing import Pair
from fxcrack.output.atomic import replacing
from fxcrack.output.collective import together
from fxcrack.output.history import Row
from fxcrack.output.vtu import FACETS, Grid, write_grid, write_header, write_series
from fxcrack.steps.evaluate import TipValues

if TYPE_CHECKING:
    from fxcrack.scene import Scene

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class InterfaceFields:
    """What is known at the slave nodes of an interface, the same on every rank.

    Attributes:
        displacement: Displacement of the slave nodes, shape (n_nodes, 3), length.
        opening: Jump from master to slave, shape (n_nodes, 3), length.
        traction: Bond or contact force per tributary area, positive along the normal in tension,
            shape (n_nodes, 3), force/length^2.
        normal: Unit vectors from master to slave, shape (n_nodes, 3).
        state: 1 bonded, 0 open, -1 no master beneath, shape (n_nodes,).
        front: 1 on front nodes, shape (n_nodes,).
        release_time: Time at which a node was released, 0 if it was open from the start, NaN while
            it is bonded, shape (n_nodes,).
        at_front: What the criterion says at the front nodes, 0 elsewhere, each of shape (n_nodes,):
            f, and what is behind it, as GI, GII, GIII and their sum G (force/length).
    """

    displacement: Array
    opening: Array
    traction: Array
    normal: Array
    state: npt.NDArray[np.int32]
    front: npt.NDArray[np.int32]
    release_time: Array
    at_front: dict[str, Array]


def displacement_function(scene: Scene) -> fem.Function:
    """Displacement of the present state; collective, one back-solve.

    Raises:
        InputError: No step was run yet.
    """
    if not hasattr(scene.model, "state"):
        raise InputError("the scene has no state yet; run a step before asking for fields")
    u = fem.Function(scene.continuum.space, name="displacement")
    vector = scene.model.displacement()
    u.x.array[: scene.continuum.n_local] = vector.array
    vector.destroy()
    u.x.scatter_forward()
    return u


def residual(scene: Scene, u: fem.Function) -> Array:
    """Forces of interfaces and supports on the bodies, K u - f; collective.

    Returns:
        Shape (n_local,), the owned dofs of this rank, force.
    """
    continuum, factors = scene.continuum, scene.model.state.loads
    stiffness = continuum.stiffness()
    out = stiffness.createVecLeft()
    stiffness.mult(u.x.petsc_vec, out)
    stiffness.destroy()
    for load, factor in zip(scene.loads, factors[len(factors) - len(scene.loads) :], strict=True):
        pattern = continuum.load_vector(load)
        out.axpy(-factor, pattern)
        pattern.destroy()
    values = out.array.copy()
    out.destroy()
    return np.asarray(values)


def _shared(continuum: Continuum, blocks: Ints, owned: Array) -> Array:
    """Values of global displacement nodes on every rank, shape (n_blocks, gdim); collective.

    Args:
        continuum: Displacement space.
        blocks: Global nodes, sorted, the same on every rank.
        owned: Values of the owned dofs, shape (n_local,).
    """
    gdim = continuum.gdim
    low, count = continuum.offset // gdim, continuum.n_local // gdim
    mine = np.flatnonzero((blocks >= low) & (blocks < low + count))
    out = np.zeros((len(blocks), gdim))
    for where, what in continuum.comm.allgather(
        (mine, owned.reshape(-1, gdim)[blocks[mine] - low])
    ):
        out[where] = what
    return out


def _in_space(values: Array) -> Array:
    """Vectors with three components, shape (n, gdim) to (n, 3)."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def interface_fields(
    scene: Scene, u: fem.Function, time: float | None = None
) -> list[InterfaceFields]:
    """Fields on every interface of the scene, in the order of ``scene.pairs``; collective.

    Args:
        scene: The scene.
        u: Its displacement, from :func:`displacement_function`.
        time: Time of the present state; that of the scene by default.
    """
    continuum, pairs = scene.continuum, scene.pairs
    used = [np.concatenate([p.surface.dofs, p.masters.ravel()]) for p in pairs]
    blocks = np.unique(np.concatenate(used)) if used else np.zeros(0, dtype=np.int64)
    motion = _shared(continuum, blocks, u.x.array[: continuum.n_local])
    direct = _shared(continuum, blocks, residual(scene, u))
    slaves = [np.searchsorted(blocks, p.surface.dofs) for p in pairs]
    masters = [np.searchsorted(blocks, p.masters) for p in pairs]
    acting = [
        p.paired & (front.bonded | (index >= 0).any(axis=1))
        for p, front, index in zip(pairs, scene.model.fronts, scene.model.index, strict=True)
    ]
    total = direct
    for _ in range(len(pairs) - 1):  # a slave may carry other slaves: at most as long a chain
        carried = np.zeros_like(direct)
        for pair, s, m, on in zip(pairs, slaves, masters, acting, strict=True):
            np.add.at(carried, m[on], pair.weights[on, :, None] * total[s[on], None, :])
        total = direct + carried
    return [
        _fields_of(
            scene,
            p,
            motion[slaves[p]],
            motion[masters[p]],
            np.where(acting[p][:, None], total[slaves[p]], 0.0),
            scene.time if time is None else time,
        )
        for p in range(len(pairs))
    ]


def _fields_of(
    scene: Scene, p: int, slave: Array, masters: Array, force: Array, time: float
) -> InterfaceFields:
    """Fields on pair p from the displacements and forces at its nodes."""
    pair, model = scene.pairs[p], scene.model
    surface = pair.surface
    under = np.einsum("nk,nkc->nc", pair.weights, masters)
    opening = np.where(pair.paired[:, None], slave - under, 0.0)
    # a component that a support holds carries the support's reaction, not a bond force
    local = np.einsum("nck,nc->nk", model.frames[p], force)
    local[model.held_by_supports[p]] = 0.0
    bond = np.einsum("nck,nk->nc", model.frames[p], local)
    area = np.where(surface.areas > 0.0, surface.areas, np.inf)  # corners of second-order facets
    state = np.where(pair.paired, model.fronts[p].bonded.astype(np.int32), -1)
    front = np.zeros(surface.n_nodes, dtype=np.int32)
    when = np.where(model.fronts[p].bonded, np.nan, 0.0)
    at_front: dict[str, Array] = {}
    for growth in scene.growths:
        if growth.p == p:
            tips = growth.tips()
            front[tips.node] = 1
            for node, moment in growth.released:
                when[node] = moment
            if model.active[p]:
                at_front = _at_front(growth.evaluate(tips, model.state, time), surface.n_nodes)
    return InterfaceFields(
        displacement=_in_space(slave),
        opening=_in_space(opening),
        traction=-_in_space(bond) / area[:, None],
        normal=_in_space(pair.frames[:, :, 0]),
        state=state.astype(np.int32),
        front=front,
        release_time=when,
        at_front=at_front,
    )


def _at_front(values: TipValues, n_nodes: int) -> dict[str, Array]:
    """Values at the tips as arrays over all slave nodes."""
    report = {"f": values.f, **values.report}
    modes = [values.report[mode] for mode in ("GI", "GII", "GIII") if mode in values.report]
    if modes:
        report["G"] = np.sum(modes, axis=0)
    out = {name: np.zeros(n_nodes) for name in report}
    for name, value in report.items():
        out[name][values.tips.node] = value
    return out


# -- grids -----------------------------------------------------------------------------------------


def body_grid(scene: Scene, u: fem.Function) -> Grid:
    """This rank's cells with displacement, stress and von Mises stress; collective."""
    continuum = scene.continuum
    stress = continuum.stress(u)
    equivalent = continuum.von_mises(stress)
    topology, kinds, x = dolfinx.plot.vtk_mesh(continuum.space)
    width = continuum.space.dofmap.dof_layout.num_dofs
    cells = np.asarray(topology).reshape(-1, width + 1)[:, 1:]
    nodes, renumbered = np.unique(cells, return_inverse=True)
    labels = list(continuum.model.labels)
    order = list(range(len(labels)))
    if continuum.gdim == 3:  # as VTK orders a symmetric tensor
        order = [labels.index(k) for k in ("xx", "yy", "zz", "xy", "yz", "xz")]
    of_cell = stress.function_space.dofmap.list[: len(cells), 0]
    of_cell_scalar = equivalent.function_space.dofmap.list[: len(cells), 0]
    return Grid(
        points=np.asarray(x)[nodes],
        cells=renumbered.reshape(cells.shape),
        kind=int(kinds[0]) if len(kinds) else 0,
        point_data={"displacement": _in_space(u.x.array.reshape(-1, continuum.gdim)[nodes])},
        cell_data={
            "stress": stress.x.array.reshape(-1, len(labels))[of_cell][:, order],
            "von_mises": equivalent.x.array[of_cell_scalar],
        },
        components={"stress": [labels[i] for i in order]},
    )


def interface_grid(pair: Pair, fields: InterfaceFields) -> Grid:
    """The slave surface with its fields."""
    surface = pair.surface
    kind, order = FACETS[surface.kind, surface.order]
    return Grid(
        points=surface.x,
        cells=surface.facets[:, order],
        kind=kind,
        point_data={
            "displacement": fields.displacement,
            "opening": fields.opening,
            "bond_traction": fields.traction,
            "normal": fields.normal,
            "bond_state": fields.state,
            "front": fields.front,
            "release_time": fields.release_time,
            **fields.at_front,
        },
    )


# -- files -----------------------------------------------------------------------------------------


class FieldSeries:
    """Writes the fields of a scene again and again; ParaView shows them as one series in time.

    ``out/fields.pvd`` shows the bodies and ``out/fields_NAME.pvd`` the interface called NAME;
    the numbers are in the folder ``out/fields``. After every write all files are whole, and what
    was there before stays as it was when a write fails.

    Args:
        scene: The scene.
        path: The .pvd file of the bodies.
        events: Events of the history at which the series, called as an observer, writes.
        every: Write at each so-manieth of them.

    Raises:
        InputError: The path does not end in .pvd, or ``every`` is not positive.

    Example:
        ``with FieldSeries(scene, "out/fields.pvd") as series: series.write()``
    """

    def __init__(
        self,
        scene: Scene,
        path: str | Path,
        *,
        events: tuple[str, ...] = ("start", "increment", "release"),
        every: int = 1,
    ) -> None:
        self.path = Path(path)
        if self.path.suffix != ".pvd":
            raise InputError(f"fields are written to a .pvd file, not to '{path}'")
        if every < 1:
            raise InputError(f"FieldSeries: every = {every} must be 1 or more")
        self._scene = scene
        self._events = events
        self._every = every
        self._seen = 0
        self._folder = self.path.with_suffix("")
        self._parts = ["bodies"]
        for pair in scene.pairs:
            name = re.sub(r"[^\w.-]", "_", pair.title)
            self._parts.append(name if name not in self._parts else f"{name}_{len(self._parts)}")
        self._steps: list[list[tuple[float, str]]] = [[] for _ in self._parts]

    def __enter__(self) -> FieldSeries:
        """Return the series itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Nothing is left to do: files are whole after every write."""

    def __call__(self, event: str, row: Row) -> None:
        """Write at a row of the history, if its event is wanted; collective."""
        if event in self._events:
            if self._seen % self._every == 0:
                self.write(float(row["time"]))
            self._seen += 1

    def write(self, time: float | None = None) -> None:
        """Write the present state; collective, one back-solve.

        Args:
            time: Its time in the series; that of the scene by default.

        Raises:
            FxcrackError: A file could not be written; the old files are still there.
        """
        scene, comm = self._scene, self._scene.mesh.comm
        time = scene.time if time is None else time
        u = displacement_function(scene)
        bodies = body_grid(scene, u)
        surfaces = [
            interface_grid(pair, fields)
            for pair, fields in zip(scene.pairs, interface_fields(scene, u, time), strict=True)
        ]
        task, folder = f"writing fields to '{self.path}'", ""
        with together(comm, task):
            if comm.rank == 0:
                self._folder.mkdir(parents=True, exist_ok=True)
                folder = tempfile.mkdtemp(prefix=f".{self.path.stem}.", dir=self.path.parent)
        temporary = Path(comm.bcast(folder))
        try:
            with together(comm, task):
                names = self._write_pieces(temporary, bodies, surfaces)
            with together(comm, task):
                if comm.rank == 0:
                    self._publish(temporary, names, float(time))
        finally:
            if comm.rank == 0:
                shutil.rmtree(temporary, ignore_errors=True)
        for steps, name in zip(self._steps, names, strict=True):
            steps.append((float(time), f"{self._folder.name}/{name}"))

    def _write_pieces(self, folder: Path, bodies: Grid, surfaces: list[Grid]) -> list[str]:
        """Write what this rank has; returns the file name of each part."""
        comm, number = self._scene.mesh.comm, f"{len(self._steps[0]):05d}"
        names = [f"{part}_{number}.vtu" for part in self._parts]
        if comm.size > 1:
            pieces = [f"{self._parts[0]}_{number}_r{rank}.vtu" for rank in range(comm.size)]
            write_grid(folder / pieces[comm.rank], bodies)
            names[0] = f"{self._parts[0]}_{number}.pvtu"
            if comm.rank == 0:
                write_header(folder / names[0], bodies, pieces)
        else:
            write_grid(folder / names[0], bodies)
        if comm.rank == 0:
            for name, surface in zip(names[1:], surfaces, strict=True):
                write_grid(folder / name, surface)
        return names

    def _publish(self, temporary: Path, names: list[str], time: float) -> None:
        """Move new files to their place, then let the .pvd files name them."""
        new = sorted(temporary.iterdir())
        for file in new:
            file.replace(self._folder / file.name)
        for i, (part, steps, name) in enumerate(zip(self._parts, self._steps, names, strict=True)):
            stem = self.path.stem if i == 0 else f"{self.path.stem}_{part}"
            with replacing(self.path.with_name(f"{stem}.pvd")) as series:
                write_series(series, [*steps, (time, f"{self._folder.name}/{name}")])
        if not self._steps[0]:
            self._forget({file.name for file in new})

    def _forget(self, keep: set[str]) -> None:
        """Remove the files of an earlier series of the same name."""
        parts = "|".join(re.escape(part) for part in self._parts)
        pattern = re.compile(rf"({parts})_\d{{5,}}(_r\d+)?\.p?vtu")
        for file in self._folder.iterdir():
            if pattern.fullmatch(file.name) and file.name not in keep:
                file.unlink()


def write_fields(scene: Scene, path: str | Path, *, time: float | None = None) -> None:
    """Write the present fields of a scene; collective, one back-solve.

    Args:
        scene: The scene, after a step.
        path: The .pvd file of the bodies; interfaces have files beside it, see
            :class:`FieldSeries`.
        time: Time to note; that of the scene by default.

    Raises:
        InputError: The path does not end in .pvd, or no step was run yet.
        FxcrackError: A file could not be written; the old ones are still there.
    """
    FieldSeries(scene, path).write(time)
