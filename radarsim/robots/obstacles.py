"""Cutting triangles with level planes."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose2
from radarsim.robots.footprint import MARGIN, NO_SEGMENTS, Footprint
from radarsim.scene.scene import Part, Scene


def slice_mesh(vertices: Floats, faces: NDArray[np.int32], height: float) -> Floats:
    """Cut a mesh at one height.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) rows of vertex numbers.
        height: z of the plane, m. A vertex in the plane counts as above it, so that
            the section of a closed mesh is closed, and a mesh that stands on the plane
            leaves no line.

    Returns:
        Line segments, (S, 2, 2) m: x and y of both ends; where the plane only grazes
        a corner, the ends are the same.
    """
    corners = vertices[faces]  # (F, 3, 3)
    above = corners[:, :, 2] >= height
    cut = above.any(axis=1) & ~above.all(axis=1)
    corners, above = corners[cut], above[cut]
    # the corner that is alone on its side goes first
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    order = (alone[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    first, others = corners[:, :1], corners[:, 1:]
    share = (height - first[..., 2:]) / (others[..., 2:] - first[..., 2:])
    ends = (first + share * (others - first))[..., :2]
    return np.ascontiguousarray(ends)


def slice_parts(parts: Iterable[Part], height: float) -> Floats:
    """Cut parts of a scene at one height.

    Args:
        parts: All of them, solid or not.
        height: z of the plane, m, map frame.

    Returns:
        The sections one after the other, (S, 2, 2) m: x and y of both ends.
    """
    cuts = [slice_mesh(part.vertices, part.faces, height) for part in parts]
    return np.concatenate([NO_SEGMENTS, *cuts])


# Section from robots.obstacles.
# The lines on the floor that a robot cannot cross: sections of all solid things.

# m above the floor: the lowest is that of a P3AT's bumpers, the highest the top of what
# it carries. Something level and thin between two of them is not met.
BUMPER_HEIGHTS = (0.058, 0.15, 0.25, 0.35, 0.45)

_SHORTEST = 1e-9  # m; a shorter line has no direction
_SEARCH_STEP = 0.05  # m between the places that are tried
_ELBOW_ROOM = 0.01  # m that such a place leaves around the footprint


def _all_open(places: Floats) -> NDArray[np.bool_]:
    return np.ones(len(places), np.bool_)


class Body(Protocol):
    """Something with a footprint that stands on the floor, such as a robot."""

    @property
    def pose(self) -> Pose2:
        """Where it stands."""
        ...

    @property
    def footprint(self) -> Footprint:
        """What it covers of the floor."""
        ...


class Obstacles:
    """Everything solid on one floor.

    These are surfaces: a footprint that fits between them is clear, be it inside a box.

    Attributes:
        segments: (S, 2, 2) m, x and y of both ends, map frame; those that are mere
            points are left out.
        floor: Height of the floor that they are met on, m.
    """

    def __init__(self, segments: Floats = NO_SEGMENTS, *, floor: float = 0.0) -> None:
        lengths = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
        self.segments = segments[lengths > _SHORTEST]
        self.floor = floor
        self._tree = shapely.STRtree(shapely.linestrings(self.segments))

    @classmethod
    def from_scene(cls, scene: Scene, *, floor: float = 0.0) -> "Obstacles":
        """Cut the solid parts of a scene at the bumpers' heights above a floor."""
        return cls.from_parts(scene.parts, floor=floor)

    @classmethod
    def from_parts(cls, parts: Iterable[Part], *, floor: float = 0.0) -> "Obstacles":
        """Cut the solid ones of some parts at the bumpers' heights above a floor."""
        cuts = [
            slice_mesh(part.vertices, part.faces, floor + height)
            for part in parts
            if part.material.solid
            for height in BUMPER_HEIGHTS
        ]
        return cls(np.concatenate([NO_SEGMENTS, *cuts]), floor=floor)

    def near(self, x: float, y: float, reach: float) -> Floats:
        """Give the segments within ``reach`` m of a point, in their own order."""
        point = shapely.Point(x, y)
        found = self._tree.query(point, predicate="dwithin", distance=reach)
        near: Floats = self.segments[np.sort(found)]
        return near

    def clear(
        self, footprint: Footprint, pose: Pose2, others: Sequence[Body] = ()
    ) -> bool:
        """Tell whether a footprint fits at a pose, free of obstacles and of others."""
        walls = self.near(pose.x, pose.y, footprint.radius)
        return _fits(footprint, pose, walls, others)

    def nearest_free_pose(
        self,
        footprint: Footprint,
        pose: Pose2,
        others: Sequence[Body] = (),
        *,
        within: float = 1.0,
        is_open: Callable[[Floats], NDArray[np.bool_]] = _all_open,
    ) -> Pose2 | None:
        """Find the nearest pose of the same yaw at which a footprint fits.

        Args:
            footprint: What is to be placed.
            pose: The pose asked for; it is the answer if it is clear.
            others: What stands there already.
            within: How far to look, m.
            is_open: Asked which of (N, 2) places, m, are such as to stand in.

        Returns:
            The pose, to 0.05 m, touching nothing; None if there is none. Of places
            equally far away it is the first counter-clockwise from the map's x axis.
        """
        here = np.array([[pose.x, pose.y]])
        if self.clear(footprint, pose, others) and is_open(here)[0]:
            return pose
        roomy = Footprint(
            footprint.length + 2 * _ELBOW_ROOM, footprint.width + 2 * _ELBOW_ROOM
        )
        walls = self.near(pose.x, pose.y, roomy.radius + within)
        places = here + _outward(within)
        outlines = [other.footprint.outline(other.pose) for other in others]
        lines = np.concatenate([walls, *outlines])
        places = places[~_meet_any(roomy.outline(pose)[:, 0] - here, places, lines)]
        for x, y in places[is_open(places)].tolist():
            place = Pose2(x, y, pose.yaw)
            if _fits(roomy, place, walls, others):
                return place
        return None


