"""Creates commands from functions: parameters become options and arguments.

If the type of a parameter is a dataclass, each field of the dataclass becomes an
option, so the command line has the same options and documentation as Python::

    def scan(map_: MapName, plan: PlacedSensor, *, count: Annotated[int, Ge(1)] = 1):
        '''Scan a map without a server.

Args:
            count: Number of scans.
        '''

A function returns its exit code, or None for 0. A parameter that is marked with
``PlansOf`` receives the plans that the parts of the program have registered.

Values of options come from the command line and from environment variables. A command
may also read them from a YAML file, such as ``serve --config FILE``.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, is_dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import click
from annotated_types import Unit
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from radarsim import plugins
from radarsim.cli.completion import complete_words
from radarsim.cli.output import print_message
from radarsim.errors import describe_os_error, did_you_mean, expected_one_of
from radarsim.plans import (
    REQUIRED,
    Form,
    PlanField,
    parameter_fields,
    plan_fields,
)

if TYPE_CHECKING:
    from radarsim.yaml_reader import YamlFile

NAMES_WIDTH: Final = 26  # columns for the names of options in help
_CONFIG: Final = "radarsim.config_file"  # key in ``click.Context.meta``
_METAVARS: Final = {int: "N", float: "NUMBER", Path: "FILE"}


@dataclass(frozen=True, slots=True)
class PlansOf:
    """Marks a parameter that receives all plans registered under a group of plugins.

    Attributes:
        group: Group under which the plans are registered; see ``radarsim.plugins``.
    """

    group: str


class FieldType(click.ParamType[Any]):
    """Parses the value of an option from the command line or a configuration file."""

    name = "text"

    def __init__(self, field: PlanField) -> None:
        self._field = field

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Parse and validate a value.

        Raises:
            click.BadParameter: If the value has a wrong form or is out of range.
        """
        field, form = self._field, self._field.marker(Form)
        if field.choices and value not in field.choices:
            self.fail(expected_one_of(str(value), field.choices), param, ctx)
        if form is None:
            return self._validate(value, param, ctx)
        try:
            return form.read(str(value))
        except ValueError:
            self.fail(f"{str(value)[:80]!r}, expected {form.name}", param, ctx)

    @property
    def metavar(self) -> str:
        """The placeholder for the option's value in the help, such as FILE."""
        field = self._field
        unit, form = field.marker(Unit), field.marker(Form)
        if field.option.metavar or field.option.is_argument:
            return field.option.metavar or field.name.rstrip("_").upper()
        if form is not None:
            return form.name
        if unit is not None:
            return unit.unit.upper()
        return "|".join(field.choices) or _METAVARS.get(field.type, "NAME")

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the completions that a shell offers."""
        field = self._field
        if field.option.words:
            words = complete_words(field.option.words, incomplete)
        elif field.type is Path:
            return [CompletionItem(incomplete, type="file")]
        else:
            words = (each for each in field.choices if each.startswith(incomplete))
        return [CompletionItem(each) for each in words]

    def _validate(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        # Help and completion should be quick and do not need pydantic, so it is
        # imported here.
        from pydantic import ConfigDict, TypeAdapter, ValidationError

        from radarsim.validation import describe_invalid

        field = self._field
        # YAML reads a text of digits only, such as a port, as a number.
        if field.type is str and type(value) in (int, float):
            value = str(value)
        config = ConfigDict(allow_inf_nan=field.option.may_be_infinite)
        kind: Any = Annotated.__class_getitem__((field.type, field, *field.markers))  # type: ignore[attr-defined]
        adapter = TypeAdapter(kind, config=config)
        try:
            return adapter.validate_python(value)
        except ValidationError as error:
            self.fail(describe_invalid(error.errors()[0]), param, ctx)


class _FlagType(click.types.BoolParamType):
    """Parses a flag from an environment variable or from a configuration file."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> bool:
        """Return whether the flag is set.

        Raises:
            click.BadParameter: If the value is neither true nor false.
        """
        try:
            return super().convert(str(value), param, ctx)
        except click.BadParameter:
            self.fail(f"{str(value)[:80]!r}, expected true or false", param, ctx)


