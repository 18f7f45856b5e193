import asyncio
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from radarsim.commander.requests import BadRequest
from radarsim.commander.task_board import MOST_TASKS, TaskBoard, Work


class Waiting:
    """Work that does not notice that it is cancelled, until it is told."""

    def __init__(self) -> None:
        self.end = threading.Event()

    def run(self, client: object, tell: object) -> str:  # noqa: ARG002
        self.end.wait(240)
        return "ended"


async def test_cancelled_tasks_count_until_their_threads_have_ended() -> None:
    board = TaskBoard(lambda _: None)
    work: Any = Waiting()
    robot: Any = SimpleNamespace(name="R1", listeners=[], set_wheels=lambda *_: None)
    for _ in range(MOST_TASKS):
        board.begin(robot, "explore", work)
    assert len(board.running) == 1  # a robot has one, the others are cancelled
    with pytest.raises(BadRequest, match="tasks"):
        board.begin(robot, "explore", work)
    work.end.set()
    async with asyncio.timeout(240):
        while not _can_begin(board, robot, work):
            await asyncio.sleep(0.01)


def _can_begin(board: TaskBoard, robot: Any, work: Work) -> bool:
    try:
        board.begin(robot, "explore", work)
    except BadRequest:
        return False
    return True
