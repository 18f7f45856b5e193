"""Pictures show where robots were and what they saw; films show all of it."""

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from radarsim.local import LocalSimulation, simulate, simulation
from radarsim.plotting.film import FRAME_RATE, HOLD
from radarsim.plotting.palette import LASER, RADAR, TRUTH
from radarsim.scene.scene import Scene
from radarsim.server.camera import Renderer
from radarsim.server.views import View


@pytest.fixture(scope="module")
def driven(foliage_room: Scene) -> LocalSimulation:
    """A radar drives ahead for 2 s, and after 1 s a laser is there."""
    sim = simulate(foliage_room)
    sim.spawn("P3AT", name="one", start="RobotStart1").drive(0.5)
    sim.step(1.0)
    sim.spawn("P3AT_SICK", name="two", start="RobotStart2")
    sim.step(1.05)
    return sim


def drawn_in(axes: Axes, colour: str) -> list[np.ndarray]:
    """Return the finite points of each line of a colour, (N, 2)."""
    lines = [line for line in axes.lines if line.get_color() == colour]
    lines = [line for line in lines if line.get_linewidth() == 1.5]  # no scale bar
    points = [np.column_stack(line.get_data()).astype(float) for line in lines]
    return [each[np.isfinite(each).all(axis=1)] for each in points]


def test_picture_shows_true_paths_and_newest_scans(driven: LocalSimulation) -> None:
    axes = Figure().add_subplot()
    assert driven.plot(axes) is axes
    one, two = drawn_in(axes, TRUTH)
    assert one[0].tolist() == pytest.approx([-7.95, 0.0], abs=0.02)
    pose = driven.robots["one"].pose
    assert one[-1].tolist() == [pose.x, pose.y]
    assert 20 < len(one) < 23
    assert 10 < len(two) < 13
    (radar,) = drawn_in(axes, RADAR)
    (laser,) = drawn_in(axes, LASER)
    for points, name in ((radar, "one"), (laser, "two")):
        expected = driven.robots[name].scan().points("map")
        np.testing.assert_allclose(points, expected, atol=1e-5)
    assert {"one", "two"} <= {text.get_text() for text in axes.texts}
    assert axes.get_title(loc="right") == "2.0 s"


def test_picture_of_the_beginning_has_no_robots(foliage_room: Scene) -> None:
    picture = simulate(foliage_room)._repr_png_()
    assert Image.open(io.BytesIO(picture)).size == (1050, 720)


def test_same_run_gives_the_same_file(driven: LocalSimulation, tmp_path: Path) -> None:
    for name in ("a.png", "b.PNG", "c.svg"):
        driven.render(tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.PNG").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == driven._repr_png_()
    assert b"<svg" in (tmp_path / "c.svg").read_bytes()


def test_film_lasts_as_long_as_the_run_at_its_speed(
    driven: LocalSimulation, tmp_path: Path
) -> None:
    driven.render(tmp_path / "run.gif", speed=4.0)
    length = 0
    with Image.open(tmp_path / "run.gif") as film:
        for frame in range(getattr(film, "n_frames", 1)):
            film.seek(frame)
            length += film.info["duration"]
    frames = int(1.95 * FRAME_RATE / 4.0) + 1  # from 0.1 s to 2.05 s
    assert length == pytest.approx(1000 * (frames / FRAME_RATE + HOLD), abs=101)


def test_film_that_cannot_be_written_is_an_error(
    driven: LocalSimulation, tmp_path: Path
) -> None:
    with pytest.raises(OSError, match="no"):
        driven.render(tmp_path / "missing" / "run.gif")


def test_camera_shows_what_viewers_see_at_any_size(driven: LocalSimulation) -> None:
    robot = driven.robots["one"]
    first = driven.call(lambda s: Renderer(s.scene).render(View.of(s)))
    same = robot.camera(width=160, height=120)
    assert np.array_equal(same, first)
    large = robot.camera(width=800, height=600)
    assert large.shape == (600, 800, 3)
    # Five by five pixels of the large one make one of the small one.
    mean = large.reshape(120, 5, 160, 5, 3).mean(axis=(1, 3))
    assert np.abs(mean - same).mean() < 3
    narrow = robot.camera(width=160, height=120, fov_deg=20)
    assert np.abs(narrow.astype(float) - same).mean() > 3


def test_camera_can_be_anywhere(foliage_room: Scene) -> None:
    sim = simulate(foliage_room)
    robot = sim.spawn()
    place = (robot.pose.x, robot.pose.y, 3.0, 0.0, np.pi / 2, 0.0)
    above = sim.camera(place, fov_deg=40)
    assert above.shape == (480, 640, 3)
    robot.remove()
    without = sim.camera(place, fov_deg=40)
    changed = (above != without).any(axis=2)
    assert changed[240, 320]
    assert 0.01 < changed.mean() < 0.2


def test_long_runs_are_noted_less_often(
    foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulation, "MOST_MOMENTS", 10)
    sim = simulate(foliage_room)
    robot = sim.spawn()
    robot.drive(0.2)
    sim.step(6.0)
    axes = sim.plot(Figure().add_subplot())
    (path,) = drawn_in(axes, TRUTH)
    assert 5 <= len(path) <= 12
    gaps = np.diff(path[:, 0])[:-1]
    assert gaps.max() - gaps.min() < 0.01  # evenly
