import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensor_settings import (
    SensorSettings,
    offset_units,
    two_way_deviation,
)
from radarsim.presets.sensors import load_settings
from radarsim.raycast.rays import Nodes, Rays, Sides
from radarsim.raycast.tracer import Tracer
from radarsim.rng import generator_for
from radarsim.sensors.beams import BeamPattern, beam_angles
from radarsim.sensors.scan_batch import ScanBatch

CONE = {"side_mode": "cone", "beamwidth_az_deg": 4.0, "beamwidth_el_deg": 2.0}
ORIGIN, HERE = Pose3(0.0, 0.0, 0.0), Pose3(1.0, -2.0, 0.5)


def aim(settings: SensorSettings, pose: Pose3, side: int) -> Rays:
    return BeamPattern(settings).aim_side(pose, side)


def trace(pattern: BeamPattern, seed: int = 0, pose: Pose3 = ORIGIN) -> ScanBatch:
    """Take a scan where there is nothing."""
    batch = ScanBatch(pattern, Tracer([]), np.array([(*pose.numbers(), -1.0)]))
    batch.draw(0, generator_for(seed, "beams"), "radar")
    batch.trace()
    return batch


def sample(pattern: BeamPattern, seed: int = 0, pose: Pose3 = ORIGIN) -> Rays:
    """Return the rays of a scan."""
    return trace(pattern, seed, pose).all_rays(0)


def sides_of(batch: ScanBatch) -> Sides:
    """Return the side of the ray of each beam that has one."""
    assert batch.rays is not None
    return np.asarray(batch.rays[0])


def test_beams_run_counter_clockwise_from_the_right() -> None:
    settings = load_settings("radar")
    assert np.degrees(beam_angles(settings)) == pytest.approx(np.arange(-90, 91))
    rays = aim(settings, HERE, 0)
    assert rays.directions[0] == pytest.approx([0, -1, 0])
    assert rays.directions[180] == pytest.approx([0, 1, 0])
    assert rays.origins == pytest.approx(np.tile(HERE.position(), (181, 1)))


@pytest.mark.parametrize("mode", ["perpendicular", "lateral"])
@pytest.mark.parametrize("side", [-1, 1])
def test_parallel_side_ray_starts_n_units_off(side: int, mode: str) -> None:
    settings = load_settings("radar", side_offset_uu=50, side_mode=mode)
    pose = Pose3(1, 2, 3, 0, 0, math.pi / 2)
    middle, aside = aim(settings, pose, 0), aim(settings, pose, side)
    left = np.cross([0, 0, 1], middle.directions)  # of each beam
    if mode == "lateral":
        left[:] = [-1.0, 0.0, 0.0]  # of the sensor, which looks north
    assert aside.directions == pytest.approx(middle.directions)
    assert aside.origins - middle.origins == pytest.approx(side * 0.2 * left)


@pytest.mark.parametrize("weights", [(1, 2, 5), (0, 1, 0), None], ids=str)
def test_rays_are_drawn_by_their_weights(weights: tuple[int, ...] | None) -> None:
    settings = {"ray_weights": weights} if weights else CONE
    wide = load_settings("radar", fov_deg=359, resolution_deg=0.01, **settings)
    pattern = BeamPattern(wide)
    if weights:
        assert pattern.weights == pytest.approx(np.array(weights) / sum(weights))
    drawn: Nodes = trace(pattern, 1).nodes
    for node, wanted in enumerate(pattern.weights.tolist()):
        error = math.sqrt(wanted * (1 - wanted) / len(drawn))
        assert abs(np.mean(drawn == node) - wanted) <= 4 * error


@pytest.mark.parametrize("side", [-1, 1])
def test_divergent_ray_is_n_units_off_at_its_distance(side: int) -> None:
    settings = load_settings(
        "radar", side_offset_uu=100, side_mode="divergent", divergence_distance=5
    )
    middle, aside = aim(settings, HERE, 0), aim(settings, HERE, side)
    assert aside.origins == pytest.approx(middle.origins)
    turn = np.cross(middle.directions, aside.directions)[:, 2]
    assert np.arcsin(turn) == pytest.approx(np.full(181, side * math.atan(0.4 / 5)))


UPRIGHT = {"beamwidth_az_deg": 0, "beamwidth_el_deg": 2.0}


def cone_offsets(pattern: BeamPattern, drawn: Rays, beam: int) -> Floats:
    """Return how far each ray of one beam is off it, (K, 2) rad to the left and up."""
    directions = drawn.directions.reshape(len(pattern.angles), -1, 3)[beam]
    across = np.arctan2(directions[:, 1], directions[:, 0]) - pattern.angles[beam]
    return np.column_stack([across, np.arcsin(directions[:, 2])])


@pytest.mark.parametrize(
    ("count", "nodes", "weights"),
    [
        (1, [0], [1]),
        (3, [-0.5201, 0, 0.5201], [0.1667, 0.6667, 0.1667]),
        (
            7,
            [-1.1262, -0.7107, -0.3466, 0, 0.3466, 0.7107, 1.1262],
            [0.0005, 0.0308, 0.2401, 0.4571, 0.2401, 0.0308, 0.0005],
        ),
    ],
    ids=["one", "three", "seven"],
)
def test_nodes_across_are_those_of_gauss_hermite_quadrature(
    count: int, nodes: list[float], weights: list[float]
) -> None:
    cone = {**CONE, "beamwidth_el_deg": 0, "cone_rays": count}
    settings = load_settings("radar", **cone, ray_choice="together")
    tall = load_settings("radar", **{**cone, **UPRIGHT})
    assert (settings.cone_grid, tall.cone_grid) == ((count, 1), (1, count))
    pattern = BeamPattern(settings)
    offsets = cone_offsets(pattern, sample(pattern), 40) / math.radians(4)
    assert offsets[:, 0] == pytest.approx(nodes, abs=6e-5)
    assert offsets[:, 1] == pytest.approx(np.zeros(count))
    assert pattern.weights == pytest.approx(weights, abs=6e-5)


