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
    return _map_file(boxes, [(-5, 0), (-3.5, 0), (-2, 0)])


def row_of_rooms(count: int = 7, side: float = 2.2, depth: float = 3.0) -> str:
    """Return the map file of equal rooms on both sides of a corridor.

    Robots start in the second, third and fourth room of one side. From inside all rooms
    look the same; the ends of the corridor tell which is which.
    """
    door, length = 1.2, count * side
    boxes = []
    for sign in (-1, 1):
        y = sign * side / 2
        for k in range(count):
            low, high = k * side - length / 2, (k + 1) * side - length / 2
            middle = (low + high) / 2
            for a, b in ((low, middle - door / 2), (middle + door / 2, high)):
                boxes.append(((a + b) / 2, y, b - a, WALL))
            if k:
                boxes.append((low, y + sign * depth / 2, WALL, depth))
        boxes.append((0.0, y + sign * depth, length + WALL, WALL))
        boxes.append((sign * length / 2, 0.0, WALL, 2 * depth + side + WALL))
    starts = [((k + 0.5) * side - length / 2, (side + depth) / 2) for k in (1, 2, 3)]
    return _map_file(boxes, starts)


def _map_file(
    boxes: list[tuple[float, float, float, float]], starts: list[tuple[float, float]]
) -> str:
    """Return the map file of walls, x, y, length and width, and of starts, all in m."""
    objects = "".join(
        f"  - {{name: wall_{i}, box: [{length:.3f}, {width:.3f}, 1.4],"
        f" position: [{x:.3f}, {y:.3f}, 0.7], material: wall}}\n"
        for i, (x, y, length, width) in enumerate(boxes)
    )
    names = "".join(
        f"  - {{name: RobotStart{k}, position: [{x:g}, {y:g}, 0]}}\n"
        for k, (x, y) in enumerate(starts, 1)
    )
    return (
        "version: 1\nmaterials:\n  wall: {density: opaque}\nobjects:\n"
        "  - {name: floor, box: [30, 30, 0.2], position: [0, 0, -0.1],"
        f" material: wall}}\n{objects}starts:\n{names}"
    )
