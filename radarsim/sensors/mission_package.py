"""Mission packages (arms, flippers, camera mounts): links that rotate on command."""

import math
from typing import Final

import numpy as np

from radarsim.engine import engine
from radarsim.geometry import Pose3
from radarsim.protocol import packages
from radarsim.protocol.packages import LinkOrder, PackageState
from radarsim.sensors.readings import Job
from radarsim.sensors.sensor import EngineSensor, Mounting, Reading

FAR: Final = 1e6  # rad; target angle of a link without limits that has a rate order


class MissionPackage(EngineSensor, types=["MisPkg"]):
    """An arm, flipper or camera mount, which reports the state of its links."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        links = self.item.links
        start = np.zeros(len(links), engine.rows["Link"])
        angles = [link.limit(0.0) for link in links]
        start["from_angle"] = start["to_angle"] = angles
        torques = [-link.max_torque for link in links]
        states = tuple(zip(angles, torques, strict=True))
        jobs = [Job(Reading.LINK_ANGLE, place) for place in self._remember(start)]
        self._report(PackageState(0.0, self.item.name, states), links=jobs)

    def tip(self, ticks: int) -> Pose3:
        """Return the pose of the last link in the body frame.

        Args:
            ticks: Simulated time in ticks.
        """
        pose = self.item.mount
        for number, link in enumerate(self.item.links):
            state = self._memory[number : number + 1]
            angle = engine.angle_of_link(state, ticks)
            pose = pose.compose(link.turned(angle))
        return pose

    def move(self, order: LinkOrder, ticks: int) -> bool:
        """Start to move the link that an order names, if this package has the link.

        Args:
            order: Order for a link.
            ticks: Simulated time in ticks.

        Returns:
            Whether this package has the link.
        """
        name = order.name.casefold()
        is_own = name == self.item.name.casefold()
        for number, link in enumerate(self.item.links):
            is_named = order.link is None and link.name.casefold() == name
            if is_named or (is_own and order.link == number + 1):
                self._turn(number, order, ticks)
                return True
        return False

    def _turn(self, number: int, order: LinkOrder, ticks: int) -> None:
        """Set a link's target angle and speed from an order; ignore unknown orders."""
        link, state = self.item.links[number], self._memory[number : number + 1]
        angle = engine.angle_of_link(state, ticks)
        speed = link.max_speed
        if order.order in (packages.ABSOLUTE, packages.BANG_BANG):
            target = order.value
        elif order.order == packages.RELATIVE:
            target = angle + order.value
        elif order.order == packages.RATE:
            target = math.copysign(FAR, order.value)
            speed = min(abs(order.value), speed)
        else:
            return
        state["from_angle"], state["from_tick"] = angle, ticks
        state["to_angle"], state["speed"] = link.limit(target), speed
