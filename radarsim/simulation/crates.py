"""The crates of a simulation, which come from the map or from clients.

A crate is a member of the fleet that does not move: an upright box that robots collide
with and all sensors see.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from radarsim.geometry import Pose2
from radarsim.presets.robots import RobotModel
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles, overlaps
from radarsim.robots.robot import Robot
from radarsim.scene.scene import MOST_CRATES, Crate, Scene

CRATE: Final = "WCCrate"  # class of crates on the wire


@dataclass(frozen=True, slots=True)
class PlacedCrate:
    """A crate in the simulation.

    Attributes:
        crate: Pose and size of the crate.
        body: Body of the crate in the fleet.
        falls: Whether the crate is always placed on the floor.
        owner: Number of the client that owns the crate; None if the crate is permanent.
    """

    crate: Crate
    body: Robot
    falls: bool = False
    owner: int | None = None


class Crates:
    """All crates of a simulation."""

    def __init__(self, scene: Scene, fleet: Fleet) -> None:
        """Place the crates that a scene contains."""
        self._scene, self._fleet = scene, fleet
        self._nothing = Obstacles()
        self._placed: dict[str, PlacedCrate] = {}
        for crate in scene.crates:
            self._keep(PlacedCrate(crate, self._add_body(crate)))

    def __iter__(self) -> Iterator[PlacedCrate]:
        """Iterate over the crates, in the order of their creation."""
        return iter(tuple(self._placed.values()))

    def __len__(self) -> int:
        return len(self._placed)

    @property
    def is_full(self) -> bool:
        """Whether the simulation has the maximum number of crates."""
        return len(self._placed) >= MOST_CRATES

    def find(self, name: str) -> PlacedCrate | None:
        """Return the crate with a name, ignoring case; None if there is none."""
        return self._placed.get(name.casefold())

    def create(self, crate: Crate, *, falls: bool, owner: int | None) -> list[str]:
        """Add a crate with an unused name, unless it would overlap a robot or a crate.

        Args:
            crate: The crate.
            falls: Whether the crate is always placed on the floor.
            owner: As in ``PlacedCrate``.

        Returns:
            Names of robots and crates in the way; the crate is added if there are none.
        """
        crate = self._landed(crate) if falls else crate
        in_way = self._in_way(crate)
        if not in_way:
            self._keep(PlacedCrate(crate, self._add_body(crate), falls, owner))
        return in_way

    def move(self, placed: PlacedCrate, crate: Crate) -> list[str]:
        """Move a crate, unless it would overlap a robot or a crate; see ``create``."""
        crate = self._landed(crate) if placed.falls else crate
        in_way = self._in_way(crate, placed.body)
        if not in_way:
            # A moved crate gets a new body without velocity, since it did not drive.
            self._fleet.remove(placed.body)
            self._keep(replace(placed, crate=crate, body=self._add_body(crate)))
        return in_way

    def remove(self, placed: PlacedCrate) -> None:
        """Remove a crate from the simulation."""
        self._fleet.remove(placed.body)
        del self._placed[placed.crate.name.casefold()]

    def remove_owned(self, owner: int) -> None:
        """Remove all crates that belong to a client."""
        for placed in self:
            if placed.owner == owner:
                self.remove(placed)

    def _keep(self, placed: PlacedCrate) -> None:
        self._placed[placed.crate.name.casefold()] = placed

    def _landed(self, crate: Crate) -> Crate:
        x, y, _ = crate.position
        z = self._scene.floor_at(x, y) + crate.size[2] / 2
        return replace(crate, position=(x, y, z))

    def _in_way(self, crate: Crate, own: Robot | None = None) -> list[str]:
        """Return the names of robots and crates that a crate would overlap."""
        length, width, height = crate.size
        x, y, z = crate.position
        footprint = Footprint(length, width)
        return [
            each.name
            for each in self._fleet.near(x, y, footprint.radius)
            if each is not own
            and each.row["bottom"] < z + height / 2
            and each.row["top"] > z - height / 2
            and overlaps(footprint, Pose2(x, y, crate.yaw), each)
        ]

    def _add_body(self, crate: Crate) -> Robot:
        length, width, height = crate.size
        x, y, z = crate.position
        model = RobotModel(
            name=CRATE,
            length=length,
            width=width,
            height=height,
            origin_height=height / 2,
            wheel_radius=1.0,
            wheel_separation=1.0,
            wheel_base=1.0,
            track=1.0,
            wheels=("right", "left"),
            mass=1.0,
            max_torque=1.0,
        )
        body = self._fleet.add(
            crate.name,
            model,
            Pose2(x, y, crate.yaw),
            obstacles=self._nothing,
            wheel_drive=WheelDrive(0.0),
        )
        self._fleet.lift(body, z, self._nothing)
        return body
