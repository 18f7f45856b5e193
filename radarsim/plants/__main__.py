"""``python -m radarsim.plants OUT``: mesh files of plants, and the figure of a shrub.

With the seed that is the default, these are the files of the shipped maps.
"""

from pathlib import Path
from typing import Annotated

import typer

from radarsim.plants.calibration import (
    RAYS,
    Comparison,
    compare_shapes,
    wanted_transmission,
)
from radarsim.plants.plant import SEED, plant_files, write_all


def make(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="The folder for the mesh files.")
    ],
    *,
    seed: Annotated[int, typer.Option(min=0, help="Of all plants.")] = SEED,
    figure: Annotated[
        Path | None,
        typer.Option(help="A PNG that compares the three shapes of the shrub."),
    ] = None,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Print what their foliage has to take.")
    ] = False,
    rays: Annotated[
        int, typer.Option(min=1, help="That calibrate a shape, from each side.")
    ] = RAYS,
) -> None:
    """Make the mesh files of plants, whole or not at all."""
    files = plant_files(seed)
    shapes: list[Comparison] = []
    if calibrate or figure is not None:
        shapes = list(compare_shapes(seed, rays=rays))
    drawn = _draw(shapes) if figure is not None else b""
    try:
        write_all(out, files)
        if figure is not None:
            write_all(figure.parent, {figure.name: drawn})
    except OSError as error:
        text = f"cannot write {error.filename}: {(error.strerror or '').lower()}"
        raise typer.BadParameter(text) from None
    for name, content in files.items():
        typer.echo(f"{out / name}: {len(content)} bytes")
    if shapes:
        typer.echo(f"wanted: mean transmission {wanted_transmission():.4f}")
    for shape in shapes:
        typer.echo(_told(shape))


def _draw(shapes: list[Comparison]) -> bytes:
    from radarsim.plants.figure import draw_shapes  # noqa: PLC0415 - matplotlib is slow

    return draw_shapes(shapes)


def _told(shape: Comparison) -> str:
    spread = shape.reading.spread()
    low, middle, high = spread.percentiles
    return (
        f"{shape.title}: mean transmission {shape.transmission:.4f}; ranges: mean "
        f"{spread.mean:.2f} m, deviation {spread.deviation:.2f} m, 5, 50, 95 %: "
        f"{low:.2f}, {middle:.2f}, {high:.2f} m, deviation at one offset "
        f"{spread.at_one_offset:.2f} m, where spent {spread.spent:.2f} m, "
        f"through {spread.through:.3f}"
    )


def main() -> None:
    """Run, and exit with the code."""
    typer.run(make)


if __name__ == "__main__":
    main()
