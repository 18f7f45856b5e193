"""``radarsim sensors``, ``robots`` and ``materials``: presets with their sources."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import click
from rich.console import Console
from rich.table import Table

from radarsim.cli.fields import Json
from radarsim.errors import expected_one_of
from radarsim.plans import Option

if TYPE_CHECKING:
    from radarsim.presets import SourcedValue
    from radarsim.presets.robots import RobotModel
    from radarsim.presets.sensors import SensorPreset
    from radarsim.scene.material import LibraryEntry

_Preset = TypeVar("_Preset")
_ANY_WIDTH: Final = 10_000  # columns
_UNITS: Final = {"g_per_m3": "g/m3", "mm_per_h": "mm/h"}

_Names = Annotated[tuple[str, ...], Option(is_argument=True, metavar="NAME")]


def sensors(names: _Names = (), *, as_json: Json = False) -> None:
    """List the sensors: their numbers, sources and confidence.

    Args:
        names: Names to list; all by default.
        as_json: Print JSON, for programs.
    """
    from radarsim.presets.sensors import item_presets, sensor_presets

    chosen = _choose("sensor", names, {**sensor_presets(), **item_presets()})
    if as_json:
        plain = {name: preset.model_dump() for name, preset in chosen.items()}
        for preset in plain.values():
            for number in preset["settings"].values():
                if number["value"] == math.inf:  # not allowed in JSON
                    number["value"] = None
        click.echo(json.dumps(plain, indent=2, allow_nan=False))
        return
    console = _console()
    if not names:
        console.print(_sensor_overview(chosen), "")
    for name, each in chosen.items():
        console.print(_details(f"{name}: {each.about}", "setting", each.settings))
        if each.fmcw:
            title = f"{name}: its FMCW radar, for spectra"
            console.print(_details(title, "setting", each.fmcw))


def robots(names: _Names = (), *, as_json: Json = False) -> None:
    """List the robot classes: their items, sizes and sources.

    Args:
        names: Names to list; all by default.
        as_json: Print JSON, for programs.
    """
    from radarsim.presets.robots import load_robot, robot_names

    chosen = _choose("robot class", names, {n: load_robot(n) for n in robot_names()})
    if as_json:
        plain = {name: model.model_dump() for name, model in chosen.items()}
        click.echo(json.dumps(plain, indent=2, allow_nan=False))
        return
    console = _console()
    if not names:
        console.print(_robot_overview(chosen), "")
    for name, model in chosen.items():
        console.print(_robot_details(name, model))


def materials(names: _Names = (), *, as_json: Json = False) -> None:
    """List the library of materials: their numbers, sources and confidence.

    Args:
        names: Names to list; all by default.
        as_json: Print JSON, for programs.
    """
    from radarsim.scene.material import library

    chosen = _choose("material", names, library())
    if as_json:
        plain = {name: entry.model_dump() for name, entry in chosen.items()}
        click.echo(json.dumps(plain, indent=2, allow_nan=False))
        return
    console = _console()
    if not names:
        console.print(_material_overview(chosen), "")
    for name, entry in chosen.items():
        console.print(_details(f"{name}: {entry.about}", "number", entry.numbers))


def _console() -> Console:
    """Return where tables are printed: a pipe, unless told otherwise, has any width."""
    console = Console()
    if console.is_terminal or "COLUMNS" in os.environ:
        return console
    return Console(width=_ANY_WIDTH)


def _choose(
    noun: str, names: Sequence[str], presets: Mapping[str, _Preset]
) -> dict[str, _Preset]:
    for name in names:
        if name not in presets:
            raise click.BadParameter(f"{noun} {expected_one_of(name, presets)}")
    return {name: presets[name] for name in names or presets}


def _sensor_overview(presets: Mapping[str, SensorPreset]) -> Table:
    """Return a row for each sensor, with the first sentence about it."""
    from radarsim.presets.sensors import load_settings, sensor_presets

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("name", no_wrap=True)
    table.add_column("medium")
    for column in ("beams", "fov °", "step °", "range m"):
        table.add_column(column, justify="right")
    table.add_column("about")
    for name, preset in presets.items():
        sentence = preset.about.partition(". ")[0].rstrip(".")
        if name not in sensor_presets():  # no scanner
            table.add_row(name, *[""] * 5, sentence)
            continue
        it = load_settings(name)
        numbers = (it.beams, it.fov_deg, it.resolution_deg, it.max_range)
        table.add_row(name, it.medium, *(f"{n:.4g}" for n in numbers), sentence)
    return table


def _material_overview(entries: Mapping[str, LibraryEntry]) -> Table:
    """Return a row for each material, with the loss of beams in it."""
    from radarsim.presets.sensor_settings import BANDS_GHZ
    from radarsim.scene.material import library_material

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("name", no_wrap=True)
    for column in (*(f"{band} GHz dB/m" for band in BANDS_GHZ), "laser dB/m"):
        table.add_column(column, justify="right")
    table.add_column("amount", no_wrap=True)
    table.add_column("about")
    for name, entry in entries.items():
        it = library_material(name)
        radar = [_loss_text(it.density, db, it.radar_mirror) for db in it.radar_db]
        laser = _loss_text(it.laser_density, it.laser_db, it.laser_mirror)
        amount = ""
        if entry.amount is not None:
            amount = f"{entry.numbers[entry.amount].value:g} {_UNITS[entry.amount]}"
        table.add_row(name, *radar, laser, amount, entry.about)
    return table


def _robot_overview(models: Mapping[str, RobotModel]) -> Table:
    """Return a row for each robot class, with what it carries."""
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("name", no_wrap=True)
    table.add_column("steering")
    table.add_column("size m", no_wrap=True)
    table.add_column("items")
    table.add_column("about")
    for name, model in models.items():
        types = list(dict.fromkeys(item.type for item in model.items))
        size = " x ".join(f"{length:g}" for length in model.dimensions)
        steering = "skid" if model.steering is None else "Ackermann"
        steering = steering if model.flight is None else "flies"
        sentence = model.about.partition(". ")[0].rstrip(".")
        table.add_row(name, steering, size, ", ".join(types), sentence)
    return table


def _robot_details(name: str, model: RobotModel) -> Table:
    """Return a row for each key of a robot class, with its source."""
    table = Table(title=f"{name}: {model.about}", title_justify="left")
    for column in ("key", "value", "confidence", "source"):
        table.add_column(column, overflow="fold")
    sources = {key: source for source in model.sources for key in source.of}
    keys = model.model_dump(exclude_unset=True, exclude={"name", "about", "sources"})
    for key, value in keys.items():
        source = sources.get(key)
        origin = (source.confidence, source.source) if source else ("", "")
        table.add_row(key, _value_text(value), *origin)
    return table


def _value_text(value: Any) -> str:
    """Return a value of a robot class as a text; of an item, its type and name."""
    if isinstance(value, dict):
        if "type" in value:
            return f"{value['type']} {value['name']}"
        return ", ".join(f"{key} {number}" for key, number in value.items())
    if isinstance(value, tuple):
        return ", ".join(map(_value_text, value))
    return str(value)


def _loss_text(density: float, decibels: float, mirror: bool) -> str:
    if math.isinf(density):
        return "mirror" if mirror else "opaque"
    return f"{decibels:.3g}"


def _details(title: str, noun: str, numbers: Mapping[Any, SourcedValue]) -> Table:
    """Return a row for each number of a preset, with its source."""
    table = Table(title=title, title_justify="left")
    for column in (noun, "value", "confidence", "source"):
        table.add_column(column, overflow="fold")
    for name, number in numbers.items():
        value = number.value
        if isinstance(value, dict):
            value = ", ".join(f"{db:g} at {band} GHz" for band, db in value.items())
        table.add_row(name, str(value), number.confidence, number.source)
    return table
