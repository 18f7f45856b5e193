"""The help of commands: short enough to read, and the same wherever it is printed."""

from collections.abc import Iterator

import click
import pytest

from radarsim import plugins
from radarsim.cli.app import EntryGroup
from radarsim.cli.command import PlanCommand
from radarsim.cli.entries import BEYOND_THE_CORE, GROUP, CommandEntry, load_entries

MOST_LINES = 48


def all_entries(
    entries: Iterator[CommandEntry], words: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], CommandEntry]]:
    """Yield all commands, also those of groups, with their words."""
    for entry in entries:
        yield (*words, entry.name), entry
        command = entry.load()
        if isinstance(command, EntryGroup):
            inner = iter(command.entries.values())
            yield from all_entries(inner, (*words, entry.name))


ENTRIES = list(all_entries(load_entries()))
NAMES = [" ".join(words) for words, _ in ENTRIES]


@pytest.mark.parametrize("entry", ENTRIES, ids=NAMES)
def test_help_fits_on_a_screen_and_says_what_options_are(
    entry: tuple[tuple[str, ...], CommandEntry],
) -> None:
    words, found = entry
    command = found.load()
    assert found.help == (command.help or "").partition("\n")[0]
    if isinstance(command, PlanCommand):
        assert [each.name for each in command.fields.values() if not each.help] == []
    context = click.Context(
        command,
        info_name=" ".join(("radarsim", *words)),
        terminal_width=78,  # of 80, two stay free
        help_option_names=["-h", "--help"],  # click keeps it with the command
    )
    lines = context.get_help().splitlines()
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= 80
    assert not any(map(str.isspace, lines))


def test_parts_beyond_the_core_have_these_commands() -> None:
    for part, names in BEYOND_THE_CORE.items():
        assert [each.name for each in plugins.load(GROUP, part)] == [*names]
