"""Errors of usage: one line in the words and the shape of all other messages."""

import re
import sys
from collections.abc import Iterator
from typing import Any, Final

import typer
from typer.core import TyperGroup

from radarsim.cli.output import print_message
from radarsim.errors import did_you_mean, expected_one_of

EXIT_CODE: Final = 2
# Commands that need one of several options.
ALTERNATIVES: Final = {"scan": ("start", "pose"), "explain": ("start", "pose")}
_UsageError: Any = typer.BadParameter.__mro__[1]  # typer does not export it


class PlainGroup(TyperGroup):
    """A group of commands that tells errors of usage as other errors are told."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Run a command, and exit with its code, or 2 after an error of usage."""
        options["standalone_mode"] = False  # errors come here
        try:
            code = super().main(*args, **options)
        except _UsageError as error:
            if text := describe_usage_error(error):  # empty if help was printed
                print_message(text)
            code = EXIT_CODE
        sys.exit(code if isinstance(code, int) else 0)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command that is meant, and its arguments.

        Raises:
            typer.BadParameter: If there is no such command.
        """
        if args[0] not in self.commands:
            text = expected_one_of(args[0], [*self.commands])
            raise typer.BadParameter(text, ctx, param_hint="COMMAND")
        return super().resolve_command(ctx, args)


def describe_usage_error(error: Any) -> str:
    """Return what is wrong with a command line.

    Args:
        error: One of the framework's exceptions.
    """
    kind = type(error).__name__
    if kind == "MissingParameter":
        missing = ", ".join(_missing(error.ctx))
        return f"missing: {missing}; {_help(error.ctx)}"
    if kind == "NoSuchOption":
        return _unknown_option(error)
    if kind == "BadOptionUsage":
        expected = "a" if "requires" in error.message else "no"
        return f"{error.option_name}: expected {expected} value with it"
    extra = re.match(
        r"Got unexpected extra arguments?(?:\(s\))? \((.*)\)", error.message
    )
    if extra is not None:
        return f"'{extra[1]}', expected no more arguments; {_help(error.ctx)}"
    hint = _hint(error)
    text = _reworded(error)
    return f"{hint}: {text}" if hint else text


def _help(ctx: Any) -> str:
    return f"see '{ctx.command_path} --help'"


def _missing(ctx: Any) -> Iterator[str]:
    """Yield the names of all that has to be given and is not."""
    for param in ctx.command.params:
        if param.required and param.name not in ctx.params:
            yield _name(param)
    names = ALTERNATIVES.get(ctx.info_name, ())
    if names and not any(ctx.params.get(name) for name in names):
        yield f"one of {' and '.join(f'--{name}' for name in names)}"


def _unknown_option(error: Any) -> str:
    name = error.option_name
    params = error.ctx.command.params
    known = [each for param in params for each in param.opts if each.startswith("--")]
    known.append("--help")
    continued = [each for each in known if each.startswith(name)]
    meant = did_you_mean(name, continued) or did_you_mean(name, known)
    return f"{name!r}, expected another option{meant or f'; {_help(error.ctx)}'}"


def _hint(error: Any) -> str:
    """Return the name of the option or the argument that is wrong; empty if unknown."""
    hint = getattr(error, "param_hint", None)
    if hint:
        return str(hint)
    param = getattr(error, "param", None)
    return "" if param is None else _name(param)


def _name(param: Any) -> str:
    names = [name for name in param.opts if name.startswith("-")]
    return max(names, key=len) if names else str(param.metavar or param.name).upper()


def _reworded(error: Any) -> str:
    from pydantic import ValidationError

    from radarsim.validation import describe_invalid

    text = str(error.message)
    if isinstance(error.__cause__, ValidationError):  # typer validates with pydantic
        text = describe_invalid(error.__cause__.errors()[0])
    choice = re.fullmatch(r"'(.*)' is not one of ('.*')\.?", text, re.DOTALL)
    if choice is None:
        return text
    return expected_one_of(choice[1], re.findall("'(.*?)'", choice[2]))
