"""Fields for ParaView: the bodies, and each interface as a surface of its own."""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path
from types import TracebackType

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.plot
import numpy as np
from dolfinx import fem

from fxcrack.base.checks import file_path, whole
from fxcrack.base.errors import InputError
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.stress import cell_stress, von_mises
from fxcrack.history import Row
from fxcrack.interface.pair import Pair
from fxcrack.output.interface_fields import InterfaceFields, in_space, interface_fields
from fxcrack.output.shell_fields import shell_grid
from fxcrack.output.vtu import FACETS, Grid, write_grid, write_header, write_series
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of


def displacement_function(source: Analysis | HasAnalysis) -> fem.Function:
    """Displacement of the present state of a scene or its analysis; collective, one back-solve.

    Raises:
        InputError: No step was run yet.
    """
    analysis = analysis_of(source)
    analysis.check_started("fields")
    u = fem.Function(analysis.continuum.space, name="displacement")
    vector = analysis.solver.displacement()
    u.x.array[: analysis.continuum.n_local] = vector.array
    vector.destroy()
    u.x.scatter_forward()
    return u


def stress_function(source: Analysis | HasAnalysis, u: fem.Function, time: float) -> fem.Function:
    """Cauchy stress of the present state, means over the undeformed cells; collective.

    Components in the order of ``model.stress_labels``.

    Args:
        source: A scene or its analysis, after a step.
        u: Its displacement.
        time: Its time, which determines the temperature.

    Raises:
        InputError: The bodies are shells, whose stress is not the same over the thickness.
    """
    analysis = analysis_of(source)
    if isinstance(analysis.continuum, ShellBodies):
        raise InputError(
            "a shell has no one stress over its thickness: write_fields() gives the stresses on "
            "both faces and the section forces, fxcrack.continuum.shell_stress the same as arrays"
        )
    solver = analysis.solver
    if isinstance(solver, NewtonSolver):
        return solver.bodies.stress()
    if isinstance(solver, ExplicitSolver) and not solver.bodies.linear:
        return solver.bodies.stress()
    continuum = analysis.continuum
    if continuum.temperature is not None:
        continuum.temperature.set(time)
    return cell_stress(continuum, u)


def has_finite_bodies(analysis: Analysis) -> bool:
    """Whether the bodies of an analysis turn and stretch by any amount."""
    solver = analysis.solver
    return isinstance(solver, NewtonSolver | ExplicitSolver) and solver.bodies.finite


# -- grids -----------------------------------------------------------------------------------------


def body_grid(analysis: Analysis, u: fem.Function, time: float) -> Grid:
    """This rank's cells with displacement, stress and von Mises stress; collective."""
    continuum = analysis.continuum
    if isinstance(continuum, ShellBodies):
        if continuum.temperature is not None:
            continuum.temperature.set(time)
        return shell_grid(continuum, u, finite=has_finite_bodies(analysis))
    stress = stress_function(analysis, u, time)
    equivalent = von_mises(continuum, stress)
    topology, kinds, x = dolfinx.plot.vtk_mesh(continuum.space)
    width = continuum.space.dofmap.dof_layout.num_dofs
    cells = np.asarray(topology).reshape(-1, width + 1)[:, 1:]
    nodes, renumbered = np.unique(cells, return_inverse=True)
    labels = list(continuum.model.stress_labels)
    order = list(range(len(labels)))
    if continuum.gdim == 3:  # as VTK orders a symmetric tensor
        order = [labels.index(k) for k in ("xx", "yy", "zz", "xy", "yz", "xz")]
    of_cell = stress.function_space.dofmap.list[: len(cells), 0]
    of_cell_scalar = equivalent.function_space.dofmap.list[: len(cells), 0]
    return Grid(
        points=np.asarray(x)[nodes],
        cells=renumbered.reshape(cells.shape),
        kind=int(kinds[0]) if len(kinds) else 0,
        point_data={"displacement": in_space(continuum.layout.displacements(u.x.array)[nodes])},
        cell_data={
            "stress": stress.x.array.reshape(-1, len(labels))[of_cell][:, order],
            "von_mises": equivalent.x.array[of_cell_scalar],
        },
        components={"stress": [labels[i] for i in order]},
    )


