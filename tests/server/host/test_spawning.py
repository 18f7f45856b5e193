"""The search for a free place is limited in each tick, by counted work."""

from collections.abc import Callable, Generator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import load_robot
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles
from radarsim.scene.scene import Scene, StartPose
from radarsim.server.host import Host, spawning
from radarsim.simulation.simulation import Simulation

BUSH = b"INIT {ClassName P3AT} {Location -0.2,1.64,0}\r\n"  # found after some ticks
HUMMER = b"INIT {ClassName Hummer} {Location 0.5,1.64,0}\r\n"  # no place within 1 m
FREE = b"INIT {ClassName P3AT} {Start RobotStart2}\r\n"


@pytest.fixture
def host(foliage_room: Scene) -> Host:
    return Host(foliage_room)


def begin(host: Host, line: bytes) -> int:
    number = host.connect()
    host.take(number)
    host.receive(number, line)
    return number


def step_until(host: Host, is_true: Callable[[], bool]) -> int:
    for ticks in range(1000):
        if is_true():
            return ticks
        host.step()
    raise AssertionError("it never became true")


def test_a_search_is_cut_into_small_steps(foliage_room: Scene) -> None:
    simulation, model = Simulation(foliage_room), load_robot("Hummer")
    steps = list(simulation.spawn_stepwise("R", model, Pose2(0.5, -1.64)))
    assert sum(steps) > 10 * max(steps)
    # A map may have as many walls at a place as it likes.
    ends = np.random.default_rng(1).uniform(-3, 3, (50_000, 1, 2))
    thicket = Obstacles(ends + np.array([[[0.0, 0.0], [0.01, 0.0]]]))
    search = thicket.search_free_pose(
        Footprint(0.01, 0.01),
        Pose2(0, 0),
        tuple,
        within=1.0,
        is_open=lambda places: np.zeros(len(places), np.bool_),
    )
    steps = list(search)
    assert sum(steps) > 3 * max(steps)  # to sort the walls once
    assert sum(steps) > 20 * np.median(steps)


def test_the_search_of_some_ticks_finds_the_place_of_one_at_once(host: Host) -> None:
    """What was sent after INIT is executed once the robot is there."""
    expected = Simulation(host.scene).spawn("R", load_robot("P3AT"), Pose2(-0.2, -1.64))
    assert expected is not None
    number = begin(host, BUSH + b"DRIVE {Left 1} {Right 1}\r\n")
    assert step_until(host, lambda: host.has_robot(number)) > 1
    (vehicle,) = host.simulation.vehicles
    place = expected.robot.pose
    assert (vehicle.robot.pose.x, vehicle.robot.pose.y) == pytest.approx(
        (place.x, place.y), abs=2e-3
    )
    step_until(host, lambda: not host.is_busy(number))
    host.step()
    assert min(vehicle.robot.side_angles) > 0


def test_a_step_beyond_the_work_of_a_tick_is_made_up_for(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spawning, "SEARCH_WORK", 20_000)  # less than most steps
    number = begin(host, BUSH)
    assert step_until(host, lambda: host.has_robot(number)) > 20


def test_a_search_that_takes_long_delays_its_client_alone(host: Host) -> None:
    """What it sends after INIT waits; another one drives, and is answered."""
    driver = begin(host, FREE)
    host.step()
    number = begin(host, HUMMER + b"GETGEO {Type Robot}\r\n")
    assert host.is_busy(number)
    host.take(driver)
    diagnostics = []
    for _ in range(3):
        host.receive(driver, b"GETGEO {Type Robot}\r\n")
        diagnostics += host.step()
        assert b"GEO {Type GroundVehicle}" in host.take(driver)
    while host.is_busy(number):
        diagnostics += host.step()
    assert [each.kind for who, each in diagnostics if who == number] == [
        "no place",
        "GETGEO without robot",
    ]


def test_a_client_that_leaves_ends_its_search(host: Host) -> None:
    first, second = begin(host, HUMMER), begin(host, FREE)
    host.disconnect(first)
    host.step()
    assert host.has_robot(second)


def test_a_place_is_not_taken_that_another_robot_has_reached_meanwhile(
    host: Host,
) -> None:
    number = begin(host, BUSH)
    host.step()
    assert not host.has_robot(number)
    other = host.simulation.spawn("other", load_robot("P3AT"), Pose2(-0.2, -1.64))
    assert other is not None  # at the place that the search would find
    step_until(host, lambda: host.has_robot(number))
    _, vehicle = host.simulation.vehicles
    assert vehicle.robot.pose != other.robot.pose
    assert Obstacles().clear(vehicle.robot.footprint, vehicle.robot.pose, [other.robot])


def test_starts_are_looked_at_within_the_work_of_ticks(foliage_room: Scene) -> None:
    """A map may have many starts that are all taken."""
    taken = tuple(StartPose(f"S{k}", Pose3(0.5, -1.64, 0.0)) for k in range(100))
    free = StartPose("free", Pose3(-8.0, 0.0, 0.0))
    host = Host(replace(foliage_room, starts=(*taken, free)))
    number = begin(host, b"INIT {ClassName P3AT} {Start S0} {FreeStart True}\r\n")
    assert host.is_busy(number)
    step_until(host, lambda: not host.is_busy(number))
    (vehicle,) = host.simulation.vehicles
    assert (vehicle.robot.pose.x, vehicle.robot.pose.y) == (-8.0, 0.0)


def test_a_client_without_a_place_waits_before_it_searches_again(host: Host) -> None:
    begin(host, 2 * HUMMER)
    diagnostics = [tick for tick in range(200) for _ in host.step()]
    assert len(diagnostics) == 2
    assert diagnostics[1] - diagnostics[0] > 50


def test_clients_without_a_place_leave_most_ticks_to_others(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many of them that try again and again search no more than one of them."""
    spent: list[int] = []
    original = Obstacles.search_free_pose

    def counted(
        self: Obstacles, *args: Any, **options: Any
    ) -> Generator[int, None, Pose2 | None]:
        for work in original(self, *args, **options):
            spent.append(work)
            yield work
        return None  # there is no place

    monkeypatch.setattr(Obstacles, "search_free_pose", counted)
    for _ in range(50):
        begin(host, 3 * HUMMER)
    works = []
    for _ in range(300):
        spent.clear()
        host.step()
        works.append(sum(spent))
    busy = [work for work in works if work]
    assert 0 < len(busy) < len(works) / 2
    assert max(busy) < 2 * np.median(busy)
