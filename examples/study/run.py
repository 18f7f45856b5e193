"""Let radars and lasers drive and map on the same maps; print a row for each run.

python examples/study/run.py [--seeds K] [--only MAP:SENSOR] > rows.jsonl

Three kinds of maps have materials that radars and lasers meet differently: smoke in a
corridor, a room behind bushes, and a hedge with a gap that leads nowhere. The others
are families of the random maps. Each kind differs for every seed. ``figure.py`` draws
the rows.
"""

import argparse
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from joblib import Parallel, delayed

from radarsim.autonomy.evaluation.shortest_path import shortest_path
from radarsim.autonomy.evaluation.trials import config_with_sensor, run_plan
from radarsim.autonomy.plans import ROBOT_RADIUS, Algorithm, ExplorationPlan, Mission
from radarsim.generators.random_maps import FAMILIES, make_random_map
from radarsim.geometry import Point
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

_FAMILIES: Final = {"thin_bushes": "thin", "forest": "trunks", "office": "offices"}
_MATERIALS: Final = """\
  concrete: {density: opaque}
  wood: {density: opaque}
  foliage: {based_on: foliage, density: 0.7}
  hedge: {based_on: hedge, density: 1.0}
  smoke: {density: 0, laser_density: 0.5, laser_db_per_m: 2.3, solid: false}
"""
MAPPING: Final = "map"
MAPPED: Final = ("hidden_room", "office")  # rooms with walls around
BEAMS: Final = {"fov_deg": 358, "resolution_deg": 2}  # as many as in half a circle by 1
DRIVING_TIME: Final = 900.0  # s of simulated time
MAPPING_TIME: Final = 120.0  # s of simulated time
MEASURED: Final = ("outcome", "collisions", "path_length", "time")
SHARES: Final = ("reachable_coverage", "hidden_coverage", "within_two_cells")
DRIVEN: Final = (*MEASURED[:3], "shortest_path", "time", "note")


@dataclass(frozen=True)
class StudySensor:
    """A preset with other settings, and fields of the plans of its runs."""

    preset: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    plan: Mapping[str, Any] = field(default_factory=dict)


SENSORS: Final = {
    "radar": StudySensor("radar"),
    "range-only radar": StudySensor("radar", plan={"echoes": False}),
    "first-echo laser": StudySensor("physical"),
    "last-echo laser": StudySensor(
        "physical", settings={"return_mode": "last"}, plan={"echoes": False}
    ),
    "USARSim Hokuyo": StudySensor("hokuyo"),
    "USARSim SICK": StudySensor("sick"),
}


@dataclass(frozen=True)
class StudyMap:
    """The text of a map file, and the start and the goal of the robot, m."""

    text: str
    start: Point
    goal: Point

    def load(self) -> Scene:
        """Load the map as a file of it would be."""
        with TemporaryDirectory() as folder:
            path = Path(folder) / "study.yaml"
            path.write_text(self.text, encoding="utf-8")
            return load_map(path)


def make_study_map(kind: str, seed: int) -> StudyMap:
    """Make the map of a kind and a seed."""
    if kind in _FAMILIES:
        # Random maps take the families in turn, so every so many numbers are of this
        # one.
        number = FAMILIES.index(_FAMILIES[kind]) + seed * len(FAMILIES)
        random_map = make_random_map(number)
        return StudyMap(random_map.as_yaml(), random_map.start, random_map.goal)
    return _DRAWERS[kind](generator_for(seed, "study", kind))


def _smoke_corridor(rng: np.random.Generator) -> StudyMap:
    """Draw a corridor with smoke from wall to wall, and crates in it and behind."""
    length, width = 14.0, float(rng.uniform(3.0, 3.6))
    cloud, at = float(rng.uniform(3, 5)), float(rng.uniform(-1, 1))
    objects = [
        *_room(length, width),
        # A little narrower than the corridor, so that its sides are not in those of the
        # walls.
        _box("cloud", "smoke", (at, 0), (cloud, width - 0.02), height=1.9),
    ]
    side = 1 if rng.random() < 0.5 else -1
    for k, x in enumerate((at, at + cloud / 2 + 1.5)):
        y = side * (-1) ** k * (width / 2 - 0.3)
        objects.append(_box(f"crate_{k}", "wood", (x, y), (0.8, 0.5)))
    return _map("smoke_corridor", objects, (-6.0, 0.0), (6.0, 0.0))


def _hidden_room(rng: np.random.Generator) -> StudyMap:
    """Draw a room that bushes divide from wall to wall, with things behind them."""
    length, width = 11.0, 8.0
    objects = [*_room(length, width)]
    at = float(rng.uniform(-0.5, 0.5))
    for k, (y, radius) in enumerate(_row_of_bushes(rng, width)):
        objects.append(
            f"{{name: bush_{k}, cylinder: [{radius:.3f}, 1.4], position:"
            f" [{at:.3f}, {y:.3f}, 0.7], material: foliage}}"
        )
    for k in range(3):
        place = (float(rng.uniform(2.2, 4.4)), float(rng.uniform(-3, 3)))
        size = float(rng.uniform(0.3, 0.8)), float(rng.uniform(0.3, 0.8))
        objects.append(_box(f"crate_{k}", "wood", place, size))
    start = (-4.2, float(rng.uniform(-2.5, 2.5)))
    return _map("hidden_room", objects, start, (1.6, float(rng.uniform(-3, 3))))


