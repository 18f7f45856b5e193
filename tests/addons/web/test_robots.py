from types import SimpleNamespace
from typing import Any

from radarsim.addons.web.robots import Robots
from radarsim.addons.web.viewers import Viewers
from radarsim.protocol.reports import RobotJoined, RobotLeft
from radarsim.simulation.config import SimulationConfig


async def test_robot_of_the_commander_stays_when_another_of_its_name_leaves() -> None:
    left: list[str] = []
    address, viewers = ("127.0.0.1", 1), Viewers(lambda _: b"")
    robots = Robots(address, SimulationConfig(), viewers, lambda: None)
    robots.on_left = left.append
    robots.watch([RobotJoined("R1", "P3AT"), RobotJoined("R2", "P3AT")])
    own: Any = SimpleNamespace(name="R1")
    robots.own["R1"] = own
    robots.watch([RobotLeft("R1"), RobotLeft("R2"), RobotLeft("R3")])
    assert [*robots.views] == ["R1"]
    assert left == ["R2"]
