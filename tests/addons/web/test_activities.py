"""The tasks of robots, without a server."""

import asyncio
import json
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from radarsim.addons.web.activities import MOST_TASKS, Activities
from radarsim.addons.web.requests import BadRequest, Explore
from radarsim.autonomy.plans import StrategyName


async def test_cancelled_tasks_count_until_their_threads_have_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ended = asyncio.Event()

    def broadcast(text: str, _: object) -> None:
        if json.loads(text)["state"] == "done":
            ended.set()

    end = threading.Event()

    def wait(*_: object) -> str:
        """Work that does not notice that it is cancelled, until it is told."""
        end.wait(240)
        return "ended"

    ways = dict.fromkeys(("read_by", "set_wheels"), lambda *_: None)
    robots: Any = SimpleNamespace(
        find_own=lambda name: SimpleNamespace(name=name, hindrance=None, **ways),
        views={},
    )
    viewers: Any = SimpleNamespace(broadcast=broadcast)
    activities = Activities(robots, viewers, lambda: None)
    monkeypatch.setattr(
        "radarsim.addons.web.algorithms.plan_exploration", lambda *_: wait
    )

    def explore(robot: str) -> None:
        activities.explore(Explore(robot=robot, strategy=StrategyName.FRONTIERS))

    for _ in range(MOST_TASKS):
        explore("R1")
    assert len(activities.running) == 1  # a robot has one, the others are cancelled
    with pytest.raises(BadRequest, match="tasks"):
        explore("R2")
    end.set()
    await asyncio.wait_for(ended.wait(), 240)
    explore("R2")
