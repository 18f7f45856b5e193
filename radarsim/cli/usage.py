"""Errors of usage: one line in the words and the shape of all other messages."""

import re

import click

from radarsim.cli.command import PlanCommand, shown_name
from radarsim.cli.config_file import describe_place
from radarsim.errors import did_you_mean


def describe_usage_error(error: click.UsageError) -> str:
    """Return what is wrong with a command line; empty if its help was printed."""
    ctx = error.ctx
    if isinstance(error, click.MissingParameter):
        return f"missing: {', '.join(_missing(ctx))}{_see_help(ctx)}"
    if isinstance(error, click.NoSuchOption):
        return _describe_unknown_option(error)
    if isinstance(error, click.BadOptionUsage):
        expected = "a" if "requires" in error.message else "no"
        return f"{error.option_name}: expected {expected} value with it"
    extra = re.match(r"Got unexpected extra arguments? \((.*)\)", error.message)
    if extra is not None:
        return f"'{extra[1]}', expected no more arguments{_see_help(ctx)}"
    if not isinstance(error, click.BadParameter):
        return error.message
    hint = error.param_hint or (shown_name(error.param) if error.param else "")
    text = f"{hint}: {error.message}" if hint else error.message
    return describe_place(error) or text


def _missing(ctx: click.Context | None) -> list[str]:
    if ctx is None or not isinstance(ctx.command, PlanCommand):
        return ["COMMAND"]
    return ctx.command.missing(ctx)


def _see_help(ctx: click.Context | None) -> str:
    return "" if ctx is None else f"; see '{ctx.command_path} --help'"


def _describe_unknown_option(error: click.NoSuchOption) -> str:
    name, ctx = error.option_name, error.ctx
    params = ctx.command.get_params(ctx) if ctx is not None else []
    known = [each for param in params for each in param.opts if each.startswith("--")]
    continued = [each for each in known if each.startswith(name)]
    meant = did_you_mean(name, continued) or did_you_mean(name, known)
    return f"{name!r}, expected another option{meant or _see_help(ctx)}"
