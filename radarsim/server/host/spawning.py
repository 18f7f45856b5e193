"""Executes INIT: spawns the robots of clients one by one, at free positions.

A search for a free position may take several ticks. The work of all clients' searches
together is limited per tick.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from radarsim.errors import PresetError, expected_one_of, list_names
from radarsim.geometry import Pose2
from radarsim.protocol.commands import CONTROLLER
from radarsim.server.host.connection import Client, Diagnostic, join_diagnostics

if TYPE_CHECKING:
    from collections.abc import Generator

    from radarsim.presets.robots import RobotModel
    from radarsim.protocol.commands import Init
    from radarsim.server.host.watchers import Watchers
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

MAX_NAME_LENGTH: Final = 64  # characters of a robot's name; longer names are cut
# Number of ticks between two spawns of one client, as the search for a position takes
# time.
SPAWN_COOLDOWN: Final = 10
FAILED_SPAWN_COOLDOWN: Final = 100  # ticks after a spawn without a free position
SPAWNS_PER_TICK: Final = 4  # for all clients together
# Number of ticks in which no client can spawn after a search for a free position.
SEARCH_COOLDOWN: Final = 3  # if the requested position was occupied
FAILED_SEARCH_COOLDOWN: Final = 10  # if no position was free
# Limit of the work of all searches in a tick, about 2 ms, in the unit of
# ``Obstacles.search_free_pose``.
SEARCH_WORK: Final = 400_000
START_WORK: Final = 60_000  # work to check whether a start is free


class Spawner:
    """Spawns and removes robots of clients.

    Attributes:
        simulation: The simulation.
        clients_by_robot: The client of each robot, by the robot's number.
        queue: Numbers of the clients with a waiting INIT, first in, first out. The
            first client stays in the queue until the search for its position ends.
    """

    def __init__(self, simulation: Simulation, watchers: Watchers) -> None:
        self.simulation = simulation
        self.clients_by_robot: dict[int, Client] = {}
        self.queue: dict[int, None] = {}
        self._watchers = watchers
        self._last_spawn = -1  # the last tick with a spawn
        self._spawn_count = 0  # number of spawns in that tick
        self._next_spawn = 0  # the first tick in which a spawn is allowed
        self._search_work = SEARCH_WORK  # remaining work in this tick
        names = simulation.config.robot_names()
        self._classes = {name.casefold(): name for name in names}

    def begin_tick(self) -> None:
        """Renew the work for searches, reduced by the excess work of the last tick."""
        self._search_work = min(self._search_work, 0) + SEARCH_WORK

    def is_too_early(self, client: Client) -> bool:
        """Return whether the INIT of a client has to wait for a later tick."""
        # Sensor intervals start at the spawn. If too many robots spawned in one tick,
        # all their scans would always fall into the same ticks.
        if client.spawning is not None:
            return False
        now = self.simulation.ticks
        if now < client.next_spawn:
            return True
        # Clients spawn in the order of their INITs, so that a client that sends many
        # INITs cannot delay the others forever.
        self.queue.setdefault(client.number)
        is_first = next(iter(self.queue)) == client.number
        full = self._last_spawn == now and self._spawn_count >= SPAWNS_PER_TICK
        return full or now < self._next_spawn or not is_first

    def spawn(self, client: Client, command: Init) -> tuple[bool, Diagnostic | None]:
        """Begin or continue to spawn a robot.

        Returns:
            Whether the spawn has ended, and a diagnostic if it failed or had another
            effect than requested.
        """
        if client.spawning is None:
            client.spawning = self._spawn(client, command)
        elif self._search_work <= 0:
            return False, None
        try:
            while True:
                self._search_work -= next(client.spawning)
                if self._search_work <= 0:
                    return False, None
        except StopIteration as end:
            client.spawning = None
            del self.queue[client.number]
            diagnostic: Diagnostic | None = end.value
            return True, diagnostic

    def remove(self, client: Client) -> None:
        """Cancel the waiting INIT of a client, and remove its robot if it has one."""
        self.queue.pop(client.number, None)
        client.spawning = None
        self._despawn(client)

    def _despawn(self, client: Client) -> None:
        if client.controls:
            self.simulation.crates.remove_owned(client.number)
            client.controls = False
        if client.vehicle is not None:
            self.simulation.remove(client.vehicle)
            self._watchers.remove_robot(client.vehicle)
            del self.clients_by_robot[client.vehicle.number]
            client.vehicle = None

    def _spawn(
        self, client: Client, command: Init
    ) -> Generator[int, None, Diagnostic | None]:
        """Spawn a robot, which replaces the client's previous robot.

        Yields:
            The work of the next step of the search for a free position.
        """
        if command.class_name.casefold() == CONTROLLER.casefold():
            self._despawn(client)
            client.controls = True
            return None
        # Names are mapped to one spelling, because presets are cached by spelling.
        class_name = self._classes.get(command.class_name.casefold())
        config = self.simulation.config
        try:
            model = config.robot(class_name or command.class_name)
            config.check_scanners(model)
        except PresetError as error:
            return Diagnostic("class", str(error))
        now = self.simulation.ticks
        self._spawn_count = self._spawn_count + 1 if self._last_spawn == now else 1
        self._last_spawn = now
        client.next_spawn = now + SPAWN_COOLDOWN
        # The old robot is removed first, so that it does not occupy the new position.
        self._despawn(client)
        requested, diagnostic = yield from self._requested_pose(command, model)
        z = -math.inf if command.position is None else command.position[2]
        name = (command.name or model.name)[:MAX_NAME_LENGTH]
        vehicle = client.vehicle = yield from self.simulation.spawn_stepwise(
            name, model, requested, z
        )
        now = self.simulation.ticks
        if vehicle is None:
            client.next_spawn = now + FAILED_SPAWN_COOLDOWN
            self._next_spawn = now + FAILED_SEARCH_COOLDOWN
            in_way = self.simulation.obstacles_at(model, requested)
            where = f" in {list_names(in_way)}" if in_way else ""
            text = f"INIT at {_place(requested)}{where}, expected a free place"
            text += " within 1 m, or another start"
            return join_diagnostics(diagnostic, Diagnostic("no place", text))
        vehicle.address = client.address
        self.clients_by_robot[vehicle.number] = client
        self._watchers.add_robot(vehicle)
        moved = self._describe_place(vehicle, requested)
        if moved is not None and moved.kind == "moved":
            self._next_spawn = now + SEARCH_COOLDOWN
        return join_diagnostics(diagnostic, moved)

    def _describe_place(self, vehicle: Vehicle, requested: Pose2) -> Diagnostic | None:
        """Return a diagnostic if the pose was moved or is outside the map."""
        pose, scene = vehicle.robot.pose, self.simulation.scene
        if (pose.x, pose.y) != (requested.x, requested.y):
            moved = f"from {_place(requested)} to {_place(pose)}"
            text = f"INIT: robot moved {moved}, the nearest free place"
            return Diagnostic("moved", text)
        (x_min, y_min), (x_max, y_max) = scene.bounds[:, :2].tolist()
        is_inside = x_min <= pose.x <= x_max and y_min <= pose.y <= y_max
        if is_inside or not scene.triangles:
            return None
        text = f"INIT at {_place(requested)}, which is outside the map:"
        text += f" x from {x_min:.2f} to {x_max:.2f} m, y from {y_min:.2f} to"
        return Diagnostic("outside", f"{text} {y_max:.2f} m")

    def _requested_pose(
        self, command: Init, model: RobotModel
    ) -> Generator[int, None, tuple[Pose2, Diagnostic | None]]:
        """Return the requested pose; the origin for an unknown start.

        Yields:
            The work to check the next start.
        """
        scene = self.simulation.scene
        if command.takes_free:
            for each in scene.starts:
                pose = Pose2(each.pose.x, each.pose.y, each.pose.yaw)
                if not self.simulation.obstacles_at(model, pose):
                    return pose, None
                yield START_WORK
        if command.start is None:
            x, y, _ = command.position or (0.0, 0.0, 0.0)
            _, _, yaw = command.rotation or (0.0, 0.0, 0.0)
            return Pose2(x, y, yaw), None
        start = scene.start(command.start)
        if start is not None:
            return Pose2(start.pose.x, start.pose.y, start.pose.yaw), None
        names = [start.name for start in scene.starts]
        text = f"start {expected_one_of(command.start, names)}; the origin is used"
        return Pose2(0.0, 0.0), Diagnostic("start", text)


def _place(pose: Pose2) -> str:
    return f"({pose.x:.2f}, {pose.y:.2f})"
