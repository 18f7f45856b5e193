"""The tasks of sweeps: scans, trials and maps, which worker processes run."""

import base64
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim import __version__
from radarsim.autonomy.evaluation.trials import (
    config_with_sensor,
    drive_trial,
    run_plan,
)
from radarsim.autonomy.plans import ExplorationPlan, StrategyName
from radarsim.errors import MapError, SweepError
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import load_sensor
from radarsim.server.host import Host
from radarsim.sweep.file import Parameters, SweepFile

MAP_VALUES: Final = (
    "coverage",
    "reachable_coverage",
    "hidden_coverage",
    "within_two_cells",
    "false_obstacles",
)
TRIAL_VALUES: Final = (
    "outcome",
    "collisions",
    "path_length",
    "time",
    "circuits",
    "off",
    "note",
    "shortest_path",
)

Row = dict[str, Any]

_scenes: dict[str, Scene] = {}  # maps that this process has received, by digest


def load_scenes(path: Path, sweep: SweepFile) -> dict[str, Scene]:
    """Load the maps of a sweep, and return them by name.

    Args:
        path: Path of the sweep file; maps in its folder come before shipped maps.
        sweep: Contents of the sweep file.

    Raises:
        MapError: If a map is wrong, or has no trial although the tasks are trials.
    """
    scenes = {}
    for name in dict.fromkeys(sweep.map):
        stem = name.partition("@")[0]
        near = path.parent / stem
        near = near if near.suffix else near.with_suffix(".yaml")
        found = name.replace(stem, str(near), 1) if near.is_file() else name
        scene = load_map(found)
        if sweep.kind == "trial" and scene.trial is None:
            raise MapError([f"{name}: no 'trial', which kind trial needs"])
        scenes[name] = scene
    return scenes


def digest(scene: Scene) -> str:
    """Return a hash of a map's contents, 16 hexadecimal digits."""
    found = hashlib.sha256()
    for part in scene.parts:
        found.update(repr((part.object_name, asdict(part.material))).encode())
        found.update(part.vertices.tobytes())
        found.update(part.faces.tobytes())
    air = None if scene.air is None else asdict(scene.air)
    rest = scene.level, scene.starts, air, scene.trial, scene.reflectors
    found.update(repr((*rest, scene.gps_origin)).encode())
    # Optional contents are hashed only for maps that have them, so that the digests of
    # other maps are the same as in earlier versions.
    if scene.tags or scene.victims:
        found.update(repr((scene.tags, scene.victims)).encode())
    if scene.crates:
        found.update(repr(scene.crates).encode())
    return found.hexdigest()[:16]


def prepare_worker(version: str, scenes: Mapping[str, Scene]) -> None:
    """Store the maps of a sweep in this worker process.

    Args:
        version: Version of radarsim in the process that sends the maps.
        scenes: Scenes by map name, from ``load_scenes``.

    Raises:
        SweepError: If this process has another version of radarsim.
    """
    if version != __version__:
        raise SweepError(
            f"worker with radarsim {__version__}, expected local version {version}"
        )
    _scenes.update({digest(scene): scene for scene in scenes.values()})


def canonical_json(parameters: Parameters) -> str:
    """Return parameters as JSON with sorted keys."""
    return json.dumps(
        parameters, sort_keys=True, allow_nan=False, separators=(",", ":")
    )


def run_sweep_task(task: Parameters) -> list[Row]:
    """Run one task of a sweep, and return its result rows as plain data.

    Args:
        task: Parameters of the task, with the digest of its map as ``scene``, and
            ``count``.
    """
    run = {"scan": _scan_rows, "trial": _trial_rows, "map": _map_rows}[task["kind"]]
    return run(task, _scenes[task["scene"]])


def _scan_rows(task: Parameters, scene: Scene) -> list[Row]:
    """Run the scans of a task, and return one result row for each."""
    # Random numbers do not depend on count and map: a larger count leaves the first
    # scans unchanged, and an edited map is scanned with the same rays.
    drawn = {key: value for key, value in task.items() if key not in ("count", "scene")}
    rng = generator_for(task["seed"], "task", canonical_json(drawn))
    settings = dict(task["sensor"])
    scanner = load_sensor(settings.pop("name"), **settings)
    pose = (task["x"], task["y"], math.radians(task["yaw_deg"]))
    scans = (scanner.scan(scene, pose, rng) for _ in range(task["count"]))
    return [
        {
            "scan": number,
            "ranges": _packed(scan.ranges, np.float32),
            "rays": None if scan.rays is None else _packed(scan.rays, np.int8),
        }
        for number, scan in enumerate(scans)
    ]


def _packed(values: Any, kind: type[np.generic]) -> str:
    """Return values as an array of a numpy type, encoded in base64."""
    return base64.b64encode(np.asarray(values, kind).tobytes()).decode()


def unpacked(text: str | None, kind: type[np.generic]) -> Any:
    """Decode an array from base64; None stays None."""
    return None if text is None else np.frombuffer(base64.b64decode(text), kind)


def _trial_rows(task: Parameters, scene: Scene) -> list[Row]:
    host, limit = _host(task, scene), task["time_limit"]
    row = drive_trial(host, task["algorithm"], time_limit=limit)
    return [row.select(TRIAL_VALUES, 4)]


def _map_rows(task: Parameters, scene: Scene) -> list[Row]:
    plan = ExplorationPlan(
        strategy=StrategyName(task["strategy"]), time_limit=task["time_limit"]
    )
    row = run_plan(plan, _host(task, scene), seed=task["seed"])
    # The table shows the length of the path as measured by the robot itself.
    row = replace(row, path_length=row.measured_length)
    names = ("outcome", "collisions", "path_length", "time", "note", *MAP_VALUES)
    return [row.select(names, 4)]


def _host(task: Parameters, scene: Scene) -> Host:
    """Create a host whose robots carry the sensor of the task as their scanner."""
    settings = dict(task["sensor"])
    config = config_with_sensor(settings.pop("name"), **settings)
    return Host(scene, config=config, seed=task["seed"])
