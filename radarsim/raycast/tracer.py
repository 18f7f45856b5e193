"""Rays through a scene: what they meet, sorted and settled.

Theory of operation
===================
One compiled loop, ``following``, takes one ray after the other. ``embree`` lists the
surfaces that the ray meets, ``penetration`` walks the sorted list.

Rule 1: which volumes contain the start of a ray is not deduced from what is ahead, as
an opaque wall may hide the exit. Where the start is in a volume's box, the same line
is looked at backwards, through everything: what was entered there and not left again
is around the ray. As it is the same line, no surface is counted on both sides of the
start, or on none, and the sum of all crossings is zero, also for a ray that starts on
a face or runs along an edge.
Rule 2: robots are upright boxes outside Embree: they move, and the scene stays sealed.
Rule 3: coordinates count from the middle of the scene, so that they are small.
"""

import functools
from collections.abc import Sequence
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast.attenuation import EVENT, EventKind
from radarsim.raycast.crossings import CROSSING
from radarsim.raycast.embree import EmbreeScene, Mesh
from radarsim.raycast.intersect import is_anything_opaque
from radarsim.raycast.material_table import (
    MaterialTable,
    find_volumes,
    middle_of,
    tabulate,
)
from radarsim.raycast.propagate import trace_rays
from radarsim.raycast.rays import (
    DEFAULT_CLASSES,
    Event,
    RayClass,
    Rays,
    Traces,
    columns_of,
    reject_ray,
)
from radarsim.raycast.robot_boxes import NO_BOXES, Boxes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box

FIRST_ROOM: Final = 512  # surfaces on one ray; a call that meets more is made again


class Tracer:
    """Casts rays into a sealed scene.

    Attributes:
        parts: Parts of the scene; the air, if any, comes last, without surfaces.
        rain_rate: (P,) rain in each part, mm/h; rain in the air falls everywhere.
        has_rain: Whether it rains anywhere.
    """

    def __init__(self, parts: Sequence[Part], air: Material | None = None) -> None:
        """Build the scene.

        Args:
            parts: What there is.
            air: What fills the rest, and the parts; None for nothing.

        Raises:
            EngineError: If Embree cannot take a part, or a penetrable one encloses
                nothing and is no sheet.
        """
        nothing = np.zeros((0, 3), np.float64), np.zeros((0, 3), np.int32)
        filling = [] if air is None else [Part("air", air, *nothing)]
        self.parts = (*parts, *filling)
        self.rain_rate = np.array(
            [part.material.rain for part in self.parts], np.float64
        )
        self.has_rain = bool(self.rain_rate.any())
        self._middle = middle_of(parts)
        self._volumes = find_volumes(parts, self._middle)
        self._air = air
        self._tolls: dict[tuple[RayClass, ...], MaterialTable] = {}
        self._scene = EmbreeScene(
            [Mesh(part.vertices - self._middle, part.faces) for part in parts]
        )
        self._room = FIRST_ROOM
        self._events_of_a_ray = 4  # as many as a call has needed on average

    def densities(self, kind: RayClass) -> tuple[Floats, float]:
        """Give what rays of a kind lose per metre in each part, (P,), and in air."""
        tolls = self._tolls_of((kind,))
        density: Floats = tolls.density[0]
        return density, float(tolls.air[0])

    @property
    def air_part(self) -> int:
        """The number of the part that the air is; -1 if there is none."""
        return -1 if self._air is None else len(self.parts) - 1

    def trace(
        self,
        rays: Rays,
        boxes: Boxes | None = None,
        *,
        events: bool = False,
        incidence: bool = False,
    ) -> Traces:
        """Follow rays to where they end.

        Args:
            rays: To be cast.
            boxes: Robots.
            events: Whether to write down all that happens to them.
            incidence: Whether to tell at which angle surfaces are hit.

        Raises:
            EngineError: If a column of the rays is not what it has to be.
        """
        n = len(rays.origins)
        room = max(self._events_of_a_ray * n, FIRST_ROOM) if events else 0
        traces = self._run(rays, boxes, room, incidence=incidence)
        most = len(traces.events) // max(n, 1) + 1
        self._events_of_a_ray = max(self._events_of_a_ray, most)
        return traces

    def is_clear(
        self,
        point: Floats,
        radius: float,
        medium: int,
        boxes: Boxes | None,
        carrier_id: int,
    ) -> bool:
        """Say whether nothing opaque is near a point, for certain.

        Args:
            point: (3,) m, map frame.
            radius: m.
            medium: ``RADAR`` or ``LASER``.
            boxes: Robots, of which ``carrier_id`` does not count.
            carrier_id: Number of a box; -1 for none.

        Returns:
            False also if something is only a little farther away.
        """
        if boxes is not None and boxes.is_any_near(point, radius, carrier_id):
            return False
        scene, roles = self._scene, self._tolls_of(DEFAULT_CLASSES).ahead[medium]
        max_range = radius + scene.handle.margin
        point = point - self._middle
        return not is_anything_opaque(
            scene.handle.numbers, scene.asked, roles, point, max_range
        )

    def explain(self, rays: Rays, boxes: Boxes | None = None) -> list[list[Event]]:
        """Follow rays and tell everything that each of them met, in order.

        Raises:
            EngineError: If a column of the rays is not what it has to be.
        """
        events: list[list[Event]] = [[] for _ in range(len(rays.origins))]
        for row in self.trace(rays, boxes, events=True).events:
            event = Event(
                float(row["t"]),
                EventKind(int(row["kind"])),
                int(row["part"]),
                float(row["power"]),
                float(row["absorbed"]),
                (float(row["x"]), float(row["y"]), float(row["z"])),
            )
            events[int(row["ray"])].append(event)
        return events

    def _tolls_of(self, kinds: tuple[RayClass, ...]) -> MaterialTable:
        """Give the tables for kinds of rays, made when first asked for."""
        tolls = self._tolls.get(kinds)
        if tolls is None:
            tolls = tabulate(self.parts, self._volumes, kinds, self._air)
            self._tolls[kinds] = tolls
        return tolls

    def _run(
        self, rays: Rays, boxes: Boxes | None, events: int, *, incidence: bool
    ) -> Traces:
        """Cast; again with more room where there was too little."""
        columns = columns_of(rays)
        n = len(rays.origins)
        laid = NO_BOXES if boxes is None else boxes.laid_out(self._middle)
        tolls = self._tolls_of(rays.ray_classes)
        scene = (self._scene.handle, self._middle, tolls, self._scene.triangles)
        while True:
            found = (
                np.zeros(n),
                np.zeros(n, np.uint8),
                np.zeros(n, np.int64),
                np.zeros(n),
                np.zeros(n if incidence else 0),
            )
            notes = np.zeros(events + 1 if events else 0, EVENT)
            room = (np.zeros(self._room, CROSSING), notes)
            needed = trace_rays(scene, columns, laid, room, found)
            written = int(notes[-1]["ray"]) if events else 0
            if needed < 0:
                reject_ray(rays, -1 - int(needed))
            if needed == 0 and written <= events:
                return Traces(*found, notes[:written])
            self._room = max(self._room, 2 * int(needed))
            events = max(events, written)


