"""The process that draws pictures."""

import asyncio
import os
import signal
from multiprocessing import active_children

import pytest

from radarsim.errors import ServerError
from radarsim.protocol.images import WHOLE, ImageType, Region
from radarsim.scene.scene import Scene
from radarsim.server.camera import Renderer, encode
from radarsim.server.image_server import PictureProcess
from radarsim.server.views import View
from radarsim.simulation.simulation import Simulation

DEADLINE = 240.0  # s; a busy machine starts Python in many
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
                pictures = await process.draw((view,), {WHOLE, REGION})
    finally:
        await process.stop()
    pixels = Renderer(foliage_room).render(view)
    for region in (WHOLE, REGION):
        assert pictures[region] == encode(pixels, region, ImageType.RAW)


async def draw_forever(process: PictureProcess, view: View) -> None:
    while True:
        await process.draw((view,), {REGION})


async def test_end_of_the_process_is_an_error(empty_room: Scene) -> None:
    view, others = View.of(Simulation(empty_room)), {*active_children()}
    process = PictureProcess(empty_room, ImageType.RAW)
    await process.start()
    try:
        async with asyncio.timeout(DEADLINE):
            await process.draw((view,), {REGION})
            (worker,) = {*active_children()} - others
            assert worker.pid is not None
            os.kill(worker.pid, signal.SIGKILL)
            with pytest.raises(ServerError, match="draws pictures has ended"):
                await draw_forever(process, view)
    finally:
        await process.stop()


async def test_stop_ends_the_process(empty_room: Scene) -> None:
    others = {*active_children()}
    process = PictureProcess(empty_room, ImageType.RAW)
    await process.start()
    await process.stop()
    assert {*active_children()} <= others


async def test_stop_ends_a_process_that_is_being_started(empty_room: Scene) -> None:
    others = {*active_children()}
    process = PictureProcess(empty_room, ImageType.RAW)
    starting = asyncio.create_task(process.start())
    await asyncio.sleep(0)
    starting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await starting
    await process.stop()
    assert {*active_children()} <= others


async def test_process_that_was_not_started_can_be_stopped(empty_room: Scene) -> None:
    await PictureProcess(empty_room, ImageType.RAW).stop()
