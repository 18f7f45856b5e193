"""``radarsim spectrum``, and the option ``--navtech`` of ``radarsim serve``."""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal

import click
from annotated_types import Ge, Gt, Interval, Unit

from radarsim.cli.fields import MapName
from radarsim.cli.output import check_ending, check_writable, print_now, write_file
from radarsim.cli.scan import PlacedSensor
from radarsim.cli.server_options import ServedMap, ServeExtension
from radarsim.errors import PresetError, describe_os_error, join_address
from radarsim.plans import RARE, Option

if TYPE_CHECKING:
    from radarsim.addons.fmcw.detection import Detections
    from radarsim.addons.fmcw.navtech_server import NavtechServer
    from radarsim.addons.fmcw.sequences import DrivenPath
    from radarsim.addons.fmcw.spectrum import Spectrum
    from radarsim.scene.scene import Scene
    from radarsim.sensors.range_scanner import RangeScanner
    from radarsim.server.host import Host

_ENDINGS: Final = ("png", "svg", "pdf", "npz", "csv")
_NAVTECH: Final = "--navtech"
ALIKE: Final = 1e-3  # largest relative difference of bin sizes without a warning


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedRadar(PlacedSensor):
    """An FMCW radar at a pose in a map, or on a path.

    Attributes:
        path: Path of the antenna, a .tum file; record a data set of all revolutions
            along it.
        settings: Change a setting of the sensor, or of its FMCW radar: fmcw.KEY=VALUE.
    """

    one_required: ClassVar[tuple[tuple[str, ...], ...]] = (("start", "pose", "path"),)

    path: Annotated[Path | None, RARE] = None

    def load_scanner(self) -> RangeScanner:
        """Create the scanner with the changed settings.

        Raises:
            click.BadParameter: If the sensor is not an FMCW radar, or a setting is
                wrong.
        """
        from radarsim.sensors.range_scanner import load_sensor

        values = dict(self.settings)
        fmcw = {
            key.removeprefix("fmcw."): values.pop(key)
            for key in list(values)
            if key.startswith("fmcw.")
        }
        try:
            scanner = load_sensor(self.sensor, fmcw=fmcw, **values)
            # Creating the radar checks its settings, so errors are reported before the
            # map is loaded.
            _ = scanner.fmcw
        except PresetError as error:
            raise click.BadParameter(str(error)) from None
        return scanner


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """The view of a picture, its azimuth and its range.

    Attributes:
        view: Top view (default), azimuth over range, or power over range (A-scope).
        azimuth: Number of the azimuth in the A-scope; by default 0, straight ahead.
        max_range: Maximum range of the picture; by default that of the last echo.
    """

    option_group: ClassVar = "Picture"

    view: Literal["cartesian", "polar", "ascope"] | None = None
    azimuth: Annotated[int | None, Ge(0), RARE] = None
    max_range: Annotated[float | None, Gt(0), Unit("m"), RARE] = None

    def refuse(self, text: str) -> None:
        """Raise an error if an option of the picture is given.

        Raises:
            click.BadParameter: If an option is given.
        """
        for name, value in asdict(self).items():
            if value is not None:
                hint = f"--{name.replace('_', '-')}"
                raise click.BadParameter(text, param_hint=hint)


@dataclass(frozen=True, slots=True, kw_only=True)
class Detector:
    """The detector of targets and its parameters.

    Attributes:
        detector: CA-CFAR, OS-CFAR, or the k strongest bins; ca by default for .csv.
        pfa: Probability of a false alarm per bin of noise, for ca and os.
        strongest: Number of bins per azimuth, for k.
    """

    option_group: ClassVar = "Detector"

    detector: Annotated[Literal["ca", "os", "k"] | None, RARE] = None
    pfa: Annotated[float, Interval(gt=0, lt=1), RARE] = 1e-4
    strongest: Annotated[int, Ge(1), RARE] = 12

    def detect(self, turn: Spectrum) -> Detections:
        """Return the targets that the detector finds in a revolution."""
        name = self.detector or "ca"
        return turn.detections(name, pfa=self.pfa, count=self.strongest)