def interface_grid(pair: Pair, fields: InterfaceFields) -> Grid:
    """The slave surface with its fields."""
    surface = pair.whole_surface
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
            **fields.bonds,
        },
        components={
            name: [f"{name}1{i}" for i in (1, 2, 3)]
            for name, values in fields.bonds.items()
            if values.ndim == 2
        },
    )


# -- files -----------------------------------------------------------------------------------------


class FieldSeries:
    """Writes the fields of a scene again and again; ParaView shows them as one series in time.

    ``out/fields.pvd`` shows the bodies and ``out/fields_NAME.pvd`` the interface called NAME;
    the numbers are in the folder ``out/fields``. After every write all files are whole, and what
    was there before stays as it was when a write fails.

    Args:
        source: A scene or its analysis.
        path: The .pvd file of the bodies.
        events: Events of the history at which the series, called as an observer, writes.
        every: Write at every n-th of them, 1 or more.

    Raises:
        InputError: The path does not end in .pvd, or ``every`` is not positive.

    Example:
        ``with FieldSeries(scene, "out/fields.pvd") as series: series.write()``
    """

    def __init__(
        self,
        source: Analysis | HasAnalysis,
        path: str | Path,
        *,
        events: tuple[str, ...] = ("start", "increment", "release"),
        every: int = 1,
    ) -> None:
        self.path = file_path("FieldSeries", "path", path)
        if self.path.suffix != ".pvd":
            raise InputError(f"fields are written to a .pvd file, not to '{path}'")
        every = whole("FieldSeries", "every", every)
        self._analysis = analysis_of(source)
        self._events = events
        self._every = every
        self._seen = 0
        self._folder = self.path.with_suffix("")
        self._parts = ["bodies"]
        for pair in self._analysis.pairs:
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
        analysis, comm = self._analysis, self._analysis.comm
        time = analysis.time if time is None else time
        u = displacement_function(analysis)
        bodies = body_grid(analysis, u, time)
        surfaces = [
            interface_grid(pair, fields)
            for pair, fields in zip(
                analysis.pairs, interface_fields(analysis, u, time), strict=True
            )
        ]
        task, folder = f"writing fields to '{self.path}'", ""
        with all_or_none(comm, task):
            if comm.rank == 0:
                self._folder.mkdir(parents=True, exist_ok=True)
                folder = tempfile.mkdtemp(prefix=f".{self.path.stem}.", dir=self.path.parent)
        temporary = Path(comm.bcast(folder))
        try:
            with all_or_none(comm, task):
                names = self._write_pieces(temporary, bodies, surfaces)
            with all_or_none(comm, task):
                if comm.rank == 0:
                    self._publish(temporary, names, float(time))
        finally:
            if comm.rank == 0:
                shutil.rmtree(temporary, ignore_errors=True)
        for steps, name in zip(self._steps, names, strict=True):
            steps.append((float(time), f"{self._folder.name}/{name}"))

    def _write_pieces(self, folder: Path, bodies: Grid, surfaces: list[Grid]) -> list[str]:
        """Write what this rank has; returns the file name of each part."""
        comm, number = self._analysis.comm, f"{len(self._steps[0]):05d}"
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


def write_fields(
    source: Analysis | HasAnalysis, path: str | Path, *, time: float | None = None
) -> None:
    """Write the present fields of a scene; collective, one back-solve.

    Args:
        source: A scene or its analysis, after a step.
        path: The .pvd file of the bodies; interfaces have files beside it, see
            :class:`FieldSeries`.
        time: Time in the series; that of the scene by default.

    Raises:
        InputError: The path does not end in .pvd, or no step was run yet.
        FxcrackError: A file could not be written; the old ones are still there.
    """
    FieldSeries(source, path).write(time)
