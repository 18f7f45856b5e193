import asyncio
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from radarsim.addons.web.activities import MOST_TASKS, TaskBoard
from radarsim.addons.web.requests import BadRequest


async def test_cancelled_tasks_count_until_their_threads_have_ended() -> None:
    ended = asyncio.Event()

    def tell(message: dict[str, Any]) -> None:
        if message["state"] == "done":
            ended.set()

    board = TaskBoard(tell)
    end = threading.Event()

    def wait(*_: object) -> str:
        """Work that does not notice that it is cancelled, until it is told."""
        end.wait(240)
        return "ended"

    ways = dict.fromkeys(("read_by", "set_wheels"), lambda *_: None)
    robot: Any = SimpleNamespace(name="R1", **ways)
    for _ in range(MOST_TASKS):
        board.begin(robot, "explore", wait)
    assert len(board.running) == 1  # a robot has one, the others are cancelled
    other: Any = SimpleNamespace(name="R2", **ways)
    with pytest.raises(BadRequest, match="tasks"):
        board.begin(other, "explore", wait)
    end.set()
    await asyncio.wait_for(ended.wait(), 240)
    board.begin(other, "explore", wait)
