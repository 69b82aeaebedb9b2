"""Command line: ``fxcrack run``, ``demo``, ``bench``, ``cost``, ``accuracy``, ``info``.

The same words run under mpirun: rank 0 prints, and an error ends all ranks. Bad input, found on
all ranks together, is one short message and exit code 1; wrong words are exit code 2. Any other
error keeps its traceback, and the rank that has it ends the job.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata
import importlib.util
import logging
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import fxcrack  # isort: skip  (orders MPI before DOLFINx, ends all ranks on an error)
import typer
from mpi4py import MPI
from rich import box
from rich.console import Console
from rich.table import Table
from typer.main import get_command

from fxcrack.base import log
from fxcrack.base.checks import positive
from fxcrack.base.errors import FxcrackError, InputError, raise_on_all_ranks
from fxcrack.base.files import check_writable, write_json
from fxcrack.base.machine import cores, machine_memory_mb
from fxcrack.base.parallel import all_arrive, end_all
from fxcrack.base.signals import Interrupted
from fxcrack.base.terminal import rank_0_console
from fxcrack.environment import information

_PATIENCE = 5.0  # seconds a rank that failed waits for the others to fail with it

app = typer.Typer(
    name="fxcrack",
    help="Crack propagation along predefined, initially bonded interfaces, on FEniCSx.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _check_outputs(outputs: Sequence[tuple[str, Path | None, bool]]) -> None:
    """Refuse outputs that could not be written, before anything is computed; collective.

    Args:
        outputs: Option, path if it was given, and whether that is a folder.
    """
    problem = None
    if MPI.COMM_WORLD.rank == 0:
        try:
            for option, path, folder in outputs:
                if path is not None:
                    check_writable(option, path, folder=folder)
        except InputError as error:
            problem = str(error)
    raise_on_all_ranks(MPI.COMM_WORLD, problem)


def _show_version(wanted: bool) -> None:
    if wanted:
        rank_0_console().print(f"fxcrack {fxcrack.__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Show the version and exit.", callback=_show_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Crack propagation along predefined, initially bonded interfaces, on FEniCSx."""


_LogOption = Annotated[
    str, typer.Option("--log", help="Log of this level on stderr: debug, info, warning, error.")
]
_QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No progress; warnings stay.")]


def _listen(level: str, quiet: bool) -> None:
    """Show the log of a level and above, and the progress unless it is not wanted."""
    log.show(level)
    log.progress.setLevel(logging.WARNING if quiet else logging.INFO)


# -- demos ---------------------------------------------------------------------------


def demo_titles() -> dict[str, str]:
    """Names of the installed demos and the first line of each, without importing them."""
    found = importlib.util.find_spec("fxcrack.demos")
    folders = found.submodule_search_locations if found is not None else None
    titles = {}
    for folder in folders or []:
        for path in sorted(Path(folder).glob("[!_]*.py")):
            text = path.read_text(encoding="utf-8")
            if "\ndef main(" in text:
                lines = (line.strip("#\"' ") for line in text.splitlines())
                titles[path.stem] = next((t for t in lines if t[:1].isalpha()), "")
    return titles


@app.command()
def demo(
    name: Annotated[str | None, typer.Argument(help="Which demo; without it they are listed.")] = (
        None
    ),
    out: Annotated[
        Path | None, typer.Option(help="Folder for results.", show_default="out/NAME")
    ] = None,
    fine: Annotated[bool, typer.Option("--fine", help="A finer mesh; takes longer.")] = False,
    checkpoint: Annotated[
        bool, typer.Option("--checkpoint", help="Keep state and history in OUT/checkpoints.")
    ] = False,
    restart: Annotated[
        bool, typer.Option("--restart", help="Go on from OUT/checkpoints, and keep them.")
    ] = False,
    level: _LogOption = "warning",
    quiet: _QuietOption = False,
) -> None:
    """Run a demo."""
    _listen(level, quiet)
    titles = demo_titles()
    if name is None:
        table = Table(box=None, show_header=False)
        for known, title in titles.items():
            table.add_row(known, title)
        rank_0_console().print(table if titles else "no demos are installed")
        return
    if name not in titles:
        raise InputError(f"there is no demo '{name}'; known: {', '.join(titles) or 'none'}")
    from fxcrack.restart.checkpoint import checkpoints

    folder = Path("out") / name if out is None else out
    _check_outputs([("--out", folder, True)])
    module = importlib.import_module(f"fxcrack.demos.{name}")
    with contextlib.ExitStack() as stack:
        if checkpoint or restart:
            stack.enter_context(checkpoints(folder / "checkpoints", restart=restart, seconds=10.0))
        module.main(folder, fine=fine)


