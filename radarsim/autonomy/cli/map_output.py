"""Output of ``radarsim map``: files, pictures, films, progress and printed results.

A run explores, or watches a robot that another client drives.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
import numpy as np

from radarsim.autonomy.cli.run_files import (
    Recording,
    check_film,
    drawn_robot,
    filmed,
)
from radarsim.autonomy.evaluation.map_score import FloorPart, robot_and_sensor
from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.mapping.export import (
    HEAD,
    MARK,
    commander_png,
    nav_map,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.mapping.trajectory import tum_text
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.autonomy.plotting.maps import (
    MapFrames,
    MapView,
    draw_area_curve,
    map_figure,
)
from radarsim.autonomy.plotting.outlines import Outline, outlines_of
from radarsim.autonomy.watching import RobotWatcher, WatchMapper
from radarsim.cli.output import (
    check_picture,
    check_writable,
    print_lines,
    print_message,
    start_log,
    write_picture,
)
from radarsim.cli.progress import live_status
from radarsim.errors import describe_os_error
from radarsim.files import is_by_radarsim, write_atomically
from radarsim.plotting.film import Pixels
from radarsim.plotting.style import as_words, render
from radarsim.processes import raise_on_signals, set_exit_code_of_sigterm

if TYPE_CHECKING:
    from radarsim.autonomy.cli.map import MapFileOptions

DEFAULT_STEM: Final = "map"  # stem of file names in a folder
FILE_SUFFIXES: Final = (".png", ".pgm", ".yaml", ".tum")
TITLE_ENDINGS: Final = {
    "incomplete": "until nothing was left to try",
    "time_limit": "until time was up",
    "stuck": "until the robot was stuck",
    "failed": "until the run failed",
    "broken_off": "until interrupted",
}
CLASSES: Final = ("free", "obstacle", "foliage", "smoke")
ENDINGS: Final = {
    "incomplete": "given up",
    "time_limit": "time is up",
    "broken_off": "interrupted",
    "watched": "mapped what was watched",
}


class MapFiles:
    """The files that a mapping run writes; chooses their names and their contents.

    Attributes:
        options: Options of the written files.
        stem: The common beginning of all file paths.
        paths: All files: cells, nav2's image and YAML, trajectory, picture.
    """

    def __init__(self, options: MapFileOptions, name: str) -> None:
        """Choose the file names.

        Args:
            options: Options of the written files. The output is a folder, or the common
                beginning of all file names; it may end in the suffix of one file.
            name: Default beginning of the file names.
        """
        self.options = options
        out = options.output or name
        path = Path(out)
        self._names_folder = is_folder = out.endswith(("/", os.sep))
        with suppress(OSError):  # for example for a name that is too long
            is_folder = is_folder or path.is_dir()
        if is_folder:
            path /= DEFAULT_STEM
        elif path.suffix in FILE_SUFFIXES:
            path = path.with_suffix("")
        self.stem = path
        scale, image = ("_scale", ".png") if options.mode == "scale" else ("", ".pgm")
        endings = (".png", f"{scale}{image}", f"{scale}.yaml", ".tum", "_view.png")
        self.paths = tuple(path.with_name(path.name + each) for each in endings)

    def check(self, served: str | None = None) -> None:
        """Check before the robot drives that all files can be written after the run.

        A missing folder is created if its name ends in a slash.

        Args:
            served: The simulated map, or None.

        Raises:
            click.BadParameter: If the folder is missing or not writable, or a file of
                another program would be overwritten.
        """
        folder = self.stem.parent
        try:
            if self._names_folder:
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"cannot make {folder}: {describe_os_error(error)}"
            raise click.BadParameter(text, param_hint="OUT") from None
        for path in self.paths:
            check_writable(path, "OUT")
            is_served = _is_same(path, served)
            if is_served or (path.is_file() and not _is_ours(path)):
                what = "the simulated map" if is_served else "another program's file"
                text = f"would overwrite {path}, which is {what}, expected another OUT"
                raise click.BadParameter(text, param_hint="-o")
        check_film(self.options.film)
        check_picture(self.options.plot)

    def write(self, run: MappingRun) -> None:
        """Write the map of a run and its plot, if there was at least one scan.

        If the map cannot be written, the reason is printed and added to the result.
        """
        mapper = run.source.mapper
        if mapper is None or not mapper.scans:
            return
        grid, paths = mapper.grid, self.paths
        image, yaml = nav_map(grid, paths[2].stem, mode=self.options.mode).values()
        figure = map_figure([view_of(run, mapper)], numbers=True)
        contents = (
            commander_png(grid),
            image,
            yaml,
            tum_text(mapper.trajectory).encode(),
            render(figure, software=MARK),
        )
        try:
            # All files are replaced together, so
            # that old and new files are never mixed.
            write_atomically(dict(zip(paths, contents, strict=True)))
            run.files = paths
        except OSError as error:
            name = "the map" if error.filename is None else error.filename
            text = f"cannot write {name}: {describe_os_error(error)}"
            print_message(text)
            run.error = f"{run.error}; {text}" if run.error else text
        plot, curve = self.options.plot, run.area_curve
        if plot is not None and curve.samples:
            name = "" if run.scene is None else f" in {as_words(run.scene.name)}"
            strategy, title = run.strategy or "", f"Known area{name}"
            form = check_picture(plot)
            write_picture(plot, draw_area_curve(curve, strategy, title, form))


def _is_ours(path: Path) -> bool:
    """Return whether radarsim wrote a file; True if the file cannot be read."""
    try:
        with path.open("rb") as file:
            return MARK.encode() in file.read(HEAD) or is_by_radarsim(path)
    except OSError:
        return True


def _is_same(path: Path, served: str | None) -> bool:
    with suppress(OSError):  # a shipped map is given by name instead of a path
        return served is not None and path.samefile(served)
    return False


def view_of(run: MappingRun, mapper: Mapper) -> MapView:
    """Return the map of a mapping run as a view that can be drawn.

    Args:
        run: The run.
        mapper: The mapper, with at least one scan.
    """
    scene, trip, path = run.scene, run.source.trip, mapper.trajectory.rows()
    robot, height = drawn_robot(run.robot_class).name, 0.0
    outlines: tuple[Outline, ...] = ()
    if scene is not None:
        x, y, _ = path[0].tolist()
        _, height = robot_and_sensor(mapper, scene, robot, (x, y))
        outlines = outlines_of(scene, height)
    ending = TITLE_ENDINGS.get(run.source.outcome, "")
    driven = f"{trip.length:.1f} m in {trip.time:.0f} s {ending}".rstrip()
    return MapView(
        mapper.grid,
        path,
        robot,
        _headline(run, mapper, outlines),
        outlines,
        f"{_who_maps_what(run)}: {driven}",
        () if scene is None else tuple(scene.parts),
        height,
    )


def _headline(run: MappingRun, mapper: Mapper, outlines: Iterable[Outline]) -> str:
    score = run.score
    if score is not None and score["hidden_coverage"] is not None:
        return _hidden_text(score["hidden_coverage"], outlines)
    if score is not None and score["coverage"] is not None:
        return f"{100 * score['coverage']:.0f} % of the floor mapped"
    grid = mapper.grid
    area = np.count_nonzero(grid.sensed_cells()) * grid.frame.resolution**2
    return f"{area:.0f} m² mapped"


def _who_maps_what(run: MappingRun) -> str:
    where = "what it senses" if run.scene is None else run.scene.name
    who = run.robot_class or "a robot that another client drives"
    return f"{who[0].upper()}{who[1:]} maps {where}"


def _hidden_text(share: float, outlines: Iterable[Outline]) -> str:
    """Return a phrase that tells how much of the unreachable floor is mapped."""
    is_foliage = any(outline.kind == CellClass.FOLIAGE for outline in outlines)
    where = "behind the foliage" if is_foliage else "out of the robot's reach"
    return f"The floor {where}: {100 * share:.0f} % mapped"


def map_camera(run: MappingRun) -> Callable[[], Pixels]:
    """Return a function that draws the map of a run; call it after the first scan."""

    @cache  # called after the first scan, when the start of the robot is known
    def film(mapper: Mapper) -> tuple[MapView, MapFrames, FloorPart | None]:
        scene = run.scene
        view = replace(view_of(run, mapper), title=_who_maps_what(run))
        if scene is None:
            return view, MapFrames(view), None
        x, y, _ = view.path[0].tolist()
        hidden = FloorPart("hidden", mapper, scene, view.robot_class, (x, y))
        return view, MapFrames(view), hidden

    def draw() -> Pixels:
        mapper, trip = run.source.mapper, run.source.trip
        assert mapper is not None
        view, frames, hidden = film(mapper)
        text = f"{trip.time:.1f} s, {trip.length:.1f} m"
        share = math.nan if hidden is None else hidden.coverage(mapper.grid)
        if math.isfinite(share):
            text = f"{_hidden_text(share, view.outlines)}, {text}"
        path = mapper.trajectory.rows()
        return frames.draw(replace(view, grid=mapper.grid, path=path, subtitle=text))

    return draw


@contextmanager
def map_progress(
    run: MappingRun, recording: Recording, update_film: Callable[[float], None]
) -> Iterator[Callable[[str], None]]:
    """Show the progress of a mapping run on stderr; film and record the growing map.

    Args:
        run: The run.
        recording: Records the map.
        update_film: Adds a frame to the film, given the time in s.

    Yields:
        A function to be called after each scan with the activity of the robot.
    """
    activity = "waiting for a scan"
    with live_status(lambda: _describe_status(run, activity)) as log:

        def note(latest: str) -> None:
            nonlocal activity
            if latest != activity:
                activity = latest
                log(_describe_status(run, activity))
            update_film(run.source.trip.time)
            recording.add_map(run.source.mapper)

        try:
            yield note
        finally:
            recording.add_map(run.source.mapper, last=True)


def _describe_status(run: MappingRun, activity: str) -> str:
    mapper, trip = run.source.mapper, run.source.trip
    if mapper is None or not mapper.scans:
        return activity
    cells = int(np.count_nonzero(mapper.grid.sensed_cells()))
    area = f"sensed {cells * mapper.grid.frame.resolution**2:7.1f} m²"
    return f"{trip.time:8.1f} s  {activity:9}  path {trip.length:6.2f} m  {area}"


def print_result(run: MappingRun, *, as_json: bool) -> None:
    """Print the result of a run, but no text if a run failed before the first scan."""
    if as_json:
        print_lines([run.to_json()])
    elif run.source.trip.start is not None or not run.error:
        print_lines(as_text(run))


def as_text(run: MappingRun) -> list[str]:
    """Return the result of a mapping run as lines of text."""
    plain = run.to_dict()
    ending = ENDINGS.get(run.source.outcome, run.source.outcome)
    how = " by" if run.source.outcome == "explored" else ", exploring by"
    by = "" if run.strategy is None else f"{how} {run.strategy}"
    path = f"{plain['path_length']:.2f} m in {plain['time']:.1f} s"
    lines = [f"{ending}{by}: {path}, {plain['scans']} scans"]
    lines += [f"doubt    {doubt}" for doubt in plain["doubts"]]
    if cells := plain["cells"]:
        area = cells["resolution"] ** 2
        areas = [f"{cells[name] * area:.2f} m² {name}" for name in CLASSES]
        lines.append(f"map      {', '.join(areas)}")
    if errors := plain["pose_errors"]:
        lines.append(
            f"pose     {errors['ate']:.3f} m and {errors['yaw_deg']:.2f} degrees off,"
            f" at most {errors['ate_max']:.3f} m and {errors['yaw_max_deg']:.2f}"
        )
    if run.source.unreached:
        points = ", ".join(f"{x:.4g} {y:.4g}" for x, y in run.source.unreached)
        why = "no path" if run.source.outcome == "explored" else "not reached"
        lines.append(f"left out {points}: {why}")
    if judge := plain.get("judge"):
        lines.append(f"truth    {_judge_text(judge)}")
    if run.files:
        lines.append(f"files    {_files_text(run.files)}")
    return lines


def _files_text(files: Sequence[Path]) -> str:
    """Return the names of the written files as text, with the plot of the map first."""
    view = next(file for file in files if file.stem.endswith("_view"))
    others = ", ".join(file.name for file in files if file != view)
    return f"{view.name} to look at; for programs {others}; in {view.parent}"


def _judge_text(judge: dict[str, Any]) -> str:
    texts = [f"{judge['path_length']:.2f} m"]
    if judge.get("coverage") is not None:
        near = f"{judge['near_coverage']:.1%} at short range"
        texts.append(f"{judge['coverage']:.1%} of the floor sensed, {near}")
    if judge.get("reachable_coverage") is not None:
        texts.append(f"{judge['reachable_coverage']:.1%} of the reachable floor")
    if judge.get("hidden_coverage") is not None:
        texts.append(f"{judge['hidden_coverage']:.1%} of the other floor")
    if "right" in judge:
        texts.append(f"{judge['right']} cells right, {judge['wrong']} wrong")
    texts.append(f"collisions: {judge['collisions']}")
    return ", ".join(texts)


def explore(
    run: MappingRun,
    files: MapFiles,
    recording: Recording,
    address: tuple[str, int],
    *,
    as_json: bool,
) -> None:
    """Run an exploration; write, score and print its map even after an error.

    Args:
        run: The run.
        files: The files to write.
        recording: Records the traffic and the map.
        address: Host and port of the server, unless it is in this process.
        as_json: Whether to print JSON.
    """
    film = filmed(files.options, map_camera(run))
    with raise_on_signals(), recording, film as update_film:
        try:
            with map_progress(run, recording, update_film) as note:
                run.run(note, partial(recording.connect, *address))
        finally:
            # Scoring takes seconds. If it is interrupted,
            # the map is written all the same.
            try:
                run.judge()
            finally:
                files.write(run)
            print_result(run, as_json=as_json)


def follow(
    plan: ExplorationPlan,
    files: MapFiles,
    recording: Recording,
    server: tuple[str, int],
    robot: str,
    *,
    as_json: bool,
) -> int:
    """Build a map from another client's robot until it leaves or a signal arrives.

    Args:
        plan: The scanner, the source of the motion, and the resolution of the map.
        files: The files to write.
        recording: Records the traffic and the map.
        server: Host and port of a radarsim server.
        robot: Name of the robot.
        as_json: Whether to print JSON.

    Returns:
        The exit code.

    Raises:
        click.BadParameter: If an option is invalid.
    """
    if not robot.strip() or "," in robot:
        text = f"{robot[:80]!r}, expected the name of a robot, without commas"
        raise click.BadParameter(text, param_hint="--watch")
    watcher = RobotWatcher(server, robot, echoes=plan.echoes)
    watcher.on_wait = lambda: print_message(f"waiting for the robot {robot[:80]!r}")
    follower = WatchMapper(plan)
    files.check()
    start_log(logging.WARNING, "%(message)s")
    set_exit_code_of_sigterm(0)  # the run has no end of its own
    run = MappingRun(plan, watched=follower)
    film = filmed(files.options, map_camera(run))
    with raise_on_signals(), recording, film as update_film:
        follower.on_data = recording.follow(robot)
        with map_progress(run, recording, update_film) as note:
            follower.on_scan = lambda: note("listening")
            code = follower.watch(watcher)
        files.write(run)
        if follower.error and not run.error:
            run.error = follower.error
            print_message(follower.error)
        print_result(run, as_json=as_json)
    return 1 if run.error else code
