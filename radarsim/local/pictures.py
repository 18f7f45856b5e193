"""Draws pictures and films of a simulation, with true paths and scans on the map."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.errors import RadarsimError, expected_one_of
from radarsim.files import write_atomically
from radarsim.geometry import Pose2
from radarsim.local.simulation import LocalSimulation, Moment
from radarsim.plotting.film import FILM_FORMATS, Film, FrameCanvas, Pixels
from radarsim.plotting.palette import TRUTH, sensor_colour
from radarsim.plotting.plan import (
    HEIGHT,
    draw_plan,
    draw_robot,
    name_objects,
    show_extent,
)
from radarsim.plotting.style import FORMS, HALO, Legend, figure_of, render, write_title
from radarsim.plotting.window import Window
from radarsim.scene.scene import Scene

_SIZE: Final = (10.5, 7.2)  # inches
_DPI: Final = 100  # gives films an even width and height in pixels, as MP4 needs
_NAMES: Final = 20  # maximum number of object names; more would hide robots


class RunPicture:
    """A figure that shows a simulation at one moment, and can show another moment.

    Attributes:
        axes: Axes with the plan, m, map frame.
    """

    def __init__(
        self, scene: Scene, moments: Sequence[Moment], on: Axes | Figure | None = None
    ) -> None:
        """Create the figure, and draw the last moment of the simulation.

        Args:
            scene: The map.
            moments: All moments of the run, at least one.
            on: Axes in metres, or an empty figure, which also gets a legend; None for a
                new figure with a legend.
        """
        figure = None
        if not isinstance(on, Axes):
            figure = on or Figure(figsize=_SIZE, dpi=_DPI, layout="compressed")
            on = figure.add_subplot()
        self.axes = axes = on
        self.take(moments)
        self._moving: list[Artist] = []
        height = scene.floor_at(0.0, 0.0) + HEIGHT
        materials, corners = draw_plan(axes, scene, height)
        places = self._paths[np.isfinite(self._paths)].reshape(-1, 2)
        show_extent(axes, np.concatenate([corners, places]))
        name_objects(axes, scene.parts, height, _NAMES)
        robots = f"{len(self._paths)} robot{'s' * (len(self._paths) != 1)}"
        write_title(axes, f"{scene.name}, {robots}")
        self._clock = axes.set_title("", loc="right")
        if figure is not None:
            legend = Legend()
            legend.add_heading("Robots")
            legend.add_line("true path", color=TRUTH, linewidth=1.5)
            for medium in sorted({medium for m in moments for medium, _ in m.seen}):
                colour = sensor_colour(medium)
                text = f"what the {medium} reads"
                legend.add_marker(text, "o", color=colour, markersize=3)
            legend.add_heading("Materials")
            legend.add_materials(materials)
            legend.draw(figure)
        self.show(len(moments) - 1)

    def take(self, moments: Sequence[Moment]) -> None:
        """Replace the moments by a longer list of the same simulation."""
        self._moments = moments
        names = dict.fromkeys(name for moment in moments for name in moment.robots)
        # NaN interrupts the path of a robot while the robot is not in the simulation.
        self._paths = np.full((len(names), len(moments), 2), np.nan)
        for row, name in enumerate(names):
            for column, moment in enumerate(moments):
                if name in moment.robots:
                    pose = moment.robots[name][1]
                    self._paths[row, column] = pose.x, pose.y

    def show(self, number: int) -> None:
        """Draw the moment with a given index, and the robots' paths until then."""
        for artist in self._moving:
            artist.remove()
        axes, moment = self.axes, self._moments[number]
        self._moving = []
        for path in self._paths[:, : number + 1]:
            self._moving += axes.plot(*path.T, color=TRUTH, linewidth=1.5, zorder=4)
        for medium, points in moment.seen:
            colour = sensor_colour(medium)
            self._moving += axes.plot(*points.T, "o", color=colour, ms=3, zorder=5)
        for name, (model, pose) in moment.robots.items():
            self._moving += draw_robot(axes, model, pose, zorder=6)
            if len(self._paths) > 1:
                self._moving.append(self._write(name, pose))
        self._clock.set_text(f"{moment.time:.1f} s")

    def _write(self, name: str, pose: Pose2) -> Artist:
        return self.axes.annotate(
            name,
            (pose.x, pose.y),
            (0, 14),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            path_effects=[HALO],
            parse_math=False,
            zorder=7,
        )

    def film(self, path: Path, speed: float) -> None:
        """Write a film of all moments of the simulation.

        Args:
            path: A ``.gif`` or ``.mp4`` file.
            speed: Simulated seconds in one second of film.

        Raises:
            OSError: If the file cannot be written.
            ValueError: If the format needs a package that is not installed.
        """
        shown = 0

        def draw() -> Pixels:
            self.show(shown)
            return canvas.render([*self._moving, self._clock])

        canvas = FrameCanvas(figure_of(self.axes))
        with Film(path, draw, speed=speed) as film:
            for shown, moment in enumerate(self._moments):  # noqa: B007 - draw uses it
                film.update(moment.time)
        if film.error is not None:
            raise film.error


def follow_run(
    sim: LocalSimulation, moments: Callable[[], Sequence[Moment]]
) -> Callable[[], bool]:
    """Show a simulation in a window, or below the cell in a notebook without windows.

    Args:
        sim: The simulation.
        moments: Function that returns the moments so far.

    Returns:
        A function that updates the picture, and returns whether the window is open.

    Raises:
        RadarsimError: If matplotlib cannot open a window, and this is no notebook.
    """
    try:
        window = Window(_SIZE, 'sim.render("run.png")')
    except RadarsimError:
        ipython = sys.modules.get("IPython")
        if ipython is None or not hasattr(ipython.get_ipython(), "kernel"):
            raise
        handle = ipython.display.display(sim, display_id=True)
        return lambda: bool(handle.update(sim))  # False without a window
    picture: RunPicture | None = None
    fixed: object = None  # map, robots and sensor types in the picture

    def draw() -> bool:
        nonlocal picture, fixed
        shown = moments()
        now = sim.scene, [*shown[-1].robots], {medium for medium, _ in shown[-1].seen}
        if picture is None or fixed != now:
            fixed = now
            window.figure.clear()
            picture = RunPicture(sim.scene, shown, window.figure)
        picture.take(shown)
        picture.show(len(shown) - 1)
        return window.refresh()

    draw()
    return draw


def draw_run(scene: Scene, moments: Sequence[Moment], form: str = "png") -> bytes:
    """Return a picture of a simulation's last moment in a format such as ``png``."""
    return render(figure_of(RunPicture(scene, moments).axes), form)


def write_run(
    scene: Scene, moments: Sequence[Moment], path: Path, *, speed: float
) -> None:
    """Write a picture of a simulation's last moment, or a film of all moments.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the file name has no known ending, or a package is missing.
    """
    form = path.suffix.lower().lstrip(".")
    if form in FILM_FORMATS:
        RunPicture(scene, moments).film(path, speed)
    elif form in FORMS:
        write_atomically({path: draw_run(scene, moments, form)})
    else:
        known = [f".{each}" for each in (*FORMS, *FILM_FORMATS)]
        raise ValueError(f"ending {expected_one_of(path.suffix, known)}")