class PlanCommand(click.Command):
    """A command that calls a function with the dataclasses made from its options.

    Attributes:
        fields: Fields of all plans and parameters, by the names of click's parameters.
    """

    def __init__(self, name: str, function: Callable[..., object]) -> None:
        """Create a command.

        Args:
            name: Name on the command line.
            function: Function that runs the command.

        Raises:
            ValueError: If two fields have the same option.
        """
        self.fields: dict[str, PlanField] = {}
        self._function = function
        # Each entry describes a plan: the parameter, the class, click's keys by field,
        # and whether the parameter receives several plans.
        self._plans: list[tuple[str, type, dict[str, str], bool]] = []
        self._values: dict[str, str] = {}  # other parameters, by click's keys
        params: list[click.Parameter] = []

        def add(field: PlanField) -> str:
            param = _make_param(field)
            key = str(param.name)
            if key in self.fields:
                raise ValueError(f"{name}: two options are named {key}")
            self.fields[key] = field
            params.append(param)
            return key

        for parameter in parameter_fields(function):
            group = parameter.marker(PlansOf)
            if group is not None:
                names = plugins.names(group.group)
                plans = [plugins.load(group.group, each) for each in names]
            elif is_dataclass(parameter.type) and isinstance(parameter.type, type):
                plans = [parameter.type]
            else:
                self._values[add(parameter)] = parameter.name
                continue
            for plan in plans:
                keys = {each.name: add(each) for each in plan_fields(plan)}
                self._plans.append((parameter.name, plan, keys, group is not None))
        has_rare = any(field.option.is_rare for field in self.fields.values())
        params.append(help_all_option(is_listed=has_rare))
        text = inspect.getdoc(function) or ""
        super().__init__(name, params=params, help=text.partition("\n\nArgs:\n")[0])

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments of a command line.

        Raises:
            click.UsageError: If an option is wrong, missing, or not allowed.
        """
        # Click names only the first missing parameter; ``missing`` finds all of them.
        rest = super().parse_args(ctx, args)
        if ctx.resilient_parsing:  # a shell asks for completions
            return rest
        self._warn_of_unknown_variables(ctx)
        if self.missing(ctx):
            raise click.MissingParameter(ctx=ctx)
        given = self._given(ctx)
        for names in self._sets("one_required", "at_most_one"):
            found = [key for key in names if key in given]
            typed = [key for key in found if _is_typed(ctx, key)]
            if len(found) > 1 and len(typed) == 1:
                # The command line takes precedence over environment variables.
                for key in {*found} - {*typed}:
                    ctx.set_parameter_source(key, ParameterSource.DEFAULT)
                    given.discard(key)
            elif len(found) > 1:
                text = f"expected only one of {self._listed(names)}"
                raise click.BadParameter(text)
        for key in given:
            needs = self.fields[key].option.needs
            if needs and not given.intersection(needs):
                text = f"needs {self._listed(needs, ' or ')}"
                raise click.BadParameter(text, ctx, param_hint=self._shown(key))
        return rest

    def missing(self, ctx: click.Context) -> list[str]:
        """Return the names of all required options and arguments that are not given."""
        given = self._given(ctx)
        required = {k for k, each in self.fields.items() if each.default is REQUIRED}
        names = [self._shown(key) for key in self.fields if key in required - given]
        sets = (keys for keys in self._sets("one_required") if given.isdisjoint(keys))
        return [*names, *(f"one of {self._listed(keys)}" for keys in sets)]

    def invoke(self, ctx: click.Context) -> Any:
        """Build the plans from the given options, and call the function."""
        given = self._given(ctx)
        values = {
            name: ctx.params[key] for key, name in self._values.items() if key in given
        }
        for name, plan, keys, is_one_of_many in self._plans:
            # Only given options are passed, so only the plans define defaults.
            found = {f: ctx.params[key] for f, key in keys.items() if key in given}
            made = plan(**found)
            values[name] = (*values.get(name, ()), made) if is_one_of_many else made
        return self._function(**values)

    def collect_usage_pieces(self, ctx: click.Context) -> list[str]:
        """Return the parts of the usage line."""
        arguments = (each for each in self.fields.values() if each.option.is_argument)
        return ["[OPTIONS]", *map(_argument_usage, arguments)]

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help: arguments first, then options by group."""
        shows_all = bool(ctx.meta.get("radarsim.help_all"))
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        groups: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            field = self.fields.get(str(param.name))
            if field is None:
                record = param.get_help_record(ctx)
                if record is not None:  # hidden if the command has no rare options
                    groups.setdefault("Options", []).append(record)
            elif shows_all or not field.option.is_rare:
                title = "Arguments" if field.option.is_argument else field.group
                record = _names(param, field), _help(field)
                groups.setdefault(title or "Options", []).append(record)
        # Arguments of all plans come first.
        for title in sorted(groups, key=lambda each: each != "Arguments"):
            with formatter.section(title):
                formatter.write_dl(groups[title], col_max=NAMES_WIDTH)

    def _warn_of_unknown_variables(self, ctx: click.Context) -> None:
        """Warn of environment variables with radarsim's prefix that match no option."""
        prefix = f"{ctx.auto_envvar_prefix}_"
        known = [
            f"{prefix}{str(param.name).upper()}"
            for param in self.params
            if isinstance(param, click.Option)
        ]
        for name in sorted(os.environ):
            if name.startswith(prefix) and name not in known:
                meant = did_you_mean(name, known)
                print_message(f"warning: {name}{meant} is ignored: no such option")

    def _given(self, ctx: click.Context) -> set[str]:
        """Return the fields set by the command line, the environment or a file."""
        # Values are not compared with the default, since a given value may equal it.
        absent = (None, ParameterSource.DEFAULT)
        return {
            key for key in self.fields if ctx.get_parameter_source(key) not in absent
        }

    def _sets(self, *names: str) -> Iterator[tuple[str, ...]]:
        """Yield the keys of the fields in each set of mutually exclusive fields."""
        for _, plan, keys, _ in self._plans:
            for name in names:
                for each in getattr(plan, name, ()):
                    yield tuple(keys[field] for field in each)

    def _listed(self, keys: Iterable[str], word: str = " and ") -> str:
        return word.join(map(self._shown, keys))

    def _shown(self, key: str) -> str:
        (param,) = (each for each in self.params if each.name == key)
        return shown_name(param)


