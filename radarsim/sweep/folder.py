"""The folder of a sweep: a log of its tasks while it runs, and in the end its table.

The log has a line for each task that has run, in any order, and in the end in that of
the sweep file. What the sweep is about is written before the first task; the number of
failed tasks in it, and everything else, once all tasks have run.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from radarsim import __version__
from radarsim.atomic_write import written_atomically
from radarsim.errors import SweepError
from radarsim.evaluation.result_log import as_line, read_log
from radarsim.evaluation.task_runner import task_key
from radarsim.os_errors import describe_os_error
from radarsim.scene.scene import Scene
from radarsim.sweep.file import Parameters, SweepFile
from radarsim.sweep.tables import write_table
from radarsim.sweep.tasks import digest

LOG: Final = "tasks.jsonl"
TABLE: Final = "rows.parquet"
ABOUT: Final = "sweep.json"
FIGURE: Final = "figure.png"


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
