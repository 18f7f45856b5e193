"""``radarsim check``: what a map contains, or its errors."""

import typer

from radarsim.cli.options import MapArgument
from radarsim.errors import MapError


def check(map_: MapArgument) -> None:
    """Read a map and print what is in it, or all its errors."""
    from radarsim.evaluation.map_warnings import occupied_starts, trial_warnings
    from radarsim.scene.map_file import load_variants
    from radarsim.scene.summary import summarise

    try:
        scene, *variants = load_variants(map_)
        summary = summarise(scene)
        lists = {
            "variants": [variant.name for variant in variants],
            "starts that are not free": occupied_starts(scene),
            "doubts of the trial": trial_warnings(scene),
        }
    except MapError as error:
        typer.echo("\n".join(error.problems))
        raise typer.Exit(1) from None
    typer.echo("\n".join(summary))
    for title, lines in lists.items():
        if lines:
            typer.echo("\n  ".join((title, *lines)))
