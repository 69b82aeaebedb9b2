"""Pictures of README and documentation are those that the demos draw now."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "demos" / "pictures"
# The container has the tests, not the pages.
pytestmark = pytest.mark.skipif(
    not (ROOT / "README.md").exists(), reason="the pages are not installed"
)


@pytest.fixture(scope="module")
def make() -> Any:
    spec = importlib.util.spec_from_file_location("make_figures", PICTURES / "make.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_picture_is_stale(make: Any) -> None:
    stale = make.stale()
    assert not stale, f"their demo has changed: python demos/pictures/make.py {' '.join(stale)}"


def test_every_picture_is_made_by_a_demo_and_shown(make: Any) -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    shown = {Path(link).stem for link in re.findall(r"\]\(([^)]*\.png)\)", text)}
    assert shown == set(make.FIGURES)
    assert {path.stem for path in PICTURES.glob("*.png")} == set(make.FIGURES)


def test_only_code_counts(make: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "demos").mkdir()
    files = {name: tmp_path / "demos" / f"{name}.py" for name in ("enf", "friction_enf")}
    for name, file in files.items():
        file.write_text((ROOT / "demos" / f"{name}.py").read_text(encoding="utf-8"))
    before = make.digest("friction_enf")
    monkeypatch.setattr(make, "ROOT", tmp_path)
    assert make.digest("friction_enf") == before
    text = files["enf"].read_text()
    files["enf"].write_text("# another remark\n" + text.replace("Grow the crack", "Let it grow"))
    assert make.digest("friction_enf") == before
    # it is drawn with what the demo enf defines
    files["enf"].write_text(text.replace("G_IIC = 0.774", "G_IIC = 0.775"))
    assert make.digest("friction_enf") != before
