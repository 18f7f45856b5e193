"""Options of a command from a YAML file: ``serve --config FILE``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click
from click.core import ParameterSource

from radarsim.errors import describe_os_error

if TYPE_CHECKING:
    from radarsim.yaml_reader import YamlFile

_FILE: Final = "radarsim.config_file"  # in what click keeps for a command


def read_config(
    ctx: click.Context, param: click.Parameter, path: Path | None
) -> Path | None:
    """Use the keys of a file as values of options that are not given.

    Keys are the long names of options, with underscores; the argument is ``map``.

    Raises:
        click.BadParameter: If it cannot be read, or has a key that is no option.
    """
    if path is None:
        return None
    from radarsim.yaml_reader import read_yaml

    try:
        file = read_yaml(path)
    except OSError as error:
        raise click.BadParameter(f"{path}: {describe_os_error(error)}") from None
    if file.problems:
        raise click.BadParameter(file.problems[0])
    data = {} if file.data is None else file.data
    if not isinstance(data, dict):
        raise click.BadParameter(f"{path}:1: expected keys such as 'map' and 'port'")
    known = {_key(each): str(each.name) for each in ctx.command.params if each != param}
    known.pop("help_all", None)
    for key in data:
        if key not in known:
            expected = f"unknown key, expected one of {sorted(known)}"
            raise click.BadParameter(file.problem([key], expected, of_key=True))
    given = {known[key]: value for key, value in data.items()}
    for each in ctx.command.params:  # a single value of those that can be repeated
        if getattr(each, "multiple", False) and isinstance(given.get(each.name), str):
            given[str(each.name)] = [given[str(each.name)]]
    # To click a default map ranks below words and variables of the environment, as a
    # file should.
    ctx.default_map = {**(ctx.default_map or {}), **given}
    ctx.meta[_FILE] = file
    return path


def describe_place(error: click.BadParameter) -> str:
    """Return the message of a wrong value in a file with its place; else nothing."""
    ctx, param = error.ctx, error.param
    file: YamlFile | None = None if ctx is None else ctx.meta.get(_FILE)
    if file is None or ctx is None or param is None:
        return ""
    if ctx.get_parameter_source(str(param.name)) is not ParameterSource.DEFAULT_MAP:
        return ""
    return f"--config: {file.problem([_key(param)], error.message)}"


def _key(param: click.Parameter) -> str:
    return str(param.name).rstrip("_")
