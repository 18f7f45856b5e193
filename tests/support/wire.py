"""A client of a host without sockets, for dialogues in bytes."""

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import RobotModel
from radarsim.protocol.dialect import COMPAT, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig


class Wire:
    """A client of a host, and all that it was sent."""

    def __init__(
        self, scene: Scene, dialect: Dialect = COMPAT, *robots: RobotModel
    ) -> None:
        self.host = Host(scene, config=SimulationConfig(dialect, robots=robots))
        self.number = self.host.connect()
        self.news: list[str] = []
        self.host.take(self.number)  # the greeting

    def send(self, *lines: str) -> list[str]:
        """Send lines, let a tick pass, and return what came but readings and status."""
        data = "".join([f"{line}\r\n" for line in lines]).encode("ascii")
        diagnostics = self.host.receive(self.number, data)
        self.news += [each.text for each in diagnostics]
        return [x for x in self.wait(0.01) if not x.startswith(("STA", "SEN"))]

    def wait(self, seconds: float) -> list[str]:
        """Let time pass, and return the lines that came."""
        for _ in range(round(100 * seconds)):
            self.news += [each.text for _, each in self.host.step()]
        return self.host.take(self.number).decode("ascii").splitlines()

    @property
    def pose(self) -> Pose2:
        """The pose of the robot."""
        (vehicle,) = self.host.simulation.vehicles
        return vehicle.robot.pose

    @property
    def body(self) -> Pose3:
        """The pose of the body of the robot."""
        (vehicle,) = self.host.simulation.vehicles
        return vehicle.robot.body
