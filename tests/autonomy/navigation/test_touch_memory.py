"""What the hull has touched is an obstacle from then on, though no beam shows it."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from contacts import Contacts
from flatland import moved
from random_trials import load_random_map, mission_to

from radarsim.autonomy.evaluation.trials import run_plan
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.hidden_obstacles import TouchedPlaces, TouchMemory
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import Algorithm
from radarsim.generators.random_maps import Block, RandomMap
from radarsim.geometry import Pose2
from radarsim.scene.map_file import load_map
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

LENGTH, WIDTH, S = 0.56, 0.5, 0.5
BEARINGS = np.radians(np.arange(360.0) - 180.0)
FORWARD = Twist(0.3, 0.0)
LASER = {"sensor": "laser"}
RADAR = {"sensor": "radar", "side_offset_uu": 0}
RADAR_50 = {"sensor": "radar", "side_offset_uu": 50}


def scan(time: float, pose: Pose2, *, touched: bool = False) -> Observation:
    ranges = np.full(360, 5.0)
    return Observation(time, pose, BEARINGS, ranges, touched=touched)


def touch_at(pose: Pose2, twist: Twist) -> TouchMemory:
    """Return the memory after a touch at a pose."""
    memory = TouchMemory(LENGTH, WIDTH, S)
    assert not memory.notice(scan(0.0, pose), STOP)
    assert memory.notice(scan(0.1, pose, touched=True), twist)
    return memory


def box(x: float, y: float, half: float = 0.1) -> np.ndarray:
    return complex(x, y) + half * np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j])


@pytest.mark.parametrize(
    ("twist", "bearing_deg", "near"),
    [
        pytest.param(FORWARD, 0, LENGTH / 2, id="ahead"),
        pytest.param(Twist(-0.3, 0.0), 180, LENGTH / 2, id="behind"),
        pytest.param(Twist(0.0, 0.5), -30, 0.32, id="right front corner"),
        pytest.param(Twist(0.0, -0.5), 30, 0.32, id="left front corner"),
    ],
)
def test_what_is_touched_is_at_the_side_that_led(
    twist: Twist, bearing_deg: int, near: float
) -> None:
    pose = Pose2(2.0, 1.0, 0.7)
    seen = touch_at(pose, twist).places.hide(scan(0.2, pose))
    ends = seen.ranges < 5.0
    assert seen.ranges[(bearing_deg + 180) % 360] == pytest.approx(near, abs=0.02)
    offsets = np.abs(np.degrees(BEARINGS[ends]) - bearing_deg)
    assert np.minimum(offsets, 360 - offsets).max() <= 50
    assert ends.sum() >= 15


def test_nothing_counts_that_is_seen_behind_it() -> None:
    places = TouchedPlaces(0.75)
    seen = scan(0.0, Pose2(0.0, 0.0))
    assert places.hide(seen) is seen
    places.add(box(2.0, 0.0))
    farther = np.array([[0.0, 6.0], [1.0, 6.0], [0.0, 1.5]])
    hidden = places.hide(replace(seen, farther=farther))
    assert hidden.ranges[180] == pytest.approx(1.9)
    assert hidden.farther.tolist() == [[1.0, 6.0], [0.0, 1.5]]
    assert hidden.ranges[190] == 5.0
    # from elsewhere it is at the same place
    moved = places.hide(scan(0.1, Pose2(2.0, -1.0, math.pi / 2)))
    assert moved.ranges[180] == pytest.approx(0.9)


@pytest.mark.parametrize(("width", "is_closed"), [(0.7, True), (0.8, False)])
def test_gap_between_two_touched_places_is_closed_where_the_robot_does_not_fit(
    width: float, is_closed: bool
) -> None:
    places = TouchedPlaces(0.75)
    places.add(box(2.0, 0.1 + width / 2))
    places.add(box(2.0, -0.1 - width / 2))
    seen = places.hide(scan(0.0, Pose2(0.0, 0.0)))
    assert bool(seen.ranges[180] < 5.0) is is_closed


def test_touch_beside_a_touched_place_is_more_of_it() -> None:
    memory = touch_at(Pose2(0.0, 0.0), FORWARD)
    memory.notice(scan(0.2, Pose2(-0.5, -0.6)), FORWARD)
    pose = Pose2(0.0, -0.6)
    assert memory.notice(scan(0.3, pose, touched=True), FORWARD)
    corners = pose.x + 1j * pose.y + LENGTH / 2 + 1j * np.array([-1, 1]) * WIDTH / 2
    far, near = memory.places.distances(corners)
    assert near == 0.0
    assert far > 0.25


def test_who_is_driven_into_keeps_nothing() -> None:
    memory = TouchMemory(LENGTH, WIDTH, S)
    for k in range(10):
        assert not memory.notice(scan(0.1 * k, Pose2(0.0, 0.0)), STOP)
    assert not memory.notice(scan(1.0, Pose2(0.0, 0.0), touched=True), STOP)
    assert not len(memory.places)


def test_who_turns_to_and_fro_takes_what_it_faces_for_touched() -> None:
    memory, turns = TouchMemory(LENGTH, WIDTH, S), [Twist(0.0, 0.8), Twist(0.0, -0.8)]
    for k in range(82):
        seen = scan(0.1 * k, Pose2(0.0, 0.0, 0.08 * (k % 2)))
        assert not memory.notice(seen, turns[k % 2])
        # as long as it has to wait for something, it is not held
        memory.note_decision(seen, None if k == 1 else turns[k % 2])
    assert memory.notice(scan(8.2, Pose2(0.0, 0.0)), turns[0])
    hidden = memory.places.hide(scan(8.2, Pose2(0.0, 0.0)))
    assert hidden.ranges.min() < 0.4
    # not to and fro, as it came
    away = memory.retreat(hidden)
    assert away is not None
    assert away.speed < 0


def test_robot_goes_back_the_way_it_came() -> None:
    memory, pose, twist = TouchMemory(LENGTH, WIDTH, S), Pose2(0.0, 0.0), STOP
    track = [pose]
    for k in range(30):
        memory.notice(scan(0.1 * k, pose), twist)
        assert memory.retreat(scan(0.1 * k, pose)) is None
        twist = Twist(0.3, 0.4)
        pose = moved(pose, twist)
        track.append(pose)
    for k in range(30, 60):
        seen = scan(0.1 * k, pose, touched=k < 32)
        assert memory.notice(seen, twist) is (k == 30)
        back = memory.retreat(seen)
        if back is None:
            break
        twist, pose = back, moved(pose, back)
        nearest = min(math.hypot(p.x - pose.x, p.y - pose.y) for p in track)
        assert nearest < 0.02
    assert 0.2 < math.hypot(track[-1].x - pose.x, track[-1].y - pose.y) < 0.4
    (near,) = memory.places.distances(np.array([pose.x + 1j * pose.y]))
    assert near == pytest.approx(S, abs=0.04)


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
@pytest.mark.parametrize("turn", [0.8, -0.8])
def test_who_turns_beside_what_was_touched_leads_its_hull_away_first(
    side: int, turn: float
) -> None:
    memory, pose = TouchMemory(LENGTH, WIDTH, S), Pose2(0.0, 0.0)
    # nearer than half the diagonal, so that a corner would swing into it
    for k in range(-2, 3):
        memory.places.add(box(0.2 * k, side * 0.42))
    walls = memory.places.samples(Pose2(0.0, 0.0))
    nearest, away = math.inf, 0.0
    for k in range(60):
        seen = memory.places.hide(scan(0.1 * k, pose))
        memory.notice(scan(0.1 * k, pose), STOP)
        bug = Twist(0.0, turn)
        twist = memory.retreat(seen) or memory.keep_off(seen, bug)
        pose = moved(pose, twist)
        there = (walls - (pose.x + 1j * pose.y)) * np.exp(-1j * pose.yaw)
        inside = np.maximum(
            np.abs(there.real) - LENGTH / 2, np.abs(there.imag) - WIDTH / 2
        )
        nearest = min(nearest, inside.min())
        away = max(away, np.abs(there).min())
        if twist == bug:
            break
    assert nearest > 0.0
    assert away >= S - 0.02


def test_motion_away_from_what_was_touched_is_as_it_was_decided() -> None:
    memory = TouchMemory(LENGTH, WIDTH, S)
    seen = scan(0.0, Pose2(0.0, 0.0))
    assert memory.keep_off(seen, FORWARD) is FORWARD
    memory.places.add(box(LENGTH / 2 + 0.1, 0.0))
    for twist in (Twist(-0.3, 0.0), STOP):
        assert memory.keep_off(seen, twist) is twist
    # no way back is known, so a way out of it
    assert memory.keep_off(seen, FORWARD).speed < 0


def test_who_touches_something_on_the_way_out_goes_back_on_that() -> None:
    memory, pose, out = TouchMemory(LENGTH, WIDTH, S), Pose2(0.0, 0.0), STOP
    memory.places.add(box(LENGTH / 2 + 0.1, 0.0))
    for k in range(5):
        seen = scan(0.1 * k, pose)
        memory.notice(seen, out)
        out = memory.retreat(seen) or memory.keep_off(seen, FORWARD)
        pose = moved(pose, out)
    assert out.speed < 0
    seen = scan(0.5, pose, touched=True)
    assert memory.notice(seen, out)
    back = memory.retreat(seen)
    assert back is not None
    assert (back.speed, back.turn) == pytest.approx((-out.speed, -out.turn))
    # and where it touches something on that, it does not stay there
    memory.notice(scan(0.6, moved(pose, back)), back)
    seen = scan(0.7, pose, touched=True)
    assert memory.notice(seen, back)
    assert memory.retreat(seen) is not None


def test_who_seems_to_overlap_what_is_seen_drives_before_it_turns() -> None:
    memory, seen = TouchMemory(LENGTH, WIDTH, S), scan(0.0, Pose2(0.0, 0.0))
    seen.ranges[180 + 48] = 0.32
    # By 0.8 rad/s the corner leads away from where that is seen.
    twist = memory.keep_off(seen, Twist(0.0, -0.8))
    assert twist.speed < 0
    assert memory.keep_off(seen, Twist(-0.2, 0.0)) == Twist(-0.2, 0.0)


def test_turn_into_what_is_seen_becomes_a_way_out() -> None:
    memory, pose, turn = TouchMemory(LENGTH, WIDTH, S), Pose2(0.0, 0.0), Twist(0.0, 0.8)
    # A pole next to the footprint: the corners of a robot that turns would meet it.
    pole = np.array([0.05 + 0.27j])
    for k in range(60):
        there = (pole - (pose.x + 1j * pose.y)) * np.exp(-1j * pose.yaw)
        beam = np.abs(np.angle(np.exp(1j * (BEARINGS - np.angle(there))))).argmin()
        seen = scan(0.1 * k, pose)
        seen.ranges[beam] = np.abs(there[0])
        memory.notice(seen, turn)
        twist = memory.retreat(seen) or memory.keep_off(seen, turn)
        pose = moved(pose, twist)
        inside = np.abs(there.real) < LENGTH / 2, np.abs(there.imag) < WIDTH / 2
        assert not (inside[0] & inside[1]).any()
    assert np.abs(pole - (pose.x + 1j * pose.y)) > math.hypot(LENGTH, WIDTH) / 2


def run(algorithm: str, *blocks: Block) -> tuple[str, int, int]:
    map_ = RandomMap(0, "mirrors", blocks, math.inf, (-3.0, 0.1), (3.0, 0.0))
    mission = mission_to(map_.goal, algorithm, time_limit=600.0)
    host = Host(load_random_map(map_))
    contacts, row = Contacts(host), run_plan(mission, host)
    return row.outcome, row.collisions, contacts.pushes


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", list(Algorithm))
@pytest.mark.parametrize("material", ["metal", "glass"])
def test_robot_gets_around_what_it_cannot_see(algorithm: str, material: str) -> None:
    plate = Block(0.0, 0.0, 0.05, 2.0, 0.3, material)
    outcome, touches, pushes = run(algorithm, plate)
    assert (outcome, pushes) == ("reached", 0)
    # it may take its own image for an obstacle, and touch nothing
    assert touches < 10


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_robot_finds_out_that_it_is_among_mirrors(algorithm: str) -> None:
    walls = [Block(-3.0 + 1.2 * k, 0.1, 0.1, 2.5, 0.0, "metal") for k in (-1, 1)]
    walls += [Block(-3.0, 0.1 + 1.2 * k, 2.5, 0.1, 0.0, "metal") for k in (-1, 1)]
    outcome, _, pushes = run(algorithm, *walls)
    # In mirrors that it has not touched it may see the image of a wall at its goal.
    assert outcome in ("no_path", "too_near")
    assert pushes == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "algorithm", "sensor", "step", "goal", "expected"),
    [
        pytest.param(
            *("mirrors_2", "tangentbug", RADAR, 1),
            *((5.0, 0.11974173248576037), "reached"),
            id="end of a pane",
        ),
        pytest.param(
            *("metal_6", "bug1", LASER, 1, (-4.0, -3.2), "reached"),
            id="end of a mirror",
        ),
        pytest.param(
            *("metal_12", "bug1", RADAR_50, 2),
            *((5.0, 0.4136666334494894), "no_path"),
            id="goal behind mirrors",
        ),
        pytest.param(
            *("mirrors_14", "tangentbug", RADAR_50, 2),
            *((5.0, -3.2814730041981734), "no_path"),
            id="stuck at the end of a mirror",
        ),
    ],
)
def test_robot_is_right_on_maps_where_it_was_wrong(
    name: str,
    algorithm: str,
    sensor: dict[str, Any],
    step: int,
    goal: tuple[float, float],
    expected: str,
) -> None:
    scene = load_map(Path(__file__).parent / "mirrors" / f"{name}.yaml")
    settings = {**sensor, "fov_deg": 360 - step, "resolution_deg": step}
    config = SimulationConfig(item_settings={"lms200": settings})
    mission = mission_to(goal, algorithm, time_limit=1800.0)
    host = Host(scene, config=config, seed=int(name.partition("_")[2]))
    contacts, row = Contacts(host), run_plan(mission, host)
    assert (row.outcome, contacts.pushes) == (expected, 0)
