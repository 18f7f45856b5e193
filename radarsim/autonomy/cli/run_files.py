"""Code shared by ``navigate`` and ``map``: checks, films and recordings of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

import click

from radarsim import plugins
from radarsim.cli.output import check_writable, print_message
from radarsim.errors import PresetError, describe_os_error, expected_one_of

if TYPE_CHECKING:
    from radarsim.autonomy.mapping.mapper import Mapper
    from radarsim.autonomy.watching import DataCallback
    from radarsim.cli.fields import RunFiles
    from radarsim.client import Client
    from radarsim.plotting.film import Pixels
    from radarsim.presets.robots import RobotModel
    from radarsim.protocol.dialect import DriveUnit
    from radarsim.scene.scene import Scene
    from radarsim.server.host import Host

HINT: Final = "--film"
GROUP: Final = "radarsim.runs"  # entry point group
DRAWN_ROBOT: Final = "P3AT"  # for an unknown robot class


def drawn_robot(class_name: str | None) -> RobotModel:
    """Return the robot model to draw for a class: a P3AT if the class is unknown."""
    from radarsim.presets.robots import load_robot

    try:
        return load_robot(class_name or DRAWN_ROBOT)
    except PresetError:
        return load_robot(DRAWN_ROBOT)


def check_start(scene: Scene | None, name: str | None) -> None:
    """Check that a map has a start with the given name, if both are known.

    Raises:
        click.BadParameter: If the map has no such start.
    """
    if scene is not None and name is not None and scene.start(name) is None:
        text = expected_one_of(name, [each.name for each in scene.starts])
        raise click.BadParameter(text, param_hint="--start")


def check_film(path: Path | None) -> None:
    """Check before a run that it can be filmed.

    Raises:
        click.BadParameter: If the file cannot be written, the suffix is no film format,
            or a package for the format is missing.
    """
    if path is None:
        return
    from radarsim.plotting.film import film_format

    check_writable(path, HINT)
    if path.exists() and not path.is_file():
        raise click.BadParameter(f"{path}, expected a regular file", param_hint=HINT)
    try:
        film_format(path)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint=HINT) from None


@contextmanager
def filmed(
    files: RunFiles, draw: Callable[[], Pixels]
) -> Iterator[Callable[[float], None]]:
    """Film a run if a file is given; the film is completed even after an error.

    Args:
        files: Options with the file of the film, or None, and its speed.
        draw: Returns a frame with the current state of the run.

    Yields:
        A function to be called after each scan with its time, s.

    Raises:
        click.BadParameter: If the film of a successful run cannot be written.
    """
    path = files.film
    if path is None:
        yield lambda _: None
        return
    from radarsim.plotting.film import Film

    film = Film(path, draw, speed=files.film_speed)
    try:
        with film:
            yield film.update
    finally:
        if film.is_written:
            print_message(f"wrote {path}")
    if film.error is not None:
        text = f"cannot write {path}: {describe_os_error(film.error)}"
        raise click.BadParameter(text, param_hint=HINT)


class Recording:
    """Base class of recordings: records nothing; subclasses override all methods."""

    def attach(self, host: Host, map_: str) -> None:
        """Record the events of a host in this process, given the name of its map."""

    def connect(self, host: str, port: int) -> Client:
        """Connect to a server over TCP, and record the traffic.

        Raises:
            ClientError: If the connection cannot be opened.
        """
        from radarsim.client import Client

        return Client.connect(host, port)

    def follow(self, robot: str) -> DataCallback:  # noqa: ARG002 - nothing is recorded
        """Return a callback that records the data of the robot with the given name."""
        return lambda *_: None

    def add_map(self, mapper: Mapper | None, *, last: bool = False) -> None:
        """Record a map, at most once a second.

        Args:
            mapper: The mapper with the map; None without a map.
            last: Whether the map is complete, so that it is recorded in any case.
        """

    def __enter__(self) -> Self:
        """Start the recording."""
        return self

    def __exit__(self, *_: object) -> None:
        """Complete the recording."""


def make_recording(
    folder: Path | None, drive_unit: DriveUnit, *, robots_map: bool = False
) -> Recording:
    """Return a recording of a run, which records nothing without a folder.

    Args:
        folder: Folder to create; None for no recording.
        drive_unit: Unit of the drive commands.
        robots_map: Whether the robots build a map, which ``add_map`` records.

    Raises:
        RecordingError: If the folder exists, or a package is missing.
        MissingPackage: If the add-on is not installed.
    """
    if folder is None:
        return Recording()
    record = plugins.load(GROUP, "record")
    recording: Recording = record(folder, drive_unit, robots_map=robots_map)
    return recording
