"""The table of a sweep as Parquet: a row for each scan, trial or map."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from radarsim.optional_packages import import_optional
from radarsim.sweep.file import Parameters, SweepFile
from radarsim.sweep.tasks import MAP_VALUES, unpacked

if TYPE_CHECKING:
    from radarsim.sweep.folder import SweepTask

EXTRA: Final = "sweep"
_GROUP: Final = 256  # tasks in a row group

Row = dict[str, Any]


def flat_parameters(task: Parameters) -> Row:
    """Return the parameters of a task as columns, ``sensor.name`` and so on."""
    sensor = {f"sensor.{key}": value for key, value in task["sensor"].items()}
    left_out = ("sensor", "kind", "scene", "count")
    others = {key: value for key, value in task.items() if key not in left_out}
    return {"map": others.pop("map"), **sensor, **others}


def write_table(
    path: Path,
    sweep: SweepFile,
    results: Iterable[tuple["SweepTask", Mapping[str, Any]]],
) -> None:
    """Write the table, some hundred tasks at a time.

    Args:
        path: The file.
        sweep: The sweep.
        results: Each task with its line of the log.
    """
    arrow = import_optional("pyarrow", EXTRA)
    parquet = import_optional("pyarrow.parquet", EXTRA)
    schema = _schema(arrow, sweep)
    rest = iter(results)
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        while group := list(islice(rest, _GROUP)):
            rows = [row for task, result in group for row in _rows_of(task, result)]
            columns = {name: [row.get(name) for row in rows] for name in schema.names}
            writer.write_table(arrow.table(columns, schema=schema))


def _rows_of(task: "SweepTask", result: Mapping[str, Any]) -> Iterator[Row]:
    head = {"task": task.key, **flat_parameters(task.parameters)}
    if "error" in result:
        yield {**head, "error": result["error"]}
    for row in result.get("rows", ()):
        yield {**head, **_decoded(row)}


def _decoded(row: Row) -> Row:
    """Return a row with its arrays; what did not return is null."""
    if "ranges" not in row:
        return row
    ranges = unpacked(row["ranges"], np.float32)
    read = [value if np.isfinite(value) else None for value in ranges]
    return {**row, "ranges": read, "rays": unpacked(row["rays"], np.int8)}


def _schema(arrow: Any, sweep: SweepFile) -> Any:
    """Return the columns: the parameters, what a task gives, and its error."""
    text, number, whole = arrow.string(), arrow.float64(), arrow.int64()
    parameters = flat_parameters(next(sweep.tasks()))
    listed = {f"sensor.{key}": values for key, values in sweep.sensor.items()}
    columns = {
        name: _kind_of(arrow, listed.get(name, [value]))
        for name, value in parameters.items()
    }
    if sweep.kind == "scan":
        ranges, rays = arrow.list_(arrow.float32()), arrow.list_(arrow.int8())
        given = {"scan": whole, "ranges": ranges, "rays": rays}
    else:
        names = ("shortest_path", "off") if sweep.kind == "trial" else MAP_VALUES
        given = {
            "outcome": text,
            "collisions": whole,
            "path_length": number,
            "time": number,
            **dict.fromkeys(names, number),
            "note": text,
        }
    everything = {"task": text, **columns, **given, "error": text}
    return arrow.schema(list(everything.items()))


def _kind_of(arrow: Any, values: list[Any]) -> Any:
    """Return the type of a column: numbers with a fraction hold whole ones as well."""
    if all(isinstance(value, bool) for value in values):
        return arrow.bool_()
    numbers = [value for value in values if isinstance(value, int | float)]
    if len(numbers) == len(values):
        is_whole = all(isinstance(value, int) for value in values)
        return arrow.int64() if is_whole else arrow.float64()
    if all(isinstance(value, list) for value in values):
        return arrow.list_(arrow.float64())
    return arrow.string()
