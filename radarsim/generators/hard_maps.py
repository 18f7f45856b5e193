"""Random maps that are hard for navigators: mirrors, panes, thin poles, and movers.

They are drawn as other random maps are, each by its number, but of families of their
own. Metal and glass are those of the library: a mirror to all, and one to radars alone.
Movers are other robots that drive to and fro.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from radarsim.generators.random_maps import (
    DRAWERS,
    HALF_LENGTH,
    HALF_WIDTH,
    Block,
    Disc,
    Drawer,
    MapMaker,
    Mover,
    RandomMap,
    Solid,
)
from radarsim.rng import generator_for

MIXED: Final = ("boxes", "trunks", "traps", "mazes", "offices")
SHARE: Final = 0.35  # of solids that are of the other material
MIRRORS: Final = ("metal", "glass")
_BESIDE: Final = 0.7  # m from a mover's track to what stands
_AWAY: Final = 1.5  # m from it to start, goal and other tracks
_TRIES: Final = 50  # of tracks of movers


def make_hard_map(number: int) -> RandomMap:
    """Make the hard map of a number, at least 0; families come by turn."""
    family = HARD_FAMILIES[number % len(HARD_FAMILIES)]
    maker = MapMaker(number, family, generator_for(number, "hard map"))
    return maker.make(_DRAWERS[family])


def _mixed(material: str) -> Drawer:
    """Return what draws a map of another family, with a share of another material."""

    def draw(maker: MapMaker) -> Iterator[Solid]:
        family = MIXED[int(maker.between(0, len(MIXED)))]
        if maker.between(0, 1) < 0.5:
            maker.fence_material = material
        for solid in DRAWERS[family](maker):
            is_other = maker.between(0, 1) < SHARE
            yield replace(solid, material=material) if is_other else solid

    return draw


def _mirrors(maker: MapMaker) -> Iterator[Solid]:
    """Yield plates that are mirrors, among boxes."""

    def plate(place: tuple[float, float]) -> Solid:
        length, thick = maker.between(0.8, 3.5), maker.between(0.02, 0.1)
        material = MIRRORS[int(maker.between(0, 2))]
        return Block(*place, length, thick, maker.between(0, np.pi), material)

    yield from maker.scattered(int(maker.between(4, 9)), plate)
    yield from DRAWERS["boxes"](maker)


def _poles(maker: MapMaker) -> Iterator[Solid]:
    def pole(place: tuple[float, float]) -> Solid:
        return Disc(*place, maker.between(0.015, 0.04))

    return maker.scattered(int(maker.between(20, 45)), pole)


def _movers(maker: MapMaker) -> Iterator[Solid]:
    """Yield boxes, and add movers that drive between them."""
    solids = list(DRAWERS["boxes"](maker))
    for _ in range(int(maker.between(1, 4))):
        if (mover := _mover(maker, solids)) is not None:
            maker.movers = (*maker.movers, mover)
    maker.has_fence = True  # it might stand on a track
    return iter(solids)


def _mover(maker: MapMaker, solids: list[Solid]) -> Mover | None:
    """Draw a mover whose track is free; None if there is no room."""
    ends = np.array([maker.start, maker.goal])
    for _ in range(_TRIES):
        x, y = (maker.between(-s, s) for s in (HALF_LENGTH, HALF_WIDTH))
        yaw, length = maker.between(-np.pi, np.pi), maker.between(2.0, 5.0)
        mover = Mover(x, y, yaw, length, maker.between(0.2, 0.5))
        track = mover.track()
        gaps = [solid.distances(track).min() for solid in solids]
        others = np.concatenate([ends, *(other.track() for other in maker.movers)])
        away = np.hypot(*(track[:, None] - others).transpose(2, 0, 1)).min()
        if min(gaps, default=np.inf) > _BESIDE and away > _AWAY:
            return mover
    return None


_DRAWERS: Final[dict[str, Drawer]] = {
    "metal": _mixed("metal"),
    "glass": _mixed("glass"),
    "mirrors": _mirrors,
    "poles": _poles,
    "thin": DRAWERS["thin"],
    "movers": _movers,
}
HARD_FAMILIES: Final = tuple(_DRAWERS)
# with things that sensors do not see, which a robot may therefore touch once each
UNSEEN_FAMILIES: Final = ("metal", "glass", "mirrors")
