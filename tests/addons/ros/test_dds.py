"""The robots of a server as topics of DDS, heard by another process."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import start_radarsim

from radarsim.addons.ros.commands import BridgeOptions, ros
from radarsim.addons.testing import UsarsimServer
from radarsim.cli.fields import Server
from radarsim.client import Client
from radarsim.errors import MissingPackage, ServerError
from radarsim.protocol.reports import GroundTruth, WatchedLine

TIMEOUT = 240  # s that a busy machine may need
SUPPORT = Path(__file__).parents[2] / "support"
DOMAIN = 1 + os.getpid() % 100  # tests beside each other have their own
foliage_server = pytest.mark.usarsim(map="foliage_room")


@contextmanager
def bridge(server: UsarsimServer, domain: int, *options: str) -> Iterator[int]:
    """Run a bridge with a robot of its own; yield its process number."""
    words = ["ros", "--bridge", "dds", "--connect", f"127.0.0.1:{server.port}"]
    words += ["--robot", "P3AT_Compare", "--start", "RobotStart1", "--map", "R1"]
    words += ["--domain", str(domain), *options]
    with start_radarsim(*words) as process:
        assert process.stdout is not None
        try:
            assert b"DDS domain" in process.stdout.readline()
            yield process.pid
        finally:
            process.terminate()
            process.communicate(timeout=TIMEOUT)


def start_listener(domain: int, count: int) -> "subprocess.Popen[bytes]":
    """Start a participant that drives, until it has heard so many scans and a map."""
    command = [sys.executable, str(SUPPORT / "dds_drive.py"), str(domain), str(count)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe)


@foliage_server
def test_participant_hears_scans_and_a_map_and_drives(
    usarsim_server: UsarsimServer,
) -> None:
    pytest.importorskip("cyclonedds")
    with (
        Client.connect("127.0.0.1", usarsim_server.port) as watcher,
        bridge(usarsim_server, DOMAIN),
        start_listener(DOMAIN + 101, 1) as other,
        start_listener(DOMAIN, 30) as listener,
    ):
        told = heard_by(listener)
        heard = told["scans"]
        watcher.watch(["R1"])
        poses = watch_until_it_stands(watcher)
        silence = json.loads(other.communicate(b"\n", timeout=TIMEOUT)[0])
    assert silence == {"scans": [], "map": None}
    check_map(told["map"])
    times = [scan["time"] for scan in heard]
    assert times == sorted(times)
    assert {scan["frame"] for scan in heard} == {"R1/lms200"}
    assert {len(scan["ranges"]) for scan in heard} == {181}
    assert heard[0]["ranges"] != heard[-1]["ranges"]  # it has driven
    # It stands, as no command comes; it has not driven to the wall.
    assert poses[-1].pose == poses[-2].pose
    assert poses[-1].pose.x < poses[0].pose.x + 3


def heard_by(listener: "subprocess.Popen[bytes]") -> dict[str, Any]:
    """Return what a listener has heard once it has ended."""
    assert listener.stdout is not None
    found: dict[str, Any] = json.loads(listener.stdout.read())
    return found


def check_map(grid: dict[str, Any]) -> None:
    """Check a map of the foliage room: floor ahead of the start is free."""
    assert grid["frame"] == "map"
    assert grid["resolution"] == pytest.approx(0.05)
    cells = np.array(grid["data"]).reshape(grid["shape"])
    assert {*np.unique(cells)} == {-1, 0, 100}
    ahead = np.array([-8.0 + 1.0, 0.0]) - grid["origin"]  # of RobotStart1
    column, row = (ahead / grid["resolution"]).astype(int)
    assert cells[row, column] == 0


def watch_until_it_stands(watcher: Client) -> list[GroundTruth]:
    """Return poses of 1.5 s of simulated time or more, of which the last two agree."""
    poses: list[GroundTruth] = []
    while (
        not poses
        or poses[-1].time < poses[0].time + 1.5
        or poses[-1].pose != poses[-2].pose
    ):
        poses += [
            each.report
            for each in watcher.read(TIMEOUT)
            if isinstance(each, WatchedLine) and isinstance(each.report, GroundTruth)
        ]
    return poses


@foliage_server
@pytest.mark.parametrize("localised_by", ["the bridge", "another program"])
def test_each_frame_has_one_parent(
    localised_by: str, usarsim_server: UsarsimServer
) -> None:
    pytest.importorskip("cyclonedds")
    by_other = localised_by == "another program"
    options = ("--own-localization",) if by_other else ()
    command = [sys.executable, str(SUPPORT / "dds_frames.py"), str(DOMAIN)]
    command += ["map"] if by_other else []
    with bridge(usarsim_server, DOMAIN, *options):
        told = json.loads(subprocess.check_output(command, timeout=TIMEOUT))
    parents = {child: parent for parent, child in told}
    assert len(parents) == len(told)
    assert parents == {
        "R1/odom": "map",
        "R1/base_link": "R1/odom",
        "R1/lms200": "R1/base_link",
        "R1/Hokuyo": "R1/base_link",
    }


def test_unknown_interface_is_refused() -> None:
    pytest.importorskip("cyclonedds")
    from radarsim.addons.ros.dds import DdsParticipant

    with pytest.raises(ServerError, match="no DDS on interface 'no_such_0'"):
        DdsParticipant(DOMAIN, "no_such_0")


def test_missing_package_is_named_with_its_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "cyclonedds.domain", None)
    with pytest.raises(MissingPackage, match=r"cyclonedds.*radarsim\[dds\]"):
        ros(Server(), BridgeOptions(bridge="dds"))