# -- decks ---------------------------------------------------------------------------


@app.command()
def run(
    deck: Annotated[Path, typer.Argument(help="Keyword deck (*.inp).", metavar="DECK")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for results.", show_default="out/NAME")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Only list what is read, replaced, refused.")
    ] = False,
    order: Annotated[
        int | None, typer.Option(help="Order of the displacement [that of the elements].")
    ] = None,
    usual_names: Annotated[
        bool, typer.Option("--usual-names", help="Columns U1, RF1, ENRRT11, ALLSE, ...")
    ] = False,
    report: Annotated[
        bool, typer.Option("--report", help="Write report.html: pictures, energies, cost.")
    ] = False,
    level: _LogOption = "warning",
    quiet: _QuietOption = False,
) -> None:
    """Run a keyword deck, and write its history, fields, bonds and crack tips."""
    _listen(level, quiet)
    if deck.suffix == ".py":
        raise InputError(
            f"'{deck}' is a Python script, not a keyword deck; run it by python {deck}"
        )
    from fxcrack.deck.run import check_only, run_deck

    if check:
        check_only(deck, rank_0_console(), order=order)
        return
    folder = Path("out") / deck.stem if out is None else out
    run_deck(deck, folder, rank_0_console(), order=order, usual_names=usual_names, report=report)


# -- benchmarks ----------------------------------------------------------------------


@app.command()
def bench(
    name: Annotated[str, typer.Argument(help="dcb2d, dcb3d, scale or explicit", metavar="NAME")],
    dx: Annotated[
        float | None, typer.Option(help="Element length along the arms [0.0625, in 3-D 0.5].")
    ] = None,
    dy: Annotated[
        float | None, typer.Option(help="Element length across the width, 3-D only [2 dx].")
    ] = None,
    ny: Annotated[int | None, typer.Option(help="Elements over an arm's height [2/dx].")] = None,
    baseline: Annotated[
        bool, typer.Option("--baseline", help="Measure what other scripts would need, too.")
    ] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="File for the numbers.")] = None,
    repeat: Annotated[int, typer.Option(help="Measure so often, keep the fastest.", min=1)] = 1,
    sizes: Annotated[str, typer.Option(help="scale: dofs, e.g. 2e4,6e4.")] = "2e4,6e4,1.25e5",
    shapes: Annotated[str, typer.Option(help="scale: of block, plate, plane.")] = (
        "block,plate,plane"
    ),
    methods: Annotated[str, typer.Option(help="scale: of schur, iterative.")] = "schur,iterative",
    ranks: Annotated[str, typer.Option(help="scale: numbers of ranks.")] = "1,2",
    limit: Annotated[float, typer.Option(help="scale: seconds a case may take.")] = 900.0,
    memory: Annotated[
        float | None, typer.Option(help="scale: GB a case may take [80 % of the machine's].")
    ] = None,
    store: Annotated[
        Path | None, typer.Option(help="scale: file for the constants of the cost model.")
    ] = None,
    cases: Annotated[str, typer.Option(help="explicit: of 4k, 54k, 127k, 211k.")] = "4k,54k",
    finite: Annotated[bool, typer.Option("--finite", help="explicit: finite strain.")] = False,
) -> None:
    """Measure a speed problem: a crack that grows from a = 30 to a = 60 in a DCB.

    "scale" compares the direct and the iterative method, 1 rank and several, over sizes.
    "explicit" measures increments of explicit dynamics beside sparse products of the same matrix.
    """
    _check_outputs([("--json", json_file, False), ("--store", store, False)])
    if name == "scale":
        _scale(sizes, shapes, methods, ranks, limit, memory, json_file, store)
        return
    if name == "explicit":
        _explicit(cases, finite, json_file)
        return
    from fxcrack.bench.problem import Problem
    from fxcrack.bench.speed import run
    from fxcrack.bench.tables import show_speed

    problem = Problem.make(name, dx, dy, ny)
    result = run(problem, MPI.COMM_WORLD, baseline=baseline, repeat=repeat)
    show_speed(result, rank_0_console())
    if json_file is not None and MPI.COMM_WORLD.rank == 0:
        write_json(json_file, result)


