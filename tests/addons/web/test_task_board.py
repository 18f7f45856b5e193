import asyncio
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from radarsim.addons.web.requests import BadRequest
from radarsim.addons.web.tasks import MOST_TASKS, TaskBoard


class Waiting:
    """Work that does not notice that it is cancelled, until it is told."""

    def __init__(self) -> None:
        self.end = threading.Event()

    def run(self, client: object, tell: object) -> str:  # noqa: ARG002
        self.end.wait(240)
        return "ended"


async def test_cancelled_tasks_count_until_their_threads_have_ended() -> None:
    ended = asyncio.Event()

    def tell(message: dict[str, Any]) -> None:
        if message["state"] == "done":
            ended.set()

    board = TaskBoard(tell)
    waiting: Any = Waiting()
    robot: Any = SimpleNamespace(name="R1", listeners=[], set_wheels=lambda *_: None)
    for _ in range(MOST_TASKS):
        board.begin(robot, "explore", waiting)
    assert len(board.running) == 1  # a robot has one, the others are cancelled
    other: Any = SimpleNamespace(name="R2", listeners=[], set_wheels=lambda *_: None)
    with pytest.raises(BadRequest, match="tasks"):
        board.begin(other, "explore", waiting)
    waiting.end.set()
    await asyncio.wait_for(ended.wait(), 240)
    board.begin(other, "explore", waiting)
