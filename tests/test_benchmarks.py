"""Each group of the benchmarks runs with a small case and has its rows."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks import engine, hosts, scenes, servers
from benchmarks.__main__ import GROUPS, main
from benchmarks.timing import Row, compare
from radarsim.raycast.rays import EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.sensors.range_scanner import load_sensor, sensor_pose

# A small case of each step, and the units of its rows.
SMALL: dict[str, tuple[Callable[[], Iterator[Row]], str]] = {
    "a": (partial(engine.scans_against_first_hits, 0.0), 9 * "x "),
    "c": (partial(engine.throughput, 0.0), "1/s x x"),
    "d": (partial(engine.growth, 0.0), 13 * "us "),
    "g": (partial(engine.beams_against_rays, 0.0), 5 * "x "),
    "h": (partial(engine.mirrors_and_leaves, 0.0), "x x"),
    "k": (partial(engine.mesh_maps, 0.0, rings=10), "x x"),
    "p": (partial(engine.turns_of_a_radar, 0.0), "x"),
    "i": (partial(hosts.floods, 2), 4 * "ms "),
    "j": (partial(hosts.driving_robots, 0.0, robots=2), "x x"),
    "j, growth": (partial(hosts.growth_of_robots, 0.0, robots=2), "x x x"),
    "q": (partial(hosts.decoding, 0.0), "x"),
    "n": (partial(hosts.decisions, 0.0), "us us us"),
    "e": (partial(servers.lateness, 1.0, robots=3), "1/s ms ms ms % MiB"),
    "e, capacity": (partial(servers.capacity, 0.5, swarms=(1, 2)), "robots"),
    "f": (partial(servers.start_up, times=1), "ms ms ms ms ms"),
    "l": (partial(servers.commander, 1.0, robots=2, silent=2), "ms ms x x ms ms"),
    "m": (partial(servers.recording, 1.5, robots=2), "ms ms x % MiB"),
    "o": (partial(servers.turning_radar, 1.0, robots=2), "ms ms 1/s %"),
}
QUICK = ("k", "p", "j", "q")


def test_every_group_has_a_small_case() -> None:
    assert {name[0] for name in SMALL} == GROUPS.keys()


@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.slow)
        for name in SMALL
    ],
)
def test_group_has_its_rows(name: str) -> None:
    run, units = SMALL[name]
    rows = list(run())
    assert {row.group for row in rows} == {name[0]}
    assert [row.unit for row in rows] == units.split()
    assert all(math.isfinite(row.value) for row in rows)


def test_rows_are_printed_below_the_title_of_their_group(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [Row("a", "kept", 2, "x", 3, "5 us"), Row("a", "late", 9, "x", 3)]
    monkeypatch.setitem(GROUPS, "a", ("scans", (lambda: iter(rows),)))
    main(["a"])
    assert capsys.readouterr().out.splitlines()[1:] == [
        "(a) scans",
        "a  kept: 2 x, at most 3 (kept); 5 us",
        "a  late: 9 x, at most 3 (MISSED)",
    ]


def test_unknown_group_names_those_that_exist() -> None:
    with pytest.raises(SystemExit, match=r"unknown groups \['z'\], expected .*'a'"):
        main(["z"])


def test_the_fast_tenth_of_the_times_counts() -> None:
    times = iter(np.cumsum([0, 3, 0, 1] * 5).tolist())
    assert compare(int, int, seconds=0, clock=lambda: next(times)) == (3, 1)


def test_foliage_wall_has_the_size_that_the_limits_hold_for() -> None:
    scene = scenes.foliage_wall()
    tracer = tracer_of(scene)
    pose, rng = sensor_pose(scene, scenes.SENSOR), generator_for(0)
    rays = engine.radar_with(1801).scan(scene, pose, rng).cast
    surfaces = (EventKind.ENTER, EventKind.LEAVE)
    crossed = [sum(e.kind in surfaces for e in ray) for ray in tracer.explain(rays)]
    assert scene.triangles == pytest.approx(77_000, rel=0.01)
    assert np.mean(crossed) == pytest.approx(1.7, abs=0.05)


@pytest.mark.parametrize("triangles", [1000, 100_000])
def test_bumpy_room_has_about_the_requested_triangles(triangles: int) -> None:
    assert scenes.bumpy_room(triangles).triangles == pytest.approx(triangles, rel=0.05)


@pytest.mark.parametrize("name", list(engine.MULTI_RAY_SENSORS))
def test_number_of_rays_follows_from_the_settings(name: str) -> None:
    settings, rays = engine.MULTI_RAY_SENSORS[name]
    sensor = load_sensor("radar", fov_deg=2, **settings)
    assert len(sensor.pattern.shares) == 3 * rays


@pytest.mark.parametrize("suffix", ["stl", "glb"])
def test_ball_is_closed_in_both_files(tmp_path: Path, suffix: str) -> None:
    scene = load_map(scenes.write_mesh_map(tmp_path, scenes.ball(10), suffix))
    assert scene.triangles == 360
    assert scene.parts[0].closed


def test_robots_drive_apart_from_each_other_and_from_poles(tmp_path: Path) -> None:
    scene = load_map(scenes.write_hall(tmp_path))
    poles = [part for part in scene.parts if part.object_name.startswith("pole")]
    assert len(poles) == scenes.POLES**2 == 121
    driving = hosts.DrivingRobots(scene, 40)
    at = np.array(
        [[v.robot.pose.x, v.robot.pose.y] for v in driving.host.simulation.vehicles]
    )
    for _ in range(10):
        driving.tenth()
    poses = [vehicle.robot.pose for vehicle in driving.host.simulation.vehicles]
    now = np.array([[pose.x, pose.y] for pose in poses])
    assert np.linalg.norm(now - at, axis=1).min() > 0.2
    centres = np.array([part.vertices[:, :2].mean(axis=0) for part in poles])
    others = np.vstack([centres, now])
    apart = np.linalg.norm(now[:, None] - others, axis=2)
    assert np.sort(apart, axis=1)[:, 1].min() > 1  # the smallest is the robot itself
