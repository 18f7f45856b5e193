"""Recordings that the page begins and ends."""

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from served_page import run_commander
from web_pages import open_page

from radarsim.client import AsyncClient
from radarsim.geometry import Pose2
from radarsim.protocol.reports import RangeScan
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.server_thread import ServerThread

pytest.importorskip("mcap")
highlevel = pytest.importorskip("rosbags.highlevel")


def read(folder: Path, topic: str) -> list[Any]:
    """Return the messages of a topic, read by rosbags."""
    with highlevel.AnyReader([folder]) as reader:
        return [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == topic
        ]


def only_folder(path: Path) -> Path:
    (folder,) = path.iterdir()
    return folder


def seconds(message: Any) -> float:
    stamp = message.header.stamp
    return round(float(stamp.sec + stamp.nanosec * 1e-9), 2)


async def test_all_robots_are_recorded_until_anybody_ends_it(
    server: tuple[str, int], tmp_path: Path
) -> None:
    with run_commander(server, record_to=tmp_path) as commander:
        async with (
            open_page(commander) as page,
            open_page(commander) as other,
            await AsyncClient.connect(*server) as client,
        ):
            await client.spawn("P3AT_Compare", name="R 1", pose=Pose2(-8.0, 0.0))
            await page.send("record", on=True)
            await other.hear("recording", on=True)
            async with open_page(commander) as third:
                await third.hear("recording", on=True)
            shown = await page.see(lambda frame: frame.robot("R 1").get("scans"))
            start = shown.header["t"]
            scans: list[RangeScan] = []
            while len(scans) < 5:
                scan = await client.wait_for(RangeScan, name="lms200")
                scans += [scan] if scan.time > start else []
            await other.send("record", on=False)
            reported = (await page.hear("recording", on=False, text=""))["text"]
            while not reported:
                reported = (await page.hear("recording", on=False))["text"]
    folder = only_folder(tmp_path)
    assert str(folder) in reported
    sent = {round(scan.time, 2): scan.ranges for scan in scans}
    recorded = read(folder, "/R_1/lms200/scan")
    common = [(m.ranges, sent[t]) for m in recorded if (t := seconds(m)) in sent]
    assert len(common) >= 3  # of the first and last it may be the one or the other
    for ranges, expected in common:
        hits = np.isfinite(ranges)
        assert np.array_equal(ranges[hits], np.float32(expected[hits]))
        assert len(set(expected[~hits])) <= 1  # beams without return
    assert any(cloud.width for cloud in read(folder, "/R_1/lms200/echoes"))
    frames = {
        t.child_frame_id for m in read(folder, "/tf_static") for t in m.transforms
    }
    assert "R_1/lms200" in frames


@pytest.mark.slow
async def test_a_recording_is_complete_when_the_commander_ends(
    server: tuple[str, int], tmp_path: Path
) -> None:
    with run_commander(server, record_to=tmp_path) as commander:
        async with open_page(commander) as page:
            await page.send("spawn", **{"class": "P3AT", "name": "R1"})
            await page.send("record", on=True)
            await page.hear("recording", on=True)
            frame = await page.see(lambda frame: frame.robot("R1").get("scans"))
            start = frame.header["t"]
            await page.see(lambda frame: frame.header["t"] > start + 1)
    folder = only_folder(tmp_path)
    assert len(read(folder, "/R1/lms200/scan")) >= 2


async def test_what_cannot_be_recorded_is_reported_and_a_lost_server_ends_a_recording(
    foliage_room: Scene, tmp_path: Path
) -> None:
    target = tmp_path / "target"
    target.write_text("a file, where a folder should be")
    server = ServerThread(Host(foliage_room), speed=1.0)
    with run_commander(server.begin(), record_to=target) as commander:
        async with open_page(commander) as page:
            await page.send("record", on=True)
            assert str(target) in (await page.hear("error"))["text"]
            target.unlink()
            await page.send("record", on=True)
            await page.hear("recording", on=True)
            await asyncio.to_thread(server.finish)
            while not (text := (await page.hear("recording", on=False))["text"]):
                pass
            folder = only_folder(target)
            assert text == f"Recorded in {folder}"
            assert (folder / "metadata.yaml").exists()


async def test_a_full_disk_is_reported_and_ends_the_recording(
    server: tuple[str, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "radarsim.addons.recording.recording_process.PROGRAM",
        "import resource, signal, sys; sys.path[:] = sys.argv[1:];"
        "sys.dont_write_bytecode = True;"  # it would be cut off at 9000 bytes
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (9000, 9000));"
        "from radarsim.addons.recording.recording_process import write_run;"
        "write_run()",
    )
    with run_commander(server, record_to=tmp_path) as commander:
        async with open_page(commander) as page:
            await page.send("spawn", **{"class": "P3AT_Compare", "name": "R1"})
            await page.send("record", on=True)
            await page.hear("recording", on=True)
            assert "disk" in (await page.hear("error"))["text"]
            await page.send("drive", robot="R1", v=0.1, w=0)
            await page.hear("viewer", robot="R1")


async def test_a_recording_that_fails_at_its_end_is_reported_as_not_complete(
    server: tuple[str, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "radarsim.addons.recording.recording_process.PROGRAM",
        "import sys; sys.stdin.buffer.read(); sys.exit(1)",
    )
    with run_commander(server, record_to=tmp_path) as commander:
        async with open_page(commander) as page:
            await page.send("record", on=True)
            await page.hear("recording", on=True)
            await page.send("record", on=False)
            assert "not complete" in (await page.hear("error"))["text"]
            async with open_page(commander) as other:
                text = (await other.hear("recording"))["text"]
    assert text == f"{only_folder(tmp_path)} is not complete"
