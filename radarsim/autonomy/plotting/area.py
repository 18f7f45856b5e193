"""Pictures of known area over time, of one exploration or of several."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from radarsim.autonomy.evaluation.area_curve import SHARES, AreaCurve
from radarsim.plotting.palette import ROBOT_PATHS
from radarsim.plotting.style import QUIET, SMALL_PRINT, render

SIZE: Final = (8.0, 4.5)  # inches


def draw_area_curves(
    curves: Mapping[str, AreaCurve], title: str, *, form: str = "png"
) -> bytes:
    """Draw how much is known over time, as a file.

    The share of the floor that the robot can get to, where all curves tell it, else the
    area that is sensed.

    Args:
        curves: By what they are called in the legend; each has a sample.
        title: What is explored.
        form: One of ``radarsim.plotting.style.FORMS``.
    """
    figure = Figure(figsize=SIZE, layout="constrained")
    axes = figure.add_subplot()
    shows_share = all(
        math.isfinite(curve.samples[-1].reachable) for curve in curves.values()
    )
    for number, (name, curve) in enumerate(curves.items()):
        table = np.array(curve.samples)
        end = curve.samples[-1]
        axes.plot(
            table[:, 0],
            100 * table[:, 3] if shows_share else table[:, 2],
            color=ROBOT_PATHS[number % len(ROBOT_PATHS)],
            linewidth=2.0,
            label=f"{name}: {end.path_length:.0f} m in {end.time:.0f} s",
        )
    if shows_share:
        for share in SHARES:
            axes.axhline(100 * share, color=QUIET, linewidth=0.6, linestyle=":")
        axes.set_ylabel("known share of the floor within reach, %")
    else:
        axes.set_ylabel("sensed area, m²")
    axes.set_xlabel("time, s")
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.grid(visible=True, color="0.9")
    axes.legend(loc="lower right", fontsize=SMALL_PRINT + 1)
    axes.set_title(title, loc="left", fontsize=14, fontweight="bold", parse_math=False)
    return render(figure, form)