def _explicit(cases: str, finite: bool, json_file: Path | None) -> None:
    from fxcrack.bench import explicit
    from fxcrack.bench.tables import show_explicit

    chosen = cases.split(",")
    unknown = [c for c in chosen if c not in explicit.CASES]
    if unknown:
        raise InputError(
            f"--cases: '{unknown[0]}' is none of the meshes; take some of "
            f"{', '.join(explicit.CASES)}, with commas"
        )
    comm = MPI.COMM_WORLD
    results = [explicit.run(explicit.CASES[c], comm, finite=finite) for c in chosen]
    show_explicit(results, rank_0_console())
    if json_file is not None and comm.rank == 0:
        write_json(json_file, {"cases": results})


def _scale(
    sizes: str,
    shapes: str,
    methods: str,
    ranks: str,
    limit: float,
    memory: float | None,
    json_file: Path | None,
    store: Path | None,
) -> None:
    from fxcrack.bench import scale
    from fxcrack.bench.fit_constants import fit_constants
    from fxcrack.bench.tables import show_scale

    comm = MPI.COMM_WORLD
    if comm.size > 1:
        raise InputError("'fxcrack bench scale' starts its ranks itself: run it without mpirun")
    try:
        given = [float(s) for s in sizes.split(",")], [int(r) for r in ranks.split(",")]
    except ValueError as error:
        raise InputError(f"sizes '{sizes}', ranks '{ranks}': give numbers with commas") from error
    cases = scale.suite(given[0], shapes.split(","), methods.split(","), given[1])
    positive("scale", limit=limit)
    if memory is not None:
        positive("scale", memory=memory)
    most = 0.8 * machine_memory_mb(comm) if memory is None else 1e3 * memory
    console = Console(stderr=True, highlight=False)

    def tell(case: dict[str, Any]) -> None:
        words = f"{case['shape']} {case['dofs']:.0f} {case['method']} {case['ranks']} ranks: "
        console.print(words + (case.get("failed") or f"{case['seconds']['total']:.1f} s"))

    result = scale.run(cases, memory_mb=most, limit=limit, tell=tell)
    show_scale(result, rank_0_console())
    reasons = [str(case["failed"]) for case in result["cases"] if case.get("failed")]
    if len(reasons) == len(result["cases"]):
        raise FxcrackError(f"no case gave a result: {reasons[0] if reasons else 'there is none'}")
    wanted = [(json_file, result), (store, fit_constants(result) if store else None)]
    for path, content in wanted:
        if path is not None:
            write_json(path, content)


@app.command()
def cost(
    dofs: Annotated[str, typer.Option(help="Displacement dofs.")] = "1e6,1e7,1e8",
    dim: Annotated[int, typer.Option(help="2 or 3.")] = 3,
    retained: Annotated[
        float, typer.Option(help="Retained jumps: components that open or are watched.")
    ] = 2e3,
    releases: Annotated[float, typer.Option(help="Events.")] = 500.0,
    shape: Annotated[str, typer.Option(help="block (compact) or plate (slender).")] = "block",
    ranks: Annotated[int | None, typer.Option(help="Ranks [as many as memory asks for].")] = None,
    memory: Annotated[
        float | None, typer.Option(help="GB per rank [this machine's over its cores].")
    ] = None,
    constants: Annotated[
        Path | None, typer.Option(help="File of 'bench scale --store' [the shipped one].")
    ] = None,
    window: Annotated[float | None, typer.Option(hidden=True)] = None,
) -> None:
    """Say what an analysis will cost, on how many ranks, and by which solver."""
    from fxcrack.bench.cost import Task, advise
    from fxcrack.bench.tables import show_cost
    from fxcrack.condensation.cost_laws import Constants, shipped

    if window is not None:
        log.warn("--window is now called --retained; the former name will be removed")
        retained = window
    if memory is not None:
        positive("cost", memory=memory)
    measured = shipped() if constants is None else Constants.read(constants)
    each = 1e9 * memory if memory else 1e6 * machine_memory_mb(MPI.COMM_WORLD) / cores()
    try:
        sizes = [float(n) for n in dofs.split(",")]
    except ValueError as error:
        raise InputError(f"dofs = '{dofs}': give numbers with commas") from error
    tasks = [Task(n, dim, retained, releases, shape) for n in sizes]
    found = [
        (task, advise(task, bytes_per_rank=each, ranks=ranks, constants=measured)) for task in tasks
    ]
    show_cost(found, measured, rank_0_console())


