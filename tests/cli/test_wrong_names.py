"""Messages about names that do not exist say which one may be meant."""

from pathlib import Path

import pytest

from .conftest import RunCommand

SCAN = ("scan", "empty_room", "--start", "RobotStart1", "--sensor")
BUG = ("navigate", "bug_box", "--algorithm", "bug1")


@pytest.mark.parametrize(
    ("command", "meant"),
    [
        (("check", "foliage_rom"), "foliage_room"),
        (("check", "foliage_rom@dust"), "foliage_room"),
        (("check", "marulan_trial@dut"), "dust"),
        ((*SCAN, "radr"), "radar"),
        ((*SCAN, "radar", "--set", "max_rnge=2"), "max_range"),
        ((*SCAN, "radar", "--set", "return_mode=lst"), "last"),
        (("scan", "empty_room", "--sensor", "sick", "--start", "RobotStrt2"), "Robot"),
        (("sensors", "rader"), "radar"),
        (("materials", "foliag"), "foliage"),
        (
            ("serve", "empty_room", "--port", "0", "--set", "lms20.max_range=1"),
            "lms200",
        ),
        (
            ("serve", "empty_room", "--port", "0", "--set", "lms200.max_rang=1"),
            "max_range",
        ),
        (("serve", "empty_room", "--port", "0", "--set", "INS.sigm=1"), "sigma"),
        (("serve", "empty_room", "--dialect", "comat"), "compat"),
        (("trials", "--algorithms", "bug"), "bug"),
        (("trials", "--sensors", "rader"), "radar"),
        (("trials", "bug_bx"), "bug_box"),
        (("navigate", "--algorithm", "bug3"), "bug"),
        ((*BUG, "--start", "RobotStart9"), "RobotStart1"),
        ((*BUG, "--robot", "P3AT_Rada360"), "P3AT_Radar360"),
        ((*BUG, "--robot", "USARBot.P3AT_Rada360"), "P3AT_Radar360"),
        ((*BUG, "--scanner", "lms201"), "lms200"),
        (("map", "empty_room", "-o", "{}/m", "--robot", "P3A_Radar360"), "P3AT_R"),
    ],
)
def test_the_name_that_may_be_meant_is_suggested(
    radarsim: RunCommand, tmp_path: Path, command: tuple[str, ...], meant: str
) -> None:
    run = radarsim(*(argument.format(tmp_path) for argument in command))
    assert run.code in (1, 2)
    message = run.text + run.err
    assert f"did you mean '{meant}" in message
    assert "expected" in message


def test_maps_beside_the_one_that_is_missing_are_suggested(
    radarsim: RunCommand, tmp_path: Path
) -> None:
    (tmp_path / "my_room.yaml").touch()
    run = radarsim("check", str(tmp_path / "my_rom.yaml"))
    assert f"did you mean '{tmp_path}/my_room.yaml'" in run.text


def test_names_in_a_map_are_suggested(radarsim: RunCommand, tmp_path: Path) -> None:
    file = tmp_path / "room.yaml"
    file.write_text(
        "version: 1\n"
        "objecs: []\n"
        "materials:\n"
        "  bark: {based_on: wod}\n"
        "objects:\n"
        "  - {name: a, box: [1, 1, 1], material: concret}\n"
        "  - {name: b, box: [1, 1, 1], material: brk}\n"
        "  - {name: c, box: [1, 1, 1], material: bark, positon: [0, 0, 0]}\n"
        "starts:\n"
        "  - {name: RobotStart1, position: [0, 0, 0]}\n"
        "trial: {start: RobotStrt1, goal: [1, 1], safety_distance: .5}\n"
    )
    run = radarsim("check", str(file))
    for name in ("objects", "wood", "concrete", "bark", "position", "RobotStart1"):
        assert f"did you mean '{name}'?" in run.text


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (("drive", "--connect", "a:99999"), "'a:99999', expected HOST:PORT"),
        (("serve", "a", "--port", "x"), "'x', expected a whole number"),
        (("serve", "a", "--port", "99999"), "'99999', expected at most 65535"),
        (("serve", "a", "--speed", "x"), "'x', expected a number"),
        (("serve", "a", "--seed", "-1"), "'-1', expected at least 0"),
        (("navigate", "--algorithm", "x"), "'x', expected one of ['bug1', 'bug2',"),
        ((*SCAN, "radar", "--set", "max_range=x"), "'x', expected a number"),
        ((*SCAN, "radar", "--set", "max_range=0"), "0, expected at least 0.001"),
        ((*SCAN, "radar", "--set", "ray_weights=1"), "1, expected a list"),
    ],
)
def test_wrong_values_are_told_in_the_words_of_the_program(
    radarsim: RunCommand, command: tuple[str, ...], expected: str
) -> None:
    run = radarsim(*command)
    assert run.code == 2
    assert expected in run.err
    assert "nput should" not in run.err
    assert "alue error" not in run.err
