"""``fxcrack run``: a deck from the command line."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI
from rich.console import Console

from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none
from fxcrack.deck.cards import DeckError
from fxcrack.deck.deck import check_deck, read_deck, stopped
from fxcrack.deck.tips import TipReport
from fxcrack.history import History
from fxcrack.output.fields import write_fields
from fxcrack.output.tables import write_releases
from fxcrack.output.usual_names import with_usual_names
from fxcrack.steps.cycles import Cycles


def check_only(path: Path, console: Console, *, order: int | None = None) -> None:
    """Print what reading a deck would do; collective.

    Args:
        path: The deck.
        console: Where rank 0 prints.
        order: Order of the displacement; that of the elements by default.

    Raises:
        DeckError: Something is refused.
    """
    report = check_deck(path, order=order)
    console.print(str(report), markup=False, soft_wrap=True)
    if report.refused:
        raise DeckError(f"'{path}': {len(report.refused)} entries are refused; see the list above")


def run_deck(
    path: Path,
    out: Path,
    console: Console,
    *,
    order: int | None = None,
    usual_names: bool = False,
    report: bool = False,
) -> History:
    """Run all steps of a deck and write what came out; collective.

    Files in ``out``: report.txt, history.csv and .json, fields.pvd; with debonds tips.txt and
    releases.csv.

    Args:
        path: The deck.
        out: Folder for the files.
        console: Where rank 0 prints.
        order: Order of the displacement; that of the elements by default.
        usual_names: Whether the columns of history.csv have the names of keyword programs.
        report: Whether report.html is written as well, see :meth:`fxcrack.Scene.report`.

    Raises:
        DeckError: The deck is refused.
    """
    deck = read_deck(path, order=order)
    comm = MPI.COMM_WORLD
    with all_or_none(comm, f"writing {out / 'report.txt'}"):
        if comm.rank == 0:
            with replacing(out / "report.txt") as temporary:
                temporary.write_text(str(deck.report), encoding="utf-8")
    tips = TipReport(deck.scene.analysis, deck.nodes)
    for step in deck.steps:
        tips.begin(step.name, step.frequency, cycles=isinstance(step.step, Cycles))
        observers = [tips] if any(step.frequency.values()) else []
        history = deck.run_step(step, save=out / "history.csv", observers=observers)
        console.print(f"step '{step.name}': {history.reason}", markup=False, soft_wrap=True)
        if stopped(history, step):
            break
    history = deck.scene.history
    (with_usual_names(history) if usual_names else history).to_csv(out / "history.csv")
    history.to_json(out / "history.json")
    if deck.steps:
        write_fields(deck.scene, out / "fields.pvd")
        if deck.scene.debonds:
            with all_or_none(comm, f"writing {out / 'tips.txt'}"):
                if comm.rank == 0:
                    with replacing(out / "tips.txt") as temporary:
                        temporary.write_text(tips.text, encoding="utf-8")
            write_releases(deck.scene, out / "releases.csv")
        if report:
            deck.scene.report(out / "report.html", title=path.name)
    console.print(f"files in {out}", markup=False, soft_wrap=True)
    deck.scene.close()
    return history
