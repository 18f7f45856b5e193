"""``radarsim sensors`` and ``radarsim materials``."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeVar

import typer
from rich.console import Console
from rich.table import Table

from radarsim.presets.materials import LibraryEntry, library, library_material
from radarsim.presets.sensor_settings import BANDS_GHZ
from radarsim.presets.sensors import (
    SensorPreset,
    SourcedValue,
    load_settings,
    sensor_presets,
)

_Listed = TypeVar("_Listed", SensorPreset, LibraryEntry)
_UNITS: Final = {"g_per_m3": "g/m3", "mm_per_h": "mm/h"}


def list_sensors(names: Sequence[str], *, as_json: bool) -> None:
    """Print presets: those of these names, or an overview and all.

    Raises:
        typer.BadParameter: If there is none of a name.
    """
    shown = _chosen("sensor", names, sensor_presets())
    if as_json:
        plain = {name: preset.model_dump() for name, preset in shown.items()}
        for told in plain.values():
            for number in told["settings"].values():
                if number["value"] == math.inf:  # JSON knows no infinity
                    number["value"] = None
        typer.echo(json.dumps(plain, indent=2, allow_nan=False))
        return
    console = Console(soft_wrap=False)
    if not names:
        console.print(_sensors(shown), "")
    for name, preset in shown.items():
        console.print(_numbers(f"{name}: {preset.about}", "setting", preset.settings))


def list_materials(names: Sequence[str], *, as_json: bool) -> None:
    """Print materials of the library: those of these names, or an overview and all.

    Raises:
        typer.BadParameter: If there is none of a name.
    """
    shown = _chosen("material", names, library())
    if as_json:
        plain = {name: entry.model_dump() for name, entry in shown.items()}
        typer.echo(json.dumps(plain, indent=2, allow_nan=False))
        return
    console = Console(soft_wrap=False)
    if not names:
        console.print(_materials(shown), "")
    for name, entry in shown.items():
        console.print(_numbers(f"{name}: {entry.about}", "number", entry.numbers))


def _chosen(
    kind: str, names: Sequence[str], every: Mapping[str, _Listed]
) -> dict[str, _Listed]:
    unknown = [name for name in names if name not in every]
    if unknown:
        raise typer.BadParameter(
            f"{kind} {unknown[0][:80]!r}, expected one of {list(every)}"
        )
    return {name: every[name] for name in names or every}


def _sensors(presets: Mapping[str, SensorPreset]) -> Table:
    """Show a line for each, with the first sentence about it."""
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("name", no_wrap=True)
    table.add_column("medium")
    for column in ("beams", "fov °", "step °", "range m"):
        table.add_column(column, justify="right")
    table.add_column("about")
    for name, preset in presets.items():
        told = load_settings(name)
        numbers = (told.beams, told.fov_deg, told.resolution_deg, told.max_range)
        sentence = preset.about.partition(". ")[0].rstrip(".")
        table.add_row(name, told.medium, *(f"{n:.4g}" for n in numbers), sentence)
    return table


def _materials(entries: Mapping[str, LibraryEntry]) -> Table:
    """Show a line for each, with what it takes from beams."""
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("name", no_wrap=True)
    for column in (*(f"{band} GHz dB/m" for band in BANDS_GHZ), "laser dB/m"):
        table.add_column(column, justify="right")
    table.add_column("amount", no_wrap=True)
    table.add_column("about")
    for name, entry in entries.items():
        told = library_material(name)
        radar = [_loss(told.density, db, told.radar_mirror) for db in told.radar_db]
        amount = ""
        if entry.amount is not None:
            amount = f"{entry.numbers[entry.amount].value:g} {_UNITS[entry.amount]}"
        laser = _loss(told.laser_density, told.laser_db, told.laser_mirror)
        table.add_row(name, *radar, laser, amount, entry.about)
    return table


def _loss(density: float, decibels: float, mirror: bool) -> str:
    if math.isinf(density):
        return "mirror" if mirror else "opaque"
    return f"{decibels:.3g}"


def _numbers(title: str, kind: str, numbers: Mapping[Any, SourcedValue]) -> Table:
    table = Table(title=title, title_justify="left")
    for column in (kind, "value", "confidence", "source"):
        table.add_column(column, overflow="fold")
    for name, number in numbers.items():
        table.add_row(name, _value(number.value), number.confidence, number.source)
    return table


def _value(value: Any) -> str:
    if not isinstance(value, dict):
        return str(value)
    return ", ".join(f"{number:g} at {band} GHz" for band, number in value.items())
