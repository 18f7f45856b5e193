"""Options of a command from a YAML file: ``serve --config FILE``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from radarsim.errors import describe_os_error


def read_config(context: typer.Context, path: Path | None) -> Path | None:
    """Use the keys of a file as values of options that are not given.

    Keys are the long names of options, with underscores; the argument is ``map``.

    Raises:
        typer.BadParameter: If it cannot be read, or has a key that is no option.
    """
    if path is None:
        return None
    from radarsim.yaml_reader import read_yaml

    try:
        file = read_yaml(path)
    except OSError as error:
        raise typer.BadParameter(f"{path}: {describe_os_error(error)}") from None
    if file.problems:
        raise typer.BadParameter(file.problems[0])
    data = {} if file.data is None else file.data
    if not isinstance(data, dict):
        raise typer.BadParameter(f"{path}:1: expected keys such as 'map' and 'port'")
    names = _names(context.command)
    defaults: dict[str, Any] = {}
    for key, value in data.items():
        if key not in names:
            expected = f"unknown key, expected one of {sorted(names)}"
            raise typer.BadParameter(file.problem([key], expected, of_key=True))
        defaults[names[key]] = value
    context.default_map = {**(context.default_map or {}), **defaults}
    return path


def _names(command: Any) -> dict[str, str]:
    """Return the names of parameters by the keys that stand for them."""
    names = {}
    for param in command.params:
        for name in param.opts:
            key = name.removeprefix("--").replace("-", "_").rstrip("_")
            if not key.startswith("_") and key not in ("config", "help"):
                names[key] = param.name
    return names


ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE",
        is_eager=True,
        callback=read_config,
        help="YAML file with values of options that are not given, and the map.",
    ),
]
