"""``radarsim spectrum``: turns of an FMCW radar as pictures, images or numbers."""

from __future__ import annotations

import csv
import io
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.cli.options import (
    MapArgument,
    SeedOption,
    SensorOption,
    SensorPoseOption,
    SensorStartOption,
    check_ending,
    check_positive,
    check_writable,
    refuse_options,
    write_file,
)
from radarsim.cli.scan import load_scene_and_pose
from radarsim.errors import PresetError

if TYPE_CHECKING:
    from radarsim.fmcw.spectrum import Spectrum
    from radarsim.sensors.range_scanner import RangeScanner

_ENDINGS = ("png", "svg", "pdf", "npz", "csv")


class View(StrEnum):
    """How a picture shows a turn."""

    CARTESIAN = "cartesian"
    POLAR = "polar"
    ASCOPE = "ascope"


class ImageLayout(StrEnum):
    """The data sets whose images can be written."""

    OXFORD = "oxford"
    BOREAS = "boreas"
    RADIATE = "radiate"


class DetectorName(StrEnum):
    """The detectors of targets."""

    CA = "ca"
    OS = "os"
    K = "k"


def spectrum(
    map_: MapArgument,
    *,
    sensor: SensorOption,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="File to write: .png, .svg or .pdf, .npz with all numbers, or .csv"
            " with the detections.",
        ),
    ],
    start: SensorStartOption = None,
    pose: SensorPoseOption = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change a setting of the sensor; of its FMCW radar: fmcw.KEY=VALUE.",
        ),
    ] = None,
    view: Annotated[
        View | None,
        typer.Option(help="What the picture shows.", show_default="cartesian"),
    ] = None,
    azimuth: Annotated[
        int | None,
        typer.Option(min=0, help="Direction of the A-scope.", show_default="0"),
    ] = None,
    reach: Annotated[
        float | None,
        typer.Option(
            "--range",
            metavar="M",
            callback=check_positive,
            help="Longest range in the picture.",
        ),
    ] = None,
    layout: Annotated[
        ImageLayout | None,
        typer.Option(help="Write an image as in a data set, not a picture."),
    ] = None,
    detector: Annotated[
        DetectorName | None,
        typer.Option(help="Detector of targets.", show_default="ca for .csv"),
    ] = None,
    pfa: Annotated[
        float, typer.Option(help="False alarms in a bin of noise, for ca and os.")
    ] = 1e-4,
    strongest: Annotated[
        int, typer.Option(min=1, help="Bins of each direction, for k.")
    ] = 12,
    count: Annotated[
        int, typer.Option(min=1, help="Number of turns, for .npz and .csv.")
    ] = 1,
    seed: SeedOption = 0,
) -> None:
    """Record turns of an FMCW radar: the power over range in each direction."""
    from radarsim.rng import generator_for

    ending = check_ending(output, _ENDINGS, "-o")
    _check_combinations(ending, view, azimuth, reach, layout, count)
    _check_pfa(pfa)
    check_writable(output, "-o")
    scanner = _load_radar(sensor, settings)
    scene, sensor_pose = load_scene_and_pose(map_, start=start, pose=pose)
    rng = generator_for(seed, sensor)
    turns = [scanner.spectrum(scene, sensor_pose, rng) for _ in range(count)]
    chosen = detector.value if detector else ("ca" if ending == "csv" else None)
    if layout is not None:
        from radarsim.fmcw.image_files import image_of

        data = image_of(turns[0], layout.value)
    elif ending == "npz":
        data = _as_npz(turns)
    elif ending == "csv":
        data = _as_csv(turns, chosen or "ca", pfa, strongest)
    else:
        data = _as_picture(
            turns[0], ending, view, azimuth, reach, (chosen, pfa, strongest)
        )
    write_file(output, data)


def _check_combinations(
    ending: str,
    view: View | None,
    azimuth: int | None,
    reach: float | None,
    layout: ImageLayout | None,
    count: int,
) -> None:
    """Refuse options that the kind of file has no use for.

    Raises:
        typer.BadParameter: If there is one.
    """
    pictures = {"--view": view, "--azimuth": azimuth, "--range": reach}
    if layout is not None:
        refuse_options(pictures, "expected no --layout with it")
        if ending != "png":
            raise typer.BadParameter(
                f"a .{ending} file, expected .png with --layout", param_hint="-o"
            )
    elif ending in ("npz", "csv"):
        refuse_options(pictures, f"expected a picture, not a .{ending} file")
    if count > 1 and ending not in ("npz", "csv"):
        raise typer.BadParameter(
            f"{count}, expected 1 for a .{ending} file", param_hint="--count"
        )
    if azimuth is not None and view is not View.ASCOPE:
        raise typer.BadParameter("expected --view ascope", param_hint="--azimuth")


def _check_pfa(pfa: float) -> None:
    if not 0 < pfa < 1:
        raise typer.BadParameter(
            f"{pfa!r}, expected above 0 and below 1", param_hint="--pfa"
        )


def _load_radar(sensor: str, settings: list[str] | None) -> RangeScanner:
    """Create a scanner with an FMCW radar from a preset and ``KEY=VALUE`` texts.

    Raises:
        typer.BadParameter: If the preset or a setting is wrong.
    """
    from radarsim.presets.sensors import parse_setting
    from radarsim.sensors.range_scanner import load_sensor

    try:
        values = dict(map(parse_setting, settings or []))
        fmcw = {
            key.removeprefix("fmcw."): values.pop(key)
            for key in list(values)
            if key.startswith("fmcw.")
        }
        scanner = load_sensor(sensor, fmcw=fmcw, **values)
        _ = scanner.fmcw
    except PresetError as error:
        raise typer.BadParameter(str(error)) from None
    return scanner


def _as_picture(
    turn: Spectrum,
    form: str,
    view: View | None,
    azimuth: int | None,
    reach: float | None,
    detector: tuple[str | None, float, int],
) -> bytes:
    from radarsim.plotting import draw_spectrum

    last = len(turn.angles) - 1
    if azimuth is not None and azimuth > last:
        raise typer.BadParameter(
            f"{azimuth}, expected 0 to {last}", param_hint="--azimuth"
        )
    name, pfa, strongest = detector
    found = turn.detections(name, pfa=pfa, count=strongest) if name else None
    return draw_spectrum(
        turn,
        view=(view or View.CARTESIAN).value,
        azimuth=azimuth or 0,
        reach=reach,
        detections=found,
        form=form,
    )


def _as_npz(turns: list[Spectrum]) -> bytes:
    """Return all numbers of turns as a NumPy archive."""
    import numpy as np

    data = io.BytesIO()
    np.savez_compressed(
        data,
        angles=turns[0].angles,
        ranges=turns[0].ranges,
        noise_floor=turns[0].noise_floor,
        pose=np.array(turns[0].pose.numbers()),
        power=np.stack([turn.power for turn in turns]),
        counts=np.stack([turn.counts for turn in turns]),
    )
    return data.getvalue()


def _as_csv(turns: list[Spectrum], detector: str, pfa: float, strongest: int) -> bytes:
    """Return a row for each detection."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["turn", "azimuth", "angle", "range", "dbm"])
    for number, turn in enumerate(turns):
        found = turn.detections(detector, pfa=pfa, count=strongest)
        for row, angle, range_, dbm in zip(
            found.rows.tolist(),
            found.angles.tolist(),
            found.ranges.tolist(),
            found.dbm.tolist(),
            strict=True,
        ):
            writer.writerow(
                [number, row, f"{angle:.6f}", f"{range_:.4f}", f"{dbm:.2f}"]
            )
    return text.getvalue().encode()
