"""Errors of users of Python are reported: what came, and what was expected."""

import copy
import math
import os
import pickle
import re
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarsim
from radarsim.protocol.reports import GroundTruth, RangeScan
from radarsim.scene.scene import Scene

Sim = radarsim.LocalSimulation
Call = Callable[[Any], object]


@pytest.fixture
def sim(empty_room: Scene) -> Sim:
    return radarsim.simulate(empty_room)


R: Any = radarsim  # whose arguments have any types


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: R.simulate(3), "map 3, expected the name of a map"),
        (lambda: R.simulate("foliage_rom"), "did you mean 'foliage_room'"),
        (lambda: R.simulate("empty_room", seed="1"), "seed '1', expected a wh"),
        (lambda: R.simulate("empty_room", seed=-1), "seed -1, .* at least 0"),
        (lambda: R.simulate("empty_room", config={"a": {}}), "config {'a': {}}, exp"),
        (
            lambda: R.simulate("empty_room", config=R.SimulationConfig("udk")),
            "dialect 'udk', expected a Dialect",
        ),
        (
            lambda: R.LocalSimulation("empty_room"),
            r"scene 'empty_room', .* radarsim.load_map\('empty_room'\)",
        ),
        (lambda: R.load_sensor(None), "sensor 'None', expected one of"),
        (
            lambda: R.compare("empty_room", "laser", start="RobotStat1"),
            "start 'RobotStat1' .did you mean 'RobotStart1'",
        ),
        (lambda: R.load_map("empty_room").without(3), "object '3', expected one of"),
        (lambda: R.plot_scene("empty_room"), r"radarsim.load_map\('empty_room'\)"),
    ],
)
def test_bad_maps_and_seeds_fail(call: Callable[[], object], message: str) -> None:
    with pytest.raises((radarsim.RadarsimError, TypeError, ValueError), match=message):
        call()


SPAWN: list[tuple[dict[str, Any], str]] = [
    ({"class_name": 3}, "text 3, expected printable ASCII"),
    ({"name": "a}b"}, "text 'a}b', expected printable ASCII without braces"),
    ({"class_name": "P3TA"}, "did you mean 'P3AT'"),
    ({"start": "RobotStrat1"}, "did you mean 'RobotStart1'"),
    ({"start": "RobotStart1", "pose": (0, 0, 0)}, "one of"),
    ({"start": (0, 0, 0)}, r"text \(0, 0, 0\), expected"),
    ({"pose": (1,)}, r"pose \(1,\), expected a Pose2, a Pose3, x, y or"),
    ({"pose": "1,2"}, "pose '1,2', expected a Pose2"),
    ({"pose": (1, math.nan, 0)}, r"pose \(1, nan, 0\), expected a Pose2"),
]


