"""The three shapes of one shrub, made to let the same power through, and compared."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from radarsim.plants.calibration import (
    DENSITY,
    POWER,
    WOODEN,
    bundle,
    calibrate,
    transmission,
    transmission_of_ball,
)
from radarsim.plants.forms import SHRUB, PlantForm
from radarsim.plants.readings import Reading, read_plant
from radarsim.plants.shrub import Plant, make_shrubs
from radarsim.randomness import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

DIGITS: Final = 3  # of what a map is told
RAYS: Final = 1600  # from each side
MOST_DENSITY: Final = 10.0  # power per metre


@dataclass(frozen=True, eq=False)
class Comparison:
    """One of the three shapes, calibrated.

    Attributes:
        shape: One of ``SHAPES``.
        plant: Stands on the origin.
        foliage: Its material: what calibration found, to ``DIGITS`` digits.
        transmission: Mean over rays which others than these have calibrated.
        reading: At the height of a scanner.
    """

    shape: str
    plant: Plant
    foliage: Material
    transmission: float
    reading: Reading

    @property
    def title(self) -> str:
        """Say what it is, and what its foliage takes."""
        if self.foliage.sheet_loss is not None:
            return f"{self.shape}, each takes {self.foliage.sheet_loss:g}"
        return f"{self.shape}, takes {self.foliage.density:g} per metre"


def foliage_material(shape: str, taken: float) -> Material:
    """Make the material of a shape's foliage.

    Args:
        shape: One of ``SHAPES``.
        taken: Power per metre; of leaves, power at each.
    """
    name = f"foliage_{shape}"
    if shape == "leaves":
        return Material(name, density=0.0, sheet_loss=taken)
    return Material(name, density=taken)


def compare_shapes(
    seed: int, form: PlantForm = SHRUB, *, rays: int = RAYS, azimuths: int = 72
) -> Iterator[Comparison]:
    """Calibrate the three shapes of a shrub, and read them.

    Args:
        seed: Of the shrub.
        form: Its crown is a sphere.
        rays: How many calibrate and measure a shape, from each side.
        azimuths: How many sides there are.
    """
    wanted = wanted_transmission(form)
    crown = (form.centre, form.crown_radius)
    first, second = (
        bundle(*crown, generator_for(seed, name), azimuths=azimuths, rays=rays)
        for name in ("calibration", "measurement")
    )
    for shape, plant in make_shrubs(seed, form).items():
        most = POWER if shape == "leaves" else MOST_DENSITY

        def parts(
            taken: float, shape: str = shape, plant: Plant = plant
        ) -> tuple[Part, Part]:
            return plant.parts("shrub", WOODEN, foliage_material(shape, taken))

        found = float(f"{calibrate(parts, wanted, first, most):.{DIGITS}g}")
        measured = float(transmission(parts(found), second).mean())
        reading = read_plant(form, parts(found))
        material = foliage_material(shape, found)
        yield Comparison(shape, plant, material, measured, reading)


def wanted_transmission(form: PlantForm = SHRUB) -> float:
    """Give the mean transmission of a bare ball as large as a crown, of ``DENSITY``."""
    return transmission_of_ball(2 * form.crown_radius * DENSITY / POWER)
