"""What users do with scenes and results that the documentation does not speak of."""

from __future__ import annotations

import copy
import os
import pickle
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI
from specimens import grow_to, specimen

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d


def mesh(comm: MPI.Comm) -> fx.Mesh:
    return dcb_2d(comm, length=60.0, dx=2.0, ny=1)


@pytest.mark.mpi
def test_a_scene_is_not_changed_copied_or_pickled(comm: MPI.Comm) -> None:
    scene = specimen(mesh(comm))
    for name, words in (("materials", r"scene.rebuilt\(materials=...\)"), ("contact", "rebuilt")):
        with pytest.raises(fx.InputError, match=rf"not changed by scene.{name} = .*{words}"):
            setattr(scene, name, None)
    assert isinstance(scene.debonds, tuple)
    assert repr(scene).startswith("<Scene of mesh 'dcb_2d', PlaneStrain, interfaces: 'bond'")
    for copied in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(fx.InputError, match=r"cannot be copied or pickled.*rebuilt\(\)"):
            copied(scene)
        with pytest.raises(fx.InputError, match=r"mesh 'dcb_2d' .*cannot be copied or pickled"):
            copied(scene.mesh)


class Careless(fx.Criterion):
    """A criterion whose parts a user has got wrong."""

    def __init__(self, found: object) -> None:
        self.found = found

    def evaluator(self, probe: Any, temperature: Any, *, softens: bool = False) -> Any:
        if not callable(self.found):
            return self.found
        return fx.TipEvaluator(probe, self.found)


class NoSoftening(Careless):
    def evaluator(self, probe: Any) -> Any:
        return None


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("criterion", "words"),
    [
        (Careless(None), r"Careless.evaluator returned None \(it lacks .*return an Evaluator"),
        (NoSoftening(None), r"NoSoftening.evaluator must take \(probe, temperature, \*, softens"),
        (Careless(lambda t, f, w: 1 / 0), "fails with ZeroDivisionError: division by zero"),
        (Careless(lambda t, f, w: (f[:, 0, 0], {"G": "x"})), "fails with ValueError: could not"),
        (Careless(lambda t, f, w: (f[:, 0, 0], {"G": f})), r"reports 'G' of shape \(1, 1, 3\)"),
    ],
)
def test_mistakes_in_an_own_criterion_are_named(
    comm: MPI.Comm, criterion: fx.Criterion, words: str
) -> None:
    with pytest.raises(fx.InputError, match=f"interface 'bond': .*{words}"):
        grow_to(specimen(mesh(comm), criterion=criterion), 40.0)


def test_classes_in_place_of_objects() -> None:
    with pytest.raises(fx.InputError, match=r"'bond': Careless is not a criterion \(it is a class"):
        specimen(mesh(MPI.COMM_SELF), criterion=Careless)
    with pytest.raises(fx.InputError, match=r"FiniteStrain is a class; make one, FiniteStrain\("):
        specimen(mesh(MPI.COMM_SELF), effects=[fx.FiniteStrain])


def test_rows_of_a_history_by_slices_and_files_of_other_kinds(tmp_path: Path) -> None:
    scene = specimen(mesh(MPI.COMM_SELF))
    history = grow_to(scene, 32.0)
    assert history[-2:] == [history[-2], history[-1]]
    with pytest.raises(fx.InputError, match="history: column"):
        history[None]
    words = r"a report is an .html file, not 'run.pdf'"
    with pytest.raises(fx.InputError, match=words if find_spec("jinja2") else "report needs"):
        scene.report("run.pdf")
    # what is no file is written to, and stays what it is
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    history.to_csv(pipe)
    assert os.read(reader, 1 << 16).startswith(b"time,event,") and pipe.is_fifo()
    os.close(reader)
    if Path("/dev/full").is_char_device():
        with pytest.raises(fx.FxcrackError, match="No space left on device"):
            history.to_csv("/dev/full")
        assert Path("/dev/full").is_char_device()
    with pytest.raises(fx.InputError, match=r"is a keyword deck; read it with read_deck\('x.inp'"):
        fx.read_mesh("x.inp")


def test_another_end_than_that_of_the_checkpoint(tmp_path: Path) -> None:
    save = fx.Checkpoint(tmp_path / "run.npz")
    scene = specimen(mesh(MPI.COMM_SELF))
    until = [fx.CrackLength(scene.debonds[0].interface, length) for length in (32.0, 34.0)]
    scene.run(fx.Static(until=until[0]), checkpoint=save)
    again = scene.rebuilt()
    with pytest.raises(
        fx.InputError, match=r"another step of this scene: step.until.length: .*To go further"
    ):
        again.run(fx.Static(until=until[1]), checkpoint=save, restart=True)
    again = scene.rebuilt()  # as the message says
    again.run(fx.Static(until=until[0]), checkpoint=save, restart=True)
    assert again.run(fx.Static(until=until[1]), checkpoint=save)[-1]["a[bond]"] == 34.0


def test_too_few_increments_are_told(caplog: pytest.LogCaptureFixture) -> None:
    moved = specimen(
        mesh(MPI.COMM_SELF),
        materials=fx.Isotropic(70e3, 0.3, density=2700.0),  # kg/m^3 beside mm and N
        effects=[fx.Inertia()],
    )
    moved.run(fx.Explicit(until=fx.Time(1e-4)))
    assert "is over after 1 of them" in caplog.text and "tonnes per mm^3" in caplog.text
    moved.run(fx.Explicit(until=fx.Time(2e-4)))  # further steps may be short
    assert caplog.text.count("is over after") == 1
