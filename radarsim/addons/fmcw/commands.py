"""``radarsim spectrum``: turns of an FMCW radar as pictures, images or numbers."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.cli.legacy_sensor import load_scene_and_pose
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
from radarsim.errors import PresetError

if TYPE_CHECKING:
    from radarsim.addons.fmcw.spectrum import Spectrum
    from radarsim.addons.fmcw.spectrum_files import Detector, Shown
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


OutputOption = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        help="File to write: .png, .svg or .pdf, .npz with all numbers, or .csv with"
        " the detections. With --path a folder.",
    ),
]
PathOption = Annotated[
    Path | None,
    typer.Option(
        "--path",
        metavar="FILE.tum",
        help="Record all turns along a path of the antenna, as in a data set.",
    ),
]
SettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a setting of the sensor; of its FMCW radar: fmcw.KEY=VALUE.",
    ),
]
ViewOption = Annotated[
    View | None,
    typer.Option(help="What the picture shows.", show_default="cartesian"),
]
AzimuthOption = Annotated[
    int | None,
    typer.Option(min=0, help="Direction of the A-scope.", show_default="0"),
]
RangeOption = Annotated[
    float | None,
    typer.Option(
        "--max-range",
        "--range",
        metavar="M",
        callback=check_positive,
        help="Longest range in the picture; by default what is above the noise.",
    ),
]
LayoutOption = Annotated[
    ImageLayout | None,
    typer.Option(
        help="Write an image as in a data set, not a picture.",
        show_default="oxford with --path",
    ),
]
DetectorOption = Annotated[
    DetectorName | None,
    typer.Option(help="Detector of targets.", show_default="ca for .csv"),
]
PfaOption = Annotated[
    float, typer.Option(help="False alarms in a bin of noise, for ca and os.")
]
StrongestOption = Annotated[
    int, typer.Option(min=1, help="Bins of each direction, for k.")
]
CountOption = Annotated[
    int, typer.Option(min=1, help="Number of turns, for .npz and .csv.")
]


def spectrum(
    map_: MapArgument,
    *,
    sensor: SensorOption,
    output: OutputOption,
    start: SensorStartOption = None,
    pose: SensorPoseOption = None,
    path: PathOption = None,
    settings: SettingsOption = None,
    view: ViewOption = None,
    azimuth: AzimuthOption = None,
    reach: RangeOption = None,
    layout: LayoutOption = None,
    detector: DetectorOption = None,
    pfa: PfaOption = 1e-4,
    strongest: StrongestOption = 12,
    count: CountOption = 1,
    seed: SeedOption = 0,
) -> None:
    """Record turns of an FMCW radar: the power over range in each direction."""
    from radarsim.addons.fmcw.spectrum_files import Detector, Shown
    from radarsim.rng import generator_for

    pictures = {"--view": view, "--azimuth": azimuth, "--range": reach}
    if path is not None:
        others = {"--start": start, "--pose": pose, "--detector": detector, **pictures}
        refuse_options(others, "expected no --path with it")
        scanner = _load_radar(sensor, settings)
        _record_path(map_, scanner, path, layout or ImageLayout.OXFORD, output, seed)
        return
    ending = check_ending(output, _ENDINGS, "-o")
    _check_combinations(ending, pictures, layout, count)
    if azimuth is not None and view is not View.ASCOPE:
        raise typer.BadParameter("expected --view ascope", param_hint="--azimuth")
    _check_pfa(pfa)
    check_writable(output, "-o")
    scanner = _load_radar(sensor, settings)
    scene, sensor_pose = load_scene_and_pose(map_, start=start, pose=pose)
    rng = generator_for(seed, sensor)
    turns = [scanner.spectrum(scene, sensor_pose, rng) for _ in range(count)]
    shown = Shown((view or View.CARTESIAN).value, azimuth or 0, reach)
    found = Detector(detector.value if detector else None, pfa, strongest)
    write_file(output, _contents(turns, ending, layout, shown, found))


def _contents(
    turns: list[Spectrum],
    ending: str,
    layout: ImageLayout | None,
    shown: Shown,
    detector: Detector,
) -> bytes:
    """Return the contents of the file."""
    from radarsim.addons.fmcw.image_files import image_of
    from radarsim.addons.fmcw.spectrum_files import as_csv, as_npz, as_picture

    if layout is not None:
        return image_of(turns[0], layout.value)
    if ending == "npz":
        return as_npz(turns)
    if ending == "csv":
        return as_csv(turns, detector)
    return as_picture(turns[0], ending, shown, detector)


def _record_path(
    map_: str,
    scanner: RangeScanner,
    path: Path,
    layout: ImageLayout,
    folder: Path,
    seed: int,
) -> None:
    """Write the turns along a path, and say how many they are."""
    from radarsim.addons.fmcw.sequences import turns_along
    from radarsim.addons.fmcw.spectrum_files import load_path, write_sequence
    from radarsim.rng import generator_for
    from radarsim.scene.map_file import load_map

    scene = load_map(map_)
    way = load_path(path, scene)
    rng = generator_for(seed, scanner.name)
    turns = turns_along(scanner.fmcw, scene, way, rng)
    number = write_sequence(folder, layout.value, turns)
    typer.echo(f"{number} turns along {way.duration:.1f} s in {folder}", err=True)


def _check_combinations(
    ending: str,
    pictures: Mapping[str, object],
    layout: ImageLayout | None,
    count: int,
) -> None:
    """Refuse options that the kind of file has no use for.

    Raises:
        typer.BadParameter: If there is one.
    """
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
