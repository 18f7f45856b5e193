"""Benchmarks of the ray engine: groups a, c, d, g, h, k and p.

Most results are ratios against a raw first-hit call of Embree on the same rays, so that
they hold on machines of any speed.
"""

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
from scipy import fft

from benchmarks import scenes
from benchmarks.first_hits import FirstHits
from benchmarks.scenes import SENSOR
from benchmarks.timing import Row, compare, measure, ratio_row
from radarsim.addons.fmcw.antenna import fixed_viewpoints
from radarsim.addons.fmcw.radar_equation import fft_length
from radarsim.geometry import Floats
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import RangeScanner, load_sensor, sensor_pose
from radarsim.sensors.scan_batch import ScanRequest, take_scans

RINGS: Final = 410  # of the ball of group k: 670,760 triangles
TRIANGLES: Final = 1_000_000  # of the leafy shrubs
BATCH: Final = 100
DRAWS: Final = 64  # of rays that take turns, as scans draw their rays each time
# Upper limits of the ratio to a raw first-hit call.
LIMITS: Final = {"foliage_wall": 1.75, "forest": 2.0, "foliage_room": 1.7}
CONE: Final[dict[str, Any]] = {
    "side_mode": "cone",
    "beamwidth_az_deg": 2,
    "beamwidth_el_deg": 2,
    "cone_rays": 16,
    "ray_choice": "together",
}
# Settings of sensors, and the number of rays of each of their beams.
MULTI_RAY_SENSORS: Final[dict[str, tuple[dict[str, Any], int]]] = {
    "echoes of the drawn ray": ({"return_mode": "all", "ray_choice": "drawn"}, 1),
    "echoes of all three rays": ({"return_mode": "all"}, 3),
    "incidence weights": ({"incidence_weights": True}, 3),
    "cone of 16": (CONE, 16),
    "cone of 16 random rays": ({**CONE, "cone_sampling": "random"}, 16),
}
# Settings that reduce such a sensor to one drawn ray for each beam.
PLAIN: Final = {
    "return_mode": "last",
    "incidence_weights": False,
    "ray_choice": "drawn",
}


def radar_with(beams: int) -> RangeScanner:
    """Create a radar with the given number of beams over 180 degrees."""
    return load_sensor("radar", resolution_deg=180 / (beams - 1))


def first_hits(scene: Scene, *draws: tuple[Floats, Floats]) -> FirstHits:
    """Return the raw first-hit calls of Embree on some rays in a scene."""
    meshes = [(part.vertices, part.faces) for part in scene.parts]
    return FirstHits(meshes, *draws)


def scans_against_first_hits(seconds: float) -> Iterator[Row]:
    """Measure whole scans, with the drawing of rays, against raw first-hit calls."""
    for scene in (scenes.foliage_wall(), scenes.forest(), load_map("foliage_room")):
        for name, scan, draws in _workloads(scene):
            times = compare(scan, first_hits(scene, *draws).run, seconds=seconds)
            yield ratio_row("a", f"{scene.name}, {name}", times, LIMITS[scene.name])


def _workloads(
    scene: Scene,
) -> Iterator[tuple[str, Callable[[], object], list[tuple[Floats, Floats]]]]:
    """Yield the name of a workload, a function that runs it, and draws of its rays."""
    tracer, pose = tracer_of(scene), sensor_pose(scene, SENSOR)
    rng = generator_for(0, "bench")
    for beams in (361, 1801):
        radar = radar_with(beams)
        drawn = [radar.scan(scene, pose, rng).cast for _ in range(DRAWS)]
        draws = [(rays.origins, rays.directions) for rays in drawn]
        yield f"{beams} beams", partial(radar.scan, scene, pose, rng), draws
    radar = radar_with(361)
    rays = Rays.concatenate([radar.scan(scene, pose, rng).cast for _ in range(BATCH)])
    batch = [ScanRequest(radar, pose, rng)] * BATCH
    scan = partial(take_scans, tracer, batch)
    yield f"{BATCH} scans of 361 beams", scan, [(rays.origins, rays.directions)]


def throughput(seconds: float) -> Iterator[Row]:
    """Measure scans per second on one core, in two threads, and from many poses."""
    scene, radar = scenes.foliage_wall(), radar_with(361)
    tracer, pose = tracer_of(scene), sensor_pose(scene, SENSOR)
    rng = generator_for(0, "bench")
    one = measure(lambda: radar.scan(scene, pose, rng), seconds=seconds)
    yield Row("c", "scans of 361 beams, one core", 1 / one, "1/s")
    rays = Rays.concatenate([radar.scan(scene, pose, rng).cast for _ in range(BATCH)])
    with ThreadPoolExecutor(2) as pool:
        times = compare(
            lambda: [tracer.trace(rays) for _ in range(2)],
            lambda: list(pool.map(lambda _: tracer.trace(rays), range(2))),
            seconds=seconds,
        )
    yield ratio_row("c", "two threads, times as fast as one", times)
    poses = [SENSOR] * BATCH
    times = compare(
        lambda: [radar.scan(scene, pose, rng) for pose in poses],
        lambda: radar.scan_many(scene, poses, rng),
        seconds=seconds,
    )
    name = f"scan_many of {BATCH} poses, times as fast as {BATCH} calls of scan"
    yield ratio_row("c", name, times)


