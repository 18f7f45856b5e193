"""``radarsim check``: what a map contains, or its errors."""

from pathlib import Path

from radarsim.cli.compile_progress import with_compile_progress
from radarsim.cli.fields import MapName
from radarsim.cli.files import (
    PICTURE_FORMS,
    check_ending,
    check_writable,
    write_file,
)
from radarsim.cli.output import print_lines, print_message
from radarsim.errors import MapError


@with_compile_progress
def check(map_: MapName, *, plot: Path | None = None, strict: bool = False) -> int:
    """Read a map and print what is in it, or all its errors.

    Args:
        map_: A map file, or the name of a shipped map; @VARIANT may follow.
        plot: Draw the plan with names into a .png, .svg or .pdf.
        strict: Exit with 1 if a start is not free or the trial has no path.

    Returns:
        The exit code.
    """
    if plot is not None:
        form = check_ending(plot, PICTURE_FORMS, "--plot")
        check_writable(plot, "--plot")
    from radarsim.scene.map_file import load_variants
    from radarsim.scene.summary import summarise
    from radarsim.simulation.map_warnings import occupied_starts, trial_warnings

    try:
        scene, *variants = load_variants(map_)
        summary = summarise(scene)
        doubts = {
            "starts that are not free": occupied_starts(scene),
            "doubts of the trial": trial_warnings(scene),
        }
    except MapError as error:
        print_lines(error.problems)
        return 1
    print_lines(summary)
    names = [variant.name for variant in variants]
    for title, lines in {"variants": names, **doubts}.items():
        if lines:
            print_lines((title, *(f"  {line}" for line in lines)))
    if plot is not None:
        from radarsim.plotting.scans import draw_scene

        write_file(plot, draw_scene(scene, form=form), "--plot")
        print_message(f"wrote {plot}")
    return int(strict and any(doubts.values()))
