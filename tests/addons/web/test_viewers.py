import asyncio
import json
import math

import pytest

from radarsim.addons.web.viewers import (
    MOST_TEXTS,
    SlowViewer,
    Viewer,
    Viewers,
    encode_json,
)


async def take(viewer: Viewer, count: int) -> list[str | bytes]:
    """Return the next messages to a viewer."""
    outgoing = viewer.outgoing()
    return [await anext(outgoing) for _ in range(count)]


async def test_texts_keep_their_order_and_newer_ones_of_a_subject_replace_older() -> (
    None
):
    viewer = Viewer("viewer 1")
    viewer.send({"op": "map", "n": 1}, "map")
    viewer.send({"op": "notice"})
    viewer.send({"op": "map", "n": 2}, "map")
    viewer.send("{}")
    texts = await take(viewer, 3)
    assert [json.loads(text) for text in texts] == [
        {"op": "notice"},
        {"op": "map", "n": 2},
        {},
    ]


async def test_of_frames_that_wait_only_the_newest_is_sent() -> None:
    viewer = Viewer("viewer 1")
    viewer.send_frame(b"old", 1)
    viewer.send_frame(b"new", 2)
    viewer.send({"op": "notice"})
    assert (await take(viewer, 2))[1] == b"new"


async def test_viewer_that_does_not_read_is_given_up() -> None:
    viewer = Viewer("viewer 1")
    for _ in range(MOST_TEXTS + 1):
        viewer.send({})
    with pytest.raises(SlowViewer):
        await take(viewer, MOST_TEXTS + 1)


def test_numbers_that_json_has_not_are_null() -> None:
    text = encode_json({"a": [math.inf, 1.5], "b": (math.nan,)})
    assert json.loads(text) == {"a": [None, 1.5], "b": [None]}


class Frames:
    """Browsers that are sent frames, and the frames that are made."""

    def __init__(self) -> None:
        self.made: list[str | None] = []
        self.viewers = Viewers(self.make)
        self.viewer = self.viewers.add()

    def make(self, selected: str | None) -> bytes:
        self.made.append(selected)
        return b"frame"


async def test_frames_wait_for_the_acknowledgement_of_the_one_before() -> None:
    frames = Frames()
    frames.viewers.send_frame(frames.viewer)
    for _ in range(3):
        frames.viewers.update()
        await asyncio.sleep(0.11)
    assert len(frames.made) == 1
    frames.viewers.acknowledge(frames.viewer)
    assert len(frames.made) == 2
    frames.viewers.acknowledge(frames.viewer)
    assert len(frames.made) == 2  # nothing is new


async def test_frames_are_at_least_a_tenth_of_a_second_apart_on_average() -> None:
    frames = Frames()
    loop = asyncio.get_running_loop()
    begin = loop.time()
    while len(frames.made) < 7:
        frames.viewers.update()
        frames.viewer.is_ready = True
        await asyncio.sleep(0.001)
    assert loop.time() - begin >= 0.48
