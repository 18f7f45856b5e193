"""A town of 200 x 200 m by its seed: streets, houses, gardens, cars and trees.

It prints the map: ``python town.py SEED > town.yaml``.

Three streets lead along x and three along y, with starts along those in the middle;
the outer ones lean against these.
Blocks between them are rows of houses with gardens, a park or a car park. The ground is
patches, which differ in what they return. All sizes and shares are estimates of a
suburb; those of materials are such that frames of a radar on a car are about as bright,
and as full, as real ones are.
"""

import math
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Final, NamedTuple

from town_objects import (
    SIDE,
    SPACING,
    WALLS,
    Frame,
    Site,
    add_boundary,
    add_bush,
    add_car,
    add_furniture,
    add_house,
    add_lamp,
    add_shed,
    add_tree,
)

from radarsim.rng import generator_for

ROADWAY: Final = 5.0  # m, half of it
PAVEMENT: Final = 8.0  # m from the middle of the street to where gardens begin
LEAN: Final = 0.22  # of the outer streets against those in the middle, at most
LANE: Final = 1.0  # m from the middle of a street to where robots start
START_STEP: Final = 15.0  # m between starts along a street
LAST_START: Final = 6  # of these steps from the middle of the map

# Backscatter of ground, dB: estimates for 77 GHz, 3 to 6 dB below the -12 to -15 dB of
# grass in the W band that are recalled, so that images show about as much as real ones.
GROUND: Final = {
    "lawn": -18.0,
    "rough_grass": -15.0,
    "soil": -24.0,
    "gravel": -19.0,
    "asphalt": -34.0,
    "old_asphalt": -30.0,
    "paving": -28.0,
}
# Power density of heights by the classes of ISO 8608, cm^3: A to C of paved roads, 16
# to 256, E to G of unpaved ones, 4096 to 65536. Which class is what is an estimate.
ROUGHNESS: Final = {
    "lawn": 16384,
    "rough_grass": 65536,
    "soil": 65536,
    "gravel": 4096,
    "asphalt": 16,
    "old_asphalt": 64,
    "paving": 256,
}
# Metal that is bent in many ways, so that what it mirrors goes everywhere: what comes
# back head-on, dB, and the rms slope of its facets, degrees. Estimates.
PAINT: Final = {
    "steel": (-18.0, 10.0),
    "paint_even": (-18.0, 14.0),
    "paint_curved": (-15.0, 18.0),
    "paint_dented": (-12.0, 22.0),
}
_OTHERS: Final = """\
  car_glass: {based_on: glass, mirror: none, backscatter_db: -20, slope_deg: 14}
  plaster: {based_on: concrete, backscatter_db: -16}
  boards: {based_on: wood}
  pane: {based_on: glass, slope_deg: 3}
  outer_twigs: {based_on: twigs, db_per_m: 0.05}
  bark: {density: opaque, backscatter_db: -9}
"""


class Block(NamedTuple):
    """The ground between streets, m: least x and y, greatest x and y."""

    left: float
    low: float
    right: float
    high: float


def town_yaml(seed: int) -> str:
    """Return the map file of a town.

    Args:
        seed: At least 0.
    """
    site = Site(generator_for(seed, "town"))
    along_x, along_y = (
        [SPACING * k + site.between(-5, 5) for k in (-1, 0, 1)] for _ in range(2)
    )
    site.put("ground", (SIDE, SIDE, 0.1), Frame(0, 0), -0.09, "lawn")
    site.lean = site.between(-LEAN, LEAN), site.between(-LEAN, LEAN)
    site.middle = along_y[1], along_x[1]
    _add_ground(site, along_x, along_y)
    for block in _blocks(along_x, along_y):
        _add_block(site, block)
    for y in along_x:
        _add_street(site, Frame(-SIDE / 2, y), along_y)
    for x in along_y:
        _add_street(site, Frame(x, -SIDE / 2, math.pi / 2), along_x)
    starts = _starts(along_x, along_y)
    return f"{_header(seed)}objects:\n{''.join(site.lines)}{starts}"


