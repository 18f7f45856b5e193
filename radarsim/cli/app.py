"""The program ``radarsim``: its group of commands, usage errors and exit codes."""

import os
import platform
import re
import sys
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import click
from click.core import ParameterSource

from radarsim import __version__, plugins
from radarsim.cli.command import (
    PlanCommand,
    describe_place,
    help_all_option,
    shown_name,
)
from radarsim.cli.entries import CommandEntry, check_part_of, load_entries
from radarsim.cli.output import print_message, program_name
from radarsim.errors import (
    RadarsimError,
    describe_os_error,
    did_you_mean,
    expected_one_of,
)
from radarsim.processes import BROKEN_PIPE, INTERRUPTED, ignore_signals


def describe_usage_error(error: click.UsageError) -> str:
    """Return the message for a usage error, with the name of the wrong option."""
    ctx = error.ctx
    if isinstance(error, click.MissingParameter):
        missing = ["COMMAND"]
        if ctx is not None and isinstance(ctx.command, PlanCommand):
            missing = ctx.command.missing(ctx)
        return f"missing: {', '.join(missing)}{_see_help(ctx)}"
    if isinstance(error, click.NoSuchOption):
        return _describe_unknown_option(error)
    # Only the message of click's error shows whether a value is missing or not allowed.
    if isinstance(error, click.BadOptionUsage):
        expected = "needs a" if "requires" in error.message else "takes no"
        return f"{error.option_name}: {expected} value"
    # click has no class for surplus arguments, so the error's message is parsed.
    extra = re.match(r"Got unexpected extra arguments? \((.*)\)", error.message)
    if extra is not None:
        return f"'{extra[1]}', expected no more arguments{_see_help(ctx)}"
    if not isinstance(error, click.BadParameter):
        return error.message
    hint = error.param_hint or _name_source(error)
    text = f"{hint}: {error.message}" if hint else error.message
    return describe_place(error) or text


def _name_source(error: click.BadParameter) -> str:
    """Return the name of the wrong parameter, or of its environment variable."""
    param, ctx = error.param, error.ctx
    if param is None:
        return ""
    if ctx is not None and param.name is not None:
        source = ctx.get_parameter_source(param.name)
        if source is ParameterSource.ENVIRONMENT:
            return f"{ctx.auto_envvar_prefix}_{param.name.upper()}"
    return shown_name(param)


def _see_help(ctx: click.Context | None) -> str:
    return "" if ctx is None else f"; see '{ctx.command_path} --help'"


def _describe_unknown_option(error: click.NoSuchOption) -> str:
    name, ctx = error.option_name, error.ctx
    params = ctx.command.get_params(ctx) if ctx is not None else []
    known = [each for param in params for each in param.opts if each.startswith("--")]
    # Earlier versions and other programs have these options.
    if name in ("--host", "--port") and "--connect" in known:
        return f"{name!r}, expected --connect HOST:PORT"
    if name in ("--map", "--maps", "--serve") and "MAP" in map(shown_name, params):
        return f"{name!r}, expected MAP as an argument, without an option"
    # Options such as --web and --record belong to add-ons that may not be installed.
    part = name.removeprefix("--").partition("-")[0]
    owner = plugins.OWN["radarsim.serve"].get(part, "").partition(":")[0]
    if owner and not plugins.has("radarsim.serve", part):
        return f"{name}: {owner} is not installed"
    continued = [each for each in known if each.startswith(name)]
    meant = did_you_mean(name, continued) or did_you_mean(name, known)
    see_help = "" if meant else _see_help(ctx)
    return f"{name!r}{meant}, expected another option{see_help}"


USAGE_ERROR: Final = 2  # exit code


