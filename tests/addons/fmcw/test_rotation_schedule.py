"""Radars whose antenna turns while robots drive, and what clients are sent of them."""

import re
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarsim
from radarsim.addons.fmcw.rotation import Sector, TurnReceiver
from radarsim.addons.fmcw.rotation_schedule import (
    LATENCY,
    RECEPTION_TICKS,
    antennas_of,
)
from radarsim.addons.fmcw.targets import beams_of, read_ranges
from radarsim.geometry import Pose3
from radarsim.presets.robots import load_robot
from radarsim.protocol.reports import RadarTargets, RangeScan, decode_report
from radarsim.raycast.rays import Boxes
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Targets
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

INIT = b"INIT {ClassName USARBot.P3AT_Navtech} {Name R1} {Start RobotStart1}\r\n"
TARGETS_ON = (
    b"SET {Type RangeScanner} {Name Navtech} {Opcode TARGETS} {Params true}\r\n"
)
TURN = 25  # ticks
WITHOUT_DETECTOR = SimulationConfig(
    item_settings={"Navtech": {"detector": "penetration"}}
)


class AtOnce:
    """Computes when it is asked to."""

    def submit(self, function: Callable[..., Any], *args: Any, **look: Any) -> Any:
        result: Future[Any] = Future()
        result.set_result(function(*args, **look))
        return result


@dataclass
class AtLast:
    """Computes when the result is needed, and all that was asked for before."""

    waiting: list[Callable[[], None]] = field(default_factory=list)

    def submit(self, function: Callable[..., Any], *args: Any, **look: Any) -> Any:
        computed: list[Any] = []
        self.waiting.append(lambda: computed.append(function(*args, **look)))

        def result() -> Any:
            while not computed:
                self.waiting.pop(0)()
            return computed[0]

        return SimpleNamespace(result=result)


def play(
    scene: Scene,
    ticks: int,
    *commands: bytes,
    init: bytes = INIT,
    watch: bytes = b"",
    worker: Any = None,
) -> list[bytes]:
    """Return what the client of a robot, or else a watcher of it, is sent."""
    host = Host(scene)
    if worker is not None:
        antennas_of(host.simulation).worker = worker
    client = host.connect()
    watcher = host.connect()
    for command in (init, *commands):
        assert host.receive(client, command) == []
    host.receive(watcher, watch)
    for number in (client, watcher):
        host.take(number)
    lines = []
    for _ in range(ticks):
        host.step()
        own, seen = host.take(client), host.take(watcher)
        lines += (seen if watch else own).splitlines()
    return lines


def reports(lines: list[bytes], kind: type) -> list[Any]:
    decoded = [decode_report(line.decode()) for line in lines]
    return [each for each in decoded if isinstance(each, kind)]


@pytest.fixture(scope="module")
def lines(foliage_room: Scene) -> list[bytes]:
    return play(foliage_room, 4 * TURN, TARGETS_ON)


def scans_of(lines: list[bytes]) -> list[RangeScan]:
    return [scan for scan in reports(lines, RangeScan) if scan.name == "Navtech"]


def test_turns_are_scans_four_times_a_second(lines: list[bytes]) -> None:
    scans = scans_of(lines)
    assert np.diff([scan.time for scan in scans]) == pytest.approx([0.25])
    assert [len(scan.ranges) for scan in scans] == [401] * 2


def test_turn_has_the_time_at_which_it_ended_and_comes_later(
    foliage_room: Scene,
) -> None:
    # Of the second turn since the spawn: half a second, and three sweeps.
    last = 2 * TURN + RECEPTION_TICKS
    early = play(foliage_room, last + LATENCY - 1)
    (scan,) = scans_of(play(foliage_room, last + LATENCY))
    assert scans_of(early) == []
    assert scan.time == pytest.approx(0.5)


@pytest.mark.parametrize("worker", [AtOnce(), AtLast()])
def test_how_fast_turns_are_computed_changes_nothing(
    foliage_room: Scene, worker: Any
) -> None:
    drive = b"DRIVE {Left 3} {Right 2}\r\n"
    expected = play(foliage_room, 3 * TURN, TARGETS_ON, drive)
    assert play(foliage_room, 3 * TURN, TARGETS_ON, drive, worker=worker) == expected
    assert len(scans_of(expected)) == 1


