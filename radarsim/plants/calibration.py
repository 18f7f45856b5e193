"""What foliage has to take from beams so that a wanted share of power gets through.

The transmission of a ray is the share of its penetration power that is left behind the
plant: 0 if it is spent in there, or ends at its wood. That of a plant is the mean over
level rays from all sides, spread evenly over the disc that its crown is seen as.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plants.growth import SHRUB, PlantParameters
from radarsim.plants.plant import Plant, make_shrubs
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene

POWER: Final = 1.0  # that rays leave with
DENSITY: Final = 0.7  # power per metre of the ball that is the measure for all
ACCURACY: Final = 1e-3  # of what is found, as a share of it
WOODEN: Final = Material("wood")

Foliage: TypeAlias = Callable[[float], Material]


def bundle(
    centre: Floats,
    radius: float,
    rng: np.random.Generator,
    *,
    azimuths: int = 48,
    rays: int = 800,
) -> Rays:
    """Point level rays at a ball from all around.

    Args:
        centre: Of the ball, (3,) m.
        radius: Of the ball, m.
        rng: Draws from where they come, and where they go through the ball's disc.
        azimuths: From how many sides.
        rays: How many from each.

    Returns:
        Parallel rays from each side, which start and end 1 m in front of the ball and
        behind it.
    """
    first = rng.uniform(0, 2 * math.pi)
    around = np.repeat(first + 2 * math.pi * np.arange(azimuths) / azimuths, rays)
    count = np.tile(np.arange(rays), azimuths)
    # Spirals of even density, each turned by chance, with a place drawn for each ray.
    out = radius * np.sqrt((count + rng.random(len(count))) / rays)
    golden = math.pi * (3 - math.sqrt(5))
    turn = golden * count + np.repeat(rng.uniform(0, 2 * math.pi, azimuths), rays)
    ways = np.column_stack([np.cos(around), np.sin(around), np.zeros(len(around))])
    left = np.column_stack([-ways[:, 1], ways[:, 0], ways[:, 2]])
    beside = out * np.cos(turn)
    starts = centre - (radius + 1) * ways + beside[:, None] * left
    starts[:, 2] += out * np.sin(turn)
    return Rays.uniform(starts, ways, max_range=2 * radius + 2, power=POWER)


def transmission(parts: Sequence[Part], rays: Rays) -> Floats:
    """Give the share of power that each ray has left behind all parts, (N,)."""
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    through = traces.outcomes == Outcome.NOTHING
    return np.where(through, traces.power, 0.0) / rays.power


def transmission_of_ball(opacity: float) -> float:
    """Give the mean transmission of a bare ball; it has a closed form.

    Args:
        opacity: What a beam through the middle loses in it, as a share of its power.
    """
    if opacity >= 1:
        return 1 / (3 * opacity**2)
    return 1 - 2 * opacity / 3


def calibrate(
    parts: Callable[[float], Sequence[Part]], wanted: float, rays: Rays, most: float
) -> float:
    """Find what foliage has to take.

    Args:
        parts: Give a plant whose foliage takes so much.
        wanted: The mean transmission.
        rays: From ``bundle``.
        most: What is taken at most; it is halved from there.

    Raises:
        ValueError: If even the most takes too little, or nothing at all too much.
    """
    low, high = 0.0, most
    reached = [float(transmission(parts(end), rays).mean()) for end in (low, high)]
    if not reached[0] >= wanted >= reached[1]:
        raise ValueError(f"transmission from {reached}, expected {wanted:.4f} between")
    while high - low > ACCURACY * high:
        middle = (low + high) / 2
        if transmission(parts(middle), rays).mean() > wanted:
            low = middle
        else:
            high = middle
    return (low + high) / 2


# Section from plants.readings.
# What a radar reads of a plant with a wall behind it, and how that spreads.

HEIGHT: Final = 0.346  # m above the ground, of a P3AT's scanner
BEFORE: Final = 4.0  # m from where rays start to the middle of the plant
BEHIND: Final = 3.0  # m from there to the wall, which is across the rays
WALL: Final = BEFORE + BEHIND


@dataclass(frozen=True, slots=True)
class Spread:
    """How ranges are spread, in m.

    Attributes:
        mean: Of all.
        deviation: Standard deviation of all.
        percentiles: The 5th, the 50th and the 95th.
        at_one_offset: Standard deviation of those that pass the plant's middle at the
            same distance but come from different sides; the root of the mean square
            over all distances. 0 for what looks the same from all sides.
        spent: Standard deviation of those that end where foliage took the last of a
            ray's power; 0 if there are none.
        through: Share of the rays that read the wall.
    """

    mean: float
    deviation: float
    percentiles: tuple[float, float, float]
    at_one_offset: float
    spent: float
    through: float


@dataclass(frozen=True, eq=False)
class Reading:
    """The ranges of level rays through a plant at the height of a scanner.

    Attributes:
        offsets: (K,) m, how far to the left of the middle they pass.
        azimuths: (A,) rad, where they go.
        ranges: (A, K) m.
        spent: (A, K) whether foliage took the last of the ray's power.
    """

    offsets: Floats
    azimuths: Floats
    ranges: Floats
    spent: NDArray[np.bool_]

    def spread(self) -> Spread:
        """Give the numbers of the spread."""
        spent = self.ranges[self.spent]
        low, middle, high = np.percentile(self.ranges, [5, 50, 95]).tolist()
        return Spread(
            float(self.ranges.mean()),
            float(self.ranges.std()),
            (low, middle, high),
            float(np.sqrt(self.ranges.var(axis=0).mean())),
            float(spent.std()) if spent.size else 0.0,
            float(np.mean(self.ranges >= WALL)),
        )


def read_plant(
    form: PlantParameters,
    parts: Sequence[Part],
    *,
    offsets: int = 101,
    azimuths: int = 120,
) -> Reading:
    """Send parallel rays from all sides over the width of a crown on the origin.

    Args:
        form: Its crown says how wide the plant is at the scanner's height.
        parts: Of the plant.
        offsets: How many rays from each side.
        azimuths: From how many sides.
    """
    height = (HEIGHT - form.crown_centre) / form.crown_half_height
    width = form.crown_radius * math.sqrt(max(1 - height**2, 0.0))
    across = np.linspace(-width, width, offsets + 2)[1:-1]
    around = 2 * math.pi * np.arange(azimuths) / azimuths
    rays = _fan(across, around)
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    shape = (azimuths, offsets)
    ranges = np.minimum(traces.ranges, WALL).reshape(shape)
    spent = (traces.outcomes == Outcome.SPENT).reshape(shape)
    return Reading(across, around, ranges, spent)


def _fan(offsets: Floats, azimuths: Floats) -> Rays:
    """Give rays, side by side, in order of azimuths and then of offsets."""
    turn = np.repeat(azimuths, len(offsets))
    beside = np.tile(offsets, len(azimuths))[:, None]
    level = np.zeros(len(turn))
    ways = np.column_stack([np.cos(turn), np.sin(turn), level])
    left = np.column_stack([-np.sin(turn), np.cos(turn), level])
    starts = beside * left - BEFORE * ways + np.array([0.0, 0.0, HEIGHT])
    return Rays.uniform(starts, ways, max_range=WALL, power=POWER)


# Section from plants.comparison.
# The three shapes of one shrub, made to let the same power through, and compared.

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
    seed: int, form: PlantParameters = SHRUB, *, rays: int = RAYS, azimuths: int = 72
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


def wanted_transmission(form: PlantParameters = SHRUB) -> float:
    """Give the mean transmission of a bare ball as large as a crown, of ``DENSITY``."""
    return transmission_of_ball(2 * form.crown_radius * DENSITY / POWER)
