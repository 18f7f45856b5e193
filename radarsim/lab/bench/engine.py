"""Benchmarks of the ray engine: groups a to d, g, h and k of the table.

Most results are ratios against a raw first-hit call of Embree on the same rays,
measured in turns in one process, so that they hold on machines of any speed. The scenes
are generated from a few numbers.

For group k a map with one closed mesh is loaded and made ready for rays. The reference
is what trimesh takes to read the file and embreex to build its own scene of it, which
tells neither whether the mesh is closed nor which side of it is outside.
"""

import importlib
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import trimesh

from radarsim.generators.plants.plant import Plant, make_shrubs
from radarsim.generators.plants.species import SHRUB
from radarsim.geometry import Floats, rotation_matrix
from radarsim.lab.bench.timing import BenchmarkRow, compare, measure
from radarsim.raycast import embree
from radarsim.raycast.embree import FirstHits
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import Faces, Mesh, box, sphere
from radarsim.sensors.range_scanner import RangeScanner, load_sensor, sensor_pose
from radarsim.sensors.scan_batch import ScanRequest, scan_batch

RINGS: Final = 410  # of the ball that is measured: 670,760 triangles
MAP: Final = """\
version: 1
objects: [{{name: ball, mesh: {}, material: foliage}}]
starts: [{{name: RobotStart1, position: [9, 0, 0]}}]
"""


def ball(rings: int) -> Mesh:
    """Create a closed, uneven ball of 4 ``rings`` (``rings`` - 1) triangles, 2 m."""
    count = 2 * rings
    polar, azimuth = np.meshgrid(
        np.linspace(0, np.pi, rings + 1)[1:-1],
        np.arange(count) * (2 * np.pi / count),
        indexing="ij",
    )
    radius = 2 + 0.05 * np.sin(40 * polar) * np.sin(40 * azimuth)
    x, y = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth)
    points = (radius * np.stack([x, y, np.cos(polar)])).reshape(3, -1).T
    poles = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    here = np.arange((rings - 2) * count).reshape(-1, count)
    there = np.roll(here, -1, axis=1)
    rim, last = np.arange(count), len(points) - count
    top, bottom = np.full(count, len(points)), np.full(count, len(points) + 1)
    sides: list[Any] = [
        (here, here + count, there + count),
        (here, there + count, there),
        (top, rim, np.roll(rim, -1)),
        (bottom, last + np.roll(rim, -1), last + rim),
    ]
    faces = np.vstack([np.stack(side, axis=-1).reshape(-1, 3) for side in sides])
    return np.vstack([points, poles]), faces.astype(np.int32)


def write_map(folder: Path, mesh: Mesh, suffix: str) -> Path:
    """Write a map of one mesh, and the mesh beside it; return the path of the map."""
    content: Any = trimesh.Trimesh(*mesh, process=False).export(file_type=suffix)
    (folder / f"ball.{suffix}").write_bytes(content)
    path = folder / f"{suffix}.yaml"
    path.write_text(MAP.format(f"ball.{suffix}"))
    return path


def mesh_maps(rings: int, seconds: float) -> Iterator[BenchmarkRow]:
    """Measure CPU time from a map to its tracer, against reading and building only."""
    mesh = ball(rings)
    for suffix in ("stl", "glb"):
        with TemporaryDirectory() as folder:
            path = write_map(Path(folder), mesh, suffix)
            result = compare(
                partial(_load, path),
                partial(_read_and_build, path.with_name(f"ball.{suffix}")),
                seconds=seconds,
                clock=time.process_time,
            )
        name = f"{len(mesh[1])} triangles, {suffix.upper()}"
        note = f"{result.subject:.2f} s against {result.reference:.2f}"
        yield BenchmarkRow("k", name, result.ratio, "x", 1.0, note)


def _load(path: Path) -> Tracer:
    return tracer_of(load_map(path))


def _read_and_build(path: Path) -> embree.FirstHits:
    mesh: Any = trimesh.load_mesh(path, process=False)
    triangles = embree.Mesh(mesh.vertices, mesh.faces)
    return embree.FirstHits([triangles], (np.zeros((1, 3)), np.eye(3)[:1]))


