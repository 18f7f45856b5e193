"""A scan of a robot of a local simulation, and the places that it saw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from radarsim.client.robot_info import no_return
from radarsim.errors import expected_one_of
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import RadarTargets, RangeScan, TargetEchoes

Frame: TypeAlias = Literal["scanner", "robot", "map", "ins", "odometry"]

CENTRE: Final = Pose2(0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class LocalScan(RangeScan):
    """A scan as clients read it, and where it was taken.

    Attributes:
        medium: ``radar`` or ``laser``.
        max_range: Range of a beam without return, m.
        mount: Pose of the scanner on the robot.
        poses: Poses of the robot when it scanned, by the frame that they are in.
        echoes: What its beams met, an entry for each object; None if the robot was not
            asked for echoes.
        targets: What its detector found; None for a scanner without a detector, or if
            the robot was not asked for targets.
    """

    medium: str
    max_range: float
    mount: Pose2
    poses: Mapping[str, Pose2]
    echoes: Sequence[TargetEchoes] | None
    targets: Sequence[RadarTargets] | None

    def points(self, frame: Frame = "robot") -> Floats:
        """Return where something came back, (N, 2) m, from right to left.

        Args:
            frame: ``scanner``, ``robot``, or ``map`` by the true pose of the robot;
                ``ins`` and ``odometry`` by the pose that these sensors last reported,
                in the map and relative to the spawn pose.

        Raises:
            ValueError: If there is no such frame, or the robot has no such sensor.
        """
        if frame == "scanner":
            pose = CENTRE
        elif frame in self.poses:
            pose = self.poses[frame].compose(self.mount)
        else:
            known = ["scanner", *self.poses]
            raise ValueError(f"frame {expected_one_of(frame, known)}")
        returned = self.ranges < no_return(self.max_range)
        angles, ranges = self.angles[returned] + pose.yaw, self.ranges[returned]
        ahead, aside = ranges * np.cos(angles), ranges * np.sin(angles)
        return np.column_stack([pose.x + ahead, pose.y + aside])