def spectrum(
    map_: MapName,
    plan: PlacedRadar,
    shown: Shown,
    detector: Detector,
    *,
    output: Annotated[Path, Option(names=("-o", "--output"))],
    count: Annotated[int, Ge(1)] = 1,
    layout: Annotated[Literal["oxford", "boreas", "radiate"] | None, RARE] = None,
) -> None:
    """Record the power of an FMCW radar in each azimuth and range bin.

    Args:
        map_: A map file or the name of a shipped map; MAP@VARIANT selects a variant.
        plan: The radar and its pose or path.
        shown: View, azimuth and range of a picture.
        detector: The detector of targets.
        output: File to write: a picture (.png, .svg, .pdf), arrays (.npz) or detections
            (.csv); with --path a folder.
        count: Number of revolutions, for .npz and .csv.
        layout: Write an image in the layout of this data set, instead of a picture;
            oxford by default with --path.
    """
    from radarsim.addons.fmcw.image_files import image_of
    from radarsim.addons.fmcw.sequences import turns_along
    from radarsim.rng import generator_for
    from radarsim.scene.map_file import load_map

    if plan.path is not None:
        shown.refuse("cannot be combined with --path")
        if detector.detector is not None:
            text = "cannot be combined with --path"
            raise click.BadParameter(text, param_hint="--detector")
        scanner = plan.load_scanner()
        scene = load_map(map_)
        way = _load_path(plan.path, scene)
        rng = generator_for(plan.seed, scanner.name)
        along = turns_along(scanner.fmcw, scene, way, rng)
        number = _write_sequence(output, layout or "oxford", along)
        click.echo(f"{number} turns along {way.duration:.1f} s in {output}", err=True)
        return
    ending = check_ending(output, _ENDINGS, "-o")
    if layout is not None:
        shown.refuse("cannot be combined with --layout")
        if ending != "png":
            text = f"a .{ending} file, expected .png with --layout"
            raise click.BadParameter(text, param_hint="-o")
    elif ending in ("npz", "csv"):
        shown.refuse(f"expected a picture, not a .{ending} file")
    if count > 1 and ending not in ("npz", "csv"):
        text = f"{count}, expected 1 for a .{ending} file"
        raise click.BadParameter(text, param_hint="--count")
    if shown.azimuth is not None and shown.view != "ascope":
        raise click.BadParameter("needs --view ascope", param_hint="--azimuth")
    check_writable(output, "-o")
    scanner = plan.load_scanner()
    scene = load_map(map_)
    pose = plan.find_pose(scene)
    # All revolutions use one random generator, so further revolutions do not change the
    # first revolutions.
    rng = generator_for(plan.seed, plan.sensor)
    turns = [scanner.spectrum(scene, pose, rng) for _ in range(count)]
    if layout is not None:
        data = image_of(turns[0], layout)
    elif ending == "npz":
        data = _as_npz(turns)
    elif ending == "csv":
        data = _as_csv(turns, detector)
    else:
        data = _as_picture(turns[0], scene, ending, shown, detector)
    write_file(output, data)


def _as_picture(
    turn: Spectrum, scene: Scene, form: str, shown: Shown, detector: Detector
) -> bytes:
    """Draw a revolution with the outlines of the map.

    Raises:
        click.BadParameter: If there is no such azimuth.
    """
    from matplotlib.figure import Figure

    from radarsim.addons.fmcw.plots import plot_spectrum
    from radarsim.plotting.style import render

    last, azimuth = len(turn.angles) - 1, shown.azimuth or 0
    if azimuth > last:
        text = f"{azimuth}, expected 0 to {last}"
        raise click.BadParameter(text, param_hint="--azimuth")
    axes = plot_spectrum(
        turn,
        view=shown.view or "cartesian",
        azimuth=azimuth,
        reach=shown.max_range,
        detections=detector.detect(turn) if detector.detector else None,
        scene=scene,
    )
    assert isinstance(axes.figure, Figure)
    return render(axes.figure, form)


def _as_npz(turns: list[Spectrum]) -> bytes:
    """Return the data of revolutions as the bytes of a NumPy archive."""
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


def _as_csv(turns: list[Spectrum], detector: Detector) -> bytes:
    """Return CSV with a row per detected target; the default detector is ``ca``."""
    import numpy as np

    text = io.StringIO("turn,azimuth,angle,range,dbm,rcs_dbsm,snr_db,radial_velocity\n")
    text.seek(0, io.SEEK_END)
    for number, turn in enumerate(turns):
        found = detector.detect(turn)
        turns_of = np.full(len(found.rows), number)
        columns = (turns_of, found.rows, *found[2:])
        form = "%d,%d,%.6f,%.4f,%.2f,%.2f,%.2f,%.3f"
        np.savetxt(text, np.column_stack(columns), fmt=form)
    return text.getvalue().encode()


