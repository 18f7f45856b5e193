"""``radarsim check``."""

import math
from collections.abc import Sequence

import typer

from radarsim.errors import MapError
from radarsim.evaluation.free_space import is_connected
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.scene.map_file import load_variants
from radarsim.scene.scene import Scene
from radarsim.scene.summary import summarise
from radarsim.simulation.simulation import Simulation


def check_map(map_: str) -> int:
    """Print what is in a map, or its errors; give the exit code."""
    try:
        scene, *variants = load_variants(map_)
        lines = [*summarise(scene), *_named(variants)]
        lines += [*taken_starts(scene), *trial_doubts(scene)]
        code = 0
    except MapError as error:
        lines, code = error.problems, 1
    for line in lines:
        typer.echo(line)
    return code


def _named(variants: Sequence[Scene]) -> list[str]:
    names = [f"  {variant.name}" for variant in variants]
    return ["variants", *names] if names else []


def taken_starts(scene: Scene) -> list[str]:
    """Tell which starts are no place for a P3AT."""
    lines = []
    simulation = Simulation(scene)
    for start in scene.starts:
        wanted = Pose2(start.pose.x, start.pose.y, start.pose.yaw)
        vehicle = simulation.spawn("check", load_robot("P3AT"), wanted)
        if vehicle is None:
            lines.append(f"  {start.name}: no place for a P3AT within 1 m")
            continue
        simulation.remove(vehicle)  # each start by itself
        pose = vehicle.robot.pose
        if pose != wanted:
            there = f"x {pose.x:.2f} m, y {pose.y:.2f} m"
            lines.append(f"  {start.name}: taken; a P3AT would stand at {there}")
    return ["starts that are not free", *lines] if lines else []


def trial_doubts(scene: Scene) -> list[str]:
    """Tell what keeps a robot from doing what a map's trial asks of it."""
    trial = scene.trial
    if trial is None or (start := scene.start(trial.start)) is None:
        return []
    model, lines = load_robot("P3AT"), []
    clearance = math.hypot(model.length, model.width) / 2
    if trial.safety_distance < clearance:
        lines.append(f"  a P3AT keeps at least {clearance:.3f} m")
    place = start.pose.x, start.pose.y
    if not is_connected(scene, place, trial.goal, trial.safety_distance):
        away = f"{trial.safety_distance:g} m from everything solid"
        lines.append(f"  no path to the goal that keeps {away}")
    return ["doubts of the trial", *lines] if lines else []
