"""Plants: their mesh files, and how much power their foliage has to take.

``python -m radarsim.lab.plants OUT`` writes mesh files of plants, and a figure. With
the default seed these are the files of the shipped maps.

Theory of operation
===================
Foliage is calibrated so that a target share of power gets through, whatever its shape.
The transmission of a ray is the share of its penetration power that is left behind the
plant: 0 if the power is spent inside, or if the ray ends at wood. The transmission of a
plant is the mean over horizontal rays from all sides, uniform over the disc that the
crown appears as.

`measure_plant` returns the ranges that a radar measures of a plant before a wall.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import click
import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from radarsim.cli.command import PlanCommand
from radarsim.cli.fields import Seed
from radarsim.errors import describe_os_error
from radarsim.files import write_atomically
from radarsim.generators.plants.plant import SEED, Plant, make_shrubs, plant_files
from radarsim.generators.plants.species import SHRUB, PlantParameters
from radarsim.geometry import Floats
from radarsim.plans import Option
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene

POWER: Final = 1.0  # initial power of rays
HEIGHT: Final = 0.346  # m above the ground, of a P3AT's scanner
BEFORE: Final = 4.0  # m from the rays' starts to the centre of the plant
BEHIND: Final = 3.0  # m from there to the wall, which is normal to the rays
WALL: Final = BEFORE + BEHIND

DENSITY: Final = 0.7  # power per metre, of the ball that defines the target
ACCURACY: Final = 1e-3  # relative, of calibrated values
DIGITS: Final = 3  # significant digits of calibrated values, as in a map file
RAYS: Final = 1600  # in each direction
MAX_DENSITY: Final = 10.0  # power per metre
WOODEN: Final = Material("wood")


@dataclass(frozen=True, slots=True)
class RangeStatistics:
    """Statistics of ranges, in m.

    Attributes:
        mean: Mean of all ranges.
        deviation: Standard deviation of all ranges.
        percentiles: The 5th, the 50th and the 95th percentile.
        at_one_offset: Standard deviation of ranges at the same distance from the
            plant's centre but from different directions; the root of the mean square
            over all distances. 0 for a plant that looks the same from all sides.
        spent: Standard deviation of the ranges of rays that lost all their power in
            foliage; 0 if there are none.
        through: Share of the rays that measure the wall.
    """

    mean: float
    deviation: float
    percentiles: tuple[float, float, float]
    at_one_offset: float
    spent: float
    through: float


@dataclass(frozen=True, eq=False)
class PlantRanges:
    """Ranges of horizontal rays through a plant at the height of a scanner.

    Attributes:
        offsets: (K,) m, of the rays to the left of the plant's centre.
        azimuths: (A,) rad, directions of the rays.
        ranges: (A, K) m.
        spent: (A, K) whether the ray lost all its power in foliage.
    """

    offsets: Floats
    azimuths: Floats
    ranges: Floats
    spent: NDArray[np.bool_]

    def statistics(self) -> RangeStatistics:
        """Return the statistics of the ranges."""
        spent = self.ranges[self.spent]
        low, median, high = np.percentile(self.ranges, [5, 50, 95]).tolist()
        return RangeStatistics(
            float(self.ranges.mean()),
            float(self.ranges.std()),
            (low, median, high),
            float(np.sqrt(self.ranges.var(axis=0).mean())),
            float(spent.std()) if spent.size else 0.0,
            float(np.mean(self.ranges >= WALL)),
        )


def measure_plant(
    parameters: PlantParameters,
    parts: Sequence[Part],
    *,
    offsets: int = 101,
    azimuths: int = 120,
) -> PlantRanges:
    """Measure ranges of parallel rays from all sides over the width of a crown.

    Args:
        parameters: The plant's parameters; the crown defines its width at the scanner's
            height.
        parts: The plant, at the origin.
        offsets: Number of rays in each direction.
        azimuths: Number of directions.
    """
    height = (HEIGHT - parameters.crown_centre) / parameters.crown_half_height
    width = parameters.crown_radius * math.sqrt(max(1 - height**2, 0.0))
    across = np.linspace(-width, width, offsets + 2)[1:-1]
    directions = 2 * math.pi * np.arange(azimuths) / azimuths
    azimuth = np.repeat(directions, offsets)
    offset = np.tile(across, azimuths)[:, None]
    level = np.zeros(len(azimuth))
    forward = np.column_stack([np.cos(azimuth), np.sin(azimuth), level])
    left = np.column_stack([-np.sin(azimuth), np.cos(azimuth), level])
    starts = offset * left - BEFORE * forward + np.array([0.0, 0.0, HEIGHT])
    rays = Rays.uniform(starts, forward, max_range=WALL, power=POWER)
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    shape = (azimuths, offsets)
    ranges = np.minimum(traces.ranges, WALL).reshape(shape)
    spent = (traces.outcomes == Outcome.SPENT).reshape(shape)
    return PlantRanges(across, directions, ranges, spent)


def bundle(
    centre: Floats,
    radius: float,
    rng: np.random.Generator,
    *,
    azimuths: int = 48,
    rays: int = 800,
) -> Rays:
    """Create horizontal rays through a ball from all sides.

    Args:
        centre: Centre of the ball, (3,) m.
        radius: Radius of the ball, m.
        rng: Draws the directions, and the positions on the ball's disc.
        azimuths: Number of directions.
        rays: Number of rays in each direction.

    Returns:
        Parallel rays in each direction, which start 1 m before the ball and end 1 m
        behind it.
    """
    first = rng.uniform(0, 2 * math.pi)
    azimuth = np.repeat(first + 2 * math.pi * np.arange(azimuths) / azimuths, rays)
    count = np.tile(np.arange(rays), azimuths)
    # Fermat spirals, which have uniform density, each rotated at random.
    offset = radius * np.sqrt((count + rng.random(len(count))) / rays)
    golden = math.pi * (3 - math.sqrt(5))
    angle = golden * count + np.repeat(rng.uniform(0, 2 * math.pi, azimuths), rays)
    directions = np.column_stack(
        [np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))]
    )
    left = np.column_stack([-directions[:, 1], directions[:, 0], directions[:, 2]])
    sideways = offset * np.cos(angle)
    starts = centre - (radius + 1) * directions + sideways[:, None] * left
    starts[:, 2] += offset * np.sin(angle)
    return Rays.uniform(starts, directions, max_range=2 * radius + 2, power=POWER)


def transmission(parts: Sequence[Part], rays: Rays) -> Floats:
    """Return the share of power that each ray has left behind all parts, (N,)."""
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    passed = traces.outcomes == Outcome.NOTHING
    return np.where(passed, traces.power, 0.0) / rays.power


def transmission_of_ball(opacity: float) -> float:
    """Return the mean transmission of a bare ball, which has a closed form.

    Args:
        opacity: Share of its power that a beam through the centre loses.
    """
    if opacity >= 1:
        # Beams near the centre lose everything; only those at the rim get through.
        return 1 / (3 * opacity**2)
    return 1 - 2 * opacity / 3


def calibrate(
    parts: Callable[[float], Sequence[Part]], target: float, rays: Rays, highest: float
) -> float:
    """Return the loss of foliage that results in a mean transmission, by bisection.

    Args:
        parts: Return a plant with foliage of a given loss.
        target: The mean transmission.
        rays: Rays through the crown, from ``bundle``.
        highest: Upper limit of the loss; the lower one is 0.

    Raises:
        ValueError: If no loss between the limits results in the target.
    """
    low, high = 0.0, highest
    limits = [float(transmission(parts(end), rays).mean()) for end in (low, high)]
    if not limits[0] >= target >= limits[1]:
        raise ValueError(f"transmission from {limits}, expected {target:.4f} between")
    while high - low > ACCURACY * high:
        middle = (low + high) / 2
        if transmission(parts(middle), rays).mean() > target:
            low = middle
        else:
            high = middle
    return (low + high) / 2


@dataclass(frozen=True, eq=False)
class Comparison:
    """One of the three shapes, calibrated.

    Attributes:
        shape: One of ``SHAPES``.
        plant: The plant, at the origin.
        foliage: Material of its foliage, calibrated to ``DIGITS`` digits.
        transmission: Mean over other rays than those of the calibration.
        ranges: Ranges at the height of a scanner.
    """

    shape: str
    plant: Plant
    foliage: Material
    transmission: float
    ranges: PlantRanges

    @property
    def title(self) -> str:
        """The shape, and the loss of its foliage."""
        if self.foliage.sheet_loss is not None:
            return f"{self.shape}, each takes {self.foliage.sheet_loss:g}"
        return f"{self.shape}, takes {self.foliage.density:g} per metre"


def foliage_material(shape: str, loss: float) -> Material:
    """Create the material of a shape's foliage.

    Args:
        shape: One of ``SHAPES``.
        loss: Power per metre; for leaves, power at each leaf.
    """
    name = f"foliage_{shape}"
    if shape == "leaves":
        return Material(name, density=0.0, sheet_loss=loss)
    return Material(name, density=loss)


def compare_shapes(
    seed: int,
    parameters: PlantParameters = SHRUB,
    *,
    rays: int = RAYS,
    azimuths: int = 72,
) -> Iterator[Comparison]:
    """Calibrate the three shapes of a shrub, and measure their ranges.

    Args:
        seed: Seed of the shrub.
        parameters: Parameters of a shrub with a spherical crown.
        rays: Number of rays in each direction, for calibration and measurement each.
        azimuths: Number of directions.
    """
    target = target_transmission(parameters)
    crown = (parameters.centre, parameters.crown_radius)
    # Other rays than those of the calibration, which fits its own too well.
    first, second = (
        bundle(*crown, generator_for(seed, name), azimuths=azimuths, rays=rays)
        for name in ("calibration", "measurement")
    )
    for shape, plant in make_shrubs(seed, parameters).items():
        highest = POWER if shape == "leaves" else MAX_DENSITY

        # Bound as defaults: a closure would see the shape of the next round.
        def parts(
            loss: float, shape: str = shape, plant: Plant = plant
        ) -> tuple[Part, Part]:
            return plant.parts("shrub", WOODEN, foliage_material(shape, loss))

        # Rounded as map files have it, so that what is measured is what they hold.
        loss = float(f"{calibrate(parts, target, first, highest):.{DIGITS}g}")
        measured = float(transmission(parts(loss), second).mean())
        ranges = measure_plant(parameters, parts(loss))
        yield Comparison(shape, plant, foliage_material(shape, loss), measured, ranges)


def target_transmission(parameters: PlantParameters = SHRUB) -> float:
    """Return the mean transmission of a ball of ``DENSITY`` as large as a crown."""
    return transmission_of_ball(2 * parameters.crown_radius * DENSITY / POWER)


def make(
    out: Annotated[Path, Option(is_argument=True)],
    *,
    seed: Seed = SEED,
    figure: Path | None = None,
    calibrate: bool = False,
    rays: Annotated[int, Ge(1)] = RAYS,
) -> None:
    """Write the mesh files of plants, all or none.

    Args:
        out: The folder for the mesh files.
        seed: Seed of all plants.
        figure: Draw the three shapes of the shrub into this PNG.
        calibrate: Print how much power their foliage has to take.
        rays: Rays for the calibration of a shape, from each side.
    """
    files = plant_files(seed)
    shapes: list[Comparison] = []
    if calibrate or figure is not None:
        shapes = list(compare_shapes(seed, rays=rays))
    written = {out / name: content for name, content in files.items()}
    if figure is not None:
        from radarsim.lab.figures.plants import plot_shapes  # noqa: PLC0415 - slow
        from radarsim.plotting.style import render  # noqa: PLC0415

        written[figure] = render(plot_shapes(shapes))
    try:
        for folder in {path.parent for path in written}:
            folder.mkdir(parents=True, exist_ok=True)
        write_atomically(written)
    except OSError as error:
        text = f"cannot write {error.filename}: {describe_os_error(error)}"
        raise click.BadParameter(text) from None
    for name, content in files.items():
        click.echo(f"{out / name}: {len(content)} bytes")
    if shapes:
        click.echo(f"wanted: mean transmission {target_transmission():.4f}")
    for shape in shapes:
        ranges = shape.ranges.statistics()
        low, median, high = ranges.percentiles
        click.echo(
            f"{shape.title}: mean transmission {shape.transmission:.4f}; ranges: mean "
            f"{ranges.mean:.2f} m, deviation {ranges.deviation:.2f} m, 5, 50, 95 %: "
            f"{low:.2f}, {median:.2f}, {high:.2f} m, deviation at one offset "
            f"{ranges.at_one_offset:.2f} m, where spent {ranges.spent:.2f} m, "
            f"through {ranges.through:.3f}"
        )


def main() -> None:
    """Run the program and exit with its code."""
    PlanCommand("plants", make).main()


if __name__ == "__main__":
    main()
