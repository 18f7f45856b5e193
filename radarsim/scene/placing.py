"""Where the copies of a repeated or scattered object stand."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from radarsim.geometry import Floats
from radarsim.randomness import generator_for
from radarsim.scene.mapmodel import ObjectEntry, ScatterEntry

_TRIES = 200  # darts thrown for each copy, before the area counts as full


@dataclass(frozen=True, eq=False)
class Copy:
    """One of an object's copies: its name, its origin, (3,) m, and its size factor."""

    name: str
    position: Floats
    scale: float = 1.0


class NoRoom(Exception):
    """The area is too small for so many copies so far apart."""


def copy_names(name: str, count: int | None) -> Iterator[str]:
    """Give the names of an object's copies: ``name_1``, ``name_2``; one is just itself.

    Args:
        name: The object's own name.
        count: None for an object that is neither repeated nor scattered.
    """
    if count is None:
        yield name
    else:
        yield from (f"{name}_{number}" for number in range(1, count + 1))


def place_copies(entry: ObjectEntry) -> list[Copy]:
    """Place an object's copies.

    Scattered places come from the entry's own seed and name, one after the other, so
    that a larger count leaves the first ones where they are.

    Raises:
        NoRoom: If scattered copies do not find room.
    """
    origin = np.array(entry.position, dtype=np.float64)
    if entry.scatter is not None:
        return list(_scattered(entry.name, origin, entry.scatter))
    step = np.array(entry.repeat.step) if entry.repeat else np.zeros(3)
    names = copy_names(entry.name, entry.copies)
    return [Copy(name, origin + i * step) for i, name in enumerate(names)]


def _scattered(name: str, origin: Floats, scatter: ScatterEntry) -> Iterator[Copy]:
    rng = generator_for(scatter.seed, "scatter", name)
    low, high = np.array(scatter.area)
    smallest, largest = scatter.scale
    places = np.full((scatter.count, 2), np.inf)
    for number, copy_name in enumerate(copy_names(name, scatter.count)):
        for _ in range(_TRIES):
            place = rng.uniform(low, high)
            gaps = np.linalg.norm(places[:number] - place, axis=1)
            if gaps.min(initial=np.inf) >= scatter.min_distance:
                break
        else:
            raise NoRoom(f"room for {number} copies, expected {scatter.count}")
        places[number] = place
        scale = rng.uniform(smallest, largest)
        yield Copy(copy_name, origin + np.append(place, 0.0), scale)
