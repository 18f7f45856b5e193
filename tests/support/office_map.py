"""Offices: rooms on both sides of a corridor."""

SIDE, CORRIDOR, WALL = 4.0, 2.4, 0.12  # m


def office_map(door: float) -> str:
    """Return the map file of six rooms of 4 by 4 m with doors of a width, m."""
    boxes = []
    for sign in (-1, 1):
        y = sign * CORRIDOR / 2
        for k in (-1, 0, 1):
            at = 0.3 * k * sign
            for low, high in ((-SIDE / 2, at - door / 2), (at + door / 2, SIDE / 2)):
                boxes.append((k * SIDE + (low + high) / 2, y, high - low, WALL))
            desk = sign * (CORRIDOR / 2 + SIDE - WALL / 2 - 0.25)
            boxes.append((k * SIDE + 0.8, desk, 1.0, 0.5))
        boxes += [(x, y + sign * SIDE / 2, WALL, SIDE) for x in (-SIDE / 2, SIDE / 2)]
    length, width = 3 * SIDE, 2 * SIDE + CORRIDOR
    for sign in (-1, 1):
        boxes.append((0.0, sign * width / 2, length + WALL, WALL))
        boxes.append((sign * length / 2, 0.0, WALL, width + WALL))
    objects = "".join(
        f"  - {{name: wall_{i}, box: [{length:.3f}, {width:.3f}, 1.4],"
        f" position: [{x:.3f}, {y:.3f}, 0.7], material: wall}}\n"
        for i, (x, y, length, width) in enumerate(boxes)
    )
    starts = "".join(
        f"  - {{name: RobotStart{k}, position: [{x:g}, 0, 0]}}\n"
        for k, x in enumerate((-5, -3.5, -2), 1)
    )
    return (
        "version: 1\nmaterials:\n  wall: {density: opaque}\nobjects:\n"
        "  - {name: floor, box: [30, 30, 0.2], position: [0, 0, -0.1],"
        f" material: wall}}\n{objects}starts:\n{starts}"
    )