def growth(seconds: float) -> Iterator[Row]:
    """Measure one scan in scenes of growing size, and with more beams."""
    cases: list[tuple[str, Scene, int]] = [
        (f"{count} triangles", scenes.bumpy_room(count), 361)
        for count in (10**3, 10**4, 10**5, 10**6)
    ]
    for crossings in (0, 2, 10, 30):
        scene = scenes.curtains(crossings // 2)
        cases.append((f"{crossings} crossings a ray", scene, 361))
    wall = scenes.foliage_wall()
    cases += [(f"{n} beams", wall, n) for n in (10, 10**2, 10**3, 10**4, 10**5)]
    for name, scene, beams in cases:
        pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
        scan = partial(radar_with(beams).scan, scene, pose, rng)
        taken = measure(scan, seconds=seconds)
        yield Row("d", f"{scene.name}, {name}", taken * 1e6, "us")


def beams_against_rays(seconds: float) -> Iterator[Row]:
    """Measure scans of many rays against as many scans of one drawn ray."""
    scene = scenes.foliage_wall()
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    for name, (settings, rays) in MULTI_RAY_SENSORS.items():
        sensor = load_sensor("radar", resolution_deg=0.5, **settings)
        plain = load_sensor("radar", resolution_deg=0.5, **{**settings, **PLAIN})

        def draw(plain: RangeScanner = plain, rays: int = rays) -> None:
            for _ in range(rays):
                plain.scan(scene, pose, rng)

        scan = partial(sensor.scan, scene, pose, rng)
        times = compare(scan, draw, seconds=seconds)
        yield ratio_row("g", name, times, 1.0 if rays > 1 else None)


def mirrors_and_leaves(seconds: float) -> Iterator[Row]:
    """Measure rays that are reflected twice, and rays through single leaves."""
    scene, bounces = scenes.hall_of_mirrors(), 2
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    # The power is unlimited, so that no ray ends in the foliage.
    settings = {"resolution_deg": 0.5, "penetration_power": math.inf}
    reflected = load_sensor("radar", **settings, max_bounces=bounces)
    plain = load_sensor("radar", **settings, max_bounces=0)
    times = compare(
        partial(reflected.scan, scene, pose, rng),
        partial(plain.scan, scene, pose, rng),
        seconds=seconds,
    )
    name = f"{bounces} bounces in a hall of mirrors, by none"
    yield ratio_row("h", name, times, bounces + 1.0)
    scene, radar = scenes.leafy_shrubs(TRIANGLES), radar_with(361)
    pose = sensor_pose(scene, SENSOR)
    rays = radar.scan(scene, pose, rng).cast
    first = first_hits(scene, (rays.origins, rays.directions))
    times = compare(partial(radar.scan, scene, pose, rng), first.run, seconds=seconds)
    name = f"leaves of {scene.triangles} triangles, by one raw first-hit call"
    yield ratio_row("h", name, times)


def mesh_maps(seconds: float, rings: int = RINGS) -> Iterator[Row]:
    """Measure CPU time from a map to its tracer, against reading and building only.

    The reference is trimesh's reading of the file and embreex' building of a scene of
    it, which shows neither whether the mesh is closed nor which side is outside.
    """
    mesh = scenes.ball(rings)
    for suffix in ("stl", "glb"):
        with TemporaryDirectory() as folder:
            path = scenes.write_mesh_map(Path(folder), mesh, suffix)
            times = compare(
                partial(_load, path),
                partial(_read_and_build, path.with_name(f"ball.{suffix}")),
                seconds=seconds,
                clock=time.process_time,
            )
        yield ratio_row("k", f"{len(mesh[1])} triangles, {suffix.upper()}", times, 1.0)


def _load(path: Path) -> Tracer:
    return tracer_of(load_map(path))


def _read_and_build(path: Path) -> FirstHits:
    mesh: Any = trimesh.load_mesh(path, process=False)
    triangles = mesh.vertices, mesh.faces
    return FirstHits([triangles], (np.zeros((1, 3)), np.eye(3)[:1]))


def turns_of_a_radar(seconds: float) -> Iterator[Row]:
    """Measure a turn of an FMCW radar against tracing its rays and the FFTs."""
    scene, radar = load_map("foliage_room"), load_sensor("navtech_cts350x").fmcw
    pose, rng = sensor_pose(scene, (-8.0, 0.0, 0.0)), generator_for(0, "bench")
    settings, tracer = radar.settings, tracer_of(scene)
    view = fixed_viewpoints(pose, radar.times(0))
    _, rays = radar.aim(scene, view, -1, range(settings.azimuths))
    signal = np.ones((settings.azimuths, fft_length(settings) // 2), np.complex64)

    def trace_and_transform() -> None:
        tracer.trace(rays, events=True, incidence=True)
        fft.fft(signal, axis=1)

    times = compare(
        lambda: radar.spectrum(scene, pose, rng),
        trace_and_transform,
        seconds=seconds,
        clock=time.thread_time,
    )
    name = f"{settings.azimuths} x {settings.bins} bins in foliage_room"
    yield ratio_row("p", name, times, 5.0)
