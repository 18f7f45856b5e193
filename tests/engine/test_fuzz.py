"""No arguments crash the engine: real calls are recorded, changed, and made again.

A library that was compiled with sanitizers ends the process at the first access beyond
an array: ``python radarsim/engine/build.py g++ -O1 -g -fsanitize=address,undefined``.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pytest
from flat_world import ROOM, look
from host_client import HostClient
from parts import brick

import radarsim
from radarsim.addons.fmcw.antenna import moving_viewpoints
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid, distance_field
from radarsim.autonomy.mapping.scan_matching import (
    PointMap,
    ScanPoints,
    best_start,
    fit,
    inward_normals,
)
from radarsim.autonomy.navigation.footprint_planning import Footprint, plan_footprint
from radarsim.autonomy.navigation.grid_search import shortest_path
from radarsim.engine import engine
from radarsim.engine.library import Packed
from radarsim.errors import EngineError
from radarsim.geometry import Pose2, Pose3
from radarsim.raycast.rays import Boxes
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene
from radarsim.scene.shapes import cylinder
from radarsim.scene.topology import orient_outward, weld_vertices
from radarsim.server.camera import Renderer
from radarsim.server.host import Host
from radarsim.server.views import View

CALLS: Final = 3000
SLOW_CALLS: Final = 200_000
KEPT: Final = 4  # distinct calls of each function
REFUSALS: Final = (EngineError, TypeError, ValueError, OverflowError)
FLOATS: Final = (math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, -0.0)
NUMBERS: Final = (0, -1, 1, 3, math.nan, 2**31, -(2**63))
# They hold addresses, and indices that are checked when they are made.
FIXED: Final = ("SceneHandle", "Hierarchy")
FUNCTIONS: Final = {name: each.call for name, each in engine.functions.items()}

Calls = list[tuple[str, tuple[Any, ...]]]


def copied(code: str, value: Any, *, whole: bool = False) -> Any:
    """Return an argument with copies of all arrays, or of those that are written."""
    if isinstance(value, np.ndarray):
        return value.copy() if whole or code[0] == "=" else value
    if not isinstance(value, Packed) or value.structure.name in FIXED:
        return value
    fields = fields_of(value)
    changed = {n: copied(kind, v, whole=whole) for n, (kind, v) in fields.items()}
    if all(changed[name] is each for name, (_, each) in fields.items()):
        return value
    return value.structure.pack(**changed)


def fields_of(value: Packed) -> dict[str, tuple[str, Any]]:
    """Return the code and the value of each field."""
    codes = value.structure.codes
    return {name: (code, value.fields[name]) for name, code in codes.items()}


def shape_of(value: Any) -> Any:
    """Return what makes a call distinct from others."""
    if isinstance(value, np.ndarray):
        return tuple(min(length, 2) for length in value.shape)
    return value if isinstance(value, bool) else None


@pytest.fixture(scope="module")
def calls() -> Calls:
    found: dict[str, dict[Any, tuple[Any, ...]]] = {name: {} for name in FUNCTIONS}

    def record(name: str, *arguments: Any) -> Any:
        distinct = found[name]
        key = tuple(map(shape_of, arguments))
        if len(distinct) < KEPT and key not in distinct:
            distinct[key] = tuple(copied("", each, whole=True) for each in arguments)
        return FUNCTIONS[name](*arguments)

    with pytest.MonkeyPatch.context() as patch:
        for name in FUNCTIONS:
            patch.setattr(engine, name, functools.partial(record, name))
        for play in (scan, turn, move, drive, match, plan):
            play()
    return [(name, each) for name in found for each in found[name].values()]


RAIN: Final[dict[str, Any]] = {
    "density": 0.0,
    "laser_density": 0.0,
    "solid": False,
    "rain": 100.0,
}
LEAVES: Final[dict[str, Any]] = {"density": 0.5, "laser_density": 2.0, "solid": False}
SCENE: Final = Scene(
    "small",
    "Small",
    (
        brick(Material("floor"), (20, 20, 0.2), (0, 0, -0.1)),
        brick(Material("wall"), (0.2, 8, 2), (5, 0, 1)),
        brick(Material("mirror", radar_mirror=True), (8, 0.2, 2), (0, 5, 1)),
        brick(Material("tree", **LEAVES, sway_m_per_s=0.1), (2, 2, 2), (-3, 0, 1)),
        brick(Material("cloud", **RAIN), (4, 4, 3), (0, -4, 1.5)),
    ),
)
EYE: Final = Pose3(0.0, 0.0, 1.0)


def scan() -> None:
    for name in ("radar", "laser", "hokuyo", "k2pi"):
        sensor = radarsim.load_sensor(name, resolution_deg=20)
        for scanner in (sensor, sensor.with_all_echoes):
            scanner.scan_many(SCENE, [EYE, Pose3(1, 1, 1)], 1)
            assert len(scanner.scan(SCENE, EYE, 1).cast.power)


def turn() -> None:
    small = {"azimuths": 8, "bins": 400, "rays_across": 1, "rays_up": 1}
    radar = radarsim.load_sensor("navtech_cts350x", fmcw=small)
    found = radar.spectrum(SCENE, EYE, 1)
    for detector in ("ca", "os", "k"):
        found.detections(detector)
    engine.gamma_at(0.5, 1.0, False, 0.1, 3.0)
    moving_viewpoints(EYE, Pose3(1, 1, 1), np.arange(2.0), (1, 1, 0))


def move() -> None:
    orient_outward(*weld_vertices(*cylinder(1, 2)))
    engine.angle_of_link(np.zeros(1, engine.rows["Link"]), 3.0)
    rows = np.arange(5) % 3
    written = np.zeros(5, engine.rows["WrittenEcho"])
    lines = np.zeros(5, engine.rows["EchoRows"])
    numbers = np.ones((3, 5))
    engine.sort_echoes(rows, np.sort(rows), *numbers, 1.0, 2, written, lines)


def drive() -> None:
    host = Host(SCENE)
    for k, name in enumerate(("P3AT", "P2AT", "AirRobot", "Sedan", "Talon")):
        place = f"{{Location {2 * (k - 2)},1,{-1 if name == 'AirRobot' else 0}}}"
        line = f"INIT {{ClassName {name}}} {{Name R{k}}} {place}\r\n"
        client = HostClient(host)
        client.send(line.encode())
        client.send(b"DRIVE {Left 3} {Right 2}\r\nDRIVE {AltitudeVelocity 1}\r\n")
    client.read(60)
    fleet = host.simulation._fleet
    slots = np.array([each.slot for each in fleet.robots], np.int64)
    for meets in (False, True):
        fleet.drive(slots, 0.01, 3, meets=meets)
    Renderer(SCENE).render(View(EYE, Boxes(np.zeros((0, 8)))))


def match() -> None:
    known, grid = PointMap(), OccupancyGrid()
    for pose in (Pose2(0.0, 0.0), Pose2(0.3, 0.1, 0.2)):
        seen = look(ROOM, pose)
        grid.add(pose, seen)
        places, along = seen.points()
        known.add(places, along)
        points = ScanPoints(places, along, inward_normals(places, along), 0.0, True)
        fit(known.table, points, pose, pose, np.array([0.3, 0.3, 0.2]))
        best_start(known.table, points, np.zeros((2, 3)))
    shapes = np.zeros(1, engine.rows["LocalShape"])
    engine.find_shape(known.table, 6.0, 0.0, 0.0, 0.0, shapes)
    beams, kinds = np.array([0, 0, 1, 2]), np.array([0, 1, 3, 4], np.int8)
    near, far = np.zeros((2, 4))
    ranges, known_range = np.array([1.0, 2, 3, 4]), np.array([5.0, 6, 7])
    is_hit = np.zeros(4, np.bool_)
    engine.pair_echoes(beams, beams, ranges, kinds, known_range, near, far, is_hit)
    distance_field(grid.blocked_cells(), 8.0)


def plan() -> None:
    cost, targets = np.ones((6, 5)), np.zeros((6, 5), np.bool_)
    targets[5, 4] = True
    shortest_path(cost, (0, 0), targets)
    around = np.array([[-2.0, -1], [2, -1], [2, 1], [-2, 1], [0, 1]])
    plan_footprint(Footprint(0.5, 0.4), around, Pose2(-1.0, 0.0, 0.0), (1.0, 0.0))


class Mutator:
    """Changes arguments at random."""

    def __init__(self, seed: int) -> None:
        self._rng = generator_for(seed)

    def choose(self, values: Any) -> Any:
        return values[self._rng.integers(len(values))]

    def call(self, calls: Calls) -> tuple[str, list[Any]]:
        """Return a recorded call with one or two other arguments."""
        name, recorded = self.choose(calls)
        codes = list(engine.functions[name].codes)
        arguments = list(map(copied, codes, recorded))
        for _ in range(self._rng.integers(1, 3) if arguments else 0):
            i = int(self._rng.integers(len(arguments)))
            arguments[i] = self.changed(codes[i], arguments[i])
        return name, arguments

    def changed(self, code: str, value: Any) -> Any:
        if isinstance(value, Packed):
            return self._packed_again(value)
        if not isinstance(value, np.ndarray):
            return self.choose((*NUMBERS, *FLOATS, None, "1"))
        if code[-1] != "]" or not self._rng.integers(12):
            return self.choose((None, value.tolist()))
        return self.choose((self._other_form, self._other_length, self._other_value))(
            value
        )

    def _packed_again(self, value: Packed) -> Packed:
        fields = fields_of(value)
        name = self.choose([n for n in fields if fields[n][0][1:] not in FIXED] or [""])
        if value.structure.name in FIXED or not name:
            return value
        changes = {name: self.changed(*fields[name])}
        return value.structure.pack(**value.fields | changes)

    def _other_form(self, value: Any) -> Any:
        kind = self.choose(("f4", "f8", "i4", "i8", "b1"))
        forms: tuple[Callable[[Any], Any], ...] = (
            lambda a: a.astype(kind) if not a.dtype.names else a.view("u1"),
            lambda a: a.astype(a.dtype.newbyteorder()),
            np.asfortranarray,
            lambda a: a[::2],
            lambda a: a[None],
            lambda a: a[..., None],
            lambda a: a[0] if a.size else a,
            lambda a: np.broadcast_to(a, a.shape),
        )
        with np.errstate(invalid="ignore", over="ignore"):
            return self.choose(forms)(value)

    def _other_length(self, value: Any) -> Any:
        axis = int(self._rng.integers(value.ndim)) if value.ndim else 0
        count = value.shape[axis] if value.ndim else 0
        kept = self.choose((0, count // 2, max(count - 1, 0), count))
        rows = np.arange(kept) if kept < count else np.arange(count + 1) % max(count, 1)
        return np.ascontiguousarray(value.take(rows, axis)) if count else value

    def _other_value(self, value: Any) -> Any:
        changed = value.copy()
        column = changed
        if changed.dtype.names:
            column = changed[self.choose(changed.dtype.names)]
        if column.dtype.kind == "f" and column.size:
            at = np.unravel_index(int(self._rng.integers(column.size)), column.shape)
            with np.errstate(over="ignore"):
                column[at] = self.choose(FLOATS)
        return changed


def bytes_of(value: Any) -> Any:
    if isinstance(value, Packed):
        return [bytes_of(each) for each in value.fields.values()]
    return value.tobytes() if isinstance(value, np.ndarray) else value


def fuzz(calls: Calls, count: int, seed: int = 0) -> None:
    mutator = Mutator(seed)
    for _ in range(count):
        try:
            name, arguments = mutator.call(calls)
            FUNCTIONS[name](*arguments)
        except REFUSALS:
            pass


def test_every_function_is_recorded(calls: Calls) -> None:
    assert FUNCTIONS.keys() == {name for name, _ in calls}


def test_changed_arguments_are_refused_or_do_no_harm(calls: Calls) -> None:
    before = [list(map(bytes_of, arguments)) for _, arguments in calls]
    fuzz(calls, CALLS)
    assert [list(map(bytes_of, arguments)) for _, arguments in calls] == before


@pytest.mark.slow
def test_many_changed_arguments_do_no_harm(calls: Calls) -> None:
    fuzz(calls, SLOW_CALLS, seed=1)
