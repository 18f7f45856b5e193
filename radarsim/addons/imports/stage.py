"""Worlds of Stage: floor plans, boxes and blocks of their models.

Source: the manual of Stage 4. A body is scaled to the size of its model, a floor plan
so that its outermost dark pixels touch the edges; models in a model stand on top of it.
A body may consist of blocks, which are polygons with a bottom and a top.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from radarsim.addons.imports.commands import ImportOptions
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.plan_picture import (
    Mask,
    Plan,
    add_floor,
    add_walls,
    place_start,
    read_picture,
)
from radarsim.addons.imports.source_file import find_in, rounded
from radarsim.addons.imports.stage_reader import Entity, Property, read_stage
from radarsim.errors import ForeignFileError
from radarsim.geometry import Floats, Pose3
from radarsim.validation import short_repr
from radarsim.xml_reader import parse_numbers, wrong

MAX_POINTS: Final = 1000
LARGEST: Final = 1e9  # of all numbers; their differences are at least its inverse


@dataclass(frozen=True, eq=False)
class Block:
    """A block.

    Attributes:
        points: (N, 2) corners, m.
        bottom: Its lowest z, m.
        top: Its highest z, m.
        path: The file that has it.
        line: Where it does.
    """

    points: Floats
    bottom: float
    top: float
    path: Path
    line: int

    def is_upright_rectangle(self) -> bool:
        """Return whether it is a rectangle along the axes."""
        low, high = self.points.min(0), self.points.max(0)
        at_edge = np.isclose(self.points, low) | np.isclose(self.points, high)
        moved = ~np.isclose(self.points, np.roll(self.points, 1, axis=0))
        return len(self.points) == 4 and bool(
            at_edge.all() and (moved.sum(1) == 1).all()
        )

    def rasterize(self, cells: int) -> Mask:
        """Return which cells of its bounding rectangle have their middle in it.

        Args:
            cells: Number of rows, and of columns; the first row is the northernmost.
        """
        low, high = self.points.min(0), self.points.max(0)
        steps = (np.arange(cells) + 0.5) / cells
        x = low[0] + steps * (high[0] - low[0])
        y = (high[1] - steps * (high[1] - low[1]))[:, None]
        inside = np.zeros((cells, cells), bool)
        ends = np.roll(self.points, -1, axis=0)
        for (x0, y0), (x1, y1) in zip(self.points, ends, strict=True):
            # even-odd rule: a middle is inside if an odd number of edges is east of it
            if y0 != y1:  # an edge that a line to the east may cross
                crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
                inside ^= ((y0 > y) != (y1 > y)) & (x < crossing)
        return inside


def _scale_blocks(
    blocks: list[Block], size: tuple[float, float, float]
) -> Iterable[Block]:
    """Yield blocks scaled so that they fill a model of a size together."""
    points = np.concatenate([block.points for block in blocks])
    low, high = points.min(0), points.max(0)
    factor = np.array(size[:2]) / (high - low)
    tops = [block.top for block in blocks]
    height = size[2] / (max(tops) - min(block.bottom for block in blocks))
    for block in blocks:
        corners = (block.points - (low + high) / 2) * factor
        bottom, top = block.bottom * height, block.top * height
        yield Block(corners, bottom, top, block.path, block.line)


def _read_block(block: Entity) -> Block:
    count = _numbers(block, block.get("points"), 1)[0]
    if not (count.is_integer() and 3 <= count <= MAX_POINTS):
        text = f"a block of {count:g} points, expected 3 to {MAX_POINTS}"
        raise wrong(block.path, block.line, text)
    names = [f"point[{number}]" for number in range(int(count))]
    points = np.array([_numbers(block, block.get(name), 2) for name in names])
    height = block.get("z")
    bottom, top = _numbers(block, height, 2) if height else (0.0, 1.0)
    if max(abs(bottom), abs(top), np.abs(points).max()) > LARGEST:
        text = f"a block, expected coordinates of at most {LARGEST:g}"
        raise wrong(block.path, block.line, text)
    # Blocks are scaled to the size of their model, which divides by their own.
    if min(top - bottom, *np.ptp(points, axis=0)) < 1 / LARGEST:
        raise wrong(block.path, block.line, "a flat block, expected one with a volume")
    return Block(points, bottom, top, block.path, block.line)


def _numbers(block: Entity, given: Property | None, count: int) -> list[float]:
    if given is None:
        text = "a block, expected as many point[0], point[1], ... as 'points' counts"
        raise wrong(block.path, block.line, text)
    return parse_numbers(given.path, given.line, given.text, count)


MAX_LEVELS: Final = 50  # of models in each other
MAX_MODELS: Final = 50_000
DEFAULT_SIZE: Final = (0.4, 0.4, 1.0)  # m
DARK: Final = 127  # brightness of pixels that are occupied
BOUNDARY: Final = 0.05  # m, thickness
CELLS: Final = 50  # along the sides of a polygon that becomes boxes
ROBOTS: Final = ("position",)
IGNORED: Final = ("block", "window", "speech")


class _Body(NamedTuple):
    """Where the body of a model is, and what it is called."""

    model: Entity
    name: str
    size: tuple[float, float, float]
    centre: Pose3


def import_stage(path: Path, options: ImportOptions) -> ImportedMap:
    """Import a world.

    Args:
        path: The file.
        options: What it does not tell.

    Raises:
        ForeignFileError: If it cannot be read, or is no world file.
    """
    imported = ImportedMap(path, options)
    world = read_stage(path, options.model_path, imported.notes)
    importer = _Importer(path, imported)
    for name in ("unit_length", "unit_angle"):
        if (unit := world.get(name)) and unit.text not in ("m", "meters", "degrees"):
            importer.note(unit, f"{name} is not read, expected metres and degrees")
    for child in world.children:
        importer.add(child, Pose3(0.0, 0.0, 0.0), 0)
    importer.place_start()
    return imported


class _Importer:
    """Adds the models of a world to a map."""

    def __init__(self, path: Path, imported: ImportedMap) -> None:
        self._folders = (path.parent, *imported.options.model_path)
        self._path = path
        self._map = imported
        self._count = 0
        self._has_robot = False
        self._ground: tuple[Mask, Plan] | None = None  # of the first floor plan

    def note(self, place: Entity | Property | Block, text: str) -> None:
        """Note what is left out."""
        self._map.note(place.path, place.line, text)

    def add(self, model: Entity, outer: Pose3, level: int) -> None:
        """Add a model that stands on something, and those on it."""
        self._count += 1
        if level > MAX_LEVELS or self._count > MAX_MODELS:
            text = f"more than {MAX_LEVELS} levels or {MAX_MODELS} models"
            raise wrong(model.path, model.line, text)
        kind = model.root_kind
        if kind in IGNORED:
            return
        pose = outer.compose(_pose(model.get("pose")))
        if kind in ROBOTS:
            text = f"the robot {short_repr(_name(model))} is left out"
            if not self._has_robot and self._map.options.start is None:
                self._map.start = (pose.x, pose.y, 0.0, math.degrees(pose.yaw))
                text += ", and the start is where it is"
            self._has_robot = True
            self.note(model, text)
            return
        if kind != "model":
            text = f"the {short_repr(model.kind)} is left out, expected a model"
            self.note(model, text)
            self._map.count_model(["of an unknown kind"])
            return
        size = _size(model.get("size"))
        self._add_body(model, size, pose)
        # In Stage, models stand on the top of the model that they are in.
        is_stacked = _is_true(model.get("stack_children"), default=True)
        top = pose.compose(Pose3(0.0, 0.0, size[2])) if is_stacked else pose
        for child in model.all_children():
            self.add(child, top, level + 1)

    def place_start(self) -> None:
        """Place the start in a floor plan, if there is no robot."""
        if self._has_robot or self._ground is None:
            return
        if not place_start(self._map, *self._ground):
            text = f"{self._path}:1: no free pixel in the floor plan, expected --start"
            raise ForeignFileError(text)

    def _add_body(
        self, model: Entity, size: tuple[float, float, float], pose: Pose3
    ) -> None:
        if not _is_true(model.get("obstacle_return"), default=True):
            name = short_repr(_name(model))
            if not _is_scanned(model):
                text = f"the model {name} is left out: robots drive through it"
                self.note(model, text)
                self._map.count_model(["with obstacle_return 0"])
                return
            self.note(model, f"robots do not drive through the model {name} here")
        self._map.count_model([], 1)
        centre = pose.compose(_pose(model.get("origin")))
        body = _Body(model, _name(model), size, centre)
        children = model.all_children()
        blocks = [_read_block(each) for each in children if each.root_kind == "block"]
        if bitmap := model.get("bitmap"):
            self._add_plan(body, bitmap)
        elif blocks:
            for block in _scale_blocks(blocks, size):
                self._add_block(body, block)
        else:
            self._add_box(body, size, Pose3(0.0, 0.0, size[2] / 2))
        if old := model.get("blocks"):
            self.note(old, "blocks that are numbered are left out, expected block(...)")

    def _add_plan(self, body: _Body, bitmap: Property) -> None:
        """Add the walls of a floor plan, and a floor if it is the first one."""
        file = find_in(self._folders, bitmap.text)
        if file is None or not file.is_file():
            expected = "expected a picture in the world's folder or a --model-path"
            text = f"{short_repr(bitmap.text)}, {expected}"
            raise wrong(bitmap.path, bitmap.line, text)
        brightness, is_opaque = read_picture(file)
        dark = is_opaque & (brightness <= DARK)
        if not dark.any():
            raise wrong(bitmap.path, bitmap.line, "a picture without dark pixels")
        # Stage crops a picture to what is dark in it, and scales that to the model.
        rows, columns = (np.flatnonzero(dark.any(axis)) for axis in (1, 0))
        dark = dark[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        width, length, height = body.size
        given = body.model.get("size")
        if given is None or len(given.values) < 3:
            height = self._map.options.wall_height
        plan = _plan(dark, (width, length), body.centre)
        # One floor is enough, and it is where a place for the start is looked for.
        if self._ground is None:
            self._ground = ~dark, plan
            add_floor(self._map, dark.shape, plan)
        add_walls(self._map, dark, plan, body.name, height)
        if not _is_true(body.model.get("boundary"), default=False):
            return
        body = body._replace(name=f"{body.name}_boundary")
        for sign in (-1, 1):
            side = sign * (width + BOUNDARY) / 2
            size = (BOUNDARY, length + 2 * BOUNDARY, height)
            self._add_box(body, size, Pose3(side, 0.0, height / 2))
            side = sign * (length + BOUNDARY) / 2
            self._add_box(body, (width, BOUNDARY, height), Pose3(0.0, side, height / 2))

    def _add_block(self, body: _Body, block: Block) -> None:
        """Add a block; one that is no rectangle becomes boxes that cover it roughly."""
        low, high = block.points.min(0), block.points.max(0)
        width, length = (float(side) for side in high - low)
        height = block.top - block.bottom
        x, y = (float(each) for each in (low + high) / 2)
        middle = Pose3(x, y, block.bottom)
        if block.is_upright_rectangle():
            at = middle.compose(Pose3(0.0, 0.0, height / 2))
            self._add_box(body, (width, length, height), at)
            return
        cells = block.rasterize(CELLS)
        plan = _plan(cells, (width, length), body.centre.compose(middle))
        add_walls(self._map, cells, plan, body.name, height)
        side = max(width, length) / CELLS
        self.note(block, f"a polygon becomes boxes, to about {side:.3g} m")

    def _add_box(
        self, body: _Body, size: tuple[float, float, float], centre: Pose3
    ) -> None:
        self._map.add(body.name, {"box": rounded(size)}, body.centre.compose(centre))


def _plan(cells: Mask, size: tuple[float, float], centre: Pose3) -> Plan:
    """Return the plan of cells that cover a rectangle around a pose."""
    rows, columns = cells.shape
    corner = centre.compose(Pose3(-size[0] / 2, -size[1] / 2, 0.0))
    return Plan(size[0] / columns, size[1] / rows, corner, rows)


def _pose(given: Property | None) -> Pose3:
    """Return ``[x y z degrees]``, or ``[x y degrees]`` of Stage 2."""
    if given is None:
        return Pose3(0.0, 0.0, 0.0)
    count = 3 if len(given.values) == 3 else 4
    x, y, *z, degrees = parse_numbers(given.path, given.line, given.text, count)
    return Pose3(x, y, z[0] if z else 0.0, yaw=math.radians(degrees))


def _size(given: Property | None) -> tuple[float, float, float]:
    """Return the lengths of a model, m."""
    if given is None:
        return DEFAULT_SIZE
    count = 2 if len(given.values) == 2 else 3
    sides = parse_numbers(given.path, given.line, given.text, count)
    if min(sides) <= 0:
        text = f"size [{short_repr(given.text)[1:-1]}], expected more than 0"
        raise wrong(given.path, given.line, text)
    x, y, z = (*sides, DEFAULT_SIZE[2])[:3]
    return x, y, z


def _is_true(given: Property | None, *, default: bool) -> bool:
    return default if given is None else given.text not in ("0", "false")


def _is_scanned(model: Entity) -> bool:
    """Return whether a model says that scanners see it, in words of Stage 4 or 3."""
    seen = model.get("ranger_return")
    if seen is not None:
        return not seen.text.startswith("-")  # 0 is seen, but dark
    return _is_true(model.get("laser_return"), default=False)


def _name(model: Entity) -> str:
    name = model.get("name")
    return name.text if name and name.text else model.kind
