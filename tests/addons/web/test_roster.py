from types import SimpleNamespace
from typing import Any

from radarsim.addons.web.roster import Roster
from radarsim.protocol.reports import RobotJoined, RobotLeft
from radarsim.simulation.config import SimulationConfig


def test_robot_of_the_commander_stays_when_another_of_its_name_leaves() -> None:
    roster = Roster(("127.0.0.1", 1), SimulationConfig())
    roster.watch([RobotJoined("R1", "P3AT"), RobotJoined("R2", "P3AT")])
    own: Any = SimpleNamespace(name="R1")
    roster.own["R1"] = own
    roster.watch([RobotLeft("R1"), RobotLeft("R2"), RobotLeft("R3")])
    assert [*roster.views] == ["R1"]
