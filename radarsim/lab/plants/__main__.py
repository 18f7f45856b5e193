"""``python -m radarsim.lab.plants OUT``: write mesh files of plants, and a figure.

With the default seed these are the files of the shipped maps.
"""

from pathlib import Path
from typing import Annotated

import click
from annotated_types import Ge

from radarsim.cli.command import PlanCommand
from radarsim.cli.fields import Seed
from radarsim.errors import describe_os_error
from radarsim.files import write_atomically
from radarsim.lab.plants.calibration import (
    RAYS,
    Comparison,
    compare_shapes,
    target_transmission,
)
from radarsim.plans import Option
from radarsim.scene.plants.plant import SEED, plant_files


def make(
    out: Annotated[Path, Option(is_argument=True)],
    *,
    seed: Seed = SEED,
    figure: Path | None = None,
    calibrate: bool = False,
    rays: Annotated[int, Ge(1)] = RAYS,
) -> None:
    """Write the mesh files of plants, all or none.

    Args:
        out: The folder for the mesh files.
        seed: Seed of all plants.
        figure: Draw the three shapes of the shrub into this PNG.
        calibrate: Print how much power their foliage has to take.
        rays: Rays for the calibration of a shape, from each side.
    """
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
        raise click.BadParameter(text) from None
    for name, content in files.items():
        click.echo(f"{out / name}: {len(content)} bytes")
    if shapes:
        click.echo(f"wanted: mean transmission {target_transmission():.4f}")
    for shape in shapes:
        ranges = shape.ranges.statistics()
        low, median, high = ranges.percentiles
        click.echo(
            f"{shape.title}: mean transmission {shape.transmission:.4f}; ranges: mean "
            f"{ranges.mean:.2f} m, deviation {ranges.deviation:.2f} m, 5, 50, 95 %: "
            f"{low:.2f}, {median:.2f}, {high:.2f} m, deviation at one offset "
            f"{ranges.at_one_offset:.2f} m, where spent {ranges.spent:.2f} m, "
            f"through {ranges.through:.3f}"
        )


def main() -> None:
    """Run the program and exit with its code."""
    PlanCommand("plants", make).main()


if __name__ == "__main__":
    main()
