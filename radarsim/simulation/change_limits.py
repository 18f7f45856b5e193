"""How many rays a client may ask for by changing the settings of a scanner.

All robots share the time of a tick: a client must not take that of the others. Whoever
starts the simulation may configure more; that much is then allowed as well.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

from radarsim.errors import PresetError
from radarsim.presets.robots import Item
from radarsim.simulation.config import SimulationConfig

MOST_RAYS: Final = 2_000  # in a scan; that takes some ms with all echoes
MOST_RAYS_A_SECOND: Final = 50_000
MOST_EXTRA_RAYS: Final = (
    500_000  # a second that all robots add to those of their classes
)
MOST_DIRECTIONS: Final = 5_000  # of which rays are drawn; preparing them takes 1 ms


class RayCounts(NamedTuple):
    """How much a scanner asks for.

    Attributes:
        rays: Rays of a scan.
        rate: Rays in a second.
        directions: Directions that the rays of a scan can have.
    """

    rays: int
    rate: float
    directions: int

    @classmethod
    def of(cls, item: Item, config: SimulationConfig) -> "RayCounts":
        """Count those of an item that is a range scanner."""
        settings = config.scanner_settings(item)
        if settings.has_detector:
            rays = config.turn_rays(item)
            return cls(rays, rays / config.interval(item), rays)
        directions = settings.beams * settings.rays_per_beam
        rays = directions if settings.combines_rays else settings.beams
        return cls(rays, rays / config.interval(item), directions)


LIMITS: Final = RayCounts(MOST_RAYS, MOST_RAYS_A_SECOND, MOST_DIRECTIONS)
NAMES: Final = ("rays in a scan", "rays a second", "directions of rays in a scan")


def check_rays(item: Item, config: SimulationConfig, first: SimulationConfig) -> None:
    """Check how many rays a scanner would have.

    Args:
        item: A range scanner.
        config: The changed configuration.
        first: The configuration that the robot was spawned with.

    Raises:
        PresetError: If they are too many.
    """
    counts, before = RayCounts.of(item, config), RayCounts.of(item, first)
    for name, count, old, limit in zip(NAMES, counts, before, LIMITS, strict=True):
        if count > max(limit, old):
            most = f"expected at most {max(limit, old):.0f}"
            raise PresetError(f"item {item.name!r}: {count:.0f} {name}, {most}")


def count_extra_rays(
    items: Iterable[Item], config: SimulationConfig, first: SimulationConfig
) -> float:
    """Count the rays in a second that changed settings have added.

    Args:
        items: Range scanners of a robot.
        config: The changed configuration.
        first: The configuration that the robot was spawned with.
    """
    return sum(
        max(0.0, RayCounts.of(item, config).rate - RayCounts.of(item, first).rate)
        for item in items
    )


def check_extra_rays(extra: float, before: float, others: float) -> None:
    """Check how many rays in a second all robots together have added.

    Args:
        extra: Those that a robot would have added; fewer than before are always right.
        before: Those that it has added.
        others: Those that all other robots have added.

    Raises:
        PresetError: If they are too many.
    """
    left = max(before, MOST_EXTRA_RAYS - others)
    if extra > left:
        raise PresetError(
            f"{extra:.0f} rays a second more than the class has, expected at most"
            f" {left:.0f}, what other clients leave of {MOST_EXTRA_RAYS}"
        )
