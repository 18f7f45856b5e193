"""The turning antenna: what it records direction by direction."""

from typing import Any

import numpy as np
import pytest
from fmcw_scenes import block, db, received_power, scene_of

import radarsim
from radarsim.addons.fmcw.antenna import fixed_viewpoints, rows_in_beam
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.rotation import Rotation, Sector, join_sectors
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.geometry import Pose3
from radarsim.raycast.rays import Boxes
from radarsim.scene.scene import Reflector, Scene

EYE = Pose3(-8.0, 0.0, 0.5, 0.0, 0.0, 0.3)


@pytest.fixture(scope="module")
def radar() -> FmcwRadar:
    settings = {"azimuths": 90, "bins": 600, "rays_across": 4, "beamwidth_az_deg": 6}
    radar: FmcwRadar = radarsim.load_sensor("navtech_cts350x", fmcw=settings).fmcw
    return radar


def turns_of(sectors: list[Sector], turn: int) -> np.ndarray:
    return np.concatenate([k.spectrum.power for k in sectors if k.turn == turn])


@pytest.mark.parametrize("count", [7, 45, 90, 200])
def test_standing_radar_records_the_spectra_of_its_pose(
    radar: FmcwRadar, foliage_room: Scene, count: int
) -> None:
    rng = radarsim.generator_for(3)
    expected = [radar.spectrum(foliage_room, EYE, rng) for _ in range(2)]
    rotation = Rotation(radar, foliage_room, radarsim.generator_for(3))
    sectors: list[Sector] = []
    while not any(each.turn == 1 and each.ends_turn for each in sectors):
        sectors += rotation.advance(EYE, count)
    for turn, whole in enumerate(expected):
        assert turns_of(sectors, turn).tobytes() == whole.power.tobytes()
        echoes = [k.spectrum.echo_power for k in sectors if k.turn == turn]
        assert np.concatenate(echoes).tobytes() == whole.echo_power.tobytes()


def test_directions_come_in_order_and_a_few_sweeps_late(
    radar: FmcwRadar, foliage_room: Scene
) -> None:
    rotation = Rotation(radar, foliage_room, radarsim.generator_for(0))
    rotation.advance(EYE, 90)  # nothing of it is received
    found = []
    for step in range(1, 11):
        for sector in rotation.advance(EYE, 10):
            found += list(
                range(sector.first, sector.first + len(sector.spectrum.angles))
            )
        assert 10 * step - rows_in_beam(radar.settings) == len(found)
    assert found[:80] == list(range(80))


def test_turn_of_a_moving_radar_is_smeared(radar: FmcwRadar) -> None:
    """A wall ahead and one behind, while the radar drives 1 m a turn."""
    scene = scene_of(*(block((0.2, 60, 20), (x, 0, 0)) for x in (-20.1, 20.1)))
    rotation = Rotation(radar, scene, radarsim.generator_for(0))
    sectors: list[Sector] = []
    for step in range(30):
        sectors += rotation.advance(Pose3(0.1 * step, 0.0, 1.0), 9)
    # The turn that is received first begins after 1 m, and looks back 0.5 m later.
    first = [k.spectrum for k in sectors if k.turn == 0]
    assert _range(first, 0) == pytest.approx(20 - 1.0, abs=0.15)
    assert _range(first, 45) == pytest.approx(20 + 1.5, abs=0.15)


def test_each_direction_is_seen_from_where_the_radar_is_then() -> None:
    """A mast 10 m ahead of a radar that turns by 60 degrees a second.

    In a rigid body's frame the mast is at the angle by which the robot has turned when
    the antenna looks there, with any number of azimuths at once.
    """
    radar = radarsim.load_sensor("navtech_cts350x", fmcw={"sidelobe_db": -300}).fmcw
    settings = radar.settings
    mast = Reflector("mast", (0.0, -10.0, 1.0), rcs_dbsm=10.0)
    scene = Scene("mast", "Mast", reflectors=(mast,))
    rate = np.radians(60.0)

    def yaw_at(row: float) -> float:
        return float(rate * row * settings.sweep_time)

    for count in (16, 100):
        rotation = Rotation(radar, scene, radarsim.generator_for(0))
        echoes: dict[int, float] = {}
        for first in range(0, 2 * settings.azimuths, count):
            start, end = (
                Pose3(0.0, 0.0, 1.0, 0.0, 0.0, yaw_at(first + more))
                for more in (0, count)
            )
            for sector in rotation.advance(end, count, start=start):
                power = sector.spectrum.echo_power.sum(axis=1)
                echoes |= dict(zip(sector.rows, power.tolist(), strict=True))
        rows = np.array(list(echoes))
        weights = np.array(list(echoes.values()))
        seen = float((rows * weights).sum() / weights.sum())
        # Clockwise from ahead: a quarter of a turn, and what the robot has turned by.
        angle = np.pi / 2 + yaw_at(settings.azimuths + seen)
        assert seen * settings.step == pytest.approx(angle, abs=np.radians(0.03))


