"""Errors of usage: exit code 2, and one line with the error and a hint."""

import os
import shlex
import sys
from pathlib import Path

import pytest
from commands import run_in_process as radarsim

# Messages by options, by the command that they follow.
WRONG = {
    "": {
        "sarve": "COMMAND: 'sarve' (did you mean 'serve'?), expected one of ['serve',",
        "recording inf": "COMMAND: 'inf' (did you mean 'info'?), expected one of",
        "--xyzzy": "'--xyzzy', expected another option; see 'radarsim --help'",
        "sensors --xyzzy": "'--xyzzy', expected another option; see 'radarsim sensors ",
        "sensors --json=3": "--json: takes no value",
        "sensors radar rader": "'rader' (did you mean 'radar'?), expected one of",
        "materials wod": "material 'wod' (did you mean 'wood'?), expected one of",
        "docs radr": "TOPIC: 'radr' (did you mean 'radar'?), expected one of",
        "scan": "missing: MAP, --sensor, one of --start and --pose; see 'radarsim scan",
        "scan empty_room": "missing: --sensor, one of --start and --pose; see",
        "check": "missing: MAP; see 'radarsim check --help'",
        "check a b c": "'b c', expected no more arguments; see 'radarsim check --help'",
        "check empty_room --plot plan.gif": "expected a .png, .svg or .pdf file",
        "replay no_folder --speed 1,5": "expected a number with a decimal point, 1.5",
    },
    "serve empty_room": {
        "--prot 1": "'--prot' (did you mean '--port'?), expected another option",
        "--port": "--port: needs a value",
        "--port x": "--port: 'x', expected a whole number",
        "--port 70000": "--port: '70000', expected at most 65535",
        "--port 5003 --image-port 5003": "--image-port: 5003 is the port of --port",
        "--port 8123 --web 8123": "--web: 8123 is the port of --port, expected another",
        "--navtech x": "--navtech: 'x', expected PORT or PORT:ROBOT",
        "--navtech 0:": "--navtech: '0:', expected the name of a robot after the colon",
        "--speed 0": "--speed: '0', expected more than 0",
        "--speed nan": "--speed: 'nan', expected a finite number",
        "--dialect comat": "--dialect: 'comat' (did you mean 'compat'?), expected one",
        "--set max_range=20": "--set: 'max_range=20', expected ITEM.KEY=VALUE",
        "--set .max_range=20": "--set: '.max_range=20', expected ITEM.KEY=VALUE",
        "--set lms200.=2": "--set: 'lms200.=2', expected ITEM.KEY=VALUE",
        "--set a.b": "--set: 'a.b', expected ITEM.KEY=VALUE",
        "--set INS.sigm=1": "item INS: ins: no setting 'sigm' (did you mean 'sigma'?)",
        "--set InsTest.sigma=-1": "item InsTest: ins: sigma: -1, expected at least 0",
        "--set LMS200.max_rnge=3": "--set: item lms200: sensor radar: no setting 'max_",
        "--set Odometer.sigma=1": "item 'Odometer': type Odometry has no settings",
    },
    "drive": {
        "": "stdin is not a terminal, expected an interactive terminal",
        "--port 3001": "'--port', expected --connect HOST:PORT",
        "--connect a:0": "--connect: 'a:0', expected HOST:PORT",
    },
    "scan empty_room --sensor radar --start RobotStart1": {
        "--sensor rader": "'rader' (did you mean 'radar'?), expected one of ['hokuyo',",
        "--start RobotStrt2": "'RobotStrt2' (did you mean 'RobotStart2'?), expected",
        "--count 0": "--count: '0', expected at least 1",
        "--pose 0,0,0": "expected only one of --start and --pose",
        "--pose 0,0": "--pose: '0,0', expected X,Y,YAW_DEG or X,Y,Z,ROLL,PITCH,YAW_DEG",
        "--pose 0,0,nan": "--pose: '0,0,nan', expected X,Y,YAW_DEG or X,Y,Z,ROLL,PITCH",
        "-o no/a.json": "-o: cannot write no/a.json: no such folder",
        "-o a.gif": "-o: a.gif, expected a .json, .csv, .png, .svg or .pdf file",
        "-o a.txt": ".pdf file, or --format",
        "-o a.png --format json": "--format: json, expected png, the ending of a.png",
        "--set max_range": "--set: 'max_range', expected KEY=VALUE",
        "--set max_range=x": "sensor radar: max_range: 'x', expected a number",
        "--set max_range=-1": "sensor radar: max_range: -1, expected at least 0.001",
        "--set ray_weights=1": "sensor radar: ray_weights: 1, expected a list",
        "--set max_rnge=2": "no setting 'max_rnge' (did you mean 'max_range'?), expec",
        "--set return_mode=lst": "return_mode: 'lst' (did you mean 'last'?), expected",
    },
    "explain empty_room --sensor radar --pose 0,0,0": {
        "--beam 181": "--beam: 181, expected 0 to 180",
    },
    "spectrum foliage_room --sensor navtech_cts350x --start RobotStart1 -o": {
        "a.gif": "-o: a.gif, expected a .png, .svg, .pdf, .npz or .csv file",
        "a.npz --view polar": "--view: expected a picture, not a .npz file",
        "a.png --count 2": "--count: 2, expected 1 for a .png file",
        "a.png --azimuth 2": "--azimuth: needs --view ascope",
        "a.png --view ascope --azimuth 400": "--azimuth: 400, expected 0 to 399",
        "a.csv --layout oxford": "-o: a .csv file, expected .png with --layout",
        "a.csv --pfa 0": "--pfa: '0', expected more than 0",
        "a.png --set fmcw.windw=hann": "no setting 'windw' (did you mean 'window'?)",
        "a.png --sensor hokuyo": "sensor hokuyo has no spectrum, expected one of hss94",
    },
    "navigate --algorithm bug2": {
        "--algorithm bug3": "--algorithm: 'bug3' (did you mean 'bug2'?), expected one",
        "--map empty_room": "'--map', expected MAP as an argument, without an option",
        "--connect h:1": "--goal: no goal, expected X,Y, or a map that has a trial",
        "--goal=0,0": "missing: one of MAP and --connect; see 'radarsim navigate ",
        "--goal=0,0 --connect h:1 --seed 1": "--seed: needs MAP",
        "--goal=0,0 --connect h:1 --set a.b=1": "--set: needs MAP",
        "--goal=0,0 --connect me": "--connect: 'me', expected HOST:PORT",
        "empty_room": "no goal, expected X,Y: the map 'empty_room' has no trial",
    },
    "navigate bug_box --algorithm bug2": {
        "--connect h:1": "expected only one of MAP and --connect",
        "--bumpers 3": "--bumpers: '3', expected at least 4",
        "--bumpers 40": "--bumpers: '40', expected at most 36",
        "--share 0": "--share: '0', expected more than 0",
        "--goal 1,inf": "--goal: '1,inf', expected X,Y",
        "--pose 1,2": "--pose: '1,2', expected X,Y,YAW_DEG",
        "--pose 1,2,3 --start RobotStart1": "expected only one of --start and --pose",
        "--start RobotStart9": "'RobotStart9' (did you mean 'RobotStart1'?), expected",
        "--robot P3AT_Rada360": "'P3AT_Rada360' (did you mean 'P3AT_Radar360'?), exp",
        "--robot USARBot.P3AT_Rada360": "(did you mean 'P3AT_Radar360'?), expected",
        "--set x.y=1": "--set: item 'x', expected one of ['Accel', 'Altitude',",
        "--rule any": "--rule: 'any', expected one of ['share', 'all', 'thesis']",
        "--plot run.gif": "--plot: run.gif, expected a .png, .svg or .pdf file",
        "--film run.webm": "--film: 'run.webm', expected a .gif or .mp4 file",
        "--trace no/t.csv": "--trace: cannot write no/t.csv: no such folder",
    },
    "map -o .": {
        "--connect h:1 --seed 1": "--seed: needs MAP or --strategy turn_away",
        "--watch R1 x": "expected only one of MAP and --watch",
        "--watch R1,R2": "'R1,R2', expected the name of a robot, without commas",
        "--watch ' '": "--watch: ' ', expected the name of a robot, without commas",
        "--watch R1 --way 1,2": "--way: cannot be combined with --watch, where another",
        "--watch R1 --strategy contour": "--strategy: cannot be combined with --watch",
    },
    "map -o . empty_room": {
        "--way=1,2 --strategy auto": "expected only one of --strategy and --way",
        "--way '1;2'": "--way: '1;2', expected X,Y",
        "--film x.avi": "--film: 'x.avi', expected a .gif or .mp4 file",
        "--film no/x.gif": "--film: cannot write no/x.gif: no such folder",
        "--strategy luck": "--strategy: 'luck', expected one of ['auto', 'turn_away',",
        "-o no/map": "OUT: cannot write no/map.png: no such folder",
        "--plot area.csv": "--plot: area.csv, expected a .png, .svg or .pdf file",
    },
    "trials": {
        "--algorithms bug1,": "--algorithms: 'bug1,', expected NAME,...",
        "--algorithms bug3": "--algorithms: 'bug3' (did you mean 'bug2'?), expected",
        "--sensors rader": "sensor 'rader' (did you mean 'radar'?), expected one of",
    },
    "commander --connect 127.0.0.1:1 --web 0": {
        "--set lms300.max_range=2": "--set: item 'lms300' (did you mean 'lms200'?)",
    },
    "demo": {
        "--hel": "'--hel' (did you mean '--help'?), expected another option",
        "demo": "OUT: demo, expected a .png, .svg or .pdf file",
        "none/demo.png": "OUT: cannot write none/demo.png: no such folder",
        "a.png -o b.png": "expected only one of OUT and --output",
    },
    "new": {
        "room.png": "FILE: room.png, expected a .yaml or .yml file",
        "no/room.yaml": "FILE: cannot write no/room.yaml: no such folder",
    },
}
CASES = [
    (f"{command} {options}", message)
    for command, messages in WRONG.items()
    for options, message in messages.items()
]


