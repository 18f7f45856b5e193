"""``radarsim sensors``, ``robots`` and ``materials``: presets with their sources."""

from __future__ import annotations

import json
import math
import os
from collections.abc import (
    Callable,
    Collection,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import click
from pydantic import BaseModel
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

_Preset = TypeVar("_Preset", bound=BaseModel)
_ANY_WIDTH: Final = 10_000  # columns, more than any table has
_UNITS: Final = {"g_per_m3": "g/m3", "mm_per_h": "mm/h"}

_Names = Annotated[tuple[str, ...], Option(is_argument=True, metavar="NAME")]


def sensors(names: _Names = (), *, as_json: Json = False) -> None:
    """List the sensor presets: their values, sources and confidence.

    Args:
        names: Names to list; all by default.
        as_json: Print JSON instead of text.
    """
    from radarsim.presets.sensors import sensor_presets

    presets = {**sensor_presets(), **sensor_presets("items")}
    _print("sensor", names, presets, _sensor_overview, _sensor_details, as_json)


def robots(names: _Names = (), *, as_json: Json = False) -> None:
    """List the robot classes: their items, sizes and sources.

    Args:
        names: Names to list; all by default.
        as_json: Print JSON instead of text.
    """
    from radarsim.presets.robots import load_robot, robot_names

    models = {name: load_robot(name) for name in robot_names()}
    _print("robot class", names, models, _robot_overview, _robot_details, as_json)


def materials(names: _Names = (), *, as_json: Json = False) -> None:
    """List the materials of the library: their values, sources and confidence.

    Args:
        names: Names to list; all by default.
        as_json: Print JSON instead of text.
    """
    from radarsim.scene.material import library

    _print("material", names, library(), _material_overview, _material_details, as_json)


def _print(
    noun: str,
    names: Sequence[str],
    presets: Mapping[str, _Preset],
    overview: Callable[[Mapping[str, _Preset]], Table],
    details: Callable[[str, _Preset], Iterable[Table]],
    as_json: bool,
) -> None:
    """Print presets as JSON or as tables; without names, print an overview first.

    Raises:
        click.BadParameter: If there is no preset of a name.
    """
    for name in names:
        if name not in presets:
            raise click.BadParameter(f"{noun} {expected_one_of(name, presets)}")
    chosen = {name: presets[name] for name in names or presets}
    if as_json:  # infinite numbers become null
        plain = {n: json.loads(each.model_dump_json()) for n, each in chosen.items()}
        click.echo(json.dumps(plain, indent=2, allow_nan=False))
        return
    console = Console()
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console = Console(width=_ANY_WIDTH)  # for a pipe
    if not names:
        console.print(overview(chosen), "")
    for name, each in chosen.items():
        for table in details(name, each):
            console.print(table)


def _overview(*columns: str, numbers: Collection[str] = ()) -> Table:
    """Return a table without rows; columns in ``numbers`` are aligned right."""
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for column in columns:
        is_short = column in ("name", "amount", "size m")
        justify: Any = "right" if column in numbers else "left"
        table.add_column(column, justify=justify, no_wrap=is_short)
    return table


def _sensor_overview(presets: Mapping[str, SensorPreset]) -> Table:
    """Return a table with a row for each sensor: its name and its first sentence."""
    from radarsim.presets.sensors import load_settings, sensor_presets

    numeric = ("beams", "fov °", "step °", "range m")
    table = _overview("name", "medium", *numeric, "about", numbers=numeric)
    for name, preset in presets.items():
        sentence = preset.about.partition(". ")[0].rstrip(".")
        if name not in sensor_presets():  # the sensor is not a scanner
            table.add_row(name, *[""] * 5, sentence)
            continue
        it = load_settings(name)
        numbers = (it.beams, it.fov_deg, it.resolution_deg, it.max_range)
        table.add_row(name, it.medium, *(f"{n:.4g}" for n in numbers), sentence)
    return table


def _material_overview(entries: Mapping[str, LibraryEntry]) -> Table:
    """Return a table with a row for each material: its name and its losses in dB/m."""
    from radarsim.presets.sensor_settings import BANDS_GHZ
    from radarsim.scene.material import library_material

    losses = (*(f"{band} GHz dB/m" for band in BANDS_GHZ), "laser dB/m")
    table = _overview("name", *losses, "amount", "about", numbers=losses)
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
    """Return a table with a row for each robot class: its name and its items."""
    table = _overview("name", "steering", "size m", "items", "about")
    for name, model in models.items():
        types = list(dict.fromkeys(item.type for item in model.items))
        size = " x ".join(f"{length:g}" for length in model.dimensions)
        steering = "skid" if model.steering is None else "Ackermann"
        steering = steering if model.flight is None else "flies"
        sentence = model.about.partition(". ")[0].rstrip(".")
        table.add_row(name, steering, size, ", ".join(types), sentence)
    return table


def _robot_details(name: str, model: RobotModel) -> Iterator[Table]:
    """Yield a table with a row for each key of a robot class, with its source."""
    rows: list[tuple[str, ...]] = []
    sources = {key: source for source in model.sources for key in source.of}
    keys = model.model_dump(exclude_unset=True, exclude={"name", "about", "sources"})
    for key, value in keys.items():
        source = sources.get(key)
        origin = (source.confidence, source.source) if source else ("", "")
        rows.append((key, _value_text(value), *origin))
    yield _sourced(f"{name}: {model.about}", "key", rows)


def _value_text(value: Any) -> str:
    """Return a value of a robot class as text; an item becomes its type and name."""
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


def _sensor_details(name: str, preset: SensorPreset) -> Iterator[Table]:
    yield _numbers(f"{name}: {preset.about}", "setting", preset.settings)
    if preset.fmcw:
        title = f"{name}: its FMCW radar, for spectra"
        yield _numbers(title, "setting", preset.fmcw)


def _material_details(name: str, entry: LibraryEntry) -> Iterator[Table]:
    yield _numbers(f"{name}: {entry.about}", "number", entry.numbers)


def _numbers(title: str, noun: str, numbers: Mapping[Any, SourcedValue]) -> Table:
    """Return a table with a row for each number of a preset and its source."""
    rows = []
    for name, number in numbers.items():
        value = number.value
        if isinstance(value, dict):
            value = ", ".join(f"{db:g} at {band} GHz" for band, db in value.items())
        rows.append((name, str(value), number.confidence, number.source))
    return _sourced(title, noun, rows)


def _sourced(title: str, noun: str, rows: Iterable[Sequence[str]]) -> Table:
    table = Table(title=title, title_justify="left")
    for column in (noun, "value", "confidence", "source"):
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*row)
    return table
