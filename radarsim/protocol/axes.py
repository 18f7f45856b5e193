"""The axes of the wire: x forward, y right, z down, yaw clockwise from above.

They are the simulation's, turned half way about x. The turn is its own inverse, and
it takes roll, pitch and yaw the way it takes x, y and z: the first stays, the others
change their sign.
"""

from collections.abc import Sequence

from radarsim.geometry import Pose3

Triple = tuple[float, float, float]


def turn_over(triple: Triple) -> Triple:
    """Take a position or roll, pitch, yaw from one frame to the other; never -0.0.

    >>> turn_over((1.0, 2.0, 0.0))
    (1.0, -2.0, 0.0)
    """
    first, second, third = triple
    return (first, 0.0 - second, 0.0 - third)


def position_on_wire(pose: Pose3) -> Triple:
    """Give x, y, z of a pose in the frame of the wire, m."""
    return turn_over((pose.x, pose.y, pose.z))


def angles_on_wire(pose: Pose3) -> Triple:
    """Give roll, pitch, yaw of a pose in the frame of the wire, rad."""
    return turn_over((pose.roll, pose.pitch, pose.yaw))


def pose_from_wire(numbers: Sequence[float]) -> Pose3:
    """Make a pose of x, y, z, roll, pitch, yaw in the frame of the wire."""
    x, y, z, roll, pitch, yaw = numbers
    return Pose3(*turn_over((x, y, z)), *turn_over((roll, pitch, yaw)))