WALL = Material("wall")
FOLIAGE = Material("foliage", density=1.0)
SENSOR = (-6.0, 0.0, 0.0)  # x, y, yaw in all of these scenes
BATCH = 100
DRAWS = 64  # of rays that take turns, as scans draw their rays anew
TREES = 1200
# Upper limits of the ratio to a raw first-hit call.
LIMITS = {"foliage_wall": 1.75, "forest": 2.0, "foliage_room": 1.7}
BEAMS_361 = {"resolution_deg": 0.5}
CONE = {"side_mode": "cone", "beamwidth_az_deg": 2, "beamwidth_el_deg": 2}
# Settings of the measured sensors, and the number of rays of each beam.
MULTI_RAY_SENSORS: dict[str, tuple[dict[str, Any], int]] = {
    "echoes of the drawn ray": ({"return_mode": "all", "ray_choice": "drawn"}, 1),
    "echoes of all three rays": ({"return_mode": "all"}, 3),
    "incidence weights": ({"incidence_weights": True}, 3),
    "cone of 16": ({**CONE, "cone_rays": 16, "ray_choice": "together"}, 16),
    "cone of 16 random rays": (
        {
            **CONE,
            "cone_rays": 16,
            "ray_choice": "together",
            "cone_sampling": "random",
        },
        16,
    ),
}
# Settings that reduce such a sensor to one drawn ray for each beam.
PLAIN = {"return_mode": "last", "incidence_weights": False, "ray_choice": "drawn"}
BOUNCES = 2
TRIANGLES = 1_000_000
LEAF = Material("leaf", density=0.0, sheet_loss=0.4)
LEAF_SPACING: Final = 2.2 * SHRUB.crown_radius  # m between neighbours


def foliage_wall(spheres: int = 60) -> Scene:
    """Create a room with a wall of foliage spheres across it, 1280 triangles each.

    Neighbours overlap by 4 % of their diameters. A ray of power 1 from ``SENSOR``
    crosses 1.7 surfaces before it is spent, or through.
    """
    rng = np.random.Generator(np.random.PCG64(7))
    radii = rng.uniform(0.48, 0.74, spheres)
    steps = 0.96 * (radii[1:] + radii[:-1])
    places = np.concatenate([[0.0], np.cumsum(steps)])
    places -= places.mean()
    width = float(places[-1] - places[0]) + 2.0
    parts = [_placed("room", WALL, box(24.0, width, 6.0), (0.0, 0.0, 2.0))]
    for i, (radius, y) in enumerate(zip(radii.tolist(), places.tolist(), strict=True)):
        parts.append(_placed(f"bush_{i}", FOLIAGE, sphere(radius), (0.0, y, 0.35)))
    return Scene("foliage_wall", "FoliageWall", tuple(parts))


def forest(trees: int = TREES) -> Scene:
    """Create a square of trees, each a trunk in a crown that hangs to the ground.

    The crowns overlap: from the middle, a ray starts in the bounds of several of them.
    """
    rng = np.random.Generator(np.random.PCG64(7))
    side = math.ceil(math.sqrt(trees))
    parts = [_placed("room", WALL, box(200.0, 200.0, 20.0), (0.0, 0.0, 9.0))]
    for number in range(trees):
        row, column = divmod(number, side)
        x, y = 3.0 * (np.array([row, column]) - side / 2) + rng.uniform(-0.9, 0.9, 2)
        trunk, crown = box(0.25, 0.25, 3.0), sphere(1.2)
        parts.append(_placed(f"trunk_{number}", WALL, trunk, (x, y, 1.5)))
        parts.append(_placed(f"crown_{number}", FOLIAGE, crown, (x, y, 1.3)))
    return Scene("forest", "Forest", tuple(parts))


def bumpy_room(triangles: int) -> Scene:
    """Create an opaque room whose far wall has about the given number of triangles."""
    n = max(2, round(math.sqrt(triangles / 2)))
    steps = np.linspace(-8.0, 8.0, n + 1)
    y, z = np.meshgrid(steps, steps * 0.25 + 1.0, indexing="ij")
    x = 6.0 + 0.2 * np.sin(3.0 * y) * np.cos(5.0 * z)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [
            np.column_stack([a, a + 1, a + n + 2]),
            np.column_stack([a, a + n + 2, a + n + 1]),
        ]
    )
    room = _placed("room", WALL, box(20.0, 20.0, 8.0), (0.0, 0.0, 2.0))
    return Scene("bumpy", "Bumpy", (room, Part("far", WALL, vertices, faces)))


def curtains(count: int) -> Scene:
    """Create a room with thin volumes in a row; a ray crosses two surfaces of each."""
    thin = Material("thin", density=0.001)
    parts = [_placed("room", WALL, box(40.0, 40.0, 6.0), (0.0, 0.0, 2.0))]
    for i in range(count):
        place = (-4.0 + 0.5 * i, 0.0, 1.0)
        parts.append(_placed(f"curtain_{i}", thin, box(0.2, 30.0, 3.0), place))
    return Scene("curtains", "Curtains", tuple(parts))