def shown_name(param: click.Parameter) -> str:
    """Return the name of an option or an argument in messages."""
    if isinstance(param, click.Argument) and isinstance(param.type, FieldType):
        return param.type.metavar
    return max(param.opts, key=len)


def _make_param(field: PlanField) -> click.Parameter:
    """Return click's option or argument for a field."""
    option, kind = field.option, FieldType(field)
    name = field.name.rstrip("_").replace("_", "-")
    if option.is_argument:
        nargs = -1 if field.is_repeated else 1
        return click.Argument([field.name], type=kind, required=False, nargs=nargs)
    names = list(option.names or (f"--{name}",))
    if field.type is bool and field.default is True:
        names = [f"--{name}/--no-{name}"]
    if field.type is bool:
        return click.Option(names, is_flag=True, type=_FlagType())
    callback = _read_config if option.is_config_file else None
    return click.Option(
        names,
        type=kind,
        multiple=field.is_repeated,
        # Click processes eager options first, so the values of the file are there when
        # it processes the other options.
        is_eager=option.is_config_file,
        callback=callback,
    )


def _read_config(
    ctx: click.Context, param: click.Parameter, path: Path | None
) -> Path | None:
    """Read a configuration file with the values of options that are not given.

    Keys are the long names of options, with underscores; the argument is ``map``.

    Raises:
        click.BadParameter: If the file cannot be read, or has an unknown key.
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
    for each in ctx.command.params:  # repeatable options may have a single value
        if getattr(each, "multiple", False) and isinstance(given.get(each.name), str):
            given[str(each.name)] = [given[str(each.name)]]
    # The command line and environment variables take precedence over click's default
    # map, and so over the file.
    ctx.default_map = {**(ctx.default_map or {}), **given}
    ctx.meta[_CONFIG] = file
    return path


def describe_place(error: click.BadParameter) -> str:
    """Return the message for a wrong value in a configuration file; else ""."""
    ctx, param = error.ctx, error.param
    file: YamlFile | None = None if ctx is None else ctx.meta.get(_CONFIG)
    if file is None or ctx is None or param is None:
        return ""
    if ctx.get_parameter_source(str(param.name)) is not ParameterSource.DEFAULT_MAP:
        return ""
    return f"--config: {file.problem([_key(param)], error.message)}"


def _key(param: click.Parameter) -> str:
    return str(param.name).rstrip("_")


def _is_typed(ctx: click.Context, key: str) -> bool:
    return ctx.get_parameter_source(key) is ParameterSource.COMMANDLINE


def help_all_option(*, is_listed: bool) -> click.Option:
    """Return the option ``--help-all``, which all commands and groups have."""

    def show(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
        if wanted and not ctx.resilient_parsing:
            ctx.meta["radarsim.help_all"] = True
            click.echo(ctx.get_help())
            ctx.exit()

    return click.Option(
        ["--help-all"],
        allow_from_autoenv=False,
        hidden=not is_listed,
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=show,
        help="Show all options, including rarely used ones.",
    )


def _argument_usage(field: PlanField) -> str:
    name = FieldType(field).metavar + "..." * field.is_repeated
    return name if field.default is REQUIRED else f"[{name}]"


def _names(param: click.Parameter, field: PlanField) -> str:
    """Return the names of a parameter and its placeholder, as shown in help."""
    if field.option.is_argument:
        return _argument_usage(field)
    names = ", ".join((*param.opts, *param.secondary_opts))
    return names if field.type is bool else f"{names} {FieldType(field).metavar}"


def _help(field: PlanField) -> str:
    """Return the help text of a field, with the default value."""
    default = field.default
    if default is REQUIRED and not field.option.is_argument:
        return f"{field.help} [required]"
    if default is REQUIRED or default in (None, "", ()) or isinstance(default, bool):
        return field.help
    text = default.value if isinstance(default, Enum) else default
    shown = f"{text:g}" if isinstance(text, float) else str(text)
    if type(default) is tuple:  # ``ServerAddress`` has its own text form
        shown = ",".join(map(str, default))
    return f"{field.help} [default: {shown}]"
