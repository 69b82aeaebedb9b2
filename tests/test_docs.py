"""The Python of every tutorial runs as it stands, and links between pages lead somewhere."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
# The container has the tests, not the pages.
pytestmark = pytest.mark.skipif(not PAGES, reason="the pages are not installed")


def code_of(page: Path) -> str:
    """The Python blocks of a page, one after the other."""
    return "\n".join(re.findall(r"^```python\n(.*?)^```", page.read_text(), flags=re.M | re.S))


TUTORIALS = [page for page in PAGES if code_of(page)]


@pytest.mark.demos
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: getattr(page, "stem", "none"))
def test_tutorials_run_as_they_stand(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(code_of(page), str(page), "exec"), {"__name__": page.stem})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: getattr(page, "stem", "none"))
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text())
    missing = [link for link in links if not (page.parent / link).exists()]
    assert not missing