def _fits(
    footprint: Footprint, pose: Pose2, walls: Floats, others: Sequence[Body]
) -> bool:
    if footprint.contact(pose, walls).gap <= MARGIN:
        return False
    return not any(_overlap(footprint, pose, other) for other in others)


def _overlap(footprint: Footprint, pose: Pose2, other: Body) -> bool:
    apart = math.hypot(other.pose.x - pose.x, other.pose.y - pose.y)
    if apart > footprint.radius + other.footprint.radius:
        return False
    sides = other.footprint.outline(other.pose)
    # no side of the other reaches in: it is apart, or all around
    return footprint.contact(pose, sides).gap <= MARGIN or other.footprint.covers(
        other.pose, pose.x, pose.y
    )


def _meet_any(corners: Floats, places: Floats, walls: Floats) -> NDArray[np.bool_]:
    """Tell at which of many places a shape meets a wall; quicker than one by one.

    Args:
        corners: (C, 2) m, of the shape around its place.
        places: (N, 2) m.
        walls: (S, 2, 2) m.
    """
    shapes = shapely.polygons(places[:, None] + corners)
    lines = shapely.STRtree(shapely.linestrings(walls))
    meeting = np.zeros(len(places), np.bool_)
    meeting[lines.query(shapes, predicate="intersects")[0]] = True
    return meeting


@cache
def _outward(within: float) -> Floats:
    """Give places in rings around (0, 0), the innermost first, (N, 2) m."""
    return np.array(list(_rings(within))).reshape(-1, 2)


def _rings(within: float) -> Iterator[tuple[float, float]]:
    for ring in range(1, int(within / _SEARCH_STEP + 1e-9) + 1):
        radius = ring * _SEARCH_STEP
        places = math.ceil(2 * math.pi * ring)
        for k in range(places):
            angle = 2 * math.pi * k / places
            yield radius * math.cos(angle), radius * math.sin(angle)
