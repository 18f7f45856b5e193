"""Records the revolutions of a radar that moves along a path."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation as Orientation
from scipy.spatial.transform import Slerp

from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.rotation import Rotation, join_sectors
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.geometry import Floats, Pose3
from radarsim.scene.scene import Scene

STEPS_IN_TURN = 25  # steps of constant speed in a revolution


@dataclass(frozen=True, eq=False)
class DrivenPath:
    """The path of a radar: N poses, between which it moves at constant speed.

    Attributes:
        times: Increasing times, (N,) s.
        positions: Positions, (N, 3) m, map frame.
        orientations: Unit quaternions x, y, z, w, (N, 4).
    """

    times: Floats
    positions: Floats
    orientations: Floats

    @property
    def duration(self) -> float:
        """Time from the first to the last pose of the path, s."""
        return float(self.times[-1] - self.times[0])

    def poses_at(self, times: Floats) -> list[Pose3]:
        """Return the radar's poses at times, s, clipped to the times of the path."""
        # Times are clipped, since Slerp raises an error for times outside of the path.
        inside = np.clip(times, self.times[0], self.times[-1])
        turns = Slerp(self.times, Orientation.from_quat(self.orientations))(inside)
        angles = turns.as_euler("ZYX")
        places = [np.interp(inside, self.times, column) for column in self.positions.T]
        return [
            Pose3(*map(float, (*place, roll, pitch, yaw)))
            for place, (yaw, pitch, roll) in zip(
                zip(*places, strict=True), angles, strict=True
            )
        ]


def read_tum(text: str) -> DrivenPath:
    """Read a path in the TUM trajectory format.

    A line is ``time x y z qx qy qz qw`` in s and m; comments begin with #.

    Raises:
        ValueError: If a line is not such a pose, times do not increase, or there are
            fewer than two poses.
    """
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 8 or not np.isfinite(row).all() or not any(row[4:]):
            raise ValueError(
                f"line {number}: {line.strip()[:80]!r}, expected time x y z qx qy qz qw"
            )
        if rows and row[0] <= rows[-1][0]:
            raise ValueError(
                f"line {number}: time {row[0]:g}, expected above {rows[-1][0]:g}"
            )
        rows.append(row)
    if len(rows) < 2:
        raise ValueError(f"{len(rows)} poses, expected at least 2")
    numbers = np.array(rows)
    return DrivenPath(numbers[:, 0], numbers[:, 1:4], numbers[:, 4:])


def tum_line(time: float, pose: Pose3) -> str:
    """Return a pose at a time, s, as a line in the TUM trajectory format."""
    turned = Orientation.from_euler("ZYX", [pose.yaw, pose.pitch, pose.roll])
    numbers = [pose.x, pose.y, pose.z, *turned.as_quat()]
    return " ".join(f"{each:.6f}" for each in (time, *numbers)) + "\n"


def turns_along(
    radar: FmcwRadar, scene: Scene, path: DrivenPath, rng: np.random.Generator
) -> Iterator[tuple[float, Spectrum]]:
    """Yield all revolutions that fit into the time of the path, with start times, s.

    The pose of a revolution is the pose in its middle. Before the path begins, the
    radar stays at the first pose for a revolution.

    Args:
        radar: The radar.
        scene: The map.
        path: Path of the antenna, map frame.
        rng: Source of speckle and noise.
    """
    settings = radar.settings
    rotation = Rotation(radar, scene, rng)
    (start,) = path.poses_at(path.times[:1])
    # Sidelobes need the previous revolution, so the first revolution gives no data.
    sectors = rotation.advance(start, settings.azimuths)
    step = max(settings.azimuths // STEPS_IN_TURN, 1)
    period = settings.azimuths * settings.sweep_time
    looked, done = 0, 0
    # The tolerance keeps rounding errors from removing the path's last revolution.
    count = int(path.duration / period + 1e-9)
    while done < count:
        seconds = step * settings.sweep_time
        time = path.times[0] + looked * settings.sweep_time
        pose, after = path.poses_at(np.array([time, time + seconds]))
        dx, dy, dz = ((after.position() - pose.position()) / seconds).tolist()
        sectors += rotation.advance(after, step, start=pose, velocity=(dx, dy, dz))
        looked += step
        # A revolution is complete some azimuths after its last azimuth, when the next
        # revolution has already begun.
        if any(each.turn == done and each.ends_turn for each in sectors):
            began = float(path.times[0] + done * period)
            (middle,) = path.poses_at(np.array([began + period / 2]))
            whole = join_sectors(each for each in sectors if each.turn == done)
            yield began, replace(whole, pose=middle, scene=scene)
            sectors = [each for each in sectors if each.turn > done]
            done += 1
