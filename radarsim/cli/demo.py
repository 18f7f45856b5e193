"""``radarsim demo``: radar and laser side by side, in one picture."""

from pathlib import Path
from typing import Annotated, Final

import click

from radarsim.cli.compile_progress import with_compile_progress
from radarsim.cli.files import check_ending, check_writable, write_file
from radarsim.cli.output import print_lines, program_name
from radarsim.files import is_by_radarsim
from radarsim.plans import Option

MAP: Final = "foliage_room"
START: Final = "RobotStart1"
TITLE: Final = "To a laser the bushes are a wall; a radar sees through them"
_NEXT: Final = f"""\
Try next:
  {{0}} explain {MAP} --sensor radar --start {START} --beam 92
  {{0}} navigate bug_u_trap --algorithm bug2 --plot run.png
  {{0}} serve {MAP} --web 0
"""


@with_compile_progress
def demo(
    out: Annotated[Path, Option(is_argument=True)] = Path("radarsim_demo.png"),
) -> None:
    """Draw what radar and laser see of a room behind bushes, in one picture.

    Args:
        out: The picture, a PNG file.
    """
    check_ending(out, ["png"], "OUT")
    check_writable(out, "OUT")
    if out.exists() and not is_by_radarsim(out):
        text = f"{out} is not by radarsim, expected another file"
        raise click.BadParameter(text, param_hint="OUT")
    from radarsim.plotting.comparison import compare
    from radarsim.plotting.style import render

    figure = compare(MAP, "laser", "radar", start=START)
    figure.suptitle(TITLE, fontsize="x-large", fontweight="bold")
    write_file(out, render(figure, "png"), "OUT")
    print_lines([out])
    click.echo(_NEXT.format(program_name()), err=True, nl=False)
