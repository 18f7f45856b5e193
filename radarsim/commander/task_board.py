"""The tasks that robots are at, each in a thread of its own."""

import asyncio
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeAlias

from radarsim.commander.own_robot import OwnRobot
from radarsim.commander.requests import BadRequest
from radarsim.commander.robot_client import RobotClient
from radarsim.errors import RadarsimError

log = logging.getLogger("radarsim.commander")
MOST_TASKS: Final = 20  # at a time

Tell: TypeAlias = Callable[[dict[str, Any]], None]


class WorkFailed(Exception):
    """A robot has not done what it was to do; the message says why."""


class Work(Protocol):
    """Something that a robot does by itself."""

    def run(self, client: RobotClient, tell: Tell) -> str:
        """Do it, and return how it went, in words.

        Args:
            client: The connection to the robot.
            tell: Called with messages.

        Raises:
            RadarsimError: If the robot or its server cannot do it.
            WorkFailed: If it is not done.
        """


@dataclass(slots=True, eq=False)
class Task:
    """One task.

    Attributes:
        number: Its number.
        robot: The robot.
        kind: ``goto`` or ``explore``.
        client: Where the task reads and drives.
        state: ``running``, ``done``, ``failed`` or ``cancelled``.
        text: How it ended, or what is done.
    """

    number: int
    robot: OwnRobot
    kind: str
    client: RobotClient
    state: str = "running"
    text: str = ""

    def describe(self) -> dict[str, Any]:
        """Return the message ``task``."""
        return {
            "op": "task",
            "id": self.number,
            "robot": self.robot.name,
            "kind": self.kind,
            "state": self.state,
            "text": self.text,
        }


class TaskBoard:
    """The tasks that run, of which a robot has at most one.

    Attributes:
        running: Tasks by their numbers.
    """

    def __init__(self, tell: Callable[[dict[str, Any]], None]) -> None:
        """Create an empty board; to be called in the event loop.

        Args:
            tell: Called with messages, in the event loop.
        """
        self.running: dict[int, Task] = {}
        self._tell = tell
        self._threads: set[int] = set()  # also of cancelled tasks, until they notice
        self._loop = asyncio.get_running_loop()
        self._count = 0

    def find(self, robot: str) -> Task | None:
        """Return the task that a robot is at, if any."""
        tasks = (task for task in self.running.values() if task.robot.name == robot)
        return next(tasks, None)

    def begin(self, robot: OwnRobot, kind: str, work: Work) -> None:
        """Begin a task, instead of the one that the robot is at.

        Raises:
            BadRequest: If there are too many tasks.
        """
        self.cancel_of(robot.name)
        if len(self._threads) >= MOST_TASKS:
            raise BadRequest(f"{MOST_TASKS} tasks are running, expected no more")
        self._count += 1
        task = Task(self._count, robot, kind, RobotClient(robot))
        self.running[task.number] = task
        self._threads.add(task.number)
        self._tell(task.describe())
        threading.Thread(target=self._run, args=(task, work), daemon=True).start()

    def cancel(self, number: int) -> None:
        """Cancel a task; one that has ended stays as it is."""
        task = self.running.pop(number, None)
        if task is not None:
            task.client.cancel()
            task.robot.set_wheels(0.0, 0.0)
            task.state = "cancelled"
            self._tell(task.describe())

    def cancel_of(self, robot: str) -> None:
        """Cancel the task of a robot, if it has one."""
        task = self.find(robot)
        if task is not None:
            self.cancel(task.number)

    def tell_threadsafe(self, message: dict[str, Any]) -> None:
        """Tell a message from any thread."""
        self._call(self._tell, message)

    def _run(self, task: Task, work: Work) -> None:
        """Do the work, in its thread."""
        state, text = "failed", "an error of the program"
        try:
            text = work.run(task.client, self.tell_threadsafe)
            state = "done"
        except (RadarsimError, WorkFailed) as error:
            text = str(error)
        except Exception:
            log.exception("the %s of %s failed", task.kind, task.robot.name)
        self._call(self._end, task, state, text)

    def _end(self, task: Task, state: str, text: str) -> None:
        self._threads.discard(task.number)
        if self.running.pop(task.number, None) is None:
            return  # it was cancelled
        task.client.cancel()
        task.state, task.text = state, text
        self._tell(task.describe())

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(function, *arguments)
