"""Pictures and films of the maps that ``radarsim map`` makes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from radarsim.autonomy.cli.film import drawn_robot
from radarsim.autonomy.evaluation.map_score import FloorPart
from radarsim.autonomy.evaluation.mapping_run import MappingResult
from radarsim.autonomy.exploration.exploration import Exploration
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.plotting.frames import MapFrames, first_map_extent
from radarsim.autonomy.plotting.maps import MapView
from radarsim.autonomy.plotting.outlines import Outline, outlines_of
from radarsim.autonomy.watching import WatchMapper
from radarsim.plotting.film import Pixels

TITLE_ENDINGS: Final = {
    "incomplete": "until nothing was left to try",
    "time_limit": "until time was up",
    "stuck": "until the robot was stuck",
    "failed": "until the run failed",
    "broken_off": "until interrupted",
}


def view_of(result: MappingResult, mapper: Mapper) -> MapView:
    """Return how the map of a run is drawn.

    Args:
        result: The run.
        mapper: Holds the map; at least one scan.
    """
    scene, trip, outlines = result.scene, result.trip, _true_outlines(result, mapper)
    ending = TITLE_ENDINGS.get(result.outcome, "")
    path = f"{trip.length:.1f} m in {trip.time:.0f} s {ending}".rstrip()
    return MapView(
        mapper.grid,
        mapper.trajectory.rows(),
        drawn_robot(result.robot_class).name,
        _headline(result, mapper, outlines),
        outlines,
        f"{_who_maps_what(result)}: {path}",
        () if scene is None else tuple(scene.parts),
        0.0 if scene is None else _sensor_height(result, mapper),
    )


def _headline(
    result: MappingResult, mapper: Mapper, outlines: Iterable[Outline]
) -> str:
    score = result.score
    if score is not None and score.hidden_coverage is not None:
        return _hidden_text(score.hidden_coverage, outlines)
    if score is not None and score.coverage is not None:
        return f"{100 * score.coverage:.0f} % of the floor mapped"
    grid = mapper.grid
    area = np.count_nonzero(grid.sensed_cells()) * grid.frame.resolution**2
    return f"{area:.0f} m² mapped"


def _who_maps_what(result: MappingResult) -> str:
    where = "what it senses" if result.scene is None else result.scene.name
    who = result.robot_class or "a robot that another client drives"
    return f"{who[0].upper()}{who[1:]} maps {where}"


def _true_outlines(result: MappingResult, mapper: Mapper) -> tuple[Outline, ...]:
    """Return the outlines of the scene at the sensor's height, if it is known."""
    if result.scene is None:
        return ()
    return outlines_of(result.scene, _sensor_height(result, mapper))


def _hidden_text(share: float, outlines: Iterable[Outline]) -> str:
    """Return how much of the floor that the robot cannot reach is mapped, in words."""
    is_foliage = any(outline.kind == "foliage" for outline in outlines)
    where = "behind the foliage" if is_foliage else "out of the robot's reach"
    return f"The floor {where}: {100 * share:.0f} % mapped"


def _sensor_height(result: MappingResult, mapper: Mapper) -> float:
    assert result.scene is not None
    x, y, _ = mapper.trajectory.rows()[0].tolist()
    above = drawn_robot(result.robot_class).origin_height + mapper.scanner.mount.z
    return result.scene.floor_at(x, y) + above


class MapCamera:
    """Draws frames of a map as it is made."""

    def __init__(
        self,
        result: MappingResult,
        source: Exploration | WatchMapper,
    ) -> None:
        """Prepare films.

        Args:
            result: Tells the robot and, if it is known, the scene.
            source: Holds the map and the distance so far.
        """
        self._result, self._source = result, source
        self._mapper: Mapper | None = None
        self._frames: MapFrames | None = None
        self._hidden: FloorPart | None = None
        self._outlines: tuple[Outline, ...] = ()

    def draw(self) -> Pixels:
        """Draw the map as it is, or as it was last; at least one scan is on it."""
        mapper, trip = self._source.mapper or self._mapper, self._source.trip
        assert mapper is not None
        self._mapper = mapper
        # Not before the first scan: only then it is known where the robot stands.
        if self._frames is None:
            self._frames = self._prepare(mapper)
        texts = [f"{trip.time:.1f} s, {trip.length:.1f} m"]
        share = None if self._hidden is None else self._hidden.coverage(mapper.grid)
        if share is not None:
            texts.insert(0, _hidden_text(share, self._outlines))
        path = mapper.trajectory.rows()
        return self._frames.draw(mapper.grid, path, ", ".join(texts))

    def _prepare(self, mapper: Mapper) -> MapFrames:
        result, resolution = self._result, mapper.grid.frame.resolution
        robot = drawn_robot(result.robot_class)
        self._outlines = _true_outlines(result, mapper)
        x, y, _ = mapper.trajectory.rows()[0].tolist()
        if result.scene is not None:
            self._hidden = FloorPart(
                "hidden",
                result.scene,
                resolution,
                start=(x, y),
                robot_radius=math.hypot(robot.length, robot.width) / 2,
                height=_sensor_height(result, mapper),
            )
        extent = first_map_extent(self._outlines, mapper.grid)
        title = _who_maps_what(result)
        return MapFrames(extent, resolution, title, robot.name, self._outlines)
