"""What a town consists of: houses, what stands around them, and along the streets.

A façade is a row of bays. Each has a wall of its own material, in the plane of the
façade or recessed, and perhaps windows, behind which there is a room.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple, TypeVar

import numpy as np

T = TypeVar("T")

# Of walls: each material of the library, and how rough and even it is here: what comes
# back head-on, dB, and the rms slope of its facets, degrees. Estimates around those of
# the library.
WALLS: Final = {
    "brick_rough": ("brick", -17.0, 11.0),
    "brick_plain": ("brick", -21.0, 6.5),
    "brick_painted": ("brick", -26.0, 4.3),
    "render_rough": ("concrete", -19.0, 8.0),
    "render_even": ("concrete", -27.0, 3.8),
    "stone": ("concrete", -16.0, 12.0),
}
PALETTES: Final = (
    ("brick_rough", "brick_plain", "brick_plain"),
    ("brick_plain", "brick_painted", "brick_painted"),
    ("render_rough", "render_even", "render_even"),
    ("stone", "stone", "brick_rough"),
)
SIDE: Final = 200.0  # m, of the town
SPACING: Final = 66.0  # m between streets
STOREY: Final = 2.7  # m
SILL, LINTEL = 0.9, 2.2  # m over the floor of each storey
WALL: Final = 0.3  # m thick
ROOM: Final = 3.0  # m deep, behind windows
RECESSES: Final = (0.0, 0.0, 0.0, 0.1, 0.3, 0.8)  # m


class Frame(NamedTuple):
    """A place on the ground with a direction: m and rad, map frame."""

    x: float
    y: float
    yaw: float = 0.0

    def moved(self, ahead: float, left: float, yaw: float = 0.0) -> "Frame":
        """Return the frame that is so far off, m, and turned further, rad."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y = self.x + c * ahead - s * left, self.y + s * ahead + c * left
        return Frame(x, y, self.yaw + yaw)


