"""Houses whose façades differ from bay to bay, and what stands around them.

A façade is a row of bays. Each has a wall of its own material, in the plane of the
façade or recessed, and perhaps windows, behind which there is a room.
"""

import math
from typing import Final

from radarsim.generators.town.site import Frame, Site

# Of walls: each material of the library, and how rough and even it is here: what comes
# back head-on, dB, and the rms slope of its facets, degrees. Estimates around those of
# the library.
WALLS: Final = {
    "brick_rough": ("brick", -14.0, 6.0),
    "brick_plain": ("brick", -18.0, 3.0),
    "brick_painted": ("brick", -23.0, 1.5),
    "render_rough": ("concrete", -16.0, 4.0),
    "render_even": ("concrete", -24.0, 1.2),
    "stone": ("concrete", -13.0, 9.0),
}
PALETTES: Final = (
    ("brick_rough", "brick_plain", "brick_plain"),
    ("brick_plain", "brick_painted", "brick_painted"),
    ("render_rough", "render_even", "render_even"),
    ("stone", "stone", "brick_rough"),
)
STOREY: Final = 2.7  # m
SILL, LINTEL = 0.9, 2.2  # m over the floor of each storey
WALL: Final = 0.3  # m thick
ROOM: Final = 3.0  # m deep, behind windows
RECESSES: Final = (0.0, 0.0, 0.0, 0.1, 0.3, 0.8)  # m


def add_house(site: Site, middle: Frame, width: float, depth: float) -> None:
    """Add a house that looks ahead: four façades around a core."""
    storeys = 1 if site.happens(0.25) else 2
    palette = PALETTES[int(site.rng.integers(len(PALETTES)))]
    sides = ((depth, width), (width, depth), (depth, width), (width, depth))
    for quarter, (off, length) in enumerate(sides):
        side = middle.moved(0, 0, quarter * math.pi / 2).moved(off / 2, 0)
        _add_facade(site, side, length, storeys, palette)
    core = [depth - 2 * ROOM, width - 2 * ROOM, STOREY * storeys]
    if min(core) > 0.5:
        site.put("core", core, middle, core[2] / 2, "plaster")
    for corner in (-1, 1):
        if site.happens(0.6):
            pipe = middle.moved(depth / 2 + 0.06, corner * (width / 2 - 0.2))
            site.put(
                "pipe", (0.05, STOREY * storeys), pipe, STOREY * storeys / 2, "steel"
            )


def _add_facade(
    site: Site, side: Frame, length: float, storeys: int, palette: tuple[str, ...]
) -> None:
    """Add one façade, which looks ahead, bay by bay."""
    count = max(round(length / site.between(2.2, 3.4)), 1)
    bay = length / count
    for i in range(count):
        recess = RECESSES[int(site.rng.integers(len(RECESSES)))]
        place = side.moved(-WALL / 2 - recess, (i + 0.5) * bay - length / 2)
        material = site.one_of(palette)
        if not site.happens(0.55):
            height = storeys * STOREY
            site.put("wall", (WALL, bay, height), place, height / 2, material)
            continue
        # What is below the windows of a storey is above those of the one before.
        between = STOREY - LINTEL + SILL
        site.put(
            "wall",
            (WALL, bay, between),
            place,
            SILL - between / 2,
            material,
            storeys=(storeys + 1, STOREY),
        )
        frame = place.moved(site.between(-0.1, 0.1), 0, site.between(-0.006, 0.006))
        site.put(
            "window",
            (0.02, bay, LINTEL - SILL),
            frame,
            (SILL + LINTEL) / 2,
            "glass",
            storeys=(storeys, STOREY),
        )


def add_shed(site: Site, place: Frame) -> None:
    """Add a shed."""
    size = site.between(1.5, 3), site.between(1.5, 3), site.between(1.9, 2.3)
    site.put("shed", size, place, size[2] / 2, site.one_of(("boards", "steel")))


def add_boundary(site: Site, start: Frame, length: float) -> None:
    """Add a hedge, a fence, a wall or railings along a line ahead, with gaps."""
    kind = site.one_of(("hedge", "hedge", "fence", "wall", "none"))
    height = {"hedge": 1.6, "fence": 1.5, "wall": 0.9, "none": 0.0}[kind]
    height *= site.between(0.7, 1.2)
    step = {"hedge": 2.5, "fence": 1.8, "wall": 4.0, "none": length}[kind]
    leaves = site.one_of(("hedge", "foliage", "dense_foliage"))
    for i in range(int(length / step)):
        middle = start.moved((i + 0.5) * step, 0)
        if kind == "none" or site.happens(0.12):
            continue
        if kind == "hedge":
            own = height * site.between(0.85, 1.1)
            size = step, site.between(0.5, 0.9), own
            site.put("hedge", size, middle, own / 2, leaves)
        elif kind == "fence":
            site.put("fence", (step, 0.03, height), middle, height / 2 + 0.05, "boards")
            post = start.moved(i * step, 0)
            site.put("post", (0.1, 0.1, height), post, height / 2, "concrete")
        else:
            material = site.one_of(PALETTES[0])
            site.put("garden_wall", (step, 0.22, height), middle, height / 2, material)