def test_failure_of_a_turn_ends_the_robot(
    foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ArithmeticError("no turn")

    monkeypatch.setattr(TurnReceiver, "receive", fail)
    host = Host(foliage_room)
    host.receive(host.connect(), INIT)
    with pytest.raises(ArithmeticError, match="no turn") as caught:  # noqa: PT012
        for _ in range(LATENCY + 2):
            host.step()
            host.raise_fault()
    notes = caught.value.__notes__
    assert notes[0].startswith("in the thread of antennas: ")


def test_radar_that_is_heard_again_starts_anew(foliage_room: Scene) -> None:
    """While nobody listens, its antenna stands; the robot drives on."""
    host = Host(foliage_room, config=WITHOUT_DETECTOR)
    host.receive(host.connect(), INIT + b"DRIVE {Left 3} {Right 3}\r\n")
    (antenna,) = antennas_of(host.simulation).all
    heard: list[tuple[Sector, float]] = []

    def hear(*seen: Any) -> None:
        heard.append(seen)

    antenna.listeners.append(hear)
    for _ in range(TURN + 12):
        host.step()
    antenna.listeners.clear()
    before = len(heard)
    for _ in range(40):
        host.step()
    assert len(heard) == before > 0
    antenna.listeners.append(hear)
    began = host.simulation.time
    for _ in range(TURN + 12):
        host.step()
    assert len(heard) == 2 * before
    sector, time = heard[before]
    assert (sector.turn, sector.first) == (0, 0)
    assert time == pytest.approx(began + 0.25)


def test_turn_keeps_the_settings_with_which_it_began(foliage_room: Scene) -> None:
    """Its beams would not fit those that the scanner has by now."""
    host = Host(foliage_room)
    client = host.connect()
    host.receive(client, INIT)
    scans = []
    for tick in range(4 * TURN):
        if tick == 2 * TURN - 9:
            command = b"SET {Type RangeScanner} {Name Navtech} {Opcode SETTING}"
            command += b" {Params resolution_deg=1.8}\r\n"
            assert host.receive(client, command) == []
        host.step()
        scans += scans_of(host.take(client).splitlines())
    assert [len(scan.ranges) for scan in scans] == [401, 201]


def test_other_scanner_of_the_robot_is_as_without_the_radar(
    foliage_room: Scene, lines: list[bytes]
) -> None:
    plain = play(foliage_room, 4 * TURN, init=INIT.replace(b"_Navtech", b""))
    is_radar = re.compile(rb"{Name Navtech}|GroundVehicle").search
    assert [x for x in lines if not is_radar(x)] == [
        x for x in plain if not is_radar(x)
    ]


def test_standing_turn_reads_what_the_sensor_scans_there(
    foliage_room: Scene, lines: list[bytes]
) -> None:
    start = foliage_room.starts[0].pose
    model = load_robot("P3AT_Navtech")
    item = model.items_of("RangeScanner")[1]
    sensor = SimulationConfig().scanner(item)
    lift = Pose3(0.0, 0.0, model.origin_height)
    pose = start.compose(lift).compose(item.mount)
    rng = radarsim.generator_for(0, "R1", "Navtech")
    for read in scans_of(lines):
        scan = sensor.scan(foliage_room, pose, rng)
        assert read.ranges == pytest.approx(
            np.minimum(scan.ranges, sensor.settings.max_range), abs=0.00501
        )


def test_targets_come_in_numbered_lines_before_their_scan(lines: list[bytes]) -> None:
    first = next(k for k, line in enumerate(lines) if b"{Type RadarTargets}" in line)
    found = reports(lines[first:], RadarTargets)
    scan = scans_of(lines)[0]
    own = [each for each in found if each.time == scan.time]
    assert [each.line for each in own] == list(range(1, len(own) + 1))
    assert {each.lines for each in own} == {len(own)}
    assert all(len(line) <= 4093 for line in lines)
    # The reading of each beam is one of its targets.
    targets = {
        (beam, round(float(r), 2))
        for each in own
        for beam, r in zip(each.beams.tolist(), each.ranges, strict=True)
    }
    seen = np.flatnonzero(scan.ranges < 165)
    read = {(int(beam), round(float(scan.ranges[beam]), 2)) for beam in seen}
    assert read - {(0, round(float(scan.ranges[0]), 2))} <= targets
    assert len(read) > 300


def test_without_a_request_there_are_no_targets(foliage_room: Scene) -> None:
    assert reports(play(foliage_room, 3 * TURN), RadarTargets) == []


def test_watchers_with_echoes_see_targets_and_others_do_not(
    foliage_room: Scene,
) -> None:
    for echoes, count in ((b"true", 1), (b"false", 0)):
        watch = b"WATCH {Robots All} {Echoes %s}\r\n" % echoes
        seen = play(foliage_room, 2 * TURN + 2 + LATENCY, watch=watch)
        heads = [line for line in seen if b"{Type RadarTargets}" in line]
        assert bool(heads) == bool(count)


@pytest.mark.parametrize(
    ("mode", "expected"), [("first", 3.0), ("strongest", 5.0), ("last", 9.0)]
)
def test_return_mode_selects_a_target(mode: str, expected: float) -> None:
    sensor = radarsim.load_sensor("navtech_cts350x", return_mode=mode)
    ranges, dbm = np.array([3.0, 5.0, 9.0]), np.array([-60.0, -40.0, -50.0])
    targets = Targets(np.array([7, 7, 7]), ranges, dbm, *3 * [np.zeros(3)])
    ranges = read_ranges(targets, sensor.settings)
    assert ranges[7] == expected
    assert np.isinf(np.delete(ranges, 7)).all()


def test_each_direction_belongs_to_one_beam() -> None:
    turn = -np.radians(0.9) * np.arange(400)
    half_a_step_beside = radarsim.load_sensor("navtech_cts350x").settings
    assert sorted(beams_of(turn, half_a_step_beside)) == list(range(400))
    ahead = radarsim.load_sensor("navtech_cts350x", fov_deg=180).settings
    beams = beams_of(turn, ahead)
    assert beams[0] == 100
    assert (beams >= 0).sum() == 201


def test_detector_needs_a_spectrum() -> None:
    with pytest.raises(radarsim.PresetError, match=r"detector 'ca'.*no spectrum"):
        radarsim.load_sensor("radar", detector="ca")


def test_client_cannot_make_a_scanner_an_antenna_that_its_class_has_not(
    foliage_room: Scene,
) -> None:
    settings = {"lms200": {"sensor": "k2pi"}}
    host = Host(foliage_room, config=SimulationConfig(item_settings=settings))
    client = host.connect()
    host.receive(client, INIT.replace(b"_Navtech", b""))
    command = b"SET {Type RangeScanner} {Opcode SETTING} {Params detector=ca}\r\n"
    (problem,) = host.receive(client, command)
    assert "23040 rays in a scan, expected at most 5400" in problem.text


def test_antenna_knows_how_fast_others_drive(foliage_room: Scene) -> None:
    looks: list[Boxes] = []

    class Noted(AtOnce):
        def submit(self, *args: Any, **look: Any) -> Any:
            looks.append(look["boxes"])
            return super().submit(*args, **look)

    host = Host(foliage_room)
    antennas_of(host.simulation).worker = Noted()  # type: ignore[assignment]
    first, second = host.connect(), host.connect()
    host.receive(first, INIT)
    host.receive(
        second,
        b"INIT {ClassName P3AT} {Name R2} {Location -6,4,0} {Rotation 0,0,0.5}\r\n"
        b"DRIVE {Left 4} {Right 4}\r\n",
    )
    for _ in range(60):
        host.step()
    other = next(each for each in host.simulation.vehicles if each.robot.name == "R2")
    found, rows = looks[-1].find(np.array([other.number]))
    assert found.tolist() == [0]
    velocities = looks[-1].velocities
    assert velocities is not None
    velocity = velocities[rows[0]]
    yaw = looks[-1].rows[rows[0], 2]
    speed = float(np.hypot(*velocity))
    assert speed > 0.3
    assert np.arctan2(velocity[1], velocity[0]) == pytest.approx(yaw, abs=0.02)
    then = looks[-11].rows[rows[0], :2]
    moved = looks[-1].rows[rows[0], :2] - then
    assert speed == pytest.approx(float(np.hypot(*moved)) / 0.1, rel=0.1)