@pytest.mark.parametrize(("arguments", "message"), SPAWN)
def test_what_no_robot_can_be_spawned_by_is_reported(
    sim: Sim, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises((radarsim.RadarsimError, ValueError), match=message):
        sim.spawn(**arguments)
    assert not sim.robots


@pytest.mark.parametrize("pose", [(1, 2), (1, 2, 0), np.array([1.0, 2.0, 0.0])])
def test_pose_can_be_any_numbers(sim: Sim, pose: Any) -> None:
    assert sim.spawn(pose=pose).pose == radarsim.Pose2(1.0, 2.0, 0.0)
    six = (3.0, 2.0, 0.0, 0.0, 0.0, 0.5)
    assert sim.spawn("p3at", pose=six).pose == radarsim.Pose2(3.0, 2.0, 0.5)


@pytest.mark.parametrize("duration", [0, -1, math.nan, math.inf, "0.1", None])
def test_time_that_cannot_pass_is_reported(sim: Sim, duration: Any) -> None:
    message = f"duration in s {duration!r}, expected more than 0"
    with pytest.raises((TypeError, ValueError), match=message):
        sim.step(duration)
    assert sim.time == 0


CALLS: list[tuple[Call, str]] = [
    (lambda r: r.drive(math.nan), "speed in m/s nan, expected a finite number"),
    (lambda r: r.send(b"DRIVE {Left 1}\r\n"), "DRIVE without Right"),
    (lambda r: r.drive(0.1, math.inf), "turn in rad/s inf, expected a finite number"),
    (lambda r: r.drive("0.4"), "speed in m/s '0.4', expected a finite number"),
    (lambda r: r.drive(np.ones(2)), "speed in m/s array.*, expected a finite number"),
    (lambda r: r.drive_wheels(None, 1), "left in rad/s None, expected a finite"),
    (lambda r: r.scan(), "no RangeScan of 'lms200' .*expected a call of step"),
    (lambda r: r.truth, "no GroundTruth until 0.00 s, expected a call of step"),
    (lambda r: r.scan("lms20"), ": .'lms200'., expected .* mean 'lms200'"),
    (lambda r: r.newest("GroundTruth"), "kind 'GroundTruth', expected a class"),
    (lambda r: r.spectrum(), "no revolution of a radar yet, expected request_spectra"),
    (lambda r: r.request_targets(), "scanner 'lms200' has no detector, expected"),
    (lambda r: r.request_spectra(), "no FMCW radar, expected a class such as P3AT"),
    (lambda r: r.camera(width=0), "picture of 0 x 480 pixels, 80 degrees, expected"),
    (lambda r: r.camera(width=0.5), "picture of 0.5 x 480 pixels, .* whole numbers"),
    (lambda r: r.camera(fov_deg=200), "200 degrees, expected .* below 180 deg"),
    (lambda r: r.simulation.camera((0, 0, 0)), "pose .0, 0, 0., expected six finite"),
    (lambda r: r.simulation.render("run.jpg"), "ending '.jpg' .* expected one of"),
    (lambda r: r.simulation.render("run.gif", speed=0), "speed 0, expected more than"),
    (lambda r: r.simulation.remove("R1"), "robot 'R1', expected one of .'P3AT'."),
    (lambda r: r.simulation.serve(port=99999), "port 99999, expected a whole number"),
    (lambda r: r.simulation.serve(port=0, speed=0), "speed 0, expected more than 0"),
]


@pytest.mark.parametrize(("call", "message"), CALLS)
def test_what_a_robot_cannot_do_is_reported(sim: Sim, call: Call, message: str) -> None:
    robot = sim.spawn()
    with pytest.raises((radarsim.RadarsimError, TypeError, ValueError), match=message):
        call(robot)


def test_robot_that_has_been_removed_is_reported(sim: Sim) -> None:
    robot = sim.spawn()
    sim.step(0.2)
    robot.remove()
    with pytest.raises(radarsim.RadarsimError, match="'P3AT' was removed"):
        robot.drive(0.1)
    with pytest.raises(ValueError, match=r"expected one of \[\]"):
        robot.remove()
    assert len(robot.scan().ranges) == 181  # what it has reported stays


EVALUATIONS: list[tuple[dict[str, Any], str]] = [
    ({"controller": "bug2"}, "controller 'bug2', expected a function"),
    ({"maps": "bug_box"}, "maps 'bug_box', expected a list of names or paths"),
    ({"seeds": 1.5}, "seeds 1.5, expected a number of seeds, or a list"),
    ({"seeds": 0}, "expected at least one map and one seed"),
    ({"workers": 0}, "workers 0, expected at least 1"),
    ({"time_limit": 0}, "time_limit in s 0, expected more than 0"),
]


@pytest.mark.parametrize(("arguments", "message"), EVALUATIONS)
def test_what_cannot_be_evaluated_is_reported_before_any_run(
    arguments: dict[str, Any], message: str
) -> None:
    good = {"controller": lambda *_: False, "maps": ["bug_box"], "seeds": 1}
    with pytest.raises((TypeError, ValueError), match=message):
        radarsim.evaluate(**{**good, **arguments})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("empty_room", (0, 0, 0), 1), r"radarsim.load_map\('empty_room'\)"),
        (((0, 0, 0), "empty_room", 1), r"scene \(0, 0, 0\), expected a Scene"),
        ((None, (0, 0), 1), r"pose \[0.0, 0.0\], expected three or six"),
        ((None, "RobotStart1", 1), "pose 'RobotStart1', expected a Pose2, a Pose3"),
        ((None, (0, 0, 0), "a"), "rng 'a', expected a seed or a numpy Generator"),
        ((None, (0, 0, 0), np.random), "rng <module 'numpy.random'.*expected a seed"),
        ((None, (0, 0, 0), -1), "seed -1, expected a whole number of at least 0"),
        ((None, (0, 0, 0), None), "no rng, expected a Generator for sensor 'radar'"),
    ],
)
def test_what_cannot_be_scanned_is_reported(
    empty_room: Scene, arguments: tuple[Any, Any, Any], message: str
) -> None:
    scene, pose, rng = arguments
    radar = radarsim.load_sensor("radar")
    with pytest.raises((TypeError, ValueError), match=message):
        radar.scan(scene or empty_room, pose, rng)


