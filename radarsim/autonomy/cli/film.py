"""What ``navigate`` and ``map`` share: checks, the robot that is drawn, films."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from radarsim.cli.output import check_writable, print_message
from radarsim.errors import PresetError, describe_os_error, expected_one_of

if TYPE_CHECKING:
    from radarsim.plotting.film import Pixels
    from radarsim.presets.robots import RobotModel
    from radarsim.scene.scene import Scene

HINT: Final = "--film"
DRAWN_ROBOT: Final = "P3AT"  # where the class is unknown


def drawn_robot(class_name: str | None) -> RobotModel:
    """Return the robot that is drawn: a P3AT if a class is unknown."""
    from radarsim.presets.robots import load_robot

    try:
        return load_robot(class_name or DRAWN_ROBOT)
    except PresetError:
        return load_robot(DRAWN_ROBOT)


def check_start(scene: Scene | None, name: str | None) -> None:
    """Check that a map has a start of a name, if both are known.

    Raises:
        click.BadParameter: If it has not.
    """
    if scene is not None and name is not None and scene.start(name) is None:
        text = expected_one_of(name, [each.name for each in scene.starts])
        raise click.BadParameter(text, param_hint="--start")


def check_film(path: Path | None) -> None:
    """Check before a run that it can be filmed.

    Raises:
        click.BadParameter: If the file cannot be written, its ending names no format,
            or a package for its format is missing.
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
    path: Path | None, draw: Callable[[], Pixels], speed: float
) -> Iterator[Callable[[float], None]]:
    """Film a run if a file is given; whatever ends the run, its film is completed.

    Args:
        path: The file; None for no film.
        draw: Returns a frame of the run as it is.
        speed: Simulated seconds per second of film.

    Yields:
        A function to be called after each scan with its time, s.

    Raises:
        click.BadParameter: If the film of a run that succeeded cannot be written.
    """
    if path is None:
        yield lambda _: None
        return
    from radarsim.plotting.film import Film

    film = Film(path, draw, speed=speed)
    try:
        with film:
            yield film.update
    finally:
        if film.is_written:
            print_message(f"wrote {path}")
    if film.error is not None:
        text = f"cannot write {path}: {describe_os_error(film.error)}"
        raise click.BadParameter(text, param_hint=HINT)
