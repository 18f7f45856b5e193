import math

import numpy as np
import pytest

from radarsim.geometry import Pose3
from radarsim.presets.sensors import load_settings
from radarsim.presets.settings import SensorSettings
from radarsim.randomness import generator_for
from radarsim.sensors.beams import BeamPattern, Fan, Sides, beam_angles

HERE = Pose3(1.0, -2.0, 0.5)


def aim(settings: SensorSettings, pose: Pose3, side: int) -> Fan:
    pattern = BeamPattern(settings)
    return pattern.aim(pose, pattern.only(side))


def draw_sides(settings: SensorSettings, rng: np.random.Generator) -> Sides:
    return BeamPattern(settings).draw(rng).sides


def test_beams_go_counter_clockwise_from_the_right() -> None:
    angles = beam_angles(load_settings("radar"))
    assert np.degrees(angles) == pytest.approx(np.arange(-90, 91))


def test_the_first_beam_points_right_and_the_last_left() -> None:
    settings = load_settings("radar")
    fan = aim(settings, HERE, 0)
    assert fan.directions[0] == pytest.approx([0, -1, 0])
    assert fan.directions[180] == pytest.approx([0, 1, 0])
    assert fan.origins == pytest.approx(np.tile(HERE.position(), (181, 1)))


@pytest.mark.parametrize("side", [-1, 1])
def test_a_perpendicular_ray_is_parallel_and_n_units_beside(side: int) -> None:
    settings = load_settings("radar", side_offset_uu=50)
    middle = aim(settings, HERE, 0)
    beside = aim(settings, HERE, side)
    way = beside.origins - middle.origins
    across = np.cross([0, 0, 1], middle.directions)  # to the left of each beam
    assert beside.directions == pytest.approx(middle.directions)
    assert np.linalg.norm(way, axis=1) == pytest.approx(np.full(181, 0.2))
    assert np.einsum("ij,ij->i", way, across) == pytest.approx(np.full(181, side * 0.2))


@pytest.mark.parametrize("side", [-1, 1])
def test_a_lateral_ray_starts_on_the_left_right_axis(side: int) -> None:
    settings = load_settings("radar", side_offset_uu=100, side_mode="lateral")
    pose = Pose3(1, 2, 3, 0, 0, math.pi / 2)
    middle = aim(settings, pose, 0)
    beside = aim(settings, pose, side)
    assert beside.directions == pytest.approx(middle.directions)
    left_of_north = np.array([-1.0, 0.0, 0.0])
    assert beside.origins - middle.origins == pytest.approx(
        np.tile(side * 0.4 * left_of_north, (181, 1))
    )


@pytest.mark.parametrize("side", [-1, 1])
def test_a_divergent_ray_is_n_units_off_at_its_distance(side: int) -> None:
    settings = load_settings(
        "radar", side_offset_uu=100, side_mode="divergent", divergence_distance=5
    )
    middle = aim(settings, HERE, 0)
    beside = aim(settings, HERE, side)
    assert beside.origins == pytest.approx(middle.origins)
    turn = np.cross(middle.directions, beside.directions)[:, 2]
    assert np.arcsin(turn) == pytest.approx(np.full(181, side * math.atan(0.4 / 5)))


def test_rays_are_drawn_by_their_weights() -> None:
    settings = load_settings(
        "radar", fov_deg=359, resolution_deg=0.01, ray_weights=(1, 2, 5)
    )
    drawn = draw_sides(settings, generator_for(1, "weights"))
    shares = [np.mean(drawn == side) for side in (-1, 0, 1)]
    for share, wanted in zip(shares, (1 / 8, 2 / 8, 5 / 8), strict=True):
        error = math.sqrt(wanted * (1 - wanted) / len(drawn))
        assert share == pytest.approx(wanted, abs=3 * error)


def test_a_ray_of_weight_zero_is_never_drawn() -> None:
    settings = load_settings("radar", ray_weights=(0, 1, 0))
    rng = generator_for(0, "never")
    assert not any(draw_sides(settings, rng).any() for _ in range(100))


def test_a_tilted_sensor_scans_its_own_plane() -> None:
    fan = aim(load_settings("radar"), Pose3(0, 0, 0, 0, 0.3, 0), 0)
    assert fan.directions[90] == pytest.approx([math.cos(0.3), 0, -math.sin(0.3)])
    assert fan.directions[0] == pytest.approx([0, -1, 0])