class EntryGroup(click.Group):
    """A group of commands, each of which is imported only when it is used."""

    def __init__(
        self, name: str, entries: Iterable[CommandEntry] | None = None, **options: Any
    ) -> None:
        """Create a group.

        Args:
            name: Name of the group.
            entries: Commands of the group; by default the commands of all packages.
            options: Keyword arguments of ``click.Group``.
        """
        super().__init__(name, no_args_is_help=True, **options)
        self.params.append(help_all_option(is_listed=False))  # has no rare options
        self._given = entries

    @cached_property
    def entries(self) -> dict[str, CommandEntry]:
        """The entries of the group's commands, by name."""
        entries = load_entries() if self._given is None else self._given
        return {each.name: each for each in entries}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, in the order of the help."""
        return list(self.entries)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command and return it; None if the name is unknown."""
        entry = self.entries.get(cmd_name)
        return None if entry is None else entry.load()

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the name of the command, the command, and its arguments.

        Raises:
            click.BadParameter: If there is no such command.
            MissingPackage: If the part of the program with the command is not
                installed.
        """
        if args[0] not in self.entries and not ctx.resilient_parsing:
            check_part_of(args[0])
            text = expected_one_of(args[0], self.entries)
            raise click.BadParameter(text, ctx, param_hint="COMMAND")
        return super().resolve_command(ctx, args)

    def format_commands(
        self, ctx: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the names and summaries of the commands, grouped under headings."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for name, entry in self.entries.items():
            groups.setdefault(entry.group, []).append((name, entry.help))
        for title, rows in groups.items():
            with formatter.section(title):
                formatter.write_dl(rows)


def _drop_output() -> None:
    # Python flushes stdout again at exit, and would report the broken pipe once more.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _ending_with_its_reader() -> Iterator[None]:
    """Exit with 141 instead of click's 1 when the reader of stdout has closed the pipe.

    Raises:
        SystemExit: If stdout is closed.
    """
    try:
        yield
    except BrokenPipeError:
        _drop_output()
        sys.exit(BROKEN_PIPE)
    except SystemExit as end:  # rich turns a broken pipe into exit code 1
        if isinstance(end.__context__, BrokenPipeError):
            sys.exit(BROKEN_PIPE)
        raise


class _Program(EntryGroup):
    def invoke(self, ctx: click.Context) -> Any:
        """Run a command without the empty line that click prints on an interrupt."""
        try:
            with _ending_with_its_reader():
                code = super().invoke(ctx)
                # Python would flush at exit, and print an error in its own format.
                sys.stdout.flush()
                return code
        except KeyboardInterrupt:
            sys.exit(INTERRUPTED)

    def make_context(self, *args: Any, **options: Any) -> click.Context:
        """Parse the program's options; ``--version`` and others print text and exit."""
        with _ending_with_its_reader():
            return super().make_context(*args, **options)

    def main(self, args: Sequence[str] | None = None, *_: Any, **options: Any) -> Any:
        """Run a command, and exit with its code, or with 2 after a usage error."""
        options |= {"prog_name": program_name(), "complete_var": "_RADARSIM_COMPLETE"}
        try:
            # In standalone mode click prints usage errors itself, on several lines.
            code = super().main(args, standalone_mode=False, **options)
        except click.UsageError as error:
            if isinstance(error, click.exceptions.NoArgsIsHelpError):
                # The message of this error is the whole help text.
                click.echo(error.message, err=True)
            else:
                print_message(describe_usage_error(error))
            code = USAGE_ERROR
        sys.exit(code if isinstance(code, int) else 0)


app = _Program(
    "radarsim",
    help="A USARSim server without Unreal, with a radar that sees through foliage and"
    " smoke.",
    context_settings={
        "help_option_names": ["-h", "--help"],
        "auto_envvar_prefix": "RADARSIM",
        "max_content_width": 88,
    },
)
click.version_option(__version__, message="radarsim %(version)s")(app)


def _replace_closed_streams() -> None:
    """Open the null device for each stream that the parent process has closed.

    Otherwise Python sets the stream to None, and the next file that is opened gets its
    file descriptor.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            stream = Path(os.devnull).open(mode, encoding="utf-8")  # noqa: SIM115
            setattr(sys, name, stream)


def _report_text() -> str:
    """Return the text that asks the user to report a bug, with the versions."""
    return (
        "this is an error in radarsim itself; please report the lines above, the"
        " command with its files, and these versions:"
        f" radarsim {__version__}, Python {platform.python_version()},"
        f" {platform.platform()}"
    )


def main() -> None:
    """Run a command and exit with its code."""
    _replace_closed_streams()
    try:
        app()
    except RadarsimError as error:
        print_message(str(error))
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except OSError as error:
        name = "" if error.filename is None else f" {error.filename}"
        reason = describe_os_error(error)
        print_message(f"cannot write{name}: {reason}")
        _drop_output()
        sys.exit(1)
    except Exception as error:  # noqa: BLE001 - a bug, with its traceback
        traceback.print_exception(error)
        print_message(_report_text())
        sys.exit(1)
    finally:
        ignore_signals()
