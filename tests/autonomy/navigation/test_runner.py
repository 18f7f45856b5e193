"""A pilot at a server that is well, and at servers that are not."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.mission import run_mission
from radarsim.autonomy.navigation.runner import NavigationStep, Result
from radarsim.autonomy.plans import Algorithm, Mission, PoseSource
from radarsim.client import Client
from radarsim.errors import ClientError, NavigationError
from radarsim.geometry import Pose2
from radarsim.protocol.commands import Drive, parse_command
from radarsim.protocol.dialect import COMPAT, UDK
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.clock import TICK
from radarsim.simulation.config import SimulationConfig

GOAL = (-5.5, 0.5)  # from RobotStart1 of the empty room, nothing is in the way
SCANS = b"{Type RangeScanner}"
ALWAYS, NEVER = 0.0, math.inf


@dataclass
class FaultyTransport:
    """A link to a host that has a fault for some time.

    Attributes:
        host: The server.
        fault: ``stalls``: all data is late; ``drops``: the connection is lost; else:
            lines that contain this are removed.
        since: Start of the fault, simulated s.
        until: End of the fault, simulated s.
        driven: Time and content of each DRIVE command.
        deaf: Whether DRIVE commands are lost.
        rewrite: Changes the data that arrives, last.
    """

    host: Host
    fault: str | bytes = "nothing"
    since: float = NEVER
    until: float = NEVER
    ignores_drive: bool = False
    drive_commands: list[tuple[float, Drive]] = field(default_factory=list)
    rewrite: Callable[[bytes], bytes] = bytes

    def __post_init__(self) -> None:
        self._link = InProcessTransport(self.host)
        self._held = b""

    @property
    def is_faulty(self) -> bool:
        return self.since <= self.time() < self.until

    def time(self) -> float:
        return self.host.simulation.time

    def send(self, data: bytes) -> None:
        if self.fault == "drops" and self.is_faulty:
            raise ConnectionError("the server closed the connection")
        command = parse_command(data.decode().strip(), COMPAT)[0]
        if isinstance(command, Drive):
            self.drive_commands.append((self.time(), command))
        if not (self.ignores_drive and isinstance(command, Drive)):
            self._link.send(data)

    def receive(self, timeout: float) -> bytes:
        end = self.time() + max(timeout, TICK)
        while self.time() < end - TICK / 2:
            if self.fault == "drops" and self.is_faulty:
                self._link.close()
                raise ConnectionError("the server closed the connection")
            self.host.step()
            data = self.rewrite(self._passing(self.host.take(self._link.number)))
            if data:
                return data
        raise TimeoutError

    def _passing(self, data: bytes) -> bytes:
        if isinstance(self.fault, bytes) and self.is_faulty:
            lines = data.splitlines(keepends=True)
            return b"".join(line for line in lines if self.fault not in line)
        if self.fault == "stalls" and self.is_faulty:
            self._held += data
            return b""
        data, self._held = self._held + data, b""
        return data

    def close(self) -> None:
        self._link.close()

    @property
    def pose(self) -> Pose2:
        """True pose of the robot."""
        return self.host.simulation.vehicles[0].robot.pose


def go(
    link: FaultyTransport,
    observe: Callable[[NavigationStep], None] = lambda _: None,
    **overrides: object,
) -> Result:
    values = {"algorithm": Algorithm.BUG2, "goals": (GOAL,), **overrides}
    mission = Mission(**values)  # type: ignore[arg-type]
    return run_mission(Client(link), mission, observe)


def stops(link: FaultyTransport) -> list[float]:
    return [
        when for when, drive in link.drive_commands if drive.left == drive.right == 0
    ]


@pytest.mark.parametrize("pose_source", list(PoseSource))
def test_goal_is_reached_by_any_pose_source(
    empty_room: Scene, pose_source: PoseSource
) -> None:
    link = FaultyTransport(Host(empty_room))
    moments: list[NavigationStep] = []
    result = go(link, pose_source=pose_source, observe=moments.append)
    assert (result.outcome, result.goals_left) == ("reached", 0)
    assert math.dist((link.pose.x, link.pose.y), GOAL) < 0.3
    assert stops(link) == [link.drive_commands[-1][0]]
    assert result.path_length == pytest.approx(math.dist((-8, 0), GOAL), abs=0.3)
    assert result.time == pytest.approx((len(moments) - 1) * 0.1, abs=1e-6)
    assert moments[-1].activity is Activity.REACHED
    assert moments[-1].goal is None
    assert {moment.goal for moment in moments[:-1]} == {GOAL}


def test_robot_is_commanded_before_the_observer_is_called(empty_room: Scene) -> None:
    """So that an observer that takes long, as a film does, makes no command late."""
    link = FaultyTransport(Host(empty_room))
    commands: list[int] = []
    go(link, observe=lambda _: commands.append(len(link.drive_commands)))
    assert commands[:3] == [1, 2, 3]


def test_navigator_reaches_waypoints_in_turn_and_returns_to_where_it_started(
    empty_room: Scene,
) -> None:
    link = FaultyTransport(Host(empty_room))
    points = ((-7.0, 0.0), (-7.0, 0.8))
    seen: list[NavigationStep] = []
    result = go(
        link, goals=points, return_to_start=True, observe=seen.append, speed=0.6
    )
    start = (seen[0].observation.pose.x, seen[0].observation.pose.y)
    assert math.dist(start, (-8, 0)) < 0.1
    assert list(dict.fromkeys(each.goal for each in seen)) == [*points, start, None]
    assert (result.outcome, result.goals_left) == ("reached", 0)
    assert math.dist((link.pose.x, link.pose.y), (-8, 0)) < 0.3
    assert 2.6 < result.path_length < 3.6


@pytest.mark.slow
def test_goal_is_met_by_slam_after_40_m(foliage_room: Scene) -> None:
    """The INS alone is off by as much as 0.15 m then, and the goal is 0.1 m wide."""
    link = FaultyTransport(Host(foliage_room))
    corners = ((-2.0, -5.0), (-2.0, 5.0), (-9.0, 5.0), (-9.0, -5.0), (-2.0, -5.0))
    result = go(link, goals=corners, pose_source=PoseSource.SLAM)
    assert result.outcome == "reached"
    assert result.path_length > 40
    assert math.dist((link.pose.x, link.pose.y), corners[-1]) < 0.15


@pytest.mark.parametrize(
    ("fault", "what_came"),
    [
        pytest.param("stalls", "nothing received", id="server that pauses"),
        pytest.param(SCANS, "received only: .*GroundTruth.*", id="no more scans"),
    ],
)
def test_robot_is_stopped_if_no_scans_arrive(
    empty_room: Scene, fault: str | bytes, what_came: str
) -> None:
    link = FaultyTransport(Host(empty_room), fault, since=3.0, until=6.0)
    expected = (
        f"^no scan of 'lms200' within 2 s, {what_came}; the robot was commanded to"
    )
    with pytest.raises(ClientError, match=expected):
        go(link)
    assert 3.4 < stops(link)[0] < 3.7
    stood = link.pose
    for _ in range(100):
        link.host.step()
    assert link.pose == stood


def test_run_goes_on_after_a_pause_shorter_than_the_timeout(empty_room: Scene) -> None:
    link = FaultyTransport(Host(empty_room), "stalls", since=3.0, until=6.0)
    result = go(link, timeout=5.0)
    assert result.outcome == "reached"
    stopped = stops(link)[0]
    assert 3.4 < stopped < 3.7
    assert not [when for when, _ in link.drive_commands if stopped < when < 6.0]
    assert math.dist((link.pose.x, link.pose.y), GOAL) < 0.3


def test_dropped_connection_is_an_error(empty_room: Scene) -> None:
    link = FaultyTransport(Host(empty_room), "drops", since=3.0)
    with pytest.raises(ClientError, match="the server closed the connection"):
        go(link)
    assert not link.host.simulation.vehicles  # it takes the robot with it


def test_robot_without_scanner_is_an_error(empty_room: Scene) -> None:
    link = FaultyTransport(Host(empty_room), SCANS, since=ALWAYS)
    with pytest.raises(ClientError, match="expected a scanner"):
        go(link)


@pytest.mark.parametrize(
    ("pose_source", "line"),
    [
        pytest.param(PoseSource.INS, b"{Type INS}", id="ins"),
        pytest.param(PoseSource.GROUND_TRUTH, b"{Type GroundTruth}", id="truth"),
        pytest.param(PoseSource.ODOMETRY, b"{Type Odometry}", id="odometry"),
    ],
)
def test_missing_poses_are_reported(
    empty_room: Scene, pose_source: PoseSource, line: bytes
) -> None:
    link = FaultyTransport(Host(empty_room), line, since=ALWAYS)
    with pytest.raises(
        ClientError, match=f"no pose from {pose_source.value} within 2 s"
    ):
        go(link, pose_source=pose_source)


def test_slam_needs_the_motion_of_an_ins(empty_room: Scene) -> None:
    link = FaultyTransport(Host(empty_room), b"{Type INS}", since=ALWAYS)
    with pytest.raises(ClientError, match="no pose from ins within 2 s") as error:
        go(link, pose_source=PoseSource.SLAM)
    assert str(error.value).endswith("set the pose source to odometry or ground_truth")


@pytest.mark.parametrize(
    ("lines", "hint"),
    [
        pytest.param(b"nothing", " pose source to ins or ground_truth", id="two"),
        pytest.param(b"{Type INS}", "; set the pose source to ground_truth", id="one"),
    ],
)
def test_robot_without_odometry_is_reported_with_what_it_has(
    empty_room: Scene, lines: bytes, hint: str
) -> None:
    host = Host(empty_room, config=SimulationConfig(UDK))
    link = FaultyTransport(host, lines, since=ALWAYS)
    with pytest.raises(ClientError) as error:
        go(link, pose_source=PoseSource.ODOMETRY, drive_unit="rev_per_s")
    text = str(error.value)
    assert text.startswith("no pose from odometry within 2 s, received only: ")
    assert text.endswith(hint)
    assert all(drive.left == drive.right == 0 for _, drive in link.drive_commands)


def test_without_any_poses_no_other_source_is_proposed(empty_room: Scene) -> None:
    link = FaultyTransport(Host(empty_room), b"{Location ", since=ALWAYS)
    with pytest.raises(ClientError, match="no pose from odometry") as error:
        go(link, pose_source=PoseSource.ODOMETRY)
    assert "expected" not in str(error.value)


def test_robot_is_stopped_after_any_error(empty_room: Scene) -> None:
    link = FaultyTransport(Host(empty_room))

    def interrupt(moment: NavigationStep) -> None:
        if moment.observation.time > 2.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        go(link, interrupt)
    assert stops(link) == [link.drive_commands[-1][0]]


def without_stamps(data: bytes) -> bytes:
    return re.sub(rb" \{Time [^}]*\}", b"", data)


def with_one_stamp(data: bytes) -> bytes:
    return re.sub(rb"\{Time [^}]*\}", b"{Time 7.00}", data)


STAMPS = pytest.mark.parametrize(
    "rewrite",
    [
        pytest.param(bytes, id="stamps"),
        pytest.param(without_stamps, id="no stamps"),
        pytest.param(with_one_stamp, id="always the same stamp"),
    ],
)


@STAMPS
def test_time_is_limited(empty_room: Scene, rewrite: Callable[[bytes], bytes]) -> None:
    link = FaultyTransport(Host(empty_room), rewrite=rewrite)
    moments: list[NavigationStep] = []
    result = go(link, time_limit=2.0, observe=moments.append)
    assert (result.outcome, result.goals_left) == ("failed", 1)
    assert result.time == pytest.approx(2.1)
    assert all(math.isfinite(moment.observation.time) for moment in moments)
    assert stops(link) == [link.drive_commands[-1][0]]


@STAMPS
def test_stuck_robot_is_an_error(
    empty_room: Scene, rewrite: Callable[[bytes], bytes]
) -> None:
    link = FaultyTransport(Host(empty_room), ignores_drive=True, rewrite=rewrite)
    with pytest.raises(
        NavigationError, match=r"stays at -8\.00 0\.00 although commanded to go 3 m"
    ):
        go(link, speed=0.6)
    assert stops(link) == [link.drive_commands[-1][0]]


def test_scanner_names_ignore_case(empty_room: Scene) -> None:
    seen: list[NavigationStep] = []

    def rewrite(data: bytes) -> bytes:
        return data.replace(b"lms200", b"LMS200") if seen else data

    link = FaultyTransport(Host(empty_room), rewrite=rewrite)
    assert go(link, observe=seen.append).outcome == "reached"


def test_scan_that_lost_most_of_its_beams_is_refused(empty_room: Scene) -> None:
    seen: list[NavigationStep] = []

    def rewrite(data: bytes) -> bytes:
        return re.sub(rb"\{Range [^}]*\}", b"{Range 5,5}", data) if seen else data

    link = FaultyTransport(Host(empty_room), rewrite=rewrite)
    with pytest.raises(ClientError, match=r"scan of 2 ranges from .*, expected \d+$"):
        go(link, observe=seen.append)
    assert stops(link) == [link.drive_commands[-1][0]]
