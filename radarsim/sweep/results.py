"""The folder of a sweep: a log of its tasks, a description, and a result table.

During the sweep a line is appended to the log for each finished task, in any order. At
the end the log is sorted in the order of the sweep file. The description is written
before the first task. After the last task the number of failed tasks is added to it,
and the table is written: a Parquet file with a row for each scan, trial or map.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim import __version__
from radarsim.errors import SweepError, describe_os_error, import_optional
from radarsim.files import write_atomically, written_atomically
from radarsim.scene.scene import Scene
from radarsim.sweep.file import Parameters, SweepFile, flat_parameters
from radarsim.sweep.tasks import MAP_VALUES, canonical_json, digest, unpacked

EXTRA: Final = "sweep"
_GROUP: Final = 256  # tasks per row group of the Parquet file

Row = dict[str, Any]
Tasks = Mapping[str, Parameters]  # by key
LOG: Final = "tasks.jsonl"
TABLE: Final = "rows.parquet"
ABOUT: Final = "sweep.json"


def _schema(arrow: Any, sweep: SweepFile) -> Any:
    """Return the schema of the table: columns for parameters, results and errors."""
    text, number, whole = arrow.string(), arrow.float64(), arrow.int64()
    listed = {f"sensor.{key}": values for key, values in sweep.sensor.items()}
    columns = {
        name: _kind_of(arrow, listed.get(name, [value]))
        for name, value in flat_parameters(next(sweep.tasks())).items()
    }
    if sweep.kind == "scan":
        ranges, rays = arrow.list_(arrow.float32()), arrow.list_(arrow.int8())
        columns |= {"scan": whole, "ranges": ranges, "rays": rays}
    else:
        names = ("shortest_path", "off") if sweep.kind == "trial" else MAP_VALUES
        numbers = dict.fromkeys(("path_length", "time", *names), number)
        columns |= {"outcome": text, "collisions": whole, **numbers, "note": text}
    return arrow.schema([("task", text), *columns.items(), ("error", text)])


def _kind_of(arrow: Any, values: list[Any]) -> Any:
    """Return the type of a column; a column of integers and floats becomes float64."""
    if all(isinstance(value, bool) for value in values):
        return arrow.bool_()
    numbers = [value for value in values if isinstance(value, int | float)]
    if len(numbers) == len(values):
        is_whole = all(isinstance(value, int) for value in values)
        return arrow.int64() if is_whole else arrow.float64()
    if all(isinstance(value, list) for value in values):
        return arrow.list_(arrow.float64())
    return arrow.string()


def as_line(result: Mapping[str, Any]) -> str:
    """Return the result of a task as a line of the log, with its checksum."""
    text = json.dumps(result, allow_nan=False) + "\n"
    checksum = hashlib.sha256(text.encode()).hexdigest()[:16]
    return json.dumps({**result, "checksum": checksum}) + "\n"


def _intact(line: str) -> dict[str, Any] | None:
    """Return the result in a line of the log; None if the checksum is wrong."""
    try:
        result: dict[str, Any] = json.loads(line)
        del result["checksum"]
        return result if as_line(result) == line else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return None  # not JSON, or JSON that is nested too deeply


def task_key(parameters: Parameters) -> str:
    """Return the key of a task: a hash of its parameters, as 32 hexadecimal digits."""
    return hashlib.sha256(canonical_json(parameters).encode()).hexdigest()[:32]


def sweep_tasks(sweep: SweepFile, scenes: Mapping[str, Scene]) -> dict[str, Parameters]:
    """Return the parameters of all tasks of a sweep, by the keys of the tasks.

    Args:
        sweep: Contents of the sweep file.
        scenes: Scenes by map name, from ``load_scenes``.
    """
    digests = {name: digest(scene) for name, scene in scenes.items()}
    tasks = {}
    for task in sweep.tasks():
        # The digest of the map is part of the key, so an edited map gives new tasks.
        whole = {**task, "count": sweep.count, "scene": digests[task["map"]]}
        tasks[task_key(whole)] = whole  # duplicate values in a list give one task
    return tasks


@dataclass(slots=True)
class SweepFolder:
    """The folder of a sweep, into which all results are written.

    Attributes:
        path: The folder.
        lines: The last line of the log for each finished task, by key.
        errors: Error messages of failed tasks, by key.
        damaged: Numbers of the lines of the log with a wrong checksum; their tasks are
            run again.
    """

    path: Path
    lines: dict[str, str] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    damaged: list[int] = field(default_factory=list)

    def open(self, file: Path, sweep: SweepFile, tasks: Tasks, *, resume: bool) -> None:
        """Create the folder, or open it and read the results of an earlier run.

        Args:
            file: Path of the sweep file.
            sweep: Contents of the sweep file.
            tasks: All tasks of the sweep, by key.
            resume: Whether to continue an earlier run.

        Raises:
            SweepError: If the folder is not empty and ``resume`` is false, if it is
                from another version of radarsim or another sweep, or cannot be used.
        """
        log = self.path / LOG
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            if not resume and any(self.path.iterdir()):
                raise SweepError(
                    f"{self.path}: not empty, expected an empty folder or --resume"
                )
            data = log.read_bytes() if log.exists() else b""
            complete = data[: data.rfind(b"\n") + 1]
            if complete != data:  # an earlier run was killed while it wrote a line
                write_atomically({log: complete})
        except OSError as error:
            raise SweepError(f"{self.path}: {describe_os_error(error)}") from error
        lines = complete.decode(errors="replace").split("\n")[:-1]
        for number, line in enumerate(lines, 1):
            result = _intact(line + "\n")
            if result is None:
                self.damaged.append(number)
                continue
            if result["version"] != __version__:
                raise SweepError(
                    f"{log}:{number}: a task of radarsim {result['version']!r},"
                    f" expected {__version__}; choose another folder"
                )
            self._keep(line + "\n", result)
        # The sweep file may have new tasks since the earlier run. No task may be
        # removed, since its results would be missing in the new table.
        if others := len(self.lines.keys() - tasks.keys()):
            try:
                before = json.loads((self.path / ABOUT).read_bytes())["file"]
            except (OSError, ValueError, KeyError, TypeError):
                before = "another file"
            raise SweepError(
                f"{self.path} has results of {before!r} for {others} tasks that are not"
                f" in {file.name!r}; expected another folder, or a file that only adds"
                " values"
            )
        if not (self.path / ABOUT).exists():
            self._write_about(file, sweep, tasks)

    def add(self, key: str, result: Mapping[str, Any]) -> None:
        """Log the result rows of a task, or its error."""
        whole = {"version": __version__, "task": key, **result}
        line = as_line(whole)
        # The log is written before memory is updated, so the log is always complete.
        with (self.path / LOG).open("a", encoding="utf-8") as log:
            log.write(line)
        self._keep(line, whole)

    def _keep(self, line: str, result: Mapping[str, Any]) -> None:
        key = result["task"]
        self.lines[key] = line
        self.errors.pop(key, None)
        if "error" in result:
            self.errors[key] = result["error"]

    def write(self, file: Path, sweep: SweepFile, tasks: Tasks) -> None:
        """Write the table, the description of the sweep, and the log in order of tasks.

        Args:
            file: Path of the sweep file.
            sweep: Contents of the sweep file.
            tasks: All tasks of the sweep, by key; all must have run.

        Raises:
            OSError: If a file cannot be written.
        """
        with written_atomically(self.path / TABLE) as table:
            self._write_table(table, sweep, tasks)
        self._write_about(file, sweep, tasks, failed=len(self.errors))
        with (
            written_atomically(self.path / LOG) as whole,
            whole.open("w", encoding="utf-8") as log,
        ):
            # Tasks end in any order, so they are sorted: equal sweeps give equal bytes.
            log.writelines(self.lines[key] for key in tasks)

    def _write_table(self, path: Path, sweep: SweepFile, tasks: Tasks) -> None:
        """Write the table in groups of tasks, since the memory may be too small."""
        arrow = import_optional("pyarrow", EXTRA)
        parquet = import_optional("pyarrow.parquet", EXTRA)
        # The schema depends only on the sweep file, so results do not change the types.
        schema = _schema(arrow, sweep)
        rest = iter(tasks.items())
        with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
            while group := list(islice(rest, _GROUP)):
                rows = [row for task in group for row in self._rows_of(*task)]
                columns = {
                    each: [row.get(each) for row in rows] for each in schema.names
                }
                writer.write_table(arrow.table(columns, schema=schema))

    def _rows_of(self, key: str, task: Parameters) -> Iterator[Row]:
        """Yield the rows of a task; a beam without return has the range null."""
        result = json.loads(self.lines[key])
        head = {"task": key, **flat_parameters(task)}
        if "error" in result:
            yield {**head, "error": result["error"]}
        for row in result.get("rows", ()):
            if "ranges" in row:
                ranges = unpacked(row["ranges"], np.float32)
                row["ranges"] = [r if np.isfinite(r) else None for r in ranges]
                row["rays"] = unpacked(row["rays"], np.int8)
            yield {**head, **row}

    def _write_about(
        self, file: Path, sweep: SweepFile, tasks: Tasks, **others: int
    ) -> None:
        about = {
            "version": __version__,
            "file": file.name,
            "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
            "maps": {task["map"]: task["scene"] for task in tasks.values()},
            "tasks": len(tasks),
            "sweep": sweep.model_dump(mode="json", exclude_none=True),
            **others,
        }
        with written_atomically(self.path / ABOUT) as whole:
            whole.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
