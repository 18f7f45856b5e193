"""``radarsim check``: what a map contains, or its errors."""

from pathlib import Path
from typing import Annotated

import typer

from radarsim.cli.options import (
    PICTURE_FORMS,
    MapArgument,
    check_ending,
    check_writable,
    write_file,
)
from radarsim.cli.output import print_lines, print_message
from radarsim.errors import MapError


def check(
    map_: MapArgument,
    *,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Exit with 1 if a start is not free or the trial has no path.",
        ),
    ] = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw the plan with names; .png, .svg or .pdf."
        ),
    ] = None,
) -> None:
    """Read a map and print what is in it, or all its errors."""
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
        raise typer.Exit(1) from None
    print_lines(summary)
    names = [variant.name for variant in variants]
    for title, lines in {"variants": names, **doubts}.items():
        if lines:
            print_lines((title, *(f"  {line}" for line in lines)))
    if plot is not None:
        from radarsim.plotting.scans import draw_scene

        write_file(plot, draw_scene(scene, form=form), "--plot")
        print_message(f"wrote {plot}")
    if strict and any(doubts.values()):
        raise typer.Exit(1)
