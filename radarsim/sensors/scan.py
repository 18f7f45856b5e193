"""The scan of a radar or a laser, its echoes, and the objects that returned them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import radarsim
from radarsim.errors import import_optional
from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.rays import EventKind, Rays, Sides
from radarsim.raycast.traced_scene import attenuation_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.beams import ray_class_of

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

ROBOT = Material("robot")  # opaque to radar and light
KINDS = {
    EventKind[name.upper()]: name
    for name in ("enter", "leave", "sheet", "hit", "spent", "rain")
}


@dataclass(frozen=True, slots=True)
class Target:
    """The object that an echo came from, as the sensor perceives it.

    Attributes:
        object: Name of the object in the map, or name of the robot.
        material: Name of the material.
        density: Penetration power that the sensor's beams lose per metre inside;
            ``math.inf`` if they cannot enter the object.
        transparency: Share of a beam's full power that passes through one metre of the
            material, or through one sheet: 1 if nothing is lost, 0 if opaque.
        laser_passes: Whether light can enter the object.
        robot_passes: Whether robots can drive through the object.
    """

    object: str
    material: str
    density: float
    transparency: float
    laser_passes: bool
    robot_passes: bool

    @classmethod
    def of(cls, name: str, material: Material, settings: SensorSettings) -> "Target":
        """Create the target for an object of a material, as seen by a sensor."""
        radar = settings.medium == "radar"
        density = attenuation_of(material, ray_class_of(settings))
        loss = density
        if material.sheet_loss is not None and math.isfinite(density):
            density, loss = 0.0, material.sheet_loss if radar else 0.0
        return cls(
            name,
            material.name,
            density,
            _share_left(loss, settings.penetration_power),
            math.isfinite(material.laser_density),
            not material.solid,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the target as JSON types; the density of an opaque target is None."""
        density = self.density if math.isfinite(self.density) else None
        return asdict(self) | {"density": density}


def _share_left(loss: float, power: float) -> float:
    """Return the share of a ray's power that is left after a loss, from 0 to 1."""
    if loss == 0:
        return 1.0
    if math.isinf(loss) or power == 0:
        return 0.0
    return max(0.0, 1.0 - loss / power)