def _load_path(path: Path, scene: Scene) -> DrivenPath:
    """Read an antenna's path; if all heights are 0, use a usual scanner height.

    Raises:
        click.BadParameter: If the file cannot be read, or has no valid path.
    """
    import numpy as np

    from radarsim.addons.fmcw.sequences import read_tum
    from radarsim.sensors.range_scanner import SENSOR_HEIGHT

    try:
        way = read_tum(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        text = f"cannot read {path}: {describe_os_error(error)}"
        raise click.BadParameter(text, param_hint="--path") from None
    except ValueError as error:
        raise click.BadParameter(f"{path}: {error}", param_hint="--path") from None
    # A .tum file always has a height, which is 0 for a path on the floor.
    if way.positions[:, 2].any():
        return way
    floor = [scene.floor_at(x, y) for x, y, _ in way.positions.tolist()]
    heights = np.array(floor) + SENSOR_HEIGHT
    return replace(way, positions=np.column_stack([way.positions[:, :2], heights]))


def _write_sequence(
    folder: Path, layout: str, turns: Iterable[tuple[float, Spectrum]]
) -> int:
    """Write revolutions in the layout of a data set, with poses; return their number.

    Args:
        folder: The folder, which is created if it is missing.
        layout: Name of the data set.
        turns: Revolutions with the times at which they begin, s.

    Raises:
        click.BadParameter: If a file cannot be written.
    """
    from radarsim.addons.fmcw.image_files import (
        LAYOUTS,
        assumed_bin,
        cartesian_image,
        epoch_of,
        file_name,
        image_of,
        list_line,
        sequence_notes,
    )
    from radarsim.addons.fmcw.sequences import tum_line

    images = folder / LAYOUTS[layout][0]
    try:
        images.mkdir(parents=True, exist_ok=True)
        if layout == "radiate":
            (folder / "Navtech_Cartesian").mkdir(exist_ok=True)
    except OSError as error:
        text = f"cannot make {images}: {describe_os_error(error)}"
        raise click.BadParameter(text, param_hint="-o") from None
    lines, poses = [], ["# time x y z qx qy qz qw, of the antenna in the middle\n"]
    epoch_us, notes = 0, ""
    for number, (time, turn) in enumerate(turns, 1):
        settings, time_us = turn.settings, round(time * 1e6)
        if number == 1:
            epoch_us = epoch_of(layout, settings.bin_size, time_us)
            start_us = time_us + epoch_us
            size, assumed = settings.bin_size, assumed_bin(layout, start_us)
            if abs(size / assumed - 1) > ALIKE:
                text = f"readers of {layout} assume bins of {assumed:g} m"
                text += f"; set {size:g} m in the reader"
                click.echo(f"warning: {text}", err=True)
            notes = sequence_notes(layout, turn, start_us, epoch_us)
        time_us += epoch_us
        name = file_name(turn, layout, time_us=time_us, number=number)
        write_file(images / name, image_of(turn, layout, time_us=time_us))
        if layout == "radiate":
            write_file(folder / "Navtech_Cartesian" / name, cartesian_image(turn))
        lines.append(list_line(layout, name, time_us))
        middle = epoch_us / 1e6 + time + settings.azimuths * settings.sweep_time / 2
        poses.append(tum_line(middle, turn.pose))
    # Lists of images are written last, so that the lists of an interrupted sequence
    # name no missing images.
    for list_name in LAYOUTS[layout][1:]:
        write_file(folder / list_name, "".join(lines).encode())
    write_file(folder / "poses.tum", "".join(poses).encode())
    write_file(folder / "README.md", notes.encode())
    return len(lines)


@dataclass(frozen=True, slots=True)
class NavtechOptions:
    """The option ``--navtech`` of ``radarsim serve``.

    Attributes:
        navtech: Also serve a robot's FMCW radar, such as that of a P3AT_Navtech, on
            this port in Navtech's protocol; by default that of the first robot with
            such a radar. Real radars use port 6317.
    """

    option_group: ClassVar = "Additional services"

    navtech: Annotated[str | None, Option(metavar="PORT[:ROBOT]", is_rare=True)] = None

    def extension(self, _: ServedMap) -> NavtechExtension | None:
        """Return the extension that the option requests, or None if it is not given."""
        if self.navtech is None:
            return None
        port, colon, robot = self.navtech.partition(":")
        problem = ""
        # isdigit() also accepts other Unicode digits, some of which int() refuses.
        if not (port.isascii() and port.isdigit() and int(port) <= 65535):
            problem = "PORT or PORT:ROBOT, with a port from 0 to 65535"
        elif colon and not robot:
            problem = "the name of a robot after the colon"
        if problem:
            text = f"{self.navtech!r}, expected {problem}"
            raise click.BadParameter(text, param_hint=_NAVTECH)
        return NavtechExtension(int(port), robot or None)


class NavtechExtension(ServeExtension):
    """Serves a robot's radar on a separate port, in addition to the USARSim server."""

    def __init__(self, port: int, robot: str | None) -> None:
        """Store the arguments for a ``NavtechServer``, which is created later."""
        self.ports = {_NAVTECH: port}
        self._robot = robot
        self._server: NavtechServer

    def attach(self, host: Host) -> None:
        """Create the radar server, and add it to the host as an observer."""
        from radarsim.addons.fmcw.navtech_server import NavtechServer

        self._server = NavtechServer(port=self.ports[_NAVTECH], robot=self._robot)
        host.add_observer(self._server)

    async def start(self, address: str) -> None:
        """Start to listen for clients of the radar on an address."""
        await self._server.start(address)

    def announce(self, _: tuple[str, int]) -> None:
        """Print on stdout that clients of the radar can connect."""
        print_now(f"radarsim: radar on {join_address(*self._server.address)}")

    async def stop(self) -> None:
        """Close the radar server and its connections."""
        await self._server.stop()