# Section from raycast.tracers.
# One tracer for each scene: built when first asked for, kept as long as the scene.

_tracers: WeakKeyDictionary[Scene, Tracer] = WeakKeyDictionary()


def tracer_of(scene: Scene) -> Tracer:
    """Give the tracer of a scene.

    Raises:
        EngineError: If Embree cannot be used, or cannot take a part of the scene.
    """
    tracer = _tracers.get(scene)
    if tracer is None:
        _see_that_rays_end_right()
        tracer = _tracers[scene] = Tracer(scene.parts, scene.air)
    return tracer


@functools.cache
def _see_that_rays_end_right() -> None:
    """Cast a ray through half a metre of hedge to a wall, once in a process.

    Embree does not tell the sizes of its structures. This shows that it has those that
    are filled in for it.
    """
    vertices, faces = box(0.5, 1.0, 1.0)
    near, far = vertices + np.array([1, 0, 0]), vertices + np.array([3.25, 0, 0])
    hedge = Part("hedge", Material("hedge", density=1.0), near, faces)
    wall = Part("wall", Material("wall"), far, faces)
    ray = Rays.uniform(np.zeros((1, 3)), np.eye(3)[:1], max_range=5.0, power=1.0)
    expect_known_end(Tracer([hedge, wall]).trace(ray))


def expect_known_end(traces: Traces) -> None:
    """Refuse an Embree that ends a ray elsewhere than at 3 m, with half its power.

    Raises:
        EngineError: If it does.
    """
    t, power = float(traces.ranges[0]), float(traces.power[0])
    if abs(t - 3.0) > 1e-9 or abs(power - 0.5) > 1e-9:
        raise EngineError(
            f"a ray of known end ends at {t:.6g} m with power {power:.6g}, expected"
            " 3 m and 0.5: this Embree is laid out otherwise than version 4.4"
        )
