"""What goes on with robots beside driving: tasks, and the maps that are made."""

from collections.abc import Callable, Iterator, Set
from typing import Any, Final

from radarsim.commander.map_maker import MapMaker, choose_scanner
from radarsim.commander.map_picture import Colours, describe_no_map
from radarsim.commander.requests import BadRequest, Cancel, Explore, Goto, Map
from radarsim.commander.roster import Roster
from radarsim.commander.task_board import TaskBoard
from radarsim.commander.viewer import encode_json
from radarsim.commander.work import Exploring, GoingTo, Work

MOST_MAPS: Final = 10  # that are made at a time
DEFAULT_COLOURS: Final[Colours] = "usarcommander"

Broadcast = Callable[[str, object], None]


class Activities:
    """Tasks and maps of robots, and the newest messages about them.

    Attributes:
        on_mapped: Called when other robots than before are mapped.
    """

    def __init__(
        self, roster: Roster, broadcast: Broadcast, safety_distance: float | None
    ) -> None:
        """Create it without any; to be called in the event loop.

        Args:
            roster: The robots.
            broadcast: Called with a message to all browsers, and its subject.
            safety_distance: Distance that robots keep on the way to a goal, m; None
                for the least one that suits them.
        """
        self.on_mapped: Callable[[], None] = lambda: None
        self._roster = roster
        self._broadcast = broadcast
        self._safety_distance = safety_distance
        self._tasks = TaskBoard(self._tell)
        self._makers: dict[str, MapMaker] = {}
        self._colours: dict[str, Colours] = {}
        self._newest: dict[tuple[str, str], str] = {}  # by op and robot

    @property
    def mapped(self) -> Set[str]:
        """Names of the robots that are mapped."""
        return self._makers.keys()

    def messages(self) -> Iterator[str]:
        """Yield what a new browser has to know, as JSON."""
        yield from self._newest.values()

    def is_at_work(self, robot: str) -> bool:
        """Return whether a robot is at a task."""
        return self._tasks.find(robot) is not None

    def go(self, request: Goto) -> None:
        """Drive to a goal.

        Raises:
            BadRequest: If that is not possible.
        """
        self._begin("goto", request.robot, GoingTo(request, self._safety_distance))

    def explore(self, request: Explore) -> None:
        """Explore, and show the map that is made for that.

        Raises:
            BadRequest: If that is not possible.
        """
        name = request.robot
        work = Exploring(request, self._colours.get(name, DEFAULT_COLOURS))
        self._begin("explore", name, work)
        self._stop_map(name)  # the explorer's own is shown

    def cancel(self, request: Cancel) -> None:
        """Cancel a task."""
        self._tasks.cancel(request.task)

    def stop(self, robot: str | None) -> None:
        """Cancel the task of a robot; None for those of all robots."""
        for name in [*self._roster.own] if robot is None else [robot]:
            self._tasks.cancel_of(name)

    def switch_map(self, request: Map) -> None:
        """Make a map of a robot, or no more, or in other colours.

        Raises:
            BadRequest: If that is not possible.
        """
        name = request.robot
        self._colours[name] = request.colours
        if not request.on:
            self._stop_map(name)
            self._tell(describe_no_map(name))
        elif name in self._makers:
            self._makers[name].colours = request.colours
        else:
            self._make_map(request)

    def forget(self, robot: str) -> None:
        """End what goes on with a robot that is gone."""
        self._tasks.cancel_of(robot)
        self._stop_map(robot)
        self._colours.pop(robot, None)
        for key in [key for key in self._newest if key[1] == robot]:
            del self._newest[key]

    def close(self) -> None:
        """End everything."""
        for robot in {*self._makers, *self._roster.own}:
            self.forget(robot)

    def _begin(self, kind: str, robot: str, work: Work) -> None:
        self._tasks.begin(self._roster.find_own(robot), kind, work)

    def _make_map(self, request: Map) -> None:
        view = self._roster.find(request.robot)
        if len(self._makers) >= MOST_MAPS:
            raise BadRequest(f"{MOST_MAPS} maps are being made, expected no more")
        self._makers[view.name] = MapMaker(
            view,
            choose_scanner(view, request.scanner),
            request.colours,
            self._tasks.tell_threadsafe,
            has_echoes=self._roster.is_watching,
        )
        self.on_mapped()

    def _stop_map(self, robot: str) -> None:
        maker = self._makers.pop(robot, None)
        if maker is not None:
            maker.stop()
            self.on_mapped()

    def _tell(self, message: dict[str, Any]) -> None:
        """Tell all browsers, and those that come later."""
        op, robot = message["op"], message["robot"]
        if robot not in self._roster.views:
            return
        if op == "task":  # frames say who drives
            self._roster.on_change()
        text = encode_json(message)
        self._newest[op, robot] = text
        self._broadcast(text, (op, robot, message.get("id")))
