"""``radarsim docs``: the pages of the manual."""

from __future__ import annotations

import os
import re
import signal
import sys
from pathlib import Path
from typing import Annotated, Final

import click

from radarsim.errors import expected_one_of
from radarsim.plans import Option
from radarsim.processes import signal_handlers

FOLDER: Final = Path(__file__).parent.parent / "docs"
_PICTURE = re.compile(r"^!\[[^\]]*\]\([^)]*\)\n+", re.MULTILINE)
_COMMENT = re.compile(r"^<!--.*?-->\n", re.MULTILINE | re.DOTALL)
_LINK_TO_PAGE = re.compile(r"\[([^\]]+)\]\((\w+)\.md(?:#[\w-]+)?\)")


def docs(topic: Annotated[str, Option(is_argument=True)] = "index") -> None:
    """Show a page of the manual; without a topic, the list of topics.

    Args:
        topic: Topic to show; 'index' lists them all.
    """
    topics = sorted(page.stem for page in FOLDER.glob("*.md"))
    if topic not in topics:
        text = expected_one_of(topic, topics)
        raise click.BadParameter(text, param_hint="TOPIC")
    text = (FOLDER / f"{topic}.md").read_text(encoding="utf-8")
    if sys.stdout.isatty():
        _page(_prepare_for_terminal(text))
    else:
        sys.stdout.write(text)


def _prepare_for_terminal(text: str) -> str:
    """Return a page without pictures and comments, its links as commands."""
    text = _COMMENT.sub("", _PICTURE.sub("", text))
    return _LINK_TO_PAGE.sub(r"\1 (`radarsim docs \2`)", text)


def _page(text: str) -> None:
    """Render a page, and show it in the user's pager."""
    from rich.console import Console
    from rich.markdown import Markdown

    # As git does: colours pass, and a page that fits on the screen is just printed.
    os.environ.setdefault("LESS", "-FRX")
    console = Console()
    width = min(console.width, 100)
    # Ctrl-C is the pager's matter: pydoc waits for it on KeyboardInterrupt.
    interrupts = signal_handlers({signal.SIGINT: signal.default_int_handler})
    with interrupts, console.pager(styles=True):
        console.print(Markdown(text, hyperlinks=False), width=width)
