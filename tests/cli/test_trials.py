import json
import re
from collections.abc import Callable
from typing import Any

import pytest

from radarsim.autonomy.commands.trials import _failure_text
from radarsim.autonomy.evaluation.trials import TrialResult

Command = Callable[..., Any]
QUICK = ("trials", "bug_box", "--seeds", "1", "--workers", "1")


@pytest.mark.slow
def test_table_has_a_row_for_each_kind_of_trial(radarsim: Command) -> None:
    run = radarsim(*QUICK)
    assert run.code == 0
    head, *rows = run.text.splitlines()
    assert head.split() == [
        *(
            "map",
            "algorithm",
            "rule",
            "sensor",
            "success",
            "path",
            "m",
            "ratio",
            "touches",
        ),
        *("time", "s", "circuits"),
    ]
    one, two, _, last = rows
    assert one.split()[:5] == ["bug_box", "bug1", "share", "radar", "1/1"]
    assert two.split()[:5] == ["bug_box", "bug2", "share", "radar", "1/1"]
    assert float(one.split()[5]) > float(two.split()[5])
    assert re.fullmatch(r"2 trials in \d+\.\d s by 1 process", last)
    assert max(map(len, rows)) <= 80


def test_json_is_a_list_of_scores(radarsim: Command) -> None:
    options = ("--algorithms", "bug2", "--sensors", "laser", "--json")
    (told,) = json.loads(radarsim(*QUICK, *options).text)
    assert {key: told[key] for key in ("map", "algorithm", "sensor", "seed")} == {
        "map": "bug_box",
        "algorithm": "bug2",
        "sensor": "laser",
        "seed": 0,
    }
    assert told["outcome"] == "reached"
    assert told["collisions"] == 0
    assert told["shortest_path"] < told["path_length"] < told["time"]


@pytest.mark.parametrize(
    ("name", "texts"),
    [
        pytest.param("bug_bx", ["bug_bx", "bug_spiral"], id="unknown"),
        pytest.param("empty_room", ["no 'trial'"], id="no trial"),
    ],
)
def test_map_without_a_trial_is_an_error_that_lists_those_with_one(
    radarsim: Command, name: str, texts: list[str]
) -> None:
    run = radarsim("trials", name)
    assert (run.code, run.out) == (1, b"")
    assert all(text in run.err for text in texts)


@pytest.mark.parametrize(
    ("options", "texts"),
    [
        pytest.param(["--algorithms", "bug1,"], ["NAME,..."], id="empty"),
        pytest.param(["--algorithms", "bug3"], ["'bug3'", "'bug2'"], id="algorithm"),
        pytest.param(["--rules", "most"], ["'most'", "'thesis'"], id="rule"),
        pytest.param(["--sensors", "sonar"], ["'sonar'", "'laser'"], id="sensor"),
        pytest.param(["--seeds", "0"], ["--seeds"], id="seeds"),
        pytest.param(["--workers", "0"], ["--workers"], id="workers"),
    ],
)
def test_unknown_name_is_a_usage_error_that_lists_the_known_ones(
    radarsim: Command, options: list[str], texts: list[str]
) -> None:
    run = radarsim("trials", *options)
    assert (run.code, run.out) == (2, b"")
    for text in texts:
        assert text in run.err


def test_errors_of_a_map_are_printed(radarsim: Command, tmp_path: Any) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("version: 1\nobject: []\n")
    run = radarsim("trials", str(path))
    assert run.code == 1
    assert "mine.yaml:2:1: object" in run.err


def test_failed_trial_is_described() -> None:
    score = TrialResult(
        map="bug_maze",
        algorithm="bug1",
        sensor="radar",
        seed=3,
        rule="thesis",
        outcome="failed",
        collisions=2,
        path_length=1.0,
        shortest_path=2.0,
        time=3.0,
        circuits=0,
        off=4.0,
        note="no scan",
    )
    assert _failure_text(score) == (
        "bug_maze bug1 thesis radar seed 3: failed; no scan; collisions: 2"
    )