@dataclass(frozen=True, slots=True, eq=False)
class Echoes:
    """A table of E echoes as columns, sorted by beam and then by range.

    Attributes:
        beams: (E,) int64, number of the beam, counted from the right.
        sides: (E,) int8, ray of the beam: -1 right, 0 centre, 1 left.
        ranges: (E,) distance from the start of the ray, m. For a volume it is the
            distance up to which half of the echo's power has returned; where the ray
            enters, if the sensor keeps first echoes; or the depth of the return
            inside, if the sensor reads first returns.
        fronts: (E,) distance at which the echo begins, m: for a volume always where
            the ray enters; otherwise as ``ranges``.
        kinds: (E,) uint8, ``EventKind`` of each echo: the ray enters or leaves a
            volume, crosses a sheet, hits a surface, has no power left, or meets rain.
        power: (E,) penetration power left on arrival, for a hit minus the absorption of
            the surface; inf if the power is unlimited.
        strength: (E,) power relative to the echo of a rough wall that fills the beam
            at normal incidence, 0 to 1; see ``echo_extraction``.
        parts: (E,) int64, index of the part in the scene; for a robot, the number of
            parts + the id of the robot.
        scene_parts: The parts of the scene.
        settings: Settings of the sensor.
    """

    beams: NDArray[np.int64]
    sides: NDArray[np.int8]
    ranges: Floats
    fronts: Floats
    kinds: NDArray[np.uint8]
    power: Floats
    strength: Floats
    parts: NDArray[np.int64]
    scene_parts: Sequence[Part] = field(repr=False)
    settings: SensorSettings = field(repr=False)

    def answers_in_clouds(self) -> dict[int, Material]:
        """Return the material of the cloud in which each beam ends, by beam number."""
        if not self.settings.reads_first_returns:
            return {}
        entering = self.kinds == EventKind.ENTER
        materials = [self.scene_parts[part].material for part in self.parts[entering]]
        met = zip(self.beams[entering].tolist(), materials, strict=True)
        return {beam: material for beam, material in met if material.is_cloud}

    def __len__(self) -> int:
        return len(self.beams)

    @property
    def decibels(self) -> Floats:
        """The strengths of the echoes, (E,) dB, at most 0; -inf for a strength of 0."""
        with np.errstate(divide="ignore"):
            return np.asarray(10 * np.log10(self.strength))

    @property
    def targets(self) -> dict[int, Target]:
        """The objects that returned the echoes, by the index of their part."""
        return {part: self.target(part) for part in np.unique(self.parts).tolist()}

    def target(self, part: int, robot_names: Mapping[int, str] | None = None) -> Target:
        """Return the object that a part belongs to.

        Args:
            part: As in ``parts``.
            robot_names: Names of the robots, by their ids; None for the ids.
        """
        robot = part - len(self.scene_parts)
        if robot >= 0:
            name = robot_names[robot] if robot_names else f"robot {robot}"
            return Target.of(name, ROBOT, self.settings)
        found = self.scene_parts[part]
        return Target.of(found.object_name, found.material, self.settings)

    def to_lists(self) -> list[list[dict[str, Any]]]:
        """Return the echoes as JSON types: a list of dictionaries for each beam."""
        targets = {part: target.to_dict() for part, target in self.targets.items()}
        lists: list[list[dict[str, Any]]] = [[] for _ in range(self.settings.beams)]
        decibels = self.decibels.tolist()
        for i, beam in enumerate(self.beams.tolist()):
            power, level = float(self.power[i]), decibels[i]
            lists[beam].append(
                {
                    "range": float(self.ranges[i]),
                    "front": float(self.fronts[i]),
                    "kind": KINDS[EventKind(int(self.kinds[i]))],
                    "ray": int(self.sides[i]) if self.settings.has_side_rays else None,
                    "power": power if math.isfinite(power) else None,
                    "strength": float(self.strength[i]),
                    "decibels": level if math.isfinite(level) else None,
                    **targets[int(self.parts[i])],
                }
            )
        return lists

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a row for each echo, with the columns of ``to_lists`` and ``beam``.

        Only the columns ``object`` and ``material`` describe the targets.

        Raises:
            MissingPackage: If pandas is not installed.
        """
        package = import_optional("pandas", "tables")
        targets = self.targets
        found = [targets[part] for part in self.parts.tolist()]
        frame: pandas.DataFrame = package.DataFrame(
            {
                "beam": self.beams,
                "ray": self.sides,
                "range": self.ranges,
                "front": self.fronts,
                "kind": [KINDS[EventKind(kind)] for kind in self.kinds.tolist()],
                "power": self.power,
                "strength": self.strength,
                "decibels": self.decibels,
                "object": [target.object for target in found],
                "material": [target.material for target in found],
            }
        )
        return frame


class Targets(NamedTuple):
    """T targets of one revolution, sorted by beam from the right, then by range.

    Attributes:
        beams: (T,) int64, number of the beam.
        ranges: (T,) m.
        dbm: (T,) received power, dBm.
        rcs_dbsm: (T,) radar cross section of an unobstructed point target in the middle
            of the beam with the same power, dB relative to 1 m^2.
        snr_db: (T,) power over the mean noise, dB.
        radial_velocity: (T,) speed away from the radar, m/s, from the simulation's
            ground truth: the radar itself measures no velocity.
    """

    beams: NDArray[np.int64]
    ranges: Floats
    dbm: Floats
    rcs_dbsm: Floats
    snr_db: Floats
    radial_velocity: Floats


# This class is not frozen, since creating frozen instances takes three times as long.
@dataclass(slots=True, eq=False, repr=False)
class Scan:
    """One scan of a radar or a laser.

    Attributes:
        sensor: Name of the preset.
        pose: Pose of the sensor, map frame.
        angles: (N,) azimuths of the beams from the sensor's forward axis, rad,
            counter-clockwise.
        ranges: (N,) m; inf where nothing was detected, 0 where a laser is blinded.
        rays: (N,) ray of the beam that gave each range: -1 right, 0 centre, 1 left;
            None for a sensor without side rays.
        range_min: Minimum range of the sensor, m; shorter ranges are not removed.
        range_max: Maximum range of the sensor, m.
        resolution: Angle between neighbouring beams, rad.
        find_cast: Function that computes ``cast`` on demand.
        find_echoes: Function that computes ``echoes`` on demand.
        scene: The map; None for a scan of a simulation with its robots.
        targets: Targets found by the detector; None for a sensor without one.
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
        """Return the plot of the scan as SVG, for notebooks; None without a map."""
        if self.scene is None:
            return None
        return radarsim.as_svg(self.plot())

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the rays, echoes and ranges of the scan over the plan of the map.

        Rays that pass through an object are the boldest lines.

        Args:
            ax: Axes of matplotlib, in m; None creates a new figure with a legend.

        Returns:
            The axes; ``scan.plot().figure.savefig("scan.png")`` writes a file.

        Raises:
            ValueError: If the scan is not from ``RangeScanner.scan``.
        """
        if self.scene is None:
            raise ValueError("the scan has no map, expected a scan by RangeScanner")
        return radarsim.plot_scan(self.scene, self, ax)

    @property
    def cast(self) -> Rays:
        """The ray that gave each beam's range; any ray of a beam without range."""
        return self.find_cast()

    @property
    def echoes(self) -> Echoes:
        """The echoes that the sensor's ``return_mode`` keeps: one per beam, or all."""
        return self.find_echoes()

    def to_dict(self) -> dict[str, Any]:
        """Return the scan as JSON types; the range of a beam without echo is None."""
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
        """Return an xarray dataset with ranges and rays by ``angle``, and attributes.

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