def test_pose_on_the_floor_is_one_of_a_scan(empty_room: Scene) -> None:
    laser = radarsim.load_sensor("laser")
    by_pose = laser.scan(empty_room, radarsim.Pose2(1.0, 2.0, 0.5))
    by_numbers = laser.scan(empty_room, (1.0, 2.0, 0.5))
    assert by_pose.ranges.tolist() == by_numbers.ranges.tolist()


@pytest.mark.parametrize("act", [copy.copy, copy.deepcopy, pickle.dumps])
def test_simulation_cannot_be_copied(sim: Sim, act: Call) -> None:
    robot = sim.spawn()
    for each in (sim, robot):
        with pytest.raises(TypeError, match="expected a new one, with the same map"):
            act(each)
    sim.step(0.2)
    scan = pickle.loads(pickle.dumps(robot.scan()))
    assert scan.points("map").tolist() == robot.scan().points("map").tolist()


def test_simulation_goes_on_after_it_was_closed(sim: Sim) -> None:
    robot = sim.spawn()
    sim.close()
    sim.close()
    sim.step(0.2)
    assert sim.spawn().name != robot.name
    assert robot.newest(GroundTruth).time == 0.2


def _run(scene: Scene, seed: int) -> list[float]:
    sim = radarsim.simulate(scene, seed=seed)
    robot = sim.spawn()
    robot.drive(0.3, turn=0.2)
    sim.step(1.0)
    ranges: list[float] = robot.newest(RangeScan).ranges.tolist()
    return ranges


def test_simulations_side_by_side_do_not_know_each_other(empty_room: Scene) -> None:
    alone = [_run(empty_room, seed) for seed in (0, 1)]
    assert alone[0] != alone[1]
    results: dict[int, list[float]] = {}

    def run(seed: int) -> None:
        results[seed] = _run(empty_room, seed)

    threads = [threading.Thread(target=run, args=(seed,)) for seed in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [results[0], results[1]] == alone
    one, two = (radarsim.simulate(empty_room, seed=seed) for seed in (0, 1))
    robots = [each.spawn() for each in (one, two)]
    for _ in range(10):  # in turns
        for robot in robots:
            robot.drive(0.3, turn=0.2)
            robot.simulation.step(0.1)
    assert [robot.scan().ranges.tolist() for robot in robots] == alone


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")  # of Python 3.12 on
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_simulation_goes_on_in_a_forked_process(sim: Sim) -> None:
    robot = sim.spawn()
    child = os.fork()
    if not child:
        sim.step(0.2)
        os._exit(0 if len(robot.scan().ranges) == 181 else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_help_says_what_one_needs_to_start() -> None:
    text = radarsim.simulate.__doc__ or ""
    for needed in ("sim.spawn(", "robot.drive(", "sim.step(", "robot.scan("):
        assert needed in text
    (indented,) = re.findall(r"::\n\n(.*?)\n\n    \S", text, re.DOTALL)
    names: dict[str, object] = {"radarsim": radarsim}
    exec("\n".join(line[8:] for line in indented.splitlines()), names)
    assert names["scan"] is not None
