"""Figure 15: maps of the test map by a radar and a laser.

Two robots drive along the bushes, one with a radar and one with a Hokuyo.
"""

from typing import Any, Final, NamedTuple

import numpy as np
import shapely
from common import (
    FAR,
    ROOM,
    SEED,
    START,
    Drawn,
    bush_parts,
    hidden_parts,
    load_scene,
    start_pose,
)

from radarsim.autonomy.evaluation.map_score import BESIDE, TOLERANCE
from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.autonomy.plotting.maps import MapView, map_figure
from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.geometry import Point
from radarsim.plotting.style import as_words, write_at
from radarsim.presets.robots import load_robot
from radarsim.robots.obstacles import slice_mesh
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

# Along all bushes, 2.5 m before their middles.
WAYPOINTS: Final = ((-2.0, -5.0), (-2.0, 5.0))
ROBOTS: Final[dict[str, tuple[str, dict[str, float]]]] = {
    "radar": ("P3AT_Radar360", {}),
    "laser": ("P3AT_Hokuyo", {"max_range": FAR}),
}
TEXT: Final = 13.0  # points


class Mapped(NamedTuple):
    """A map made on a drive, with the share of the hidden floor that it shows."""

    robot: str
    height: float  # of the sensor, m
    grid: OccupancyGrid
    trajectory: Trajectory
    share: float


def explore(sensor: str, waypoints: tuple[Point, ...] = WAYPOINTS) -> Mapped:
    """Drive a robot with a sensor along waypoints, and score its map."""
    robot, settings = ROBOTS[sensor]
    scene, model = load_scene(ROOM), load_robot(robot)
    item = model.items_of("RangeScanner")[0]
    plan = ExplorationPlan(waypoints=waypoints, robot_class=robot, start=START)
    config = SimulationConfig(item_settings={item.name: dict(settings)})
    run = MappingRun(plan, Host(scene, config=config, seed=SEED), seed=SEED)
    run.run()
    run.judge()
    mapper, score = run.source.mapper, run.score
    assert mapper is not None
    assert score is not None
    height = start_pose(scene).z + model.origin_height + item.mount.z
    share = score["hidden_coverage"] or 0.0
    return Mapped(robot, height, mapper.grid, mapper.trajectory, share)


def count_object_cells(run: Mapped) -> dict[str, int]:
    """Count the black cells within the tolerance of each object behind the bushes."""
    x, y = np.meshgrid(*run.grid.frame.cell_centers())
    ended = run.grid.beam_end_cells()
    black = shapely.points(x[ended], y[ended])
    far = (TOLERANCE + BESIDE) * run.grid.frame.resolution
    counts = {}
    for part in hidden_parts(load_scene(ROOM)):
        cut = slice_mesh(part.vertices, part.faces, run.height)
        lines = shapely.MultiLineString(list(cut))
        near = shapely.distance(lines, black) <= far
        counts[part.object_name] = int(np.count_nonzero(near))
    return counts


def draw(waypoints: tuple[Point, ...] = WAYPOINTS) -> Drawn:
    """Draw two maps made on the same path along the bushes, side by side."""
    scene = load_scene(ROOM)
    runs = {sensor: explore(sensor, waypoints) for sensor in ROBOTS}
    views = [
        MapView(
            run.grid,
            run.trajectory.rows(),
            run.robot,
            f"{100 * run.share:.0f} % of the yard mapped with the {sensor}",
            outlines_of(scene, run.height),
        )
        for sensor, run in runs.items()
    ]
    drawing = map_figure(views, text=TEXT)
    # The bushes, the yard behind them, and the things in it that a map shows.
    corners = np.concatenate([part.vertices for part in bush_parts(scene)])[:, :2]
    (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
    yard = (east + scene.bounds[1, 0]) / 2, north - 0.8
    style: Any = {"ha": "center", "fontsize": TEXT, "zorder": 5}
    found = []
    for axes, (sensor, run) in zip(drawing.axes, runs.items(), strict=True):
        middle = (west + east) / 2, (south + north) / 2
        write_at(axes, "bushes", middle, rotation=90, va="center", **style)
        write_at(axes, "the yard behind the bushes", yard, va="center", **style)
        counts = count_object_cells(run)
        seen = [part for part in hidden_parts(scene) if counts[part.object_name]]
        for part in seen:
            low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
            place, name = ((low[0] + high[0]) / 2, low[1]), as_words(part.object_name)
            write_at(axes, name, place, offset=(0, -4), va="top", **style)
        share = f"{100 * run.share:.1f} % of the yard behind the bushes"
        found.append(f"the {sensor}'s {share} and {len(seen)} of {len(counts)} objects")
    caption = (
        "Two robots drive along a wall of bushes and map: green is foliage, black is"
        f" solid, and grey is not sensed. The maps show: {', '.join(found)}."
    )
    return {"figure_15.png": (drawing, caption)}