def hall_of_mirrors() -> Scene:
    """Create a room whose walls are mirrors, with a wall of foliage across it."""
    silver = Material("silver", radar_mirror=True)
    parts = [
        Part(part.object_name, silver, part.vertices, part.faces)
        if part.object_name == "room"
        else part
        for part in foliage_wall().parts
    ]
    return Scene("mirrors", "Mirrors", tuple(parts))


def leaf_scene(triangles: int) -> Scene:
    """Create a room of leafy shrubs with approximately a given number of triangles.

    The shrubs stand in a square grid from x = -4 m on, each with a random yaw, with
    space for a sensor at x = -6, y = 0. No two of them touch.

    Args:
        triangles: Number of triangles; at least one shrub is created, of about 15,000.
    """
    shrub = make_shrubs(0)["leaves"]
    count = max(1, round(triangles / shrub.triangles))
    rng = generator_for(0, "plants", "leaf scene")
    side = math.ceil(math.sqrt(count))
    length, width, height = 4.0 + LEAF_SPACING * side, LEAF_SPACING * (side + 2), 6.0
    centre = (-8.0 + length / 2, 0.0, height / 2)
    parts = [_placed("room", WALL, box(length, width, height), centre)]
    for number in range(count):
        row, column = divmod(number, side)
        position = np.array(
            [-4.0 + LEAF_SPACING * row, LEAF_SPACING * (column - (side - 1) / 2), 0.0]
        )
        rotation = rotation_matrix(0.0, 0.0, rng.uniform(0, 2 * math.pi)).T
        rotated = Plant(
            (shrub.wood[0] @ rotation, shrub.wood[1]),
            (shrub.foliage[0] @ rotation, shrub.foliage[1]),
        )
        parts += rotated.parts(f"shrub_{number + 1}", Material("wood"), LEAF, position)
    return Scene("leaves", "Leaves", tuple(parts))


def _placed(
    name: str,
    material: Material,
    shape: tuple[Floats, Faces],
    place: tuple[float, float, float],
) -> Part:
    vertices, faces = shape
    return Part(name, material, vertices + np.array(place), faces)


def radar_with(beams: int) -> RangeScanner:
    """Create a radar with the given number of beams over 180 degrees."""
    return load_sensor("radar", resolution_deg=180 / (beams - 1))


