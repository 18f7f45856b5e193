"""What figures 2 to 5 count: readings of radar and laser in clear air and in dust."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from radarsim.figures.scan_spec import ScanSpec, load_scene, object_names
from radarsim.geometry import Floats
from radarsim.plotting.style import scan_points
from radarsim.scene.scene import Part
from radarsim.sensors.scan import Scan

MAP: Final = "marulan_trial"
RADAR: Final = "hss94_marulan"
LASER: Final = "physical"
WHO: Final = {
    RADAR: "the 94 GHz radar of the Marulan data sets",
    LASER: "a laser that loses light in dust",
}
SMOKE_CELL: Final = "cloud"  # the name of the dust in the map
COUNT: Final = 10  # scans
CELL: Final = 0.2  # m; readings that differ by no more are the same

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Counts:
    """Readings in dust compared with those in clear air.

    Attributes:
        clear: Number of readings in clear air.
        crossing: Number of the readings in clear air whose beam crosses the dust.
        unchanged: Number of ``crossing`` that are the same in dust.
        beside: Number of the others that are the same in dust.
        cloud: Number of readings of the dust itself.
        objects: Number of objects that are read in dust.
        all_objects: Number of objects in the map.
    """

    clear: int
    crossing: int
    unchanged: int
    beside: int
    cloud: int
    objects: int
    all_objects: int


def scan_spec_for(sensor: str, air: str, seed: int) -> ScanSpec:
    """Return the scans of a figure; ``air`` is ``clear`` or ``dust``."""
    return ScanSpec(
        MAP if air == "clear" else f"{MAP}@{air}", sensor, seed, count=COUNT
    )


def count_readings(sensor: str, air: str, seed: int) -> Counts:
    """Compare scans in some air with those in clear air."""
    clear = scan_spec_for(sensor, "clear", seed).take()
    scans = scan_spec_for(sensor, air, seed).take()
    found = np.array([np.isfinite(scan.ranges) for scan in clear])
    across = np.array([_crosses(scan) for scan in clear]) & found
    with np.errstate(invalid="ignore"):  # inf - inf, of beams that are left out
        pairs = zip(clear, scans, strict=True)
        moved = np.array([np.abs(one.ranges - two.ranges) for one, two in pairs])
    same = found & (moved <= CELL)
    answers = [object_names(scan) for scan in scans]
    names = {name for each in answers for name in each.tolist()} - {"", SMOKE_CELL}
    return Counts(
        clear=int(found.sum()),
        crossing=int(across.sum()),
        unchanged=int((same & across).sum()),
        beside=int((same & ~across).sum()),
        cloud=sum(int((each == SMOKE_CELL).sum()) for each in answers),
        objects=len(names),
        all_objects=len({part.object_name for part in trial_parts()}),
    )


def trial_parts() -> list[Part]:
    """Return the parts that stand on the ground."""
    return [part for part in load_scene(MAP).parts if part.object_name != "ground"]


def dust_extent() -> Floats:
    """Return the lower and upper x, y of the dust, (2, 2) m."""
    parts = load_scene(f"{MAP}@dust").parts
    (cloud,) = (part for part in parts if part.object_name == SMOKE_CELL)
    corners = cloud.vertices[:, :2]
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _crosses(scan: Scan) -> Mask:
    """Return a mask (N,) of the readings whose beams cross the dust."""
    ends = scan_points(scan)
    starts = np.broadcast_to(scan.pose.position()[:2], ends.shape)
    lines = shapely.linestrings(np.stack([starts, ends], axis=1))
    return np.asarray(shapely.intersects(lines, shapely.box(*dust_extent().ravel())))
