"""``radarsim check`` and ``radarsim sensors``."""

import json
import math

import typer
from rich.console import Console
from rich.table import Table

from radarsim.errors import MapError
from radarsim.presets.sensors import sensor_presets
from radarsim.scene.mapfile import load_map
from radarsim.scene.summary import summarise


def check_map(map_: str) -> int:
    """Print what is in a map, or its errors; give the exit code."""
    try:
        lines, code = summarise(load_map(map_)), 0
    except MapError as error:
        lines, code = error.problems, 1
    for line in lines:
        typer.echo(line)
    return code


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
