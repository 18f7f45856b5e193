"""Two robots follow walls in a loop of one's own, one by radar. No server is needed.

python examples/follow_walls.py
"""

import math
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from numpy.typing import NDArray

import radarsim
from radarsim.protocol.reports import Touch

DISTANCE = 0.9  # m from the wall on the left
SPEED = 0.3  # m/s
PERIOD = 0.1  # s


class WallFollower:
    """Keeps a wall on the left of a robot."""

    def __init__(self, robot: radarsim.LocalRobot) -> None:
        self.robot = robot
        self.touches = 0

    def nearest(self, points: NDArray[np.float64], low: float, high: float) -> float:
        """Return the distance of the nearest point between two bearings, rad."""
        bearings = np.arctan2(points[:, 1], points[:, 0])
        chosen = points[(bearings > low) & (bearings < high)]
        return float(np.hypot(*chosen.T).min(initial=5.0))

    def step(self) -> None:
        """Decide by the newest scan how to drive."""
        points = self.robot.scan("lms200").points("robot")
        ahead = self.nearest(points, -0.4, 0.4)
        left = self.nearest(points, 0.6, math.pi / 2)
        if ahead < 1.2:
            self.robot.drive(0.0, turn=-0.6)
        else:
            error = max(-0.5, min(0.5, left - DISTANCE))
            self.robot.drive(SPEED, turn=0.8 * error)
        touches = [each for each in self.robot.reports if isinstance(each, Touch)]
        self.touches += any(each.touched for each in touches)

    def drift(self) -> float:
        """Return how far the INS is off, m."""
        true, believed = self.robot.truth.pose, self.robot.ins.pose
        return math.hypot(true.x - believed.x, true.y - believed.y)


with radarsim.simulate("foliage_room", seed=1) as sim:
    radar = sim.spawn("P3AT", name="radar", start="RobotStart1")
    laser = sim.spawn("P3AT_SICK", name="laser", start="RobotStart3")
    followers = [WallFollower(radar), WallFollower(laser)]
    sim.step(PERIOD)
    while sim.time < 20:
        for follower in followers:
            follower.step()
        sim.step(PERIOD)
    for each in followers:
        print(f"{each.robot.name}: {each.drift():.2f} m off, {each.touches} touches")
    picture = Path(mkdtemp()) / "walls.png"
    sim.render(picture)
    print(f"wrote {picture}")