def test_cone_with_two_widths_has_a_grid_of_nodes() -> None:
    settings = load_settings("radar", **CONE, cone_rays=12, ray_choice="together")
    pattern = BeamPattern(settings)
    assert settings.cone_grid == (4, 3)
    offsets = cone_offsets(pattern, sample(pattern), 100)
    assert len(np.unique(offsets[:, 0].round(9))) == 4
    assert len(np.unique(offsets[:, 1].round(9))) == 3
    variance = pattern.weights @ offsets**2
    assert np.sqrt(variance) == pytest.approx(
        [two_way_deviation(math.radians(4)), two_way_deviation(math.radians(2))]
    )
    assert pattern.weights.sum() == pytest.approx(1.0)


def test_random_rays_are_distributed_like_the_two_way_beam() -> None:
    settings = load_settings(
        "radar", **CONE, cone_rays=500, cone_sampling="random", ray_choice="together"
    )
    pattern = BeamPattern(settings)
    drawn = sample(pattern, 3)
    offsets = np.concatenate(
        [cone_offsets(pattern, drawn, i) for i in range(0, 181, 9)]
    )
    n = len(offsets)
    for i, width in enumerate((4, 2)):
        sigma = two_way_deviation(math.radians(width))
        assert offsets[:, i].mean() == pytest.approx(0, abs=4 * sigma / math.sqrt(n))
        error = sigma / math.sqrt(2 * n)
        assert offsets[:, i].std() == pytest.approx(sigma, abs=4 * error)
    assert np.corrcoef(offsets.T)[0, 1] == pytest.approx(0, abs=4 / math.sqrt(n))


@pytest.mark.parametrize("sampling", ["quadrature", "random"])
def test_side_of_a_cone_ray_follows_its_offset(sampling: str) -> None:
    cone = {**CONE, "cone_rays": 9, "cone_sampling": sampling}
    pattern = BeamPattern(load_settings("radar", **cone))
    batch = trace(pattern)
    ahead = batch.all_rays(0).directions
    turned = np.arctan2(ahead[:, 1], ahead[:, 0]) - pattern.angles
    assert sides_of(batch).tolist() == np.sign(turned.round(9)).tolist()
    assert {-1, 1} <= set(sides_of(batch).tolist())


@settings(max_examples=15)
@given(st.tuples(*[st.floats(-10, 10)] * 6))
def test_rays_are_turned_and_moved_by_the_pose_exactly(
    numbers: tuple[float, ...],
) -> None:
    pattern = BeamPattern(load_settings("radar", fov_deg=4, ray_choice="together"))
    pose = Pose3(*numbers)
    moved, own = sample(pattern, pose=pose), sample(pattern)
    turn, place = pose.rotation(), pose.position()
    for i in range(len(own.power)):
        for axis, (x, y, z) in enumerate(turn.tolist()):
            dx, dy, dz = own.directions[i].tolist()
            sx, sy, sz = own.origins[i].tolist()
            assert moved.directions[i, axis] == x * dx + y * dy + z * dz
            assert moved.origins[i, axis] == place[axis] + (x * sx + y * sy + z * sz)


def test_three_divergent_rays_can_equal_a_cone_of_three() -> None:
    distance, width = 20.0, math.radians(4)
    cone = {**CONE, "beamwidth_el_deg": 0, "cone_rays": 3}
    three = {
        "side_mode": "divergent",
        "side_offset_uu": offset_units(
            math.sqrt(3) * two_way_deviation(width), distance
        ),
        "divergence_distance": distance,
        "ray_weights": (1, 4, 1),
    }
    one, other = (
        BeamPattern(load_settings("radar", **settings, ray_choice="together"))
        for settings in (cone, three)
    )
    assert one.weights == pytest.approx(other.weights)
    directions = [sample(pattern, pose=HERE).directions for pattern in (one, other)]
    assert directions[0] == pytest.approx(directions[1])


def test_rays_of_a_beam_are_consecutive() -> None:
    pattern = BeamPattern(load_settings("radar", ray_choice="together"))
    rays = sample(pattern, pose=HERE)
    for node, side in enumerate((-1, 0, 1)):
        alone = pattern.aim_side(HERE, side)
        assert rays.origins[node::3].tolist() == alone.origins.tolist()
        assert rays.directions[node::3].tolist() == alone.directions.tolist()


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param({**CONE, "cone_rays": 9}, id="a grid"),
        pytest.param({**CONE, "cone_sampling": "random"}, id="random rays"),
    ],
)
def test_cone_has_no_side_rays_to_select(settings: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="no ray -1, expected beams of three rays"):
        BeamPattern(load_settings("radar", **settings)).aim_side(HERE, -1)


def test_laser_has_one_ray_whatever_its_settings() -> None:
    settings = load_settings("laser", **CONE, side_offset_uu=50, ray_choice="together")
    pattern = BeamPattern(settings)
    assert (pattern.rays, pattern.radius, pattern.kinds) == (1, 0.0, [])
