"""The Python of every tutorial runs as it stands; links and names on pages lead somewhere."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
from pathlib import Path

import pytest

import fxcrack as fx

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: getattr(page, "stem", "none"))
def test_names_and_arguments_exist(page: Path) -> None:
    """Whatever a page names of the package exists, in code that does not run as well."""
    text = page.read_text()
    wrong = [f"fx.{n}" for n in re.findall(r"\bfx\.([A-Za-z_]\w*)", text) if not hasattr(fx, n)]
    for call in re.finditer(r"\b(?:fx\.)?([A-Z]\w+)\(", text):
        called = getattr(fx, call[1], None)
        if not isinstance(called, type) or not dataclasses.is_dataclass(called):
            continue
        known = inspect.signature(called).parameters
        wrong += [f"{call[1]}({k}=)" for k in keywords(text, call.end()) if k not in known]
    wrong += [
        name
        for name in re.findall(r"`((?:[a-z_]+/)+\w+\.py)`", text)
        if not any((ROOT / base / name).exists() for base in ("", "fxcrack"))
    ]
    assert not wrong


def keywords(text: str, start: int) -> list[str]:
    """Keyword arguments of a call of Python in a text, none where it is not whole."""
    depth, end = 1, start
    while end < len(text) and depth and end - start < 600:
        depth += (text[end] in "([{") - (text[end] in ")]}")
        end += 1
    if depth:
        return []
    try:
        call = ast.parse(f"f({text[start : end - 1].replace('`', '')})", mode="eval").body
    except SyntaxError:
        return []
    return [k.arg for k in call.keywords if k.arg] if isinstance(call, ast.Call) else []


def test_wrong_names_would_be_found() -> None:
    assert keywords("VCCT(GIc=0.2, mix=fx.BK(eta=1.6)) and more (a=1)", 5) == ["GIc", "mix"]
    assert keywords("VCCT(GIc=0.2, ", 5) == []
