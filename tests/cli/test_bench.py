import json
from collections.abc import Callable
from typing import Any

import pytest

from radarsim.lab.bench import run as bench
from radarsim.lab.bench.timing import BenchmarkRow

Command = Callable[..., Any]
ROWS = [
    BenchmarkRow("a", "kept row", 2.5, "x", 3.0, "5 us against 2"),
    BenchmarkRow("f", "missed row", 600.0, "ms", 500.0),
]


@pytest.fixture(autouse=True)
def _no_measuring(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in list(bench.STEPS):
        monkeypatch.delitem(bench.STEPS, name)
    monkeypatch.setitem(bench.STEPS, "two rows", (lambda: iter(ROWS), 1))


def test_table_shows_which_limits_are_kept(radarsim: Command) -> None:
    text = radarsim("bench").text
    assert "kept; 5 us against 2" in " ".join(text.replace("│", " ").split())
    assert "MISSED" in text
    assert "(f) start-up" in text


def test_json_is_a_list_of_rows(radarsim: Command) -> None:
    run = radarsim("bench", "--json")
    rows = json.loads(run.text)
    assert [row["name"] for row in rows] == ["kept row", "missed row"]
    assert [row["within"] for row in rows] == [True, False]