@pytest.mark.parametrize(("command", "message"), CASES)
def test_error_of_usage_is_one_line_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        run = radarsim(*shlex.split(command))
    assert (run.code, run.out) == (2, b"")
    assert run.err.startswith("radarsim: ")
    assert message in run.err
    assert run.err.count("\n") == 1
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("check foliage_rom@dust", "no such file (did you mean 'foliage_room'?), "),
        ("check marulan_trial@dut", "'dut' (did you mean 'dust'?), expected one of"),
        ("navigate bug_bx --algorithm bug1", "(did you mean 'bug_box'?), expected a"),
        ("trials empty_room", "empty_room: no 'trial', expected a start, a goal and"),
        ("check .", ".: a folder, expected a map file"),
        ("serve no_such_room", "no_such_room: no such file, expected a map file or"),
        (
            "navigate bug_box --algorithm bug1 --scanner lms201",
            ": ['lms200'], expected the scanner 'lms201' (did you mean 'lms200'?)",
        ),
    ],
)
def test_unknown_names_are_reported(command: str, message: str) -> None:
    run = radarsim(*shlex.split(command))
    assert run.code == 1
    assert message in run.text + run.err
    assert (run.text + run.err).count("\n") == 1


def test_maps_beside_the_one_that_is_missing_are_suggested(tmp_path: Path) -> None:
    (tmp_path / "my_room.yaml").touch()
    run = radarsim("check", tmp_path / "my_rom.yaml")
    assert f"did you mean '{tmp_path}/my_room.yaml'" in run.text


def test_program_without_a_command_prints_its_help() -> None:
    run = radarsim()
    assert run.code == 2
    assert "serve" in run.text + run.err
    assert "radarsim: " not in run.err
