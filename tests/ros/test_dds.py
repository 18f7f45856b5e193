"""The robots of a server as topics of DDS, heard by another process."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from processes import start_radarsim

from radarsim.client import Client
from radarsim.errors import MissingPackage, ServerError
from radarsim.protocol.reports import GroundTruth, WatchedLine
from radarsim.pytest_plugin import UsarsimServer

TIMEOUT = 240  # s that a busy machine may need
LISTENER = Path(__file__).parents[1] / "support" / "dds_drive.py"
DOMAIN = 1 + os.getpid() % 100  # tests beside each other have their own
foliage_server = pytest.mark.usarsim(map="foliage_room")


@contextmanager
def bridge(server: UsarsimServer, domain: int) -> Iterator[int]:
    """Run a bridge with a robot of its own; yield its process number."""
    words = ("ros", "--bridge", "dds", "--port", str(server.port))
    robot = ("--robot", "P3AT_Compare", "--start", "RobotStart1")
    with start_radarsim(*words, *robot, "--domain", str(domain)) as process:
        assert process.stdout is not None
        try:
            assert b"DDS domain" in process.stdout.readline()
            yield process.pid
        finally:
            process.terminate()
            process.communicate(timeout=TIMEOUT)


def listen(domain: int, seconds: float) -> list[dict[str, Any]]:
    command = [sys.executable, str(LISTENER), str(domain), str(seconds)]
    found: list[dict[str, Any]] = json.loads(
        subprocess.check_output(command, timeout=2 * TIMEOUT)
    )
    return found


@pytest.mark.slow
@foliage_server
def test_participant_hears_scans_and_drives(usarsim_server: UsarsimServer) -> None:
    pytest.importorskip("cyclonedds")
    with (
        Client.connect("127.0.0.1", usarsim_server.port) as watcher,
        bridge(usarsim_server, DOMAIN),
    ):
        heard = listen(DOMAIN, 90)
        watcher.watch(["R1"])
        poses: list[GroundTruth] = []
        while not poses or poses[-1].time < poses[0].time + 1.5:
            poses += [
                each.report
                for each in watcher.read()
                if isinstance(each, WatchedLine)
                and isinstance(each.report, GroundTruth)
            ]
        assert listen(DOMAIN + 101, 3) == []  # another domain
    assert len(heard) >= 40
    times = [scan["time"] for scan in heard]
    assert times == sorted(times)
    assert {scan["frame"] for scan in heard} == {"R1/lms200"}
    assert {len(scan["ranges"]) for scan in heard} == {181}
    assert heard[0]["ranges"] != heard[-1]["ranges"]  # it has driven
    assert poses[-1].pose == poses[-2].pose  # and stands, as no command comes


def test_unknown_interface_is_refused() -> None:
    pytest.importorskip("cyclonedds")
    from radarsim.ros.dds import DdsParticipant

    with pytest.raises(ServerError, match="no DDS on interface 'no_such_0'"):
        DdsParticipant(DOMAIN, "no_such_0")


def test_missing_package_is_named_with_its_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from radarsim.ros.dds import DdsParticipant

    monkeypatch.setitem(sys.modules, "cyclonedds.domain", None)
    with pytest.raises(MissingPackage, match=r"cyclonedds.*radarsim\[dds\]"):
        DdsParticipant(DOMAIN)
