"""What goes on with robots beside driving: tasks, and the maps that are made.

The modules that do it take seconds to import, and what they have compiled to load, so
``import_algorithms`` and ``load_algorithms`` do that beside all else; who asks earlier
waits for it.
"""

import importlib
from collections.abc import Callable, Iterator, Set
from typing import TYPE_CHECKING, Any, Final

from radarsim.addons.web.requests import (
    BadRequest,
    Cancel,
    Colours,
    Explore,
    Goto,
    Map,
)
from radarsim.addons.web.roster import Roster
from radarsim.addons.web.tasks import TaskBoard, Work
from radarsim.addons.web.viewer import encode_json

if TYPE_CHECKING:
    from radarsim.addons.web.map_maker import MapMaker

MOST_MAPS: Final = 10  # that are made at a time
DEFAULT_COLOURS: Final[Colours] = "usarcommander"

Broadcast = Callable[[str, object], None]


def import_algorithms() -> None:
    """Import what tasks and maps are made with."""
    importlib.import_module("radarsim.addons.web.map_maker")
    importlib.import_module("radarsim.addons.web.tasks")


def load_algorithms() -> None:
    """Load or compile what tasks and maps are made with."""
    importlib.import_module("radarsim.autonomy.exploration.compilation").warm_up()


class Activities:
    """Tasks and maps of robots, and the newest messages about them.

    Attributes:
        on_mapped: Called when other robots than before are mapped.
        bounds: Extent of the map, west, south, east and north, m; None if it is not
            known.
        safety_distance: Distance that robots keep on the way to a goal, m; None for the
            least one that suits them.
    """

    def __init__(self, roster: Roster, broadcast: Broadcast) -> None:
        """Create it without any; to be called in the event loop.

        Args:
            roster: The robots.
            broadcast: Called with a message to all browsers, and its subject.
        """
        self.bounds: tuple[float, float, float, float] | None = None
        self.safety_distance: float | None = None
        self.on_mapped: Callable[[], None] = lambda: None
        self._roster = roster
        self._broadcast = broadcast
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
        from radarsim.addons.web.tasks import GoingTo  # noqa: PLC0415

        self._check_goal(request.goal)
        self._begin("goto", request.robot, GoingTo(request, self.safety_distance))

    def explore(self, request: Explore) -> None:
        """Explore, and show the map that is made for that.

        Raises:
            BadRequest: If that is not possible.
        """
        from radarsim.addons.web.tasks import Exploring  # noqa: PLC0415

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
        self._roster.find(name)
        self._colours[name] = request.colours
        if not request.on:
            self._stop_map(name)
            self._tell({"op": "map", "robot": name, "png": None})
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

    def _check_goal(self, goal: tuple[float, float]) -> None:
        if self.bounds is None:
            return
        west, south, east, north = self.bounds
        (x, y) = goal
        if not (west <= x <= east and south <= y <= north):
            raise BadRequest(
                f"goal ({x:g}, {y:g}) is outside of the map, expected x from {west:g}"
                f" to {east:g} m and y from {south:g} to {north:g} m"
            )

    def _begin(self, kind: str, robot: str, work: Work) -> None:
        own = self._roster.find_own(robot)
        if own.hindrance is not None:
            raise BadRequest(f"{robot!r} cannot go by itself: {own.hindrance}")
        self._tasks.begin(own, kind, work)

    def _make_map(self, request: Map) -> None:
        from radarsim.addons.web.map_maker import (  # noqa: PLC0415
            MapMaker,
            choose_scanner,
        )

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
        if op == "task":  # frames say who drives
            self._roster.on_change()
        text = encode_json(message)
        if robot in self._roster.views:
            self._newest[op, robot] = text
        self._broadcast(text, (op, robot, message.get("id")))
