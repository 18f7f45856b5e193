"""``radarsim demo``: radar and laser side by side, in one picture."""

from pathlib import Path
from typing import Annotated, Final

import typer

from radarsim.cli.options import check_ending, check_writable, write_file
from radarsim.cli.output import print_lines, program_name
from radarsim.files import is_by_radarsim

MAP: Final = "foliage_room"
START: Final = "RobotStart1"
TITLE: Final = "To a laser the bushes are a wall; a radar sees through them"
_NEXT: Final = f"""\
Try next:
  {{0}} explain {MAP} --sensor radar --start {START} --beam 92
  {{0}} navigate bug_u_trap --algorithm bug2 --plot run.png
  {{0}} serve {MAP} --web 0
"""


def demo(
    out: Annotated[
        Path, typer.Argument(metavar="[OUT]", help="The picture, a PNG file.")
    ] = Path("radarsim_demo.png"),
) -> None:
    """Draw what radar and laser see of a room behind bushes, in one picture."""
    _check_out(out)
    from radarsim.plotting.comparison import compare
    from radarsim.plotting.style import render

    figure = compare(MAP, "laser", "radar", start=START)
    figure.suptitle(TITLE, fontsize="x-large", fontweight="bold")
    write_file(out, render(figure, "png"), "OUT")
    print_lines([out])
    typer.echo(_NEXT.format(program_name()), err=True, nl=False)


def _check_out(out: Path) -> None:
    """Check that a picture can be written, and that no other file is in its place."""
    check_ending(out, ["png"], "OUT")
    check_writable(out, "OUT")
    if out.exists() and not is_by_radarsim(out):
        text = f"{out} is not by radarsim, expected another file"
        raise typer.BadParameter(text, param_hint="OUT")