class Site:
    """A map that grows object by object, each a line of its file.

    Attributes:
        rng: The generator of all draws.
        lines: A line for each object so far.
        lean: By how much the outer streets lean, along x and along y;
            and where these cross, m, map frame.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        """Begin without any."""
        self.rng = rng
        self.lines: list[str] = []
        self.lean = (0.0, 0.0)
        self.middle = (0.0, 0.0)
        self._numbers: Counter[str] = Counter()

    def between(self, low: float, high: float) -> float:
        """Draw a number."""
        return float(self.rng.uniform(low, high))

    def happens(self, probability: float) -> bool:
        """Draw whether something is so."""
        return float(self.rng.random()) < probability

    def one_of(self, choices: Sequence[T]) -> T:
        """Draw one of some choices; one that is there twice is twice as likely."""
        return choices[int(self.rng.integers(len(choices)))]

    def put(
        self,
        name: str,
        size: Sequence[float],
        frame: Frame,
        height: float,
        material: str,
        *,
        storeys: int | None = None,
    ) -> None:
        """Add an object.

        Args:
            name: Its name, to which a number is added.
            size: Three lengths of a box, radius and height of a cylinder, or the radius
                of a sphere, m.
            frame: Where its middle is, and its direction.
            height: That of its middle over the ground, m.
            material: Name of its material.
            storeys: How many of it are above each other, one in each storey.
        """
        frame = self._leaning(frame)
        if max(abs(frame.x), abs(frame.y)) > SIDE / 2:
            return
        self._numbers[name] += 1
        shape = {1: "sphere", 2: "cylinder", 3: "box"}[len(size)]
        lengths = ", ".join(f"{each:.3f}" for each in size)
        if len(size) > 1:
            lengths = f"[{lengths}]"
        line = f"name: {name}_{self._numbers[name]}, {shape}: {lengths}, position: "
        line += f"[{frame.x:.3f}, {frame.y:.3f}, {height:.3f}], material: {material}"
        if shape == "box":
            line += f", yaw_deg: {math.degrees(frame.yaw):.2f}"
        if storeys is not None:
            line += f", repeat: {{count: {storeys}, step: [0, 0, {STOREY:g}]}}"
        self.lines.append(f"  - {{{line}}}\n")

    def _leaning(self, frame: Frame) -> Frame:
        """Return where a frame is in a town whose outer streets lean."""
        x, y = frame.x - self.middle[0], frame.y - self.middle[1]
        share = [max(min(each / SPACING, 1.0), -1.0) for each in (x, y)]
        across = [self.lean[i] * share[i] * abs(share[i]) for i in (0, 1)]
        c, s = math.cos(frame.yaw), math.sin(frame.yaw)
        # Objects turn as the street next to them, or the one that crosses it, does.
        yaw = frame.yaw - across[0] * s * s + across[1] * c * c
        return Frame(frame.x + across[0] * y, frame.y + across[1] * x, yaw)


def add_house(site: Site, middle: Frame, width: float, depth: float) -> None:
    """Add a house that looks ahead: four façades around a core."""
    storeys = 1 if site.happens(0.25) else 2
    palette = site.one_of(PALETTES)
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
            height = STOREY * storeys
            site.put("pipe", (0.05, height), pipe, height / 2, "steel")


def _add_facade(
    site: Site, side: Frame, length: float, storeys: int, palette: tuple[str, ...]
) -> None:
    """Add one façade, which looks ahead, bay by bay."""
    count = max(round(length / site.between(2.2, 3.4)), 1)
    bay = length / count
    for i in range(count):
        recess = site.one_of(RECESSES)
        place = side.moved(-WALL / 2 - recess, (i + 0.5) * bay - length / 2)
        material = site.one_of(palette)
        if not site.happens(0.55):
            height = storeys * STOREY
            site.put("wall", (WALL, bay, height), place, height / 2, material)
            continue
        # The wall below the windows of a storey is above those of the one before.
        between = STOREY - LINTEL + SILL
        size, middle = (WALL, bay, between), SILL - between / 2
        site.put("wall", size, place, middle, material, storeys=storeys + 1)
        frame = place.moved(site.between(-0.1, 0.1), 0, site.between(-0.006, 0.006))
        size, middle = (0.02, bay, LINTEL - SILL), (SILL + LINTEL) / 2
        site.put("window", size, frame, middle, "pane", storeys=storeys)


def add_shed(site: Site, place: Frame) -> None:
    """Add a shed."""
    size = site.between(1.5, 3), site.between(1.5, 3), site.between(1.9, 2.3)
    site.put("shed", size, place, size[2] / 2, site.one_of(("boards", "steel")))


def add_boundary(site: Site, start: Frame, length: float) -> None:
    """Add a hedge, a fence, a wall or railings along a line ahead, with gaps."""
    kind = site.one_of(("hedge", "fence", "wall", "none", "none"))
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
            site.put("post", (0.1, 0.1, height), post, height / 2, "boards")
        else:
            material = site.one_of(PALETTES[0])
            site.put("garden_wall", (step, 0.22, height), middle, height / 2, material)


# Length, width, height of the body, and length and height of the cabin on it, m.
CARS: Final = (
    (4.2, 1.75, 0.75, 2.2, 0.5),
    (4.6, 1.8, 0.75, 2.3, 0.5),
    (3.7, 1.65, 0.8, 2.1, 0.55),
    (5.2, 1.95, 1.2, 3.6, 0.8),  # a van
)
CLEARANCE: Final = 0.25  # m under a car
PAINTS: Final = ("paint_even", "paint_curved", "paint_dented")


def add_car(site: Site, place: Frame) -> None:
    """Add a car that looks ahead."""
    length, width, body, cabin, top = site.one_of(CARS)
    paint = site.one_of(PAINTS)
    middle = place.moved(site.between(-0.2, 0.2), 0, site.between(-0.03, 0.03))
    site.put("car", (length, width, body), middle, CLEARANCE + body / 2, paint)
    back = middle.moved(-0.06 * length, 0)
    height = CLEARANCE + body + top / 2
    site.put("cabin", (cabin, 0.86 * width, top), back, height, "car_glass")


def add_tree(site: Site, place: Frame, largest: float = 5.0) -> None:
    """Add a tree, bare or in leaf, whose crown has at most some radius, m."""
    radius = site.between(0.3, 1.0) * largest
    height = radius + site.between(0.5, 2.5)
    stem = height + radius / 2
    site.put("trunk", (site.between(0.08, 0.25), stem), place, stem / 2, "bark")
    leaves = site.one_of(("twigs", "twigs", "sparse_foliage", "foliage"))
    # Outer twigs are thin, so that crowns have soft edges.
    for own_leaves, share in 2 * (("outer_twigs", 1.6), (leaves, 0.8)):
        off, angle = site.between(0, 0.6 * radius), site.between(0, 2 * math.pi)
        middle = place.moved(off * math.cos(angle), off * math.sin(angle))
        own = share * radius * site.between(0.6, 1.0)
        site.put("crown", (own,), middle, height + site.between(0, radius), own_leaves)


def add_bush(site: Site, place: Frame) -> None:
    """Add a bush."""
    radius = site.between(0.4, 1.1)
    leaves = site.one_of(("twigs", "foliage", "foliage", "dense_foliage"))
    site.put("bush", (1.5 * radius,), place, 0.7 * radius, "outer_twigs")
    for _ in range(2):
        middle = place.moved(site.between(-radius, radius), site.between(-0.6, 0.6))
        own = radius * site.between(0.4, 0.8)
        site.put("bush", (own,), middle, 0.8 * own, leaves)


def add_lamp(site: Site, place: Frame) -> None:
    """Add a street lamp."""
    site.put("lamp", (site.between(0.06, 0.1), 6.0), place, 3.0, "steel")


def add_furniture(site: Site, place: Frame) -> None:
    """Add a sign, a cabinet or a bin, which looks ahead more or less."""
    turned = place.moved(0, 0, site.between(-0.3, 0.3))
    kind = site.one_of(("sign", "sign", "cabinet", "bin", "bollards"))
    if kind == "sign":
        site.put("pole", (0.04, 2.6), place, 1.3, "steel")
        site.put("sign", (0.01, 0.6, 0.6), turned.moved(0.05, 0), 2.3, "steel")
    elif kind == "cabinet":
        site.put("cabinet", (0.4, 1.1, 1.2), turned, 0.6, "steel")
    elif kind == "bin":
        site.put("bin", (0.25, 0.9), place, 0.45, "steel")
    else:
        for i in range(3):
            site.put("bollard", (0.06, 1.0), place.moved(0, 1.5 * i), 0.5, "steel")