def scans_against_first_hits(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure whole scans, with the drawing of rays, against raw first-hit calls."""
    for scene in (foliage_wall(), forest(), load_map("foliage_room")):
        meshes = [embree.Mesh(part.vertices, part.faces) for part in scene.parts]
        for name, scan, draws in _workloads(scene):
            first = FirstHits(meshes, *draws)
            result = compare(scan, first.run, seconds=seconds)
            title, limit = f"{scene.name}, {name}", LIMITS[scene.name]
            yield BenchmarkRow("a", title, result.ratio, "x", limit, result.in_us)


def _workloads(
    scene: Scene,
) -> Iterator[tuple[str, Callable[[], object], list[tuple[Floats, Floats]]]]:
    """Yield the name of a workload, a function that runs it, and draws of its rays."""
    tracer, pose = tracer_of(scene), sensor_pose(scene, SENSOR)
    rng = generator_for(0, "bench")
    for beams in (361, 1801):
        radar = radar_with(beams)
        plans = [radar.plan(tracer, pose, rng) for _ in range(DRAWS)]
        draws = [(plan.rays.origins, plan.rays.directions) for plan in plans]
        yield f"{beams} beams", partial(radar.scan, scene, pose, rng), draws
    radar = radar_with(361)
    plans = [radar.plan(tracer, pose, rng) for _ in range(BATCH)]
    rays = Rays.concatenate([plan.rays for plan in plans])
    yield (
        f"{BATCH} scans of 361 beams",
        partial(scan_batch, tracer, [ScanRequest(radar, pose, rng)] * BATCH),
        [(rays.origins, rays.directions)],
    )


def against_open3d(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure scans against Open3D's list of all hits, where Open3D is installed."""
    try:
        open3d: Any = importlib.import_module("open3d")
    except (ImportError, OSError):  # it lacks system libraries on many machines
        return

    scene = foliage_wall()
    # One thread, as scans have one.
    o3d = open3d.t.geometry.RaycastingScene(nthreads=1)
    for part in scene.parts:
        o3d.add_triangles(
            part.vertices.astype(np.float32), part.faces.astype(np.uint32)
        )
    for name, scan, draws in _workloads(scene):
        both = np.hstack(draws[0]).astype(np.float32)
        tensor = open3d.core.Tensor(both)
        hits = partial(o3d.list_intersections, tensor)
        result = compare(scan, hits, seconds=seconds)
        title = f"{scene.name}, {name}"
        yield BenchmarkRow("b", title, result.ratio, "x", 1.0, result.in_us)


def throughput(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure scans per second on one core, and two threads against one."""
    scene, beams = foliage_wall(), 361
    tracer, pose = tracer_of(scene), sensor_pose(scene, SENSOR)
    radar, rng = radar_with(beams), generator_for(0, "bench")
    one = measure(lambda: radar.scan(scene, pose, rng), seconds=seconds)
    yield BenchmarkRow("c", f"scans of {beams} beams, one core", 1 / one, "1/s")
    rays = Rays.concatenate([radar.plan(tracer, pose, rng).rays for _ in range(BATCH)])
    with ThreadPoolExecutor(2) as pool:
        result = compare(
            lambda: [tracer.trace(rays) for _ in range(2)],
            lambda: list(pool.map(lambda _: tracer.trace(rays), range(2))),
            seconds=seconds,
        )
    yield BenchmarkRow("c", "two threads, times as fast as one", result.ratio, "x")


def many_poses(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure scans from many poses on all processors against as many single scans."""
    scene, poses, rng = foliage_wall(), [SENSOR] * BATCH, generator_for(0, "bench")
    radar = radar_with(361)
    result = compare(
        lambda: [radar.scan(scene, pose, rng) for pose in poses],
        lambda: radar.scan_many(scene, poses, rng),
        seconds=seconds,
    )
    title = f"scan_many of {BATCH} poses, times as fast as {BATCH} calls of scan"
    yield BenchmarkRow("c", title, result.ratio, "x")


def growth(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure one scan in scenes of growing size."""
    radar = radar_with(361)
    for triangles in (10**3, 10**4, 10**5, 10**6):
        yield _scan_row(bumpy_room(triangles), radar, f"{triangles} triangles", seconds)
    for crossings in (0, 2, 10, 30):
        scene = curtains(crossings // 2)
        yield _scan_row(scene, radar, f"{crossings} crossings a ray", seconds)
    scene = foliage_wall()
    for beams in (10, 10**2, 10**3, 10**4, 10**5):
        yield _scan_row(scene, radar_with(beams), f"{beams} beams", seconds)


def _scan_row(
    scene: Scene, radar: RangeScanner, name: str, seconds: float
) -> BenchmarkRow:
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    taken = measure(lambda: radar.scan(scene, pose, rng), seconds=seconds)
    return BenchmarkRow("d", f"{scene.name}, {name}", taken * 1e6, "us")


def beams_against_rays(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure scans of many rays against as many scans of one drawn ray."""
    scene = foliage_wall()
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    for name, (settings, rays) in MULTI_RAY_SENSORS.items():
        sensor = load_sensor("radar", **BEAMS_361, **settings)
        plain = load_sensor("radar", **BEAMS_361, **{**settings, **PLAIN})
        draw = partial(plain.scan, scene, pose, rng)
        result = compare(
            partial(sensor.scan, scene, pose, rng),
            partial(_repeat, draw, rays),
            seconds=seconds,
        )
        limit = 1.0 if rays > 1 else None
        yield BenchmarkRow("g", name, result.ratio, "x", limit, result.in_us)


def _repeat(run: Callable[[], object], times: int) -> None:
    for _ in range(times):
        run()


def mirrors_and_leaves(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure rays that are reflected twice, and rays through single leaves."""
    scene = hall_of_mirrors()
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    reflected, plain = (
        load_sensor(
            # the power is unlimited, so that no ray ends in the foliage
            "radar",
            **BEAMS_361,
            max_bounces=bounces,
            penetration_power=math.inf,
        )
        for bounces in (BOUNCES, 0)
    )
    result = compare(
        partial(reflected.scan, scene, pose, rng),
        partial(plain.scan, scene, pose, rng),
        seconds=seconds,
    )
    name = f"{BOUNCES} bounces in a hall of mirrors, by none"
    yield BenchmarkRow("h", name, result.ratio, "x", BOUNCES + 1.0, result.in_us)
    scene = leaf_scene(TRIANGLES)
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    radar = load_sensor("radar", **BEAMS_361)
    rays = radar.plan(tracer_of(scene), pose, rng).rays
    meshes = [embree.Mesh(part.vertices, part.faces) for part in scene.parts]
    first = FirstHits(meshes, (rays.origins, rays.directions))
    result = compare(partial(radar.scan, scene, pose, rng), first.run, seconds=seconds)
    name = f"leaves of {scene.triangles} triangles, by one raw first-hit call"
    yield BenchmarkRow("h", name, result.ratio, "x", None, result.in_us)
