"""Ranges to drive by, from echoes."""

import math
from typing import Any

import numpy as np
import pytest
from flat_world import echoes_of
from random_trials import load_random_map, mission_to

from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.autonomy.navigation.mission import run_mission
from radarsim.autonomy.navigation.observation import ObservationBuilder
from radarsim.autonomy.plans import PoseSource
from radarsim.client import Client, ScannerInfo
from radarsim.client.robot_state import EchoCollector
from radarsim.generators.random_maps import Disc, RandomMap
from radarsim.geometry import Pose3
from radarsim.protocol.reports import EchoLine, GroundTruth, RangeScan, TargetEchoes
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport

RANGES = np.array([5.0, 5.0, 80.0])


@pytest.mark.parametrize(
    ("echoes", "expected"),
    [
        pytest.param([], [5, 5, 80], id="nothing"),
        pytest.param(
            [echoes_of((1, 2.0, "enter"), (1, 2.4, "leave"))],
            [5, 2, 80],
            id="thin bush",
        ),
        pytest.param([echoes_of((2, 3.0, "sheet"))], [5, 5, 3], id="a leaf"),
        pytest.param(
            [echoes_of((0, 1.0, "enter"), (0, 5.0, "spent"), passes=True)],
            [5, 5, 80],
            id="smoke",
        ),
        pytest.param([echoes_of((1, 0.5, "rain"))], [5, 5, 80], id="drops"),
        pytest.param(
            [echoes_of((3, 1.0, "hit"), (-1, 1.0, "hit"), (0, math.nan, "hit"))],
            [5, 5, 80],
            id="no beam, no range",
        ),
    ],
)
def test_beam_is_blocked_by_the_first_thing_that_robots_cannot_pass(
    echoes: list[TargetEchoes], expected: list[float]
) -> None:
    scanner = ScannerInfo("a", Pose3(0, 0, 0), 0.1, 80.0, 0.1, 0.2, 3)
    builder = ObservationBuilder(scanner, PoseSource.GROUND_TRUTH, lambda: 0.0)
    builder.take(GroundTruth(1.0, "truth", Pose3(0, 0, 0)))
    for k, each in enumerate(echoes or [None], start=1):
        builder.take(EchoLine(1.0, "a", k * bool(each), len(echoes), each))
    seen = builder.take(RangeScan(1.0, "a", 0.1, 0.2, RANGES))
    assert seen is not None
    assert np.minimum(seen.ranges, 80.0) == pytest.approx(expected)
    assert RANGES.tolist() == [5.0, 5.0, 80.0]


def test_echoes_of_a_scan_count_only_if_all_lines_came() -> None:
    collector = EchoCollector()
    scan = RangeScan(1.0, "a", 0.1, 0.2, RANGES)
    lines = [EchoLine(1.0, "a", k, 2, echoes_of((0, k, "hit"))) for k in (1, 2)]
    collector.take(lines[0])
    assert collector.of(scan) is None
    for line in lines:
        collector.take(line)
    echoes = collector.of(scan)
    assert echoes is not None
    assert len(echoes) == 2
    assert collector.of(scan) is None
    collector.take(EchoLine(2.0, "a", 0, 0, None))
    assert collector.of(RangeScan(2.0, "a", 0.1, 0.2, RANGES)) == []


class NoEchoes(InProcessTransport):
    """A link to a server that does not know ECHOES."""

    def send(self, data: bytes) -> None:
        if b"ECHOES" not in data:
            super().send(data)


class NoTouch(InProcessTransport):
    """A link to a server whose robots feel nothing."""

    def receive(self, timeout: float) -> bytes:
        return super().receive(timeout).replace(b"Touch True", b"Touch False")


class NeitherNor(NoTouch, NoEchoes):
    """A link to a server that has neither."""


def drive_at_a_thin_bush(link: type[InProcessTransport], **changed: Any) -> Any:
    """Drive through a bush of 1 m and density .7; return the result and the touches."""
    bush = RandomMap(0, "thin", (Disc(0, 0, 0.5),), 0.7, (-3.0, 0.1), (3.0, 0.1))
    host = Host(load_random_map(bush))
    monitor = GroundTruthMonitor(host)
    mission = mission_to(bush.goal, "bug2", speed=0.6, **changed)
    with Client(link(host, after_tick=monitor.watch)) as client:
        return run_mission(client, mission).outcome, monitor.collisions


def test_thin_bush_is_not_touched_by_who_uses_echoes() -> None:
    reached = drive_at_a_thin_bush(InProcessTransport, time_limit=100.0)
    assert reached == ("reached", 0)


@pytest.mark.parametrize(
    ("link", "changed"),
    [
        pytest.param(NeitherNor, {}, id="server without echoes"),
        pytest.param(NoTouch, {"echoes": False}, id="not asked for"),
    ],
)
def test_ranges_alone_lead_into_a_thin_bush(
    link: type[InProcessTransport], changed: dict[str, Any]
) -> None:
    outcome, touches = drive_at_a_thin_bush(link, time_limit=8.0, **changed)
    assert outcome == "failed"  # it presses against the bush
    assert touches > 0


@pytest.mark.slow
def test_who_feels_a_thin_bush_gets_around_it() -> None:
    outcome, touches = drive_at_a_thin_bush(NoEchoes, time_limit=100.0)
    assert outcome == "reached"
    assert 1 <= touches <= 8