def _row_of_bushes(
    rng: np.random.Generator, width: float
) -> Iterator[tuple[float, float]]:
    """Yield the places and radii of bushes that overlap a little, m."""
    y = -width / 2
    while y < width / 2:
        radius = float(rng.uniform(0.6, 0.9))
        yield y + 0.9 * radius, radius
        y += 1.85 * radius


def _dead_end(rng: np.random.Generator) -> StudyMap:
    """Draw a hedge across a yard with two gaps; behind the nearer one is a pocket."""
    side = 1 if rng.random() < 0.5 else -1
    half, thick, gap = 6.5, 0.6, float(rng.uniform(1.9, 2.3))
    near, far = float(rng.uniform(-0.6, 0.6)), side * float(rng.uniform(3.6, 4.6))
    depth = float(rng.uniform(2.0, 3.0))
    low, high = sorted((near, far))
    ends = (-half, low - gap / 2, low + gap / 2, high - gap / 2, high + gap / 2, half)
    objects = [*_room(14.0, 2 * half)]
    for k in range(3):
        bottom, top = ends[2 * k], ends[2 * k + 1]
        place, size = (0.0, (bottom + top) / 2), (thick, top - bottom)
        objects.append(_box(f"hedge_{k}", "hedge", place, size))
    for k in (-1, 1):
        place = (depth / 2, near + k * (gap + thick) / 2)
        objects.append(_box(f"arm_{k + 1}", "hedge", place, (depth - thick, thick)))
    back = (gap + 2 * thick, (depth, near))
    objects.append(_box("back", "hedge", back[1], (thick, back[0])))
    return _map("dead_end", objects, (-5.5, 0.0), (5.5, 0.0))


def _room(length: float, width: float) -> Iterator[str]:
    """Yield a floor with walls around it, whose inner sides are that far apart, m."""
    yield (
        f"{{name: floor, box: [{length + 1:.3f}, {width + 1:.3f}, 0.2],"
        " position: [0, 0, -0.1], material: concrete}"
    )
    x, y = length / 2 + 0.1, width / 2 + 0.1
    for name, place, size in (
        ("north", (0.0, y), (length + 0.4, 0.2)),
        ("south", (0.0, -y), (length + 0.4, 0.2)),
        ("east", (x, 0.0), (0.2, width)),
        ("west", (-x, 0.0), (0.2, width)),
    ):
        yield _box(f"{name}_wall", "concrete", place, size, height=2.0)


def _box(
    name: str, material: str, place: Point, size: Point, *, height: float = 1.4
) -> str:
    return (
        f"{{name: {name}, box: [{size[0]:.3f}, {size[1]:.3f}, {height}], position:"
        f" [{place[0]:.3f}, {place[1]:.3f}, {height / 2}], material: {material}}}"
    )


def _map(name: str, objects: list[str], start: Point, goal: Point) -> StudyMap:
    lines = "".join(f"  - {each}\n" for each in objects)
    facing = math.degrees(math.atan2(goal[1] - start[1], goal[0] - start[0]))
    text = (
        f"version: 1\nlevel: DM-{name}\nmaterials:\n{_MATERIALS}objects:\n{lines}"
        f"starts:\n  - {{name: RobotStart1, position: [{start[0]:.3f}, {start[1]:.3f},"
        f" 0], yaw_deg: {facing:.3f}}}\n"
    )
    return StudyMap(text, start, goal)


_DRAWERS: Final[dict[str, Callable[[np.random.Generator], StudyMap]]] = {
    "smoke_corridor": _smoke_corridor,
    "hidden_room": _hidden_room,
    "dead_end": _dead_end,
}
KINDS: Final = (*_DRAWERS, *_FAMILIES)


def run(kind: str, name: str, method: str, seed: int) -> dict[str, Any]:
    """Return the row of a run, rounded to mm, ms, and four digits of shares."""
    map_ = make_study_map(kind, seed)
    scene = map_.load()
    sensor = SENSORS[name]
    config = config_with_sensor(sensor.preset, **sensor.settings, **BEAMS)
    host = Host(scene, config=config, seed=seed)
    task = {"seed": seed, "map": kind, "sensor": name, "method": method}
    if method == MAPPING:
        plan = ExplorationPlan(time_limit=MAPPING_TIME, **sensor.plan)
        row = run_plan(plan, host, seed=seed)
        note = {"note": row.note}
        return task | row.select(MEASURED) | row.select(SHARES, 4) | note
    # The robot's own size decides the right verdict, not its safety distance.
    shortest = shortest_path(scene, map_.start, map_.goal, ROBOT_RADIUS)
    length = None if shortest is None else shortest[0]
    mission = Mission(
        algorithm=Algorithm(method),
        goals=(map_.goal,),
        time_limit=DRIVING_TIME,
        **sensor.plan,
    )
    row = replace(run_plan(mission, host), shortest_path=length)
    expected = {"expected": "no_path" if shortest is None else "reached"}
    return task | expected | row.select(DRIVEN)


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--seeds", type=int, default=10)
parser.add_argument("--only", metavar="MAP:SENSOR", help="one map and sensor")
options = parser.parse_args()
runs = [
    delayed(run)(kind, sensor, method, seed)
    for seed, kind, sensor in product(range(options.seeds), KINDS, SENSORS)
    if options.only in (None, f"{kind}:{sensor}")
    for method in ("planned", MAPPING)[: 1 + (kind in MAPPED)]
]
for row in Parallel(-1, return_as="generator")(runs):
    print(json.dumps(row), flush=True)
