"""What stands along streets and in gardens: cars, trees, lamps, signs."""

import math
from typing import Final

from radarsim.generators.town.site import Frame, Site

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
    length, width, body, cabin, top = CARS[int(site.rng.integers(len(CARS)))]
    paint = site.one_of(PAINTS)
    middle = place.moved(site.between(-0.2, 0.2), 0, site.between(-0.03, 0.03))
    site.put("car", (length, width, body), middle, CLEARANCE + body / 2, paint)
    back = middle.moved(-0.06 * length, 0)
    height = CLEARANCE + body + top / 2
    site.put("cabin", (cabin, 0.86 * width, top), back, height, "car_glass")


def add_tree(site: Site, place: Frame) -> None:
    """Add a tree, bare or in leaf."""
    height, radius = site.between(2.0, 4.0), site.between(0.9, 2.0)
    stem = height + radius / 2
    site.put("trunk", (site.between(0.08, 0.25), stem), place, stem / 2, "bark")
    leaves = site.one_of(("twigs", "twigs", "sparse_foliage", "foliage"))
    for _ in range(2):
        off, angle = site.between(0, 0.6 * radius), site.between(0, 2 * math.pi)
        middle = place.moved(off * math.cos(angle), off * math.sin(angle))
        own = radius * site.between(0.7, 1.0)
        site.put("crown", (own,), middle, height + site.between(0, radius), leaves)


def add_bush(site: Site, place: Frame) -> None:
    """Add a bush."""
    radius = site.between(0.4, 1.1)
    leaves = site.one_of(("twigs", "foliage", "foliage", "dense_foliage"))
    site.put("bush", (radius,), place, 0.7 * radius, leaves)


def add_lamp(site: Site, place: Frame) -> None:
    """Add a street lamp."""
    site.put("lamp", (site.between(0.06, 0.1), 6.0), place, 3.0, "steel")


def add_furniture(site: Site, place: Frame) -> None:
    """Add a sign, a cabinet or a bin, which looks ahead more or less."""
    turned = place.moved(0, 0, site.between(-0.3, 0.3))
    kind = site.one_of(("sign", "sign", "cabinet", "bin", "bollards"))
    if kind == "sign":
        site.put("pole", (0.04, 2.6), place, 1.3, "steel")
        site.put("sign", (0.01, 0.6, 0.6), turned.moved(0.05, 0), 2.3, "metal")
    elif kind == "cabinet":
        site.put("cabinet", (0.4, 1.1, 1.2), turned, 0.6, "steel")
    elif kind == "bin":
        site.put("bin", (0.25, 0.9), place, 0.45, "steel")
    else:
        for i in range(3):
            site.put("bollard", (0.06, 1.0), place.moved(0, 1.5 * i), 0.5, "steel")
