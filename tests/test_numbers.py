"""Numbers of README and documentation are those of the runs and of the code."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
NUMBERS = ROOT / "docs" / "numbers" / "make.py"
# The container has the tests, not the pages.
pytestmark = pytest.mark.skipif(not NUMBERS.exists(), reason="the pages are not installed")


@pytest.fixture(scope="module")
def make() -> Any:
    spec = importlib.util.spec_from_file_location("make_numbers", NUMBERS)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_number_is_stale(make: Any) -> None:
    stale = make.stale()
    assert not stale, f"their demo has changed: python docs/numbers/make.py {' '.join(stale)}"


def test_pages_say_what_runs_and_code_give(make: Any) -> None:
    numbers, used = make.texts(), set()
    for page in make.pages():
        content = page.read_text(encoding="utf-8")
        assert not re.search(r"^ *<!--n [\w.]+-->(?!\n)", content, flags=re.M), "begins a line"
        for name, text in make.marks(content):
            used.add(name)
            assert text == numbers.get(name), f"{page.name}: {name}; python docs/numbers/make.py"
    assert used == set(numbers)


def test_a_number_is_filled_in(make: Any) -> None:
    page = "at <!--n a.b-->1.2<!--/n--> and <!--n c-->\n| old |\n<!--/n--> as it is"
    assert make.marks(page) == [("a.b", "1.2"), ("c", "\n| old |\n")]
    now = make.filled(page, {"a.b": "1.3", "c": "\n| new |\n"})
    assert now == "at <!--n a.b-->1.3<!--/n--> and <!--n c-->\n| new |\n<!--/n--> as it is"
    with pytest.raises(KeyError):
        make.filled(page, {"c": ""})
    # a deviation is rounded up: what a page says holds
    assert make.off([0.9988, 1.0011]) == "0.2 %" and make.off([1.0, 1.001001]) == "0.2 %"