def _header(seed: int) -> str:
    walls = (
        f"  {name}: {{based_on: {base}, backscatter_db: {db:g},"
        f" slope_deg: {slope:g}}}\n"
        for name, (base, db, slope) in WALLS.items()
    )
    paint = (
        f"  {name}: {{based_on: metal, mirror: none, backscatter_db: {db:g},"
        f" specular_db: -6, slope_deg: {slope:g}}}\n"
        for name, (db, slope) in PAINT.items()
    )
    ground = (
        f"  {name}: {{density: opaque, backscatter_db: {db:g}, constant_gamma: true,"
        f" roughness_cm3: {ROUGHNESS[name]}}}\n"
        for name, db in GROUND.items()
    )
    return (
        f"# The town of seed {seed}, by radarsim new --town {seed}.\n"
        f"version: 1\nlevel: DM-Town{seed}\n"
        f"materials:\n"
        f"{''.join(walls)}{''.join(paint)}{''.join(ground)}{_OTHERS}"
    )


def _starts(along_x: list[float], along_y: list[float]) -> str:
    """Return starts along the two streets in the middle, in the right-hand lane."""
    places = [i * START_STEP for i in range(-LAST_START, LAST_START + 1)]
    poses = [(place, along_x[1] - LANE, 0) for place in places]
    poses += [(along_y[1] + LANE, place, 90) for place in places]
    lines = (
        f"  - {{name: RobotStart{i}, position: [{x:.3f}, {y:.3f}, 0],"
        f" yaw_deg: {yaw}}}\n"
        for i, (x, y, yaw) in enumerate(poses, 1)
    )
    return f"starts:\n{''.join(lines)}"


def _blocks(along_x: list[float], along_y: list[float]) -> Iterator[Block]:
    half = SIDE / 2 + PAVEMENT
    columns, rows = ([-half, *streets, half] for streets in (along_y, along_x))
    for left, right in pairwise(columns):
        for low, high in pairwise(rows):
            edge = PAVEMENT
            yield Block(left + edge, low + edge, right - edge, high - edge)


def _patch(
    site: Site, block: Block, top: float, names: tuple[str, ...], size: float
) -> None:
    """Add a patch of ground somewhere in a block."""
    sides = block.right - block.left, block.high - block.low
    length, width = (min(site.between(0.3, 1) * size, side) for side in sides)
    x = site.between(block.left + length / 2, block.right - length / 2)
    y = site.between(block.low + width / 2, block.high - width / 2)
    place = Frame(x, y)
    site.put("patch", (length, width, 0.1), place, top - 0.05, site.one_of(names))


def _add_ground(site: Site, along_x: list[float], along_y: list[float]) -> None:
    """Add streets in pieces, and repairs on them."""
    for yaw, streets in ((0.0, along_x), (math.pi / 2, along_y)):
        for middle in streets:
            start = Frame(0, 0, yaw).moved(-SIDE / 2, middle * (1 if yaw == 0 else -1))
            way = 0.0
            while way < SIDE:
                piece = min(site.between(8, 25), SIDE - way)
                place = start.moved(way + piece / 2, 0)
                # Streets that cross are not at the same height, nor are pieces.
                top = -0.012 if yaw == 0 else -0.014
                size = piece, 2 * ROADWAY, 0.1
                material = site.one_of(("asphalt", "asphalt", "old_asphalt"))
                site.put("road", size, place, top - 0.05, material)
                for side in (-1, 1):
                    size = piece, PAVEMENT - ROADWAY, 0.1
                    aside = place.moved(0, side * (PAVEMENT + ROADWAY) / 2)
                    material = site.one_of(("paving", "old_asphalt"))
                    site.put("pavement", size, aside, top - 0.058, material)
                if site.happens(0.7):
                    repair = place.moved(site.between(-3, 3), site.between(-3, 3))
                    size = site.between(0.6, 4), site.between(0.6, 2), 0.1
                    material = site.one_of(("asphalt", "old_asphalt", "paving"))
                    site.put("repair", size, repair, -0.055, material)
                way += piece


def _add_block(site: Site, block: Block) -> None:
    """Add one of the kinds of blocks."""
    kind = site.one_of(("houses", "houses", "houses", "park", "park", "cars"))
    if min(block.right - block.left, block.high - block.low) < 10:
        return
    for _ in range(7):
        _patch(site, block, -0.025, ("rough_grass", "soil", "lawn", "gravel"), 14)
    if kind == "houses":
        _add_rows(site, block)
    elif kind == "park":
        for _ in range(14):
            add_tree(site, _somewhere(site, block, 9.5), 7.0)
            add_bush(site, _somewhere(site, block))
    else:
        _add_car_park(site, block)
    for x in (block.left, block.right):
        add_boundary(site, Frame(x, block.low, math.pi / 2), block.high - block.low)


