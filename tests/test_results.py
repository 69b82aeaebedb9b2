"""Working with results: descriptions, notebooks, frames, pictures in one's own axes, the report."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.output import plots


def grown(comm: MPI.Intracomm) -> fx.Scene:
    bond = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] > 30.0 - 1e-6, name="bond"
    )
    scene = fx.Scene(
        dcb_2d(comm, length=60.0, dx=1.5, ny=1),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.3))],
    )
    scene.run(fx.Static(until=[fx.CrackLength(bond, 36.0)]), progress=False)
    return scene


@pytest.mark.mpi
@pytest.mark.three
def test_the_report_holds_everything_in_one_file(comm: MPI.Intracomm, shared_path: Path) -> None:
    pytest.importorskip("jinja2")
    scene = grown(comm)
    scene.report(shared_path / "report.html", title="Arms < 2 mm")
    text = (shared_path / "report.html").read_text(encoding="utf-8")
    assert "<h1>Arms &lt; 2 mm</h1>" in text  # text of users is not taken for markup
    assert text.count("data:image/png;base64,") == 3
    assert "src=" in text and "http" not in text  # nothing is fetched
    assert scene.history.describe().splitlines()[0] in text
    assert f"<td>{scene.history['R[pin_top.y]'][3]:.6g}</td>" in text
    assert "There were no warnings." in text


@pytest.mark.slow
def test_a_report_names_the_warnings_of_its_own_scene(comm: MPI.Intracomm, tmp_path: Path) -> None:
    pytest.importorskip("jinja2")
    fx.base.log.warn("said before the scene was made")
    scene = grown(comm)
    fx.base.log.warn("said of %s", "<this> one")
    scene.report(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "said of &lt;this&gt; one" in text and "said before" not in text


def test_a_report_needs_a_step_and_its_library(
    comm: MPI.Intracomm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = grown(comm)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    monkeypatch.delitem(sys.modules, "fxcrack.output.report", raising=False)
    with pytest.raises(fx.InputError, match="report needs jinja2, which is not installed"):
        scene.report(tmp_path / "report.html")
    monkeypatch.undo()
    pytest.importorskip("jinja2")
    with pytest.raises(fx.InputError, match="its report"):
        scene.rebuilt().report(tmp_path / "report.html")
    assert not (tmp_path / "report.html").exists()


def test_a_description_says_what_happened(comm: MPI.Intracomm) -> None:
    assert fx.History(comm).describe() == str(fx.History(comm)) == "no rows: no step was run"
    scene = grown(comm)
    history = scene.history
    text = history.describe()
    assert text == str(history)
    assert repr(history).startswith(f"<History of {len(history)} rows and ")
    at = int(np.argmax(np.abs(history["R[pin_top.y]"])))
    for words in (
        f"{len(history)} rows: 1 start, 4 onset, 4 release",
        f"largest R[pin_top.y]: {history['R[pin_top.y]'][at]:.6g} at u = ",
        f"length from {history['a[bond]'][0]:.6g} to 36, 4 nodes released",
        "largest error of the energy balance: ",
    ):
        assert words in text
    html = history._repr_html_()
    assert html.count("<tr>") == min(len(history), 13) + 1
    assert "length from" in html and "<pre>solver: linear" in scene._repr_html_()


def test_a_frame_has_the_columns_of_the_history(
    comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch
) -> None:
    history = grown(comm).history
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "pandas", None)
        with pytest.raises(fx.InputError, match="to_frame needs pandas"):
            history.to_frame()
    pytest.importorskip("pandas")
    frame = history.to_frame()
    assert list(frame.columns) == history.columns and len(frame) == len(history)
    assert np.array_equal(frame["time"].to_numpy(), history["time"])


def test_plots_take_axes_and_return_their_figure(comm: MPI.Intracomm, tmp_path: Path) -> None:
    scene = grown(comm)
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert scene.history.plot(ax=left) is figure
    assert plots.energies(scene.history, tmp_path / "both.png", ax=right) is figure
    assert (tmp_path / "both.png").stat().st_size > 0
    assert len(left.lines) and [t.get_text() for t in right.get_legend().get_texts()] == [
        "work of loads and supports",
        "strain energy",
        "energy released by growth",
    ]
    alone = plots.r_curve(scene.history, None, "bond")
    assert isinstance(alone, Figure) and alone is not figure
    assert isinstance(plots.deformed(scene), Figure)
    with pytest.raises(fx.InputError, match="no rows"):
        plots.energies(fx.History(comm))