# -- accuracy ------------------------------------------------------------------------


@app.command()
def accuracy(
    scene: Annotated[
        str,
        typer.Argument(
            help="dcb, enf, mmb, penny, fatigue_dcb, strip_dcb (_enf, _slb, _mmb), or "
            "path/to/file.py:function, or package.module:function."
        ),
    ],
    budget: Annotated[float, typer.Option(help="Seconds all runs together may take.")] = 60.0,
    out: Annotated[
        Path | None, typer.Option(help="Folder for results.", show_default="out/accuracy/SCENE")
    ] = None,
    sizes: Annotated[
        str | None, typer.Option(help="Element sizes instead of the study's, e.g. 1,0.5,0.25.")
    ] = None,
    measure: Annotated[
        str, typer.Option(help="Quantity whose error counts: load, G, length or another measured.")
    ] = "worst",
) -> None:
    """Measure what accuracy costs in time, and advise the cheapest setting for 5, 1 and 0.1 %."""
    from fxcrack.accuracy import report
    from fxcrack.accuracy.run_study import run_study

    if MPI.COMM_WORLD.size > 1:
        raise InputError(
            "fxcrack accuracy starts processes of its own, on several ranks where it needs them; "
            "call it without mpirun"
        )
    try:
        chosen = [float(word) for word in sizes.split(",")] if sizes else []
    except ValueError:
        raise InputError(f"--sizes {sizes}: give numbers with commas, e.g. 1,0.5,0.25") from None
    console = rank_0_console()
    folder = Path("out") / "accuracy" / scene.rpartition(":")[2] if out is None else out
    _check_outputs([("--out", folder, True)])
    result = run_study(scene, budget=budget, sizes=chosen, measure=measure, tell=console.print)
    report.show(result, console)
    files = report.write(result, folder)
    console.print(f"files: {', '.join(str(f) for f in files)}")


# -- information ---------------------------------------------------------------------


@app.command()
def info() -> None:
    """Show versions, available solvers, ranks and threads."""
    table = Table(box=box.SIMPLE, show_header=False)
    for key, value in information().items():
        table.add_row(key, value)
    rank_0_console().print(table)


# -- errors and ranks ----------------------------------------------------------------


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line and exit.

    Args:
        argv: Words after the program's name, ``None`` for those it was called with.

    Raises:
        SystemExit: Always; with code 0, 1 (an error of fxcrack) or 2 (wrong words).
    """
    words = list(sys.argv[1:] if argv is None else argv)
    # its own communicator: nothing a failed command left unfinished can mix with it
    comm = MPI.COMM_WORLD.Dup()
    code: Any = 0
    message = ""
    try:
        with _only_rank_0_prints():
            log.show(logging.WARNING)
            get_command(app)(words, prog_name="fxcrack")
    except FxcrackError as error:
        code, message = 1, f"fxcrack: {error}"
    except SystemExit as end:
        code = end.code
        stopped = _interruption(end)
        if stopped is not None:
            code, message = stopped.code, f"fxcrack: {stopped}"
    if code:
        together = all_arrive(comm, _PATIENCE)
        if message and (comm.rank == 0 or not together):
            print(message, file=sys.stderr, flush=True)
        if not together:
            end_all(comm, code if isinstance(code, int) else 1)
    comm.Free()
    sys.exit(code)


def _interruption(end: BaseException | None) -> Interrupted | None:
    """The signal behind an exit: the command line turns Ctrl-C into an exit of its own."""
    while end is not None and not isinstance(end, Interrupted):
        end = end.__cause__ or end.__context__
    return end


@contextlib.contextmanager
def _only_rank_0_prints() -> Iterator[None]:
    """Let what the other ranks print vanish; uncaught errors still show."""
    if MPI.COMM_WORLD.rank == 0:
        yield
        return
    with (
        open(os.devnull, "w", encoding="utf-8") as nowhere,
        contextlib.redirect_stdout(nowhere),
        contextlib.redirect_stderr(nowhere),
    ):
        yield
