"""The scan of a radar or a laser."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import radarsim
from radarsim.errors import import_optional
from radarsim.geometry import Floats, Pose3
from radarsim.raycast.aimed_rays import Sides
from radarsim.raycast.rays import Rays
from radarsim.scene.scene import Scene
from radarsim.sensors.echoes import Echoes

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


class Targets(NamedTuple):
    """Targets of one turn, beam by beam from the right, the nearest first; T of them.

    Attributes:
        beams: (T,) int64, number of the beam.
        ranges: (T,) m.
        dbm: (T,) received power, dBm.
    """

    beams: NDArray[np.int64]
    ranges: Floats
    dbm: Floats


# Not frozen: Python would take three times as long to set the attributes.
@dataclass(slots=True, eq=False, repr=False)
class Scan:
    """One scan of a radar or a laser.

    Attributes:
        sensor: Name of the preset.
        pose: Pose of the sensor, map frame.
        angles: (N,) directions of the beams from the sensor's forward axis, rad,
            counter-clockwise.
        ranges: (N,) m; inf where nothing was detected, 0 where a laser is blinded.
        rays: (N,) ray of its beam that gave each range: -1 right, 0 centre, 1 left;
            None for a sensor without side rays.
        range_min: Minimum range of the sensor, m; shorter ranges are not removed.
        range_max: Maximum range of the sensor, m.
        resolution: Angle between neighbouring beams, rad.
        find_cast: Computes ``cast`` on demand.
        find_echoes: Computes ``echoes`` on demand.
        scene: The map; None for a scan of a simulation with its robots.
        targets: What its detector found; None for a sensor without one.
    """

    sensor: str
    pose: Pose3
    angles: Floats
    ranges: Floats
    rays: Sides | None
    range_min: float
    range_max: float
    resolution: float
    find_cast: Callable[[], Rays]
    find_echoes: Callable[[], Echoes]
    scene: Scene | None = None
    targets: Targets | None = None

    def __repr__(self) -> str:
        read = sum(map(math.isfinite, self.ranges.tolist()))
        return (
            f"<Scan {self.sensor}: {read} of {len(self.ranges)} beams return,"
            f" from x {self.pose.x:.2f} m, y {self.pose.y:.2f} m,"
            f" yaw {math.degrees(self.pose.yaw):.0f}°>"
        )

    def _repr_html_(self) -> str | None:
        """Return the picture as SVG, for notebooks; None without a map."""
        if self.scene is None:
            return None
        return radarsim.as_svg(self.plot())

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw rays, echoes and readings over the plan of the map.

        Rays that see through something are the boldest lines.

        Args:
            ax: Axes of matplotlib, in m; None for a figure of its own, with a legend.

        Returns:
            The axes; ``scan.plot().figure.savefig("scan.png")`` writes a file.

        Raises:
            ValueError: If the scan is not from ``RangeScanner.scan``.
        """
        if self.scene is None:
            raise ValueError("scan without a map, expected one from RangeScanner.scan")
        return radarsim.plot_scan(self.scene, self, ax)

    @property
    def cast(self) -> Rays:
        """The N rays that gave the ranges; for a beam without range one of its rays."""
        return self.find_cast()

    @property
    def echoes(self) -> Echoes:
        """The echoes that the sensor's ``return_mode`` keeps: one per beam, or all."""
        return self.find_echoes()

    def to_dict(self) -> dict[str, Any]:
        """Return the scan as JSON types; None stands for a range without echo."""
        ranges = [r if math.isfinite(r) else None for r in self.ranges.tolist()]
        return {
            "sensor": self.sensor,
            "pose": list(self.pose.numbers()),
            "angle_min": float(self.angles[0]),
            "angle_increment": self.resolution,
            "range_min": self.range_min,
            "range_max": self.range_max,
            "ranges": ranges,
            "rays": None if self.rays is None else self.rays.tolist(),
            "echoes": self.echoes.to_lists(),
        }

    def to_xarray(self) -> "xarray.Dataset":
        """Return ranges and rays by ``angle``, and the rest as attributes.

        Raises:
            MissingPackage: If xarray is not installed.
        """
        variables: dict[str, Any] = {"ranges": ("angle", self.ranges, {"units": "m"})}
        if self.rays is not None:
            variables["rays"] = ("angle", self.rays)
        dataset: xarray.Dataset = import_optional("xarray", "tables").Dataset(
            variables,
            {"angle": ("angle", self.angles, {"units": "rad"})},
            {
                "sensor": self.sensor,
                "pose": list(self.pose.numbers()),
                "range_min": self.range_min,
                "range_max": self.range_max,
            },
        )
        return dataset
