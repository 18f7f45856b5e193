"""The robots of a server as topics of DDS, heard by another process."""

import base64
import io
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from live_bridge import bridge, running
from PIL import Image
from processes import start_radarsim

from radarsim.addons.ros.bridge import as_jpeg, run_bridge
from radarsim.addons.ros.cli import BridgeOptions, TopicOptions, ros
from radarsim.addons.testing import UsarsimServer
from radarsim.cli.fields import Server
from radarsim.client import Client
from radarsim.errors import MissingPackage, ServerError
from radarsim.protocol.images import ImageType, encode_raw
from radarsim.protocol.reports import GroundTruth, WatchedLine

TIMEOUT = 240  # s that a busy machine may need
SUPPORT = Path(__file__).parents[2] / "support"
DOMAIN = 1 + os.getpid() % 100  # parallel tests have their own
OPTIONS = ["--bridge", "dds", "--robot", "P3AT_Compare", "--start", "RobotStart1"]
OPTIONS += ["--map", "R1", "--domain", str(DOMAIN)]
foliage_server = pytest.mark.usarsim(map="foliage_room")


def participant(program: str, domain: int, *words: str) -> "subprocess.Popen[bytes]":
    """Start a program of another participant."""
    command = [sys.executable, str(SUPPORT / program), str(domain), *words]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)


@foliage_server
def test_participant_hears_scans_and_a_map_and_drives(
    usarsim_server: UsarsimServer,
) -> None:
    pytest.importorskip("cyclonedds")
    with (
        Client.connect("127.0.0.1", usarsim_server.port) as watcher,
        bridge(usarsim_server, *OPTIONS) as line,
        # It drives until it has heard so many scans, and a map.
        participant("dds_drive.py", DOMAIN, "15") as listener,
    ):
        assert "DDS domain" in line
        assert listener.stdout is not None
        received = json.loads(listener.stdout.read())
        watcher.watch(["R1"])
        poses = watch_until_it_stands(watcher)
    check_map(received["map"])
    heard = received["scans"]
    times = [scan["time"] for scan in heard]
    assert times == sorted(times)
    assert {scan["frame"] for scan in heard} == {"R1/lms200"}
    assert {len(scan["ranges"]) for scan in heard} == {181}
    assert heard[0]["ranges"] != heard[-1]["ranges"]  # it has driven
    # It stands, as no command comes; it has not driven to the wall.
    assert poses[-1].pose == poses[-2].pose
    assert poses[-1].pose.x < poses[0].pose.x + 3


def check_map(grid: dict[str, Any]) -> None:
    """Check a map of the foliage room: floor ahead of the start is free."""
    assert grid["frame"] == "map"
    assert grid["resolution"] == pytest.approx(0.05)
    assert {*grid["data"]} == {-1, 0, 100}
    assert cell_at(grid, -8.0 + 1.0, 0.0) == 0  # ahead of RobotStart1


def cell_at(grid: dict[str, Any], x: float, y: float) -> int:
    place = np.array([x, y]) - grid["origin"]
    column, row = (place / grid["resolution"]).astype(int)
    return int(np.array(grid["data"]).reshape(grid["shape"])[row, column])


def watch_until_it_stands(watcher: Client) -> list[GroundTruth]:
    """Return poses of 1.5 s of simulated time or more; the last two agree."""
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


def check_world(received: dict[str, Any]) -> None:
    """Check what a viewer has heard of a robot in the foliage room."""
    alphas = {marker["ns"]: marker["alpha"] for marker in received["scene"]}
    assert alphas["bush_1"] == pytest.approx(0.5)
    assert alphas["north_wall"] == 1.0
    assert all(marker["points"] % 3 == 0 for marker in received["scene"])
    grid = received["map"]
    assert (grid["frame"], {*grid["data"]}) == ("map", {0, 100})
    assert cell_at(grid, -7.0, 0.0) == 0  # the floor
    assert cell_at(grid, -10.5, 0.0) == 100  # a wall
    links = ET.fromstring(received["robot_description"]).iter("link")
    assert {"R1/base_link", "R1/lms200"} <= {link.get("name") for link in links}
    picture = received["camera/image/compressed"]
    assert picture["frame"] == "R1/camera_optical"
    shown = Image.open(io.BytesIO(base64.b64decode(picture["jpeg"])))
    info = received["camera/camera_info"]
    assert info["size"] == list(shown.size)
    assert info["k"][0] == pytest.approx(shown.size[0] / 2 / math.tan(math.radians(40)))


