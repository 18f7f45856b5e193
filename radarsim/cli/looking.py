"""``radarsim check`` and ``radarsim sensors``."""

import json
import math

import typer
from rich.console import Console
from rich.table import Table

from radarsim.errors import MapError
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.presets.sensors import sensor_presets
from radarsim.scene.mapfile import load_map
from radarsim.scene.scene import Scene
from radarsim.scene.summary import summarise
from radarsim.simulation.simulation import Simulation


def check_map(map_: str) -> int:
    """Print what is in a map, or its errors; give the exit code."""
    try:
        scene = load_map(map_)
        lines, code = [*summarise(scene), *taken_starts(scene)], 0
    except MapError as error:
        lines, code = error.problems, 1
    for line in lines:
        typer.echo(line)
    return code


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


def list_sensors(*, as_json: bool) -> None:
    """Print the presets."""
    presets = sensor_presets()
    if as_json:
        shown = {name: preset.model_dump() for name, preset in presets.items()}
        for told in shown.values():
            for number in told["settings"].values():
                if number["value"] == math.inf:
                    number["value"] = None  # JSON knows no infinity
        typer.echo(json.dumps(shown, indent=2, allow_nan=False))
        return
    console = Console(soft_wrap=False)
    for name, preset in presets.items():
        table = Table(title=f"{name}: {preset.about}", title_justify="left")
        for column in ("setting", "value", "confidence", "source"):
            table.add_column(column, overflow="fold")
        for setting, number in preset.settings.items():
            table.add_row(setting, str(number.value), number.confidence, number.source)
        console.print(table)
