"""What robots read that look for victims and tags, against geometry."""

import math
from dataclasses import replace
from typing import TypeVar

import pytest
from tick_readings import read, spawn

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import load_robot
from radarsim.protocol.fields import LineReport
from radarsim.protocol.reports import (
    GasDensity,
    HumanMotion,
    RfidTags,
    Sound,
    VictimParts,
)
from radarsim.scene.scene import BODY_PARTS, Scene, Tag, Victim

T = TypeVar("T")
AHEAD = Victim("Becky", (3.0, 0.0, 0.2), math.pi / 2, True, 60.0, 2.0, 4.0)


def first_read(
    scene: Scene, *, tags: tuple[Tag, ...] = (), victims: tuple[Victim, ...] = ()
) -> list[LineReport]:
    """Return what a robot at the origin reads at first."""
    scene = replace(scene, tags=tags, victims=victims)
    return read(*spawn(scene, Pose2(0, 0), "P3AT_Rescue"))


def only(kind: type[T], reports: list[LineReport]) -> T:
    (report,) = (each for each in reports if isinstance(each, kind))
    return report


def mount_of(name: str) -> Pose3:
    model = load_robot("P3AT_Rescue")
    (item,) = (item for item in model.items if item.name == name)
    return Pose3(0, 0, model.origin_height).compose(item.mount)


def test_scene_without_victims_reads_as_nothing(empty_room: Scene) -> None:
    reports = first_read(empty_room)
    victims, motion = only(VictimParts, reports), only(HumanMotion, reports)
    sound, gas = only(Sound, reports), only(GasDensity, reports)
    assert victims.parts == ()
    assert motion.probability == 0.0
    assert (sound.loudness, sound.duration) == (0.0, 0.0)
    assert gas.density == 0.0
    assert not any(isinstance(each, RfidTags) for each in reports)


def test_all_parts_of_a_victim_ahead_are_seen_where_they_are(empty_room: Scene) -> None:
    report = only(VictimParts, first_read(empty_room, victims=(AHEAD,)))
    assert [label for label, _ in report.parts] == [name for name, _, _ in BODY_PARTS]
    sensor = mount_of("VictSensor")
    for (_, along, left), (_, place) in zip(BODY_PARTS, report.parts, strict=True):
        # the head is to the left of the robot, as the victim lies across its way
        expected = (3.0 - left - sensor.x, along, 0.2 - sensor.z)
        assert place == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("place", "is_read"),
    [
        pytest.param((5.9, 0, 0.3), True, id="within range"),
        pytest.param((6.5, 0, 0.3), False, id="too far away"),
        pytest.param((-3, 0, 0.3), True, id="behind"),
        pytest.param((0.2, 0, 0.346), True, id="where the sensor is"),
    ],
)
def test_tags_are_read_all_around_within_range(
    empty_room: Scene, place: tuple[float, float, float], is_read: bool
) -> None:
    reports = first_read(empty_room, tags=(Tag(7, place),))
    found = [each for each in reports if isinstance(each, RfidTags)]
    assert [[label for label, _ in each.tags] for each in found] == [["7"]] * is_read


def test_tag_on_a_wall_is_read_and_one_behind_it_is_not(empty_room: Scene) -> None:
    wall = {"box": [0.2, 4.0, 2.0], "position": [2.0, 0.0, 1.0]}
    scene = empty_room.with_object("screen", material="concrete", **wall)
    tags = (Tag(1, (1.9, 0.5, 0.5)), Tag(2, (3.0, 0.0, 0.5)))
    report = only(RfidTags, first_read(scene, tags=tags))
    assert [label for label, _ in report.tags] == ["1"]
    behind = first_read(scene, victims=(AHEAD,))
    victims, motion = only(VictimParts, behind), only(HumanMotion, behind)
    assert victims.parts == ()
    assert motion.probability == 0.0
    sound = only(Sound, behind)  # which goes around the wall
    assert sound.loudness > 0


def test_other_robots_hide_victims(empty_room: Scene) -> None:
    scene = replace(empty_room, victims=(AHEAD,))
    simulation, searcher = spawn(scene, Pose2(0, 0), "P3AT_Rescue")
    assert simulation.spawn("S", load_robot("P3AT"), Pose2(1.5, 0)) is not None
    report = only(VictimParts, read(simulation, searcher))
    assert "Pelvis" not in [label for label, _ in report.parts]


def test_signs_of_life_follow_their_formulas(empty_room: Scene) -> None:
    reports = first_read(empty_room, victims=(AHEAD,))
    head = (3.0, 0.75, 0.2)
    motion, sound = only(HumanMotion, reports), only(Sound, reports)
    gas = only(GasDensity, reports)
    away = math.dist(mount_of("HumanMotion").numbers()[:3], head)
    assert motion.probability == pytest.approx(1 - away / 10)
    away = math.dist(mount_of("Sound").numbers()[:3], head)
    assert sound.loudness == pytest.approx(60 - 20 * math.log10(away))
    assert sound.duration == 2.0
    away = math.dist(mount_of("CO2").numbers()[:3], head)
    assert gas.density == (pytest.approx(4 * (0.1 / away) ** 2) if away <= 3 else 0)


def test_two_equal_calls_are_three_decibels_louder_than_one(empty_room: Scene) -> None:
    one = only(Sound, first_read(empty_room, victims=(AHEAD,)))
    twin = replace(AHEAD, name="Ann", duration=5.0)
    both = only(Sound, first_read(empty_room, victims=(AHEAD, twin)))
    assert both.loudness - one.loudness == pytest.approx(10 * math.log10(2))
    assert both.duration == 2.0  # of the first of those that are loudest


def test_quiet_calls_are_not_below_zero_and_silence_is_no_call(
    empty_room: Scene,
) -> None:
    quiet = only(Sound, first_read(empty_room, victims=(replace(AHEAD, loudness=0.0),)))
    assert (quiet.loudness, quiet.duration) == (0.0, 2.0)
    silent = replace(AHEAD, loudness=None, moves=False, co2=0.0)
    reports = first_read(empty_room, victims=(silent,))
    sound, motion = only(Sound, reports), only(HumanMotion, reports)
    assert sound.duration == 0.0
    assert motion.probability == 0.0


@pytest.mark.parametrize(
    ("material", "is_seen"),
    [pytest.param("smoke", True), pytest.param("foliage", False)],
)
def test_what_robots_pass_hides_nobody(
    empty_room: Scene, material: str, is_seen: bool
) -> None:
    cloud = {"box": [1.0, 6.0, 2.0], "position": [1.5, 0.0, 1.0]}
    scene = empty_room.with_object("cloud", material=material, **cloud)
    report = only(VictimParts, first_read(scene, victims=(AHEAD,)))
    assert bool(report.parts) is is_seen