def test_raw_pictures_become_jpeg() -> None:
    rows = [bytes((0, 0, 250)) * 18] * 10  # blue, green, red
    shown = Image.open(io.BytesIO(as_jpeg(ImageType.RAW, encode_raw(18, 10, rows))))
    assert shown.size == (18, 10)
    red, green, blue = np.asarray(shown).mean(axis=(0, 1))
    assert red > 200
    assert max(green, blue) < 50
    with pytest.raises(ValueError, match="raw picture of 3 bytes"):
        as_jpeg(ImageType.RAW, b"abc")


# JPEG and raw pictures
@pytest.mark.parametrize(
    "dialect", ["compat", pytest.param("udk", marks=pytest.mark.slow)]
)
def test_participant_sees_the_world_of_a_live_run(dialect: str) -> None:
    pytest.importorskip("cyclonedds")
    from radarsim.addons.ros.dds import DdsParticipant

    domain = DOMAIN + (101 if dialect == "compat" else 102)  # own ones of this process
    words = ["serve", "foliage_room", "--port", "0", "--image-port", "0"]
    words += ["--dialect", dialect]
    with start_radarsim(*words) as server:
        assert server.stdout is not None
        ports: dict[bool, str] = {}  # that of images is True
        try:
            while len(ports) < 2:
                line = server.stdout.readline().decode()
                ports["images" in line] = line.rpartition(":")[2].strip()
            options = TopicOptions(
                draw="foliage_room", true_map=True, image_port=int(ports[True])
            )
            work = run_bridge(
                ("127.0.0.1", int(ports[False])),
                DdsParticipant(domain),
                options=options,
                robot_class="P3AT",
            )
            # It ends when it has heard of all that viewers show.
            viewing = participant("dds_world.py", domain, "R1")
            with running(work), viewing as viewer:
                try:
                    out, _ = viewer.communicate(timeout=TIMEOUT)
                finally:
                    viewer.kill()
        finally:
            server.terminate()
            server.communicate(timeout=TIMEOUT)
    check_world(json.loads(out))


@foliage_server
@pytest.mark.slow
@pytest.mark.parametrize("localised_by", ["the bridge", "another program"])
def test_each_frame_has_one_parent(
    localised_by: str, usarsim_server: UsarsimServer
) -> None:
    pytest.importorskip("cyclonedds")
    by_other = localised_by == "another program"
    options = ["--own-localization"] * by_other
    command = [sys.executable, str(SUPPORT / "dds_frames.py"), str(DOMAIN)]
    command += ["map"] * by_other
    with bridge(usarsim_server, *OPTIONS, *options):
        received = json.loads(subprocess.check_output(command, timeout=TIMEOUT))
    parents = {child: parent for parent, child in received}
    assert len(parents) == len(received)
    assert parents == {
        "R1/odom": "map",
        "R1/base_link": "R1/odom",
        "R1/lms200": "R1/base_link",
        "R1/Hokuyo": "R1/base_link",
    }


def test_unknown_interface_is_refused() -> None:
    pytest.importorskip("cyclonedds")
    from radarsim.addons.ros.dds import DdsParticipant

    with pytest.raises(ServerError, match="no DDS on 'no_such_0'"):
        DdsParticipant(DOMAIN, "no_such_0")


def test_missing_package_is_named_with_its_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "cyclonedds.domain", None)
    with pytest.raises(MissingPackage, match=r"cyclonedds.*'\.\[dds\]'"):
        ros(Server(), BridgeOptions(bridge="dds"), TopicOptions())
