"""What a scan got back: echoes, and what each of them came from."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.material_table import attenuation_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.sensors.beams import ray_class_of

ROBOT = Material("robot")  # opaque to everything
KINDS = {
    EventKind.ENTER: "enter",
    EventKind.LEAVE: "leave",
    EventKind.SHEET: "sheet",
    EventKind.HIT: "hit",
    EventKind.SPENT: "spent",
    EventKind.RAIN: "rain",
}


@dataclass(frozen=True, slots=True)
class Target:
    """What an echo came from, as far as a sensor can tell.

    Attributes:
        object: Its name in the map; of a robot, its name.
        material: Name of the material.
        density: Penetration power that the sensor's beams lose per metre in it;
            ``math.inf`` for what they do not enter.
        transparency: Share of a beam's full power that a metre of it lets through, or
            of a sheet one layer: 1 for what costs nothing, 0 for what is opaque.
        laser_passes: Whether light gets into it.
        robot_passes: Whether robots can drive through it.
    """

    object: str
    material: str
    density: float
    transparency: float
    laser_passes: bool
    robot_passes: bool

    @classmethod
    def of(cls, name: str, material: Material, settings: SensorSettings) -> "Target":
        """Tell what a sensor can know of an object."""
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
        """Give what JSON can hold; a density of None is opaque."""
        return {
            "object": self.object,
            "material": self.material,
            "density": self.density if math.isfinite(self.density) else None,
            "transparency": self.transparency,
            "laser_passes": self.laser_passes,
            "robot_passes": self.robot_passes,
        }


def _share_left(loss: float, power: float) -> float:
    """Give the share of a power that is left after a loss."""
    if loss == 0:
        return 1.0
    if math.isinf(loss) or power == 0:
        return 0.0
    return max(0.0, 1.0 - loss / power)


@dataclass(frozen=True, slots=True, eq=False)
class Echoes:
    """A row for each echo: beam by beam, the nearest first.

    Attributes:
        beams: (E,) int64, the beam's number, counted from the right.
        sides: (E,) int8, the ray that it came on: -1 right, 0 centre, 1 left.
        ranges: (E,) m from the start of its ray.
        kinds: (E,) uint8, an ``EventKind`` each: the ray enters or leaves a volume,
            crosses a sheet, hits what is opaque, or is spent, or drops answer.
        power: (E,) penetration power left on arrival, of what is hit without what it
            keeps; inf if it is unlimited.
        strength: (E,) share of the beam that it gives back, 0 to 1: see ``gathering``.
        parts: (E,) int64, the index of the part in the scene; of a robot, the number
            of parts + the robot's number.
        scene_parts: Of the scene.
        settings: Of the sensor.
    """

    beams: NDArray[np.int64]
    sides: NDArray[np.int8]
    ranges: Floats
    kinds: NDArray[np.uint8]
    power: Floats
    strength: Floats
    parts: NDArray[np.int64]
    scene_parts: Sequence[Part] = field(repr=False)
    settings: SensorSettings = field(repr=False)

    def __len__(self) -> int:
        return len(self.beams)

    @property
    def targets(self) -> dict[int, Target]:
        """What the echoes came from, by the numbers in ``parts``."""
        return {part: self._target(part) for part in np.unique(self.parts).tolist()}

    def _target(self, part: int) -> Target:
        count = len(self.scene_parts)
        if part >= count:
            return Target.of(f"robot {part - count}", ROBOT, self.settings)
        found = self.scene_parts[part]
        return Target.of(found.object_name, found.material, self.settings)

    def to_lists(self) -> list[list[dict[str, Any]]]:
        """Give a list for each beam of what JSON can hold."""
        told = {part: target.to_dict() for part, target in self.targets.items()}
        lists: list[list[dict[str, Any]]] = [[] for _ in range(self.settings.beams)]
        for i, beam in enumerate(self.beams.tolist()):
            power = float(self.power[i])
            lists[beam].append(
                {
                    "range": float(self.ranges[i]),
                    "kind": KINDS[EventKind(int(self.kinds[i]))],
                    "ray": int(self.sides[i]) if self.settings.has_side_rays else None,
                    "power": power if math.isfinite(power) else None,
                    "strength": float(self.strength[i]),
                    **told[int(self.parts[i])],
                }
            )
        return lists