def _somewhere(site: Site, block: Block, margin: float = 1.0) -> Frame:
    """Return a place that is a margin off the edges of a block, or in its middle, m."""
    sides = (block.left, block.right), (block.low, block.high)
    x, y = (
        (low + high + max(high - low - 2 * margin, 0.0) * site.between(-1, 1)) / 2
        for low, high in sides
    )
    return Frame(x, y)


def _add_rows(site: Site, block: Block) -> None:
    """Add a row of houses along either street, and gardens between them."""
    deep = block.high - block.low
    rows = ((block.low, -1), (block.high, 1)) if deep > 35 else ((block.low, -1),)
    for y, side in rows:
        x = block.left
        while True:
            lot = site.between(11, 17)
            if x + lot > block.right:
                break
            setback, depth = site.between(5, 12), site.between(7, 10)
            width = min(site.between(6.5, 10), lot - 2)
            frame = Frame(x + lot / 2, y, side * math.pi / 2)
            if site.happens(0.7):
                add_house(site, frame.moved(-setback - depth / 2, 0), width, depth)
            _add_garden(site, frame, lot, min(deep / len(rows), 30), setback + depth)
            x += lot


def _add_garden(
    site: Site, lot: Frame, width: float, deep: float, behind: float
) -> None:
    """Add the boundaries of a lot, and what grows and stands in it.

    Args:
        site: The map.
        lot: The middle of its front, which looks to the street.
        width: m.
        deep: m.
        behind: m from its front to the back of the house.
    """
    if site.happens(0.8):
        add_boundary(site, lot.moved(0, -width / 2, math.pi / 2), width - 3)
    if deep > behind + 3:
        edge = lot.moved(-deep, width / 2, 0)
        add_boundary(site, edge, deep - behind)
        if site.happens(0.4):
            place = site.between(-width / 3, width / 3)
            add_shed(site, lot.moved(-deep + 3, place, site.between(-0.2, 0.2)))
        for add in (add_tree, add_bush, add_bush):
            if site.happens(0.7):
                back = site.between(-deep + 1, -behind - 1)
                add(site, lot.moved(back, site.between(-width / 2, width / 2)))
    if site.happens(0.5):
        add_tree(site, lot.moved(-1.5, site.between(-width / 3, width / 3)), 3.3)
    if site.happens(0.25):
        add_car(site, lot.moved(-3, width / 2 - 1.5))


def _add_car_park(site: Site, block: Block) -> None:
    """Add rows of cars on asphalt, and trees between them."""
    width, deep = block.right - block.left, block.high - block.low
    middle = Frame((block.left + block.right) / 2, (block.low + block.high) / 2)
    site.put("car_park", (width, deep, 0.1), middle, -0.07, "old_asphalt")
    for row in range(int(deep / 14)):
        for spot in range(int(width / 2.8)):
            place = Frame(block.left + 1.4 + 2.8 * spot, block.low + 5 + 14 * row)
            if site.happens(0.2):
                add_car(site, place.moved(0, 0, math.pi / 2))
        if site.happens(0.8):
            for spot in range(int(width / 12)):
                add_tree(
                    site, Frame(block.left + 6 + 12 * spot, block.low + 9 + 14 * row)
                )


def _add_street(site: Site, start: Frame, crossings: list[float]) -> None:
    """Add what stands along a street, apart from its crossings."""
    way = 2.0
    while way < SIDE - 2:
        at = way - SIDE / 2
        way += 6.0
        if min(abs(at - each) for each in crossings) < PAVEMENT + 3:
            continue
        for side in (-1, 1):
            aside = start.moved(at + SIDE / 2, side * (ROADWAY - 1.0))
            kerb = start.moved(at + SIDE / 2 + 2, side * (ROADWAY + 0.5))
            if site.happens(0.2):
                add_car(site, aside.moved(0, 0, 0 if side < 0 else math.pi))
            if site.happens(0.1):
                add_lamp(site, kerb)
            elif site.happens(0.1):
                add_furniture(site, kerb.moved(0, 0, -side * math.pi / 2))
            elif site.happens(0.15):
                add_tree(site, kerb, 1.6)


if __name__ == "__main__":
    print(town_yaml(int(sys.argv[1])), end="")
