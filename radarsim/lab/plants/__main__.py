"""``python -m radarsim.lab.plants OUT``: write mesh files of plants, and a figure.

With the default seed these are the files of the shipped maps.
"""

from pathlib import Path
from typing import Annotated

import typer

from radarsim.errors import describe_os_error
from radarsim.files import write_atomically
from radarsim.lab.plants.calibration import (
    RAYS,
    Comparison,
    compare_shapes,
    target_transmission,
)
from radarsim.scene.plants.plant import SEED, plant_files


def make(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="The folder for the mesh files.")
    ],
    *,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all plants.")] = SEED,
    figure: Annotated[
        Path | None,
        typer.Option(help="Draw the three shapes of the shrub into this PNG."),
    ] = None,
    calibrate: Annotated[
        bool,
        typer.Option(
            "--calibrate", help="Print how much power their foliage has to take."
        ),
    ] = False,
    rays: Annotated[
        int,
        typer.Option(
            min=1, help="Rays for the calibration of a shape, from each side."
        ),
    ] = RAYS,
) -> None:
    """Write the mesh files of plants, all or none."""
    files = plant_files(seed)
    shapes: list[Comparison] = []
    if calibrate or figure is not None:
        shapes = list(compare_shapes(seed, rays=rays))
    written = {out / name: content for name, content in files.items()}
    if figure is not None:
        from radarsim.lab.plants.figure import plot_shapes  # noqa: PLC0415 - slow
        from radarsim.plotting.style import render  # noqa: PLC0415

        written[figure] = render(plot_shapes(shapes))
    try:
        for folder in {path.parent for path in written}:
            folder.mkdir(parents=True, exist_ok=True)
        write_atomically(written)
    except OSError as error:
        text = f"cannot write {error.filename}: {describe_os_error(error)}"
        raise typer.BadParameter(text) from None
    for name, content in files.items():
        typer.echo(f"{out / name}: {len(content)} bytes")
    if shapes:
        typer.echo(f"wanted: mean transmission {target_transmission():.4f}")
    for shape in shapes:
        ranges = shape.ranges.statistics()
        low, median, high = ranges.percentiles
        typer.echo(
            f"{shape.title}: mean transmission {shape.transmission:.4f}; ranges: mean "
            f"{ranges.mean:.2f} m, deviation {ranges.deviation:.2f} m, 5, 50, 95 %: "
            f"{low:.2f}, {median:.2f}, {high:.2f} m, deviation at one offset "
            f"{ranges.at_one_offset:.2f} m, where spent {ranges.spent:.2f} m, "
            f"through {ranges.through:.3f}"
        )


def main() -> None:
    """Run the program and exit with its code."""
    typer.run(make)


if __name__ == "__main__":
    main()
