"""A deck read: the scene it describes and its steps."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, cast

from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.checks import communicator, file_path
from fxcrack.base.errors import FxcrackError, InputError
from fxcrack.deck.cards import DeckError
from fxcrack.deck.explicit import SAFETY
from fxcrack.deck.left_out import without_unused
from fxcrack.deck.model import read_model
from fxcrack.deck.procedures import DeckStep
from fxcrack.deck.reader import read_cards
from fxcrack.deck.report import Report
from fxcrack.deck.tips import NodeNames
from fxcrack.deck.translate import Translated, translate
from fxcrack.history import History
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import on_root
from fxcrack.scene import Scene
from fxcrack.steps.explicit import Explicit


class Deck:
    """The scene of a keyword deck and its steps, which can be changed and run.

    Attributes:
        scene: The scene; another one may be put in its place, e.g. one of
            ``deck.scene.rebuilt(debonds=[...])``.
        steps: The steps in order: each has a name, a step for :meth:`fxcrack.Scene.run`, and the
            names of the interfaces that may grow in it.
        report: What was read, replaced and ignored.
        nodes: Names of the slave nodes of interfaces that may come apart, by title.
    """

    def __init__(
        self, scene: Scene, steps: list[DeckStep], report: Report, nodes: dict[str, NodeNames]
    ) -> None:
        self.scene = scene
        self.steps = steps
        self.report = report
        self.nodes = nodes

    def run(self, **options: Any) -> History:
        """Run all steps, one after the other; collective.

        Args:
            **options: Those of :meth:`fxcrack.Scene.run` but ``grow``.

        Returns:
            The history of all steps.

        Raises:
            InputError: An interface that is to grow is not part of the scene any more.
        """
        for step in self.steps:
            history = self.run_step(step, **options)
            if stopped(history, step):
                break
        return self.scene.history

    def run_step(self, step: DeckStep, **options: Any) -> History:
        """Run one step; arguments and errors as for :meth:`run`."""
        by_title = {d.interface.title: d for d in self.scene.debonds}
        for name in step.grow:
            if name not in by_title:
                raise InputError(
                    f"step '{step.name}': interface '{name}' is not part of the scene; take it out "
                    "of the step's grow"
                )
        return self.scene.run(step.step, grow=[by_title[n] for n in step.grow], **options)


def stopped(history: History, step: DeckStep) -> bool:
    """Whether the last step ended before its time: the steps after it have no state to begin with.

    It is said with what would help in the words of a deck.
    """
    if not history.reason.startswith("stopped"):
        return False
    log.warn("the analysis ends with this step; in a deck, %s", _help(history.reason, step))
    return True


def _help(reason: str, step: DeckStep) -> str:
    """What would help, by cards and parameters."""
    if isinstance(step.step, Explicit):
        if step.step.dt is not None:
            return (
                "a shorter increment on the data line of *DYNAMIC, EXPLICIT, DIRECT USER CONTROL "
                "(0.8 times as long, say), or leaving out DIRECT USER CONTROL lets increments "
                "follow the stable one, and *BULK VISCOSITY with 0., 0. leaves out the viscosity "
                "that shortens it"
            )
        return (
            "SCALE FACTOR of *DYNAMIC, EXPLICIT gives smaller increments (it is the safety over "
            f"{SAFETY:g}: SCALE FACTOR={0.8 * step.step.safety / SAFETY:.2g} for increments 0.8 "
            "times as long), and *BULK VISCOSITY with 0., 0. leaves out the viscosity that "
            "shortens the stable increment"
        )
    reached = re.search(r"\bf = ([0-9.e+-]+) ", reason)
    least = ""
    if reached:
        value = max(1.1 * (float(reached[1]) - 1.0), 1e-3)
        least = f"; f = {reached[1]} asks for UNSTABLE GROWTH TOLERANCE={value:.2g} at least"
    smaller = ""
    if "below the minimum" in reason:
        smaller = (
            "a smaller least increment (third field of the procedure's data line, which DIRECT "
            "takes away) or a smaller first one meets the onset; "
        )
    return smaller + (
        "UNSTABLE GROWTH TOLERANCE of *FRACTURE CRITERION (without a value it has no limit"
        f"{least}; it counts once a node has debonded) or a larger TOLERANCE lets several nodes "
        "debond in one increment, *CONTROLS, PARAMETERS=TIME INCREMENTATION (eighth field, I_A) "
        "allows more cutbacks, and INC of *STEP more increments"
    )


def read_deck(
    path: str | Path, comm: MPI.Intracomm = MPI.COMM_WORLD, *, order: int | None = None
) -> Deck:
    """Read a keyword deck, ``*.inp``; collective.

    What has no word in fxcrack is refused with file, line, card and what would help; what is
    computed in another way than the deck says is warned of once and listed in ``deck.report``.

    Args:
        path: The deck; it and the files it includes are opened on rank 0 only.
        comm: Communicator of the scene.
        order: 2 raises first-order elements to the second order, 1 leaves them what they are. By
            default those are raised that would lock in place of reduced integration or incompatible
            modes, and continuum shells. Nodes added between two nodes of a set belong to it where
            it is held.

    Raises:
        DeckError: The deck cannot be read, or asks for what fxcrack does not have.
        InputError: The scene it describes contradicts itself.
    """
    path = file_path("read_deck", "path", path)
    communicator("read_deck", comm)
    found = on_root(comm, lambda: translated(path, order), DeckError)
    return _made(found, path, comm, say=True)


def _made(found: Translated | None, path: Path, comm: MPI.Intracomm, *, say: bool) -> Deck:
    """The deck of what rank 0 has translated; collective.

    Args:
        found: On rank 0.
        path: The deck.
        comm: Communicator of the scene.
        say: Whether what is replaced is warned of.
    """
    raw = None if found is None else found.raw
    shared: tuple[dict[str, Any], list[DeckStep], Report, dict[str, NodeNames]] = comm.bcast(
        None if found is None else (found.arguments, found.steps, found.report, found.nodes)
    )
    arguments, steps, report, nodes = shared
    mesh = distribute(raw, comm, path.stem)
    try:
        scene = Scene(mesh, **arguments)
    except InputError as error:
        raise DeckError(f"{path.name}: {error}") from error
    finally:  # after the scene is made, whose report holds the warnings since then
        for line in [*report.replaced, *report.doubts] if say else ():
            log.warn("%s", line)
    return Deck(scene, steps, report, nodes)


def translated(path: Path, order: int | None = None) -> Translated:
    """A deck in the words of a scene; on one rank. Arguments and errors as of :func:`read_deck`."""
    report = Report(path.name)
    return _translated(path, report, order)


def _translated(path: Path, report: Report, order: int | None = None) -> Translated:
    try:
        cards = without_unused(read_cards(path), report)
        report.screen(cards)
        model = read_model(cards, report)
        report.check()
        return translate(model, report, order)
    except InputError as error:
        if isinstance(error, DeckError):
            raise
        raise DeckError(f"{path.name}: {error}") from error


def check_deck(
    path: str | Path, comm: MPI.Intracomm = MPI.COMM_WORLD, *, order: int | None = None
) -> Report:
    """What reading a deck would do: read, replaced, ignored, refused; collective.

    Args:
        path: The deck.
        comm: Communicator.
        order: As of :func:`read_deck`.

    Returns:
        The account, with all cards and elements that are refused by their name, and the first
        thing that is wrong otherwise.
    """
    report = Report(Path(path).name)
    found = None
    if comm.rank == 0:
        try:
            found = _translated(Path(path), report, order)
        except FxcrackError as error:
            first = str(error).split(" (and ")[0]
            if not any(first == line for line in report.refused):
                report.refused.append(str(error))
    report = cast(Report, comm.bcast(report))
    if not report.refused:
        try:
            _made(found, Path(path), comm, say=False).scene.close()
        except FxcrackError as error:
            report.refused.append(str(error))
    return report
