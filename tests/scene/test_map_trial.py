from pathlib import Path

import pytest
from map_texts import problems

from radarsim.scene.map_file import load_map, load_variants
from radarsim.scene.scene import Trial

HEAD = """\
version: 1
starts:
  - {name: RobotStart1, position: [0, 0, 0]}
  - {name: PlayerStart, position: [1, 0, 0]}
"""
KNOWN = "expected one of ['RobotStart1', 'PlayerStart']"
KEYS = "expected one of ['goal', 'safety_distance', 'start']"
WHOLE = "start: RobotStart1, goal: [7, -2.5], safety_distance: 0.5"


pytestmark = pytest.mark.usefixtures("mesh_folder")


@pytest.mark.parametrize("name", ["RobotStart1", "robotstart1"])
def test_map_may_have_a_trial(name: str) -> None:
    text = WHOLE.replace("RobotStart1", name)
    Path("m.yaml").write_text(f"{HEAD}trial: {{{text}}}\nvariants:\n  wet: {{air: }}\n")
    trial = Trial(name, (7.0, -2.5), 0.5)
    scenes = load_variants("m.yaml")
    assert [scene.trial for scene in scenes] == [trial, trial]
    assert scenes[0].start(name) == scenes[0].starts[0]


@pytest.mark.parametrize("line", ["", "trial:\n"])
def test_trial_is_optional(line: str) -> None:
    Path("m.yaml").write_text(HEAD + line)
    assert load_map("m.yaml").trial is None


@pytest.mark.parametrize(
    ("old", "new", "column", "expected"),
    [
        (
            "RobotStart1",
            "RobotStart2",
            16,
            f".start: 'RobotStart2' (did you mean 'RobotStart1'?), {KNOWN}",
        ),
        ("start: RobotStart1, ", "", 8, ".start: missing"),
        ("[7, -2.5]", "[7, 1001]", 39, ".goal.1: 1001, expected at most 1000"),
        pytest.param(
            "goal:", "aim: 1, goal:", 29, f".aim: unknown key, {KEYS}", id="unknown key"
        ),
    ],
)
def test_problem_of_a_trial_has_place_and_expectation(
    old: str, new: str, column: int, expected: str
) -> None:
    line = f"trial: {{{WHOLE.replace(old, new, 1)}}}\n"
    assert problems(HEAD + line) == [f"m.yaml:5:{column}: trial{expected}"]


def test_trial_may_name_an_invalid_start() -> None:
    text = f"version: 1\nstarts: [{{name: RobotStart1}}, 3]\ntrial: {{{WHOLE}}}\n"
    places = [problem.split(": ")[1] for problem in problems(text)]
    assert places == ["starts.0.position", "starts.1"]


def test_invalid_names_of_starts_are_not_proposed() -> None:
    text = HEAD.replace("RobotStart1", "Gate") + f"trial: {{{WHOLE}}}\n"
    first, second = problems(text)
    assert "starts.0.name: 'Gate', expected Robot, Player, ComSt or Point" in first
    assert second.endswith(".start: 'RobotStart1', expected one of ['PlayerStart']")
    text = text.replace("PlayerStart", "Door")
    *_, last = problems(text)
    assert last.endswith("trial.start: 'RobotStart1', expected the name of a start")
    *_, last = problems(
        text.replace("trial: {start: RobotStart1", "trial: {start: Gate")
    )
    assert "trial" not in last
