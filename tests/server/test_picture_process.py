"""The process that draws pictures."""

import asyncio
import io
import os
import pickle
import signal
import struct
import subprocess
import sys
from asyncio.subprocess import Process

import pytest

from radarsim.camera.__main__ import draw_pictures
from radarsim.camera.encoding import encode
from radarsim.camera.renderer import Renderer
from radarsim.camera.view import View
from radarsim.errors import ServerError
from radarsim.protocol.images import WHOLE, ImageType, Region
from radarsim.scene.scene import Scene
from radarsim.server.picture_process import PictureProcess
from radarsim.simulation.simulation import Simulation

DEADLINE = 120.0  # s; a busy machine starts Python in many
REGION = Region(10, 20, 30, 40)


async def test_pictures_of_the_process_are_those_of_the_renderer(
    foliage_room: Scene,
) -> None:
    view = View.of(Simulation(foliage_room))
    process = PictureProcess(foliage_room, ImageType.RAW)
    await process.start()
    try:
        async with asyncio.timeout(DEADLINE):
            for _ in range(2):
                pictures = await process.draw(view, {WHOLE, REGION})
    finally:
        await process.stop()
    pixels = Renderer(foliage_room).render(view)
    for region in (WHOLE, REGION):
        assert pictures[region] == encode(pixels, region, ImageType.RAW)


async def test_end_of_the_process_is_an_error_that_tells_its_exit_code(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[Process] = []
    create = asyncio.create_subprocess_exec

    async def create_and_note(*words: str, **options: object) -> Process:
        started.append(await create(*words, **options))  # type: ignore[arg-type]
        return started[-1]

    monkeypatch.setattr(asyncio, "create_subprocess_exec", create_and_note)
    process = PictureProcess(empty_room, ImageType.RAW)
    await process.start()
    os.kill(started[0].pid, signal.SIGKILL)
    with pytest.raises(ServerError, match="-9"):
        async with asyncio.timeout(DEADLINE):
            await process.draw(View.of(Simulation(empty_room)), {WHOLE})
    await process.stop()


async def test_process_that_was_not_started_can_be_stopped(empty_room: Scene) -> None:
    await PictureProcess(empty_room, ImageType.RAW).stop()


def test_process_ends_when_its_input_does(empty_room: Scene) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "radarsim.camera"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    request = pickle.dumps((empty_room, ImageType.RAW))
    assert process.communicate(request, timeout=DEADLINE) == (b"", b"")
    assert process.returncode == 0


def test_answer_has_its_length_before_it(empty_room: Scene) -> None:
    view = View.of(Simulation(empty_room))
    requests = io.BytesIO(
        pickle.dumps((empty_room, ImageType.RAW)) + pickle.dumps((view, {REGION}))
    )
    replies = io.BytesIO()
    draw_pictures(requests, replies)
    (length,) = struct.unpack(">Q", replies.getvalue()[:8])
    assert len(replies.getvalue()) == 8 + length
    assert set(pickle.loads(replies.getvalue()[8:])) == {REGION}