def _range(parts: list[Spectrum], row: int) -> float:
    echoes = np.concatenate([each.echo_power for each in parts])[row]
    return float(parts[0].ranges[np.argmax(echoes)])


def test_approached_reflector_seems_nearer() -> None:
    """As a wall does: 5.5 cm per m/s with a sweep of 625 us and 863 MHz."""
    sphere = Reflector("sphere", (20.0, 0.0, 1.0), rcs_dbsm=0.0)
    scene = Scene("sphere", "Sphere", reflectors=(sphere,))
    radar = radarsim.load_sensor("navtech_cts350x").fmcw
    views = [
        fixed_viewpoints(Pose3(0.0, 0.0, 1.0), np.zeros(1), (speed, 0.0, 0.0))
        for speed in (0.0, 10.0)
    ]
    still, moving = (radar.tones(scene, each, range(1)).ranges[0] for each in views)
    assert still - moving == pytest.approx(0.554, rel=0.02)


@pytest.mark.parametrize("heading_deg", [0, 60, 180])
def test_robot_that_drives_seems_nearer_or_farther(heading_deg: float) -> None:
    """By what it comes nearer each second: 5.5 cm per m/s."""
    scene, heading = Scene("empty", "Empty"), np.radians(heading_deg)
    radar = radarsim.load_sensor("navtech_cts350x").fmcw
    view = fixed_viewpoints(Pose3(0.0, 0.0, 0.3), np.zeros(1))
    places = []
    for speed in (0.0, 10.0):
        own = [0.0, 0.0, 0.0, 0.0, 0.6, 0.3, 0.3, 4.0]
        other = [20.0, 0.0, heading, 0.0, 0.6, 0.3, 0.3, 9.0]
        velocity = speed * np.array([np.cos(heading), np.sin(heading)])
        boxes = Boxes(np.array([other, own]), np.array([velocity, [0, 0]]))
        echoes = radar.new_turn(scene)
        radar.add_echoes(echoes, scene, view, range(1), 7, boxes, carrier_id=4)
        power = echoes.rows(0, 1, echoes, echoes).power[0]
        places.append((power * radar.ranges).sum() / power.sum())
    expected = 0.554 * np.cos(heading)
    assert places[1] - places[0] == pytest.approx(expected, abs=0.02)


def test_target_has_its_cross_section_and_its_velocity() -> None:
    """A sphere of 0 dBsm, and a robot with a known speed."""
    sphere = Reflector("sphere", (20.0, 0.0, 1.0), rcs_dbsm=0.0)
    scene = Scene("sphere", "Sphere", reflectors=(sphere,))
    radar = radarsim.load_sensor("navtech_cts350x").fmcw
    rotation = Rotation(radar, scene, radarsim.generator_for(0))
    pose, own, other = Pose3(0.0, 0.0, 1.0), [0.0] * 8, [-9.0, 0, 0, 0, 2, 1, 1, 9.0]
    boxes = Boxes(np.array([other, own]), np.array([[3.0, 0.0], [0.0, 0.0]]))
    moving: dict[str, Any] = {"boxes": boxes, "carrier_id": 0}
    moving["velocity"] = (1.0, 0.0, 0.0)
    sectors = [each for _ in range(9) for each in rotation.advance(pose, 100, **moving)]
    turn = join_sectors(each for each in sectors if each.turn == 0)
    found = turn.detections()
    sphere_row = found.dbm == found.dbm[found.rows == 0].max()
    assert found.rcs_dbsm[sphere_row] == pytest.approx([0], abs=0.6)
    assert found.radial_velocity[sphere_row] == pytest.approx([-1])
    assert found.ranges[sphere_row] == pytest.approx([20 - 0.055], abs=0.05)
    snr = received_power(radar.settings, 1.0, 20.0) / turn.noise_floor[457]
    assert found.snr_db[sphere_row] == pytest.approx([db(snr)], abs=0.6)
    # It is behind, drives towards the radar by 3 m/s, and that drives away by 1 m/s.
    robot = (found.rows == 200) & (np.abs(found.ranges - 8) < 1)
    assert found.radial_velocity[robot] == pytest.approx(-2, abs=0.05)
    assert robot.any()
