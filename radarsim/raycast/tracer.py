"""Traces rays through a scene.

Theory of operation
===================
The engine processes one ray after the other: ``intersect.hpp`` collects the surfaces
ahead of the ray, and ``attenuation.hpp`` computes the losses along the sorted list.

Rule 1: the surfaces ahead of a ray do not show which volumes contain its start, since
an opaque wall may hide their far side. If the start is in the bounds of a volume, the
same line is searched backwards through all surfaces: a part that was entered there and
not left encloses the start. Both searches use the same line, so each surface counts on
exactly one side of the start, and the signs of all crossings add up to zero, even if a
ray starts on a face or runs along an edge.
Rule 2: robots are upright boxes outside Embree, since they move and the scene is fixed.
Rule 3: coordinates are relative to the centre of the scene to keep them small.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import Packed, engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.processes import thread_count
from radarsim.raycast.embree import EmbreeScene
from radarsim.raycast.rays import (
    EVENT,
    NO_BOXES,
    Boxes,
    Event,
    EventKind,
    Nodes,
    RayClass,
    Rays,
    Sides,
    Traces,
)
from radarsim.raycast.traced_scene import (
    centre_of,
    find_volumes,
    material_table,
    scattering_of,
)
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, expected_scene
from radarsim.scene.shapes import box

RAYS_PER_THREAD: Final = 2_000  # with fewer rays, a thread costs more than it saves
INITIAL_CAPACITY: Final = 512  # crossings per segment; events per call
EMPTY: Final = np.zeros(0)
NO_EVENTS: Final = np.zeros(0, EVENT)
# The argument ``scans`` of engine calls that trace given rays instead of scans.
NO_SCANS: Final = (
    np.zeros((0, 7)),
    np.zeros((0, 0)),
    np.zeros(0, np.int16),
    np.zeros(0, np.int8),
)


class Tracer:
    """Traces rays through one scene, which must not change.

    Attributes:
        parts: Parts of the scene; the air, if any, comes last, without surfaces.
        rain_rate: (P,) rain in each part, mm/h; rain in the air falls everywhere.
        has_rain: Whether any part has rain.
        clouds: (P,) whether each part scatters light from all depths, as smoke does.
        has_clouds: Whether any part is a cloud.
    """

    def __init__(self, parts: Sequence[Part], air: Material | None = None) -> None:
        """Build the ray-tracing scene from its parts.

        Args:
            parts: Parts of the scene.
            air: The material that fills the whole scene, including the parts; None for
                clear air.

        Raises:
            EngineError: If Embree cannot use a part, or a penetrable part is neither
                closed nor a sheet.
        """
        # The air is a part with an index, so that events and echoes can refer to it.
        nothing = np.zeros((0, 3), np.float64), np.zeros((0, 3), np.int32)
        filling = [] if air is None else [Part("air", air, *nothing)]
        self.parts = (*parts, *filling)
        self.rain_rate = np.array(
            [part.material.rain for part in self.parts], np.float64
        )
        self.has_rain = bool(self.rain_rate.any())
        # The air never counts as a cloud, even if it is fog, since rays do not cross a
        # boundary of the air.
        self.clouds = np.array(
            [part.material.is_cloud for part in parts] + [False] * len(filling), bool
        )
        self.has_clouds = bool(self.clouds.any())
        self._centre = centre_of(parts)
        self._volumes = find_volumes(parts, self._centre)
        self._air = air
        self._losses: dict[RayClass, tuple[Floats, float, Floats]] = {}
        # Packed scenes for the engine. They are packed again after a slice is added to
        # the scene.
        self._packed: dict[tuple[RayClass, ...], Packed] = {}
        self._scene = EmbreeScene(
            [(part.vertices - self._centre, part.faces) for part in parts]
        )
        self._max_crossings = INITIAL_CAPACITY
        self._events_per_ray = 4  # the largest average of all calls so far

    def losses(self, ray_class: RayClass) -> tuple[Floats, float, Floats]:
        """Return the power that rays lose in each part, and its scattered share.

        Returns:
            The power lost per metre in each part, (P,), and in the air; and the
            scattered share of the loss in each part, relative to foliage, (P,).
        """
        found = self._losses.get(ray_class)
        if found is None:
            table = self._packed_for((ray_class,)).materials
            each = [scattering_of(part.material, ray_class) for part in self.parts]
            found = table.density[0], float(table.air[0]), np.array(each, np.float64)
            self._losses[ray_class] = found
        return found

    @property
    def air_part(self) -> int:
        """The index of the part that represents the air; -1 if there is none."""
        return -1 if self._air is None else len(self.parts) - 1

    def trace(
        self,
        rays: Rays,
        boxes: Boxes | None = None,
        *,
        events: bool = False,
        incidence: bool = False,
    ) -> Traces:
        """Trace rays, and return where each ray ends.

        Args:
            rays: The rays.
            boxes: Boxes of the robots.
            events: Whether to record all events along the rays.
            incidence: Whether to compute angles of incidence at hits.

        Raises:
            EngineError: If a ray or a column of the rays is invalid.
        """
        size, classes = len(rays.origins), rays.ray_classes
        options = boxes, events, incidence, self._threads_for(size)
        return self._run(rays.pack(), classes, size, NO_SCANS, rays.invalid, *options)

    def trace_scans(
        self,
        source: Packed,
        ray_classes: tuple[RayClass, RayClass],
        scans: tuple[Floats, Floats, Nodes, Sides],
        boxes: Boxes | None = None,
        *,
        events: bool = False,
        incidence: bool = False,
        threads: int | None = None,
    ) -> Traces:
        """Compute the rays of scans and trace them, in one call of the engine.

        If an opaque surface is between the sensor and the start of a side ray, the
        middle ray of the beam is traced instead.

        Args:
            source: The packed ``RaySource`` of the sensor.
            ray_classes: The class of the rays, and the class that decides whether a
                surface hides a ray's start.
            scans: Arrays of J scans with M rays each: (J, 7) x, y, z, roll, pitch, yaw
                of the sensor, map frame, and the id of the box that carries it, -1 for
                none; (J, N) random numbers from 0 to 1, which select a node of each
                beam, or (J, 0) to trace all nodes; and two output arrays, (J * M,) the
                node of each ray in its beam, and its side.
            boxes: Boxes of the robots.
            events: As in ``trace``.
            incidence: As in ``trace``.
            threads: Number of threads; None chooses it by the number of rays.

        Raises:
            EngineError: If a pose is not finite.
        """
        places, size = scans[0], len(scans[2])

        def invalid(ray: int) -> EngineError:
            pose = places[ray * len(places) // size, :6].tolist()
            return EngineError(f"pose {pose}, expected finite numbers")

        options = boxes, events, incidence, threads or self._threads_for(size)
        return self._run(source, ray_classes, size, scans, invalid, *options)

    @staticmethod
    def _threads_for(size: int) -> int:
        most = size // RAYS_PER_THREAD
        return min(most, thread_count()) if most > 1 else 1

    def explain(self, rays: Rays, boxes: Boxes | None = None) -> list[list[Event]]:
        """Trace rays and return the events of each ray, ordered by distance.

        Raises:
            EngineError: If a ray or a column of the rays is invalid.
        """
        events: list[list[Event]] = [[] for _ in range(len(rays.origins))]
        rows = self.trace(rays, boxes, events=True).events.tolist()
        for ray, t, part, kind, power, absorbed, x, y, z in rows:
            event = Event(t, EventKind(kind), part, power, absorbed, (x, y, z))
            events[ray].append(event)
        return events

    def _packed_for(self, ray_classes: tuple[RayClass, ...]) -> Packed:
        """Return the engine's packed ``Scene`` for some classes of rays."""
        found, handle = self._packed.get(ray_classes), self._scene.handle
        # A packed scene with an old handle is outdated, since adding a slice replaces
        # the handle.
        if found is None or found.handle is not handle:
            if found is None:
                parts, air = self.parts, self._air
                table = material_table(parts, self._volumes, ray_classes, air)
            else:
                table = found.materials
            found = self._packed[ray_classes] = engine.structures["Scene"].pack(
                handle=handle,
                materials=table,
                centre=self._centre[None],
                triangles=self._scene.triangles,
            )
        return found

    def _run(
        self,
        source: Packed,
        ray_classes: tuple[RayClass, ...],
        size: int,
        scans: tuple[NDArray[Any], ...],
        invalid: Callable[[int], EngineError],
        boxes: Boxes | None,
        events: bool,
        incidence: bool,
        threads: int,
    ) -> Traces:
        """Trace rays; repeat this with larger buffers if the buffers were too small.

        Args:
            source: The packed ``RaySource``.
            ray_classes: The classes of the rays.
            size: The number of rays.
            scans: As in ``trace_scans``; ``NO_SCANS`` for given rays.
            invalid: Returns the error for an invalid ray, by its index.
            boxes: Boxes of the robots.
            events: As in ``trace``.
            incidence: As in ``trace``.
            threads: Number of threads.
        """
        # If the buffers are too small, the engine is called again. The required sizes
        # are stored, so this seldom happens.
        room = max(self._events_per_ray * size, INITIAL_CAPACITY) if events else 0
        scene, summary = self._packed_for(ray_classes), np.zeros(3)
        table = NO_BOXES if boxes is None else boxes.table(self._centre)
        while True:
            columns = (
                np.zeros(size),
                np.zeros(size, np.uint8),
                np.zeros(size, np.int64),
                np.zeros(size),
                np.zeros(size) if incidence else EMPTY,
            )
            rows = np.zeros(room, EVENT) if room else NO_EVENTS
            needed = engine.trace_rays(
                scene,
                source,
                table,
                self._max_crossings,
                rows,
                *columns,
                *scans,
                threads,
                summary,
            )
            count, height, unsliced = summary.tolist()
            if needed < 0:
                raise invalid(-1 - needed)
            if needed == 0 and count <= room:
                # The engine counts horizontal rays without a slice, but only Python can
                # build a slice; see ``embree``.
                if unsliced:
                    self._scene.count_unsliced(height, int(unsliced))
                if room:
                    most = int(count) // max(size, 1) + 1
                    self._events_per_ray = max(self._events_per_ray, most)
                return Traces(*columns, rows[: int(count)])
            self._max_crossings = max(self._max_crossings, 2 * needed)
            room = max(room, int(count))
            self._events_per_ray = max(self._events_per_ray, room // max(size, 1) + 1)


# One tracer per scene, created on demand. Scenes are held by weak references, so a
# tracer is freed with its scene.
_tracers: WeakKeyDictionary[Scene, Tracer] = WeakKeyDictionary()


def tracer_of(scene: Scene) -> Tracer:
    """Return the tracer of a scene, which is created on the first call.

    Raises:
        EngineError: If Embree cannot be used, or cannot use a part of the scene.
        TypeError: If the argument is not a Scene.
    """
    if not isinstance(scene, Scene):
        raise expected_scene(scene)
    tracer = _tracers.get(scene)
    if tracer is None:
        _check_engine()
        tracer = _tracers[scene] = Tracer(scene.parts, scene.air)
    return tracer


@functools.cache
def _check_engine() -> None:
    """Check the engine with a ray through half a metre of hedge, once per process.

    Embree does not report the layout of its structures. This test verifies the layout
    that ``intersect.hpp`` assumes.
    """
    vertices, faces = box(0.5, 1.0, 1.0)
    near, far = vertices + np.array([1, 0, 0]), vertices + np.array([3.25, 0, 0])
    hedge = Part("hedge", Material("hedge", density=1.0), near, faces)
    wall = Part("wall", Material("wall"), far, faces)
    ray = Rays.uniform(np.zeros((1, 3)), np.eye(3)[:1], max_range=5.0, power=1.0)
    check_known_end(Tracer([hedge, wall]).trace(ray))


def check_known_end(traces: Traces) -> None:
    """Check that the ray of ``_check_engine`` ended at 3 m with half its power.

    Raises:
        EngineError: If the range or the power differs.
    """
    t, power = float(traces.ranges[0]), float(traces.power[0])
    if abs(t - 3.0) > 1e-9 or abs(power - 0.5) > 1e-9:
        raise EngineError(
            f"a test ray ends at {t:.6g} m with power {power:.6g}, expected 3 m"
            " and 0.5: the memory layout of this Embree differs from version 4.4"
        )
