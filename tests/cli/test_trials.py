import json
from pathlib import Path
from typing import Any

import pytest
from commands import run_in_process as radarsim

from radarsim.autonomy.evaluation.trials import TrialResult

QUICK = ("trials", "bug_box", "--seeds", "1", "--workers", "1")


def test_table_has_a_row_for_each_kind_of_trial_and_a_line_for_each_failure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    failed = {"outcome": "failed", "note": "no scan", "collisions": 2}

    def run(
        map_: str, algorithm: str, sensor: str, seed: int, rule: str
    ) -> TrialResult:
        row: dict[str, Any] = {"collisions": 0, "path_length": 9.0, "time": 3.0}
        row |= {"shortest_path": 6.0, "circuits": 0, "off": 0.1}
        return TrialResult(
            map=map_,
            algorithm=algorithm,
            sensor=sensor,
            seed=seed,
            rule=rule,
            **row | (failed if algorithm == "bug2" else {"outcome": "reached"}),
        )

    monkeypatch.setattr("radarsim.autonomy.evaluation.trials.run_trial", run)
    run_ = radarsim(*QUICK)
    assert run_.code == 0
    head, one, two, _, failure, last = run_.text.splitlines()
    assert head.split()[:5] == ["map", "algorithm", "rule", "sensor", "success"]
    assert " ".join(one.split()) == "bug_box bug1 share radar 1/1 9.00 1.50 0 3.0 0.0"
    assert " ".join(two.split()[:5]) == "bug_box bug2 share radar 0/1"
    assert failure.endswith(" share radar seed 0: failed; no scan; collisions: 2")
    assert last.startswith("2 trials in ")
    assert last.endswith(" s by 1 process")
    assert max(map(len, (head, one, two, last))) <= 80


def test_json_is_a_list_of_scores(tmp_path: Path) -> None:
    yard = tmp_path / "yard.yaml"
    yard.write_text(
        "version: 1\nobjects: [{name: pole, box: [0.2, 0.2, 1], material: metal}]\n"
        "starts: [{name: RobotStart1, position: [-2.5, 2, 0]}]\n"
        "trial: {start: RobotStart1, goal: [-1.5, 2], safety_distance: 0.5}\n"
    )
    options = ("--algorithms", "bug2", "--sensors", "laser", "--seeds", "1", "--json")
    (data,) = json.loads(radarsim("trials", yard, *options).text)
    expected = {"map": str(yard), "algorithm": "bug2", "sensor": "laser", "seed": 0}
    assert data.items() >= (expected | {"outcome": "reached", "collisions": 0}).items()
    assert data["shortest_path"] == 1.0
    assert 0.8 < data["path_length"] < data["time"]
