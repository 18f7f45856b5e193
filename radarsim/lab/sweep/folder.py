"""The folder of a sweep: a log of its tasks while it runs, and in the end its table.

The log has a line for each task that has run, in any order, and in the end in that of
the sweep file. What the sweep is about is written before the first task; the number of
failed tasks in it, and everything else, once all tasks have run.

The table of a sweep as Parquet: a row for each scan, trial or map.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim import __version__
from radarsim.autonomy.evaluation.task_runner import as_line, read_log, task_key
from radarsim.errors import SweepError, describe_os_error, import_optional
from radarsim.files import written_atomically
from radarsim.lab.sweep.file import Parameters, SweepFile
from radarsim.lab.sweep.tasks import MAP_VALUES, digest, unpacked
from radarsim.scene.scene import Scene

EXTRA: Final = "sweep"
_GROUP: Final = 256  # tasks in a row group

Row = dict[str, Any]
LOG: Final = "tasks.jsonl"
TABLE: Final = "rows.parquet"
ABOUT: Final = "sweep.json"
FIGURE: Final = "figure.png"


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


@dataclass(frozen=True, slots=True)
class SweepTask:
    """A task of a sweep.

    Attributes:
        key: The same for equal parameters, and the same map.
        parameters: Its parameters, as ``run_sweep_task`` takes them.
    """

    key: str
    parameters: Parameters


def sweep_tasks(sweep: SweepFile, scenes: Mapping[str, Scene]) -> list[SweepTask]:
    """Return all tasks of a sweep.

    Args:
        sweep: The sweep file.
        scenes: From ``load_scenes``.
    """
    digests = {name: digest(scene) for name, scene in scenes.items()}
    tasks = {}
    for task in sweep.tasks():
        whole = {**task, "count": sweep.count, "scene": digests[task["map"]]}
        tasks[task_key(whole)] = whole  # equal values in a list are one task
    return [SweepTask(key, whole) for key, whole in tasks.items()]


@dataclass(slots=True)
class SweepFolder:
    """The folder of a sweep.

    Attributes:
        path: The folder.
        lines: The last line of each task that has run, by its key.
    """

    path: Path
    lines: dict[str, str] = field(default_factory=dict)

    def open(
        self, file: Path, sweep: SweepFile, tasks: Sequence[SweepTask], *, resume: bool
    ) -> None:
        """Create the folder, or read what an earlier run has left in it.

        Args:
            file: The sweep file.
            sweep: Its contents.
            tasks: All its tasks.
            resume: Whether to go on with what an earlier run has left.

        Raises:
            SweepError: If there is something in it and it is not to be resumed, or is
                by another version of radarsim, or of another sweep, or it cannot be
                used.
        """
        log = self.path / LOG
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            if not resume and any(self.path.iterdir()):
                raise SweepError(
                    f"{self.path}: not empty, expected an empty folder, or --resume"
                )
            results = read_log(log, ("version", "task"), "a task of a sweep")
        except OSError as error:
            raise SweepError(f"{self.path}: {describe_os_error(error)}") from error
        except ValueError as error:
            raise SweepError(str(error)) from error
        for number, result in enumerate(results, 1):
            if result["version"] != __version__:
                raise SweepError(
                    f"{log}:{number}: a task of radarsim {result['version']!r},"
                    f" expected {__version__}; choose another folder"
                )
            self.lines[result["task"]] = as_line(result)
        self._refuse_others(file, tasks)
        if not (self.path / ABOUT).exists():
            self._write_about(self._describe(file, sweep, tasks))

    def _refuse_others(self, file: Path, tasks: Sequence[SweepTask]) -> None:
        """Refuse tasks that have run and that a sweep has not; it may have more.

        Raises:
            SweepError: If there are some, whose rows a new table would lack.
        """
        others = len(self.lines.keys() - {task.key for task in tasks})
        if not others:
            return
        try:
            before = json.loads((self.path / ABOUT).read_bytes())["file"]
        except (OSError, ValueError, KeyError, TypeError):
            before = "another file"
        raise SweepError(
            f"{self.path}: has {others} tasks of {before!r} that {file.name!r} with its"
            " maps does not have; expected another folder, or a file that only adds"
            " values"
        )

    def has(self, task: SweepTask) -> bool:
        """Return whether a task has run and did not fail."""
        line = self.lines.get(task.key)
        return line is not None and "error" not in json.loads(line)

    def write(self, file: Path, sweep: SweepFile, tasks: Sequence[SweepTask]) -> None:
        """Write the table, what it is about, and the log in the order of the tasks.

        Args:
            file: The sweep file.
            sweep: Its contents.
            tasks: All its tasks, each of which has run.

        Raises:
            OSError: If a file cannot be written.
        """
        with written_atomically(self.path / TABLE) as table:
            write_table(table, sweep, self._results(tasks))
        about = self._describe(file, sweep, tasks)
        about["failed"] = sum("error" in result for _, result in self._results(tasks))
        self._write_about(about)
        with (
            written_atomically(self.path / LOG) as whole,
            whole.open("w", encoding="utf-8") as log,
        ):
            log.writelines(self.lines[task.key] for task in tasks)

    def _describe(
        self, file: Path, sweep: SweepFile, tasks: Sequence[SweepTask]
    ) -> dict[str, Any]:
        return {
            "version": __version__,
            "file": file.name,
            "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
            "maps": {
                task.parameters["map"]: task.parameters["scene"] for task in tasks
            },
            "tasks": len(tasks),
            "sweep": sweep.model_dump(mode="json", exclude_none=True),
        }

    def _write_about(self, about: Mapping[str, Any]) -> None:
        with written_atomically(self.path / ABOUT) as whole:
            whole.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")

    def _results(
        self, tasks: Sequence[SweepTask]
    ) -> Iterator[tuple[SweepTask, Mapping[str, Any]]]:
        for task in tasks:
            yield task, json.loads(self.lines[task.key])
