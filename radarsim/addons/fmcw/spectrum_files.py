"""What ``radarsim spectrum`` writes: pictures, archives, tables, and sequences."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from radarsim.cli.options import write_file
from radarsim.errors import describe_os_error

if TYPE_CHECKING:
    from collections.abc import Iterable

    from radarsim.addons.fmcw.sequences import DrivenPath, DrivenTurn
    from radarsim.addons.fmcw.spectrum import Spectrum
    from radarsim.scene.scene import Scene


class Detector(NamedTuple):
    """How targets are detected.

    Attributes:
        name: As ``Spectrum.detections`` has it; None for no detector.
        pfa: Probability of a false alarm.
        strongest: Bins of each direction, for ``k``.
    """

    name: str | None
    pfa: float
    strongest: int


class Shown(NamedTuple):
    """What a picture shows.

    Attributes:
        view: ``cartesian``, ``polar`` or ``ascope``.
        azimuth: The direction of an A-scope.
        reach: Longest range, m; None for what is above the noise.
    """

    view: str
    azimuth: int
    reach: float | None


def as_picture(turn: Spectrum, form: str, shown: Shown, detector: Detector) -> bytes:
    """Draw a turn.

    Raises:
        typer.BadParameter: If it has no such direction.
    """
    from radarsim.addons.fmcw.plots import draw_spectrum

    last = len(turn.angles) - 1
    if shown.azimuth > last:
        raise typer.BadParameter(
            f"{shown.azimuth}, expected 0 to {last}", param_hint="--azimuth"
        )
    name, pfa, strongest = detector
    found = turn.detections(name, pfa=pfa, count=strongest) if name else None
    return draw_spectrum(turn, **shown._asdict(), detections=found, form=form)


def as_npz(turns: list[Spectrum]) -> bytes:
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


def as_csv(turns: list[Spectrum], detector: Detector) -> bytes:
    """Return a row for each detection, by default of ``ca``."""
    name, pfa, strongest = detector
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["turn", "azimuth", "angle", "range", "dbm"])
    for number, turn in enumerate(turns):
        found = turn.detections(name or "ca", pfa=pfa, count=strongest)
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


def load_path(path: Path, scene: Scene) -> DrivenPath:
    """Read the path of an antenna; one without heights is at that of a robot's scanner.

    Raises:
        typer.BadParameter: If it cannot be read, or is no path.
    """
    import numpy as np

    from radarsim.addons.fmcw.sequences import read_tum
    from radarsim.sensors.range_scanner import SENSOR_HEIGHT

    try:
        way = read_tum(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        text = f"cannot read {path}: {describe_os_error(error)}"
        raise typer.BadParameter(text, param_hint="--path") from None
    except ValueError as error:
        raise typer.BadParameter(f"{path}: {error}", param_hint="--path") from None
    if way.positions[:, 2].any():
        return way
    floor = [scene.floor_at(x, y) for x, y, _ in way.positions.tolist()]
    return way.at_heights(np.array(floor) + SENSOR_HEIGHT)


def write_sequence(folder: Path, layout: str, turns: Iterable[DrivenTurn]) -> int:
    """Write turns as a data set has them, with their poses; return their number.

    Args:
        folder: Created if it is missing.
        layout: Of which data set.
        turns: The turns.

    Raises:
        typer.BadParameter: If a file cannot be written.
    """
    from radarsim.addons.fmcw.image_files import (
        file_name,
        folder_of,
        image_of,
        list_file,
        list_line,
    )

    images = folder / folder_of(layout)
    try:
        images.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        text = f"cannot make {images}: {describe_os_error(error)}"
        raise typer.BadParameter(text, param_hint="-o") from None
    lines, poses = [], ["# time x y z qx qy qz qw, of the antenna in the middle\n"]
    for number, turn in enumerate(turns, 1):
        time_us = round(turn.time * 1e6)
        name = file_name(turn.spectrum, layout, time_us=time_us, number=number)
        write_file(images / name, image_of(turn.spectrum, layout, time_us=time_us))
        lines.append(list_line(layout, name, time_us))
        poses.append(turn.tum_line())
    write_file(folder / list_file(layout), "".join(lines).encode())
    write_file(folder / "poses.tum", "".join(poses).encode())
    return len(lines)
