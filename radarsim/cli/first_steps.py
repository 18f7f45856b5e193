"""First steps: ``radarsim demo``, ``radarsim new`` and ``radarsim docs``.

The commands draw a radar scan and a laser scan in one picture, write a small map, and
show pages of the manual.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import sys
from pathlib import Path
from typing import Annotated, Final

import click
from annotated_types import Ge

from radarsim.cli.fields import OutputFile
from radarsim.cli.output import (
    check_new_map,
    check_picture,
    print_lines,
    program_name,
    write_file,
)
from radarsim.errors import expected_one_of
from radarsim.files import is_by_radarsim
from radarsim.plans import Option
from radarsim.processes import signal_handlers

MAP: Final = "foliage_room"
START: Final = "RobotStart1"
TITLE: Final = "To a laser the bushes are a wall; some beams of a radar pass them"
_NEXT: Final = f"""\
Try next:
  {{0}} explain {MAP} --sensor radar --start {START} --beam 95
  {{0}} navigate bug_u_trap --algorithm bug2 --plot run.png
  {{0}} serve {MAP} --web 0
"""
STARTER_MAP: Final = Path(__file__).parents[1] / "scene" / "starter_map.yaml"
FOLDER: Final = Path(__file__).parent.parent / "docs"
_PICTURE = re.compile(r"^!\[[^\]]*\]\([^)]*\)\n+", re.MULTILINE)
_COMMENT = re.compile(r"^<!--.*?-->\n", re.MULTILINE | re.DOTALL)
_LINK_TO_PAGE = re.compile(r"\[([^\]]+)\]\((\w+)\.md(?:#[\w-]+)?\)")
_LINK_TO_FILE = re.compile(r"\[([^\]]+)\]\((?!https:)(?:[\w./]+\.\w+)?(?:#[\w-]+)?\)")


def demo(
    out: Annotated[Path | None, Option(is_argument=True)] = None,
    *,
    output: OutputFile = None,
) -> None:
    """Draw a radar scan and a laser scan of a room with bushes.

    Args:
        out: Picture file, .png, .svg or .pdf; by default radarsim_demo.png.
        output: Same as OUT, given as an option as in other commands.
    """
    if out is not None and output is not None:
        raise click.BadParameter("expected only one of OUT and --output")
    hint = "OUT" if output is None else "-o"
    out = output or out or Path("radarsim_demo.png")
    form = check_picture(out, hint)
    # The default name may be the name of a user's file, which must not be replaced.
    if out.exists() and not is_by_radarsim(out):
        text = f"{out} exists and is not by radarsim, expected another name"
        raise click.BadParameter(text, param_hint=hint)
    from radarsim.plotting.scans import compare
    from radarsim.plotting.style import render

    figure = compare(MAP, "laser", "radar", start=START)
    figure.suptitle(TITLE, fontsize="x-large", fontweight="bold")
    write_file(out, render(figure, form), hint)
    print_lines([out])
    # Hints go to stderr, so scripts read only the name of the file on stdout.
    click.echo(_NEXT.format(program_name()), err=True, nl=False)


def new(
    file: Annotated[Path, Option(is_argument=True)],
    *,
    random: Annotated[int | None, Ge(0), Option(metavar="K")] = None,
) -> None:
    """Write a small map with comments, as a template for your own maps.

    Args:
        file: The map file to write, such as room.yaml.
        random: Write random map number K; seven families of maps alternate.
    """
    check_new_map(file, "FILE")
    if random is not None:
        from radarsim.generators.random_maps import make_random_map

        data = make_random_map(random).as_yaml().encode()
    else:
        data = STARTER_MAP.read_bytes()
    write_file(file, data, "FILE")
    name = shlex.quote(str(file))
    picture = shlex.quote(str(file.with_suffix(".png")))
    scan = f"scan {name} --sensor radar --start RobotStart1 -o {picture}"
    commands = (f"check {name}", scan, f"serve {name}")
    first = f"{file}: change it in an editor, then try"
    print_lines((first, *(f"  {program_name()} {command}" for command in commands)))


def docs(topic: Annotated[str, Option(is_argument=True)] = "index") -> None:
    """Show a page of the manual; without TOPIC, the list of topics.

    Args:
        topic: Name of the page; 'index' lists all topics.
    """
    topics = sorted(page.stem for page in FOLDER.glob("*.md"))
    if topic not in topics:
        text = expected_one_of(topic, topics)
        raise click.BadParameter(text, param_hint="TOPIC")
    text = (FOLDER / f"{topic}.md").read_text(encoding="utf-8")
    if not sys.stdout.isatty():
        sys.stdout.write(text)
        return
    from rich.console import Console
    from rich.markdown import Markdown

    # For a terminal, pictures and comments are removed, and links become commands.
    text = _COMMENT.sub("", _PICTURE.sub("", text))
    text = _LINK_TO_PAGE.sub(r"\1 (`radarsim docs \2`)", text)
    text = _LINK_TO_FILE.sub(r"\1", text)  # links to files and to the same page
    # With these options, which git also uses, less shows colours, and exits immediately
    # if the page fits on the screen.
    os.environ.setdefault("LESS", "-FRX")
    console = Console()
    width = min(console.width, 100)
    # The pager handles Ctrl-C; on KeyboardInterrupt pydoc waits until the pager ends.
    interrupts = signal_handlers({signal.SIGINT: signal.default_int_handler})
    with interrupts, console.pager(styles=True):
        console.print(Markdown(text, hyperlinks=False), width=width)
