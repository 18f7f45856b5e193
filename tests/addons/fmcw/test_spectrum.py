"""Turns of a radar in a scene."""

import numpy as np
import pytest
from fmcw_scenes import EYE, block, db, radar, received_power, scene_of, wall_at

import radarsim
from radarsim.addons.fmcw.radar_equation import fft_length
from radarsim.errors import PresetError
from radarsim.rng import generator_for
from radarsim.scene.scene import Reflector, Scene

PLACE = (-8.0, 0.0, 0.0)


def test_same_seed_gives_the_same_spectrum(foliage_room: Scene) -> None:
    which = radarsim.load_sensor("navtech_cts350x")
    first, again, other = (
        which.spectrum(foliage_room, PLACE, generator_for(seed)) for seed in (1, 1, 2)
    )
    assert (first.power == again.power).all()
    assert (first.power != other.power).any()
    assert (first.echo_power == other.echo_power).all()


def test_spectrum_in_between_changes_no_range(foliage_room: Scene) -> None:
    radar_, turning = (
        radarsim.load_sensor(name) for name in ("radar", "navtech_cts350x")
    )
    plain, asked = generator_for(4), generator_for(4)
    for _ in range(3):
        expected = radar_.scan(foliage_room, PLACE, plain)
        turning.spectrum(foliage_room, PLACE, asked)
        assert (radar_.scan(foliage_room, PLACE, asked).ranges == expected.ranges).all()


def test_mean_is_what_turns_of_many_seeds_average_to() -> None:
    which, scene = radar(azimuths=16, bins=600, leakage_db=-300), wall_at(10)
    turns = [which.spectrum(scene, EYE, generator_for(seed)) for seed in range(200)]
    average = np.mean([turn.power[0] for turn in turns], axis=0)
    strong = turns[0].mean[0] > 0.1 * turns[0].mean[0].max()
    found = db(average[strong] / turns[0].mean[0][strong])
    assert found == pytest.approx(0, abs=1.2)
    assert db(average.sum() / turns[0].mean[0].sum()) == pytest.approx(0, abs=0.5)


def test_directions_are_clockwise_from_straight_ahead() -> None:
    which = radar(azimuths=80, bins=600)
    right = scene_of(block((1, 1, 3), (0, -10, 1)))
    turn = which.spectrum(right, EYE, generator_for(0))
    assert turn.echo_power.sum(axis=1).argmax() == 20
    assert turn.angles[20] == pytest.approx(-np.pi / 2)


def test_counts_are_half_decibels_over_the_noise() -> None:
    which = radar(azimuths=40, bins=600)
    turn = which.spectrum(wall_at(10), EYE, generator_for(0))
    counts = turn.counts.astype(float)
    assert np.median(counts[:, 400:]) == pytest.approx(17, abs=1)
    loud = (counts > 20) & (counts < 255)
    rows = turn.decibels[loud] - turn.decibels[loud].min()
    steps = counts[loud] - counts[loud].min()
    assert 2 * rows == pytest.approx(steps, abs=1.01)


def test_detections_find_a_wall(foliage_room: Scene) -> None:
    which = radarsim.load_sensor("navtech_cts350x")
    turn = which.spectrum(foliage_room, PLACE, generator_for(0))
    for detector in ("ca", "os", "k"):
        found = turn.detections(detector)
        assert (np.diff(found.rows) >= 0).all()
        assert found.ranges == pytest.approx(turn.ranges[found.bins])
        # The south wall is 6.4 m to the right.
        ahead = np.abs(found.angles + np.pi / 2) < 0.01
        assert (np.abs(found.ranges[ahead] - 6.4) < 0.3).any()
    with pytest.raises(ValueError, match="expected one of"):
        turn.detections("cfar")
    with pytest.raises(ValueError, match="at least 1"):
        turn.detections("k", count=0)


def test_setting_of_the_radar_can_be_changed(foliage_room: Scene) -> None:
    small = radarsim.load_sensor("navtech_cts350x", fmcw={"bins": 300, "azimuths": 20})
    turn = small.spectrum(foliage_room, PLACE, generator_for(0))
    assert turn.power.shape == (20, 300)
    assert "20 azimuths of 300 bins" in repr(turn)
    assert "20 azimuths of 300 bins" in repr(small.fmcw)


def test_errors_of_a_setting_are_reported(foliage_room: Scene) -> None:
    with pytest.raises(PresetError, match="no setting 'binz'"):
        radarsim.load_sensor("navtech_cts350x", fmcw={"binz": 3})
    with pytest.raises(PresetError, match="at most c/2B"):
        radarsim.load_sensor("navtech_cts350x", fmcw={"bin_size": 0.5})
    with pytest.raises(PresetError, match="no spectrum, expected one of"):
        radarsim.load_sensor("hokuyo").spectrum(foliage_room, PLACE, generator_for(0))


def test_presets_of_a_radar_agree_with_its_scanner() -> None:
    for name in radarsim.presets.sensors.sensor_presets():
        scanner = radarsim.load_sensor(name)
        if not radarsim.presets.sensors.sensor_presets()[name].fmcw:
            continue
        it, sensor = scanner.fmcw.settings, scanner.settings
        assert it.azimuths == sensor.beams
        assert it.max_range == pytest.approx(sensor.max_range, rel=1e-3)
        assert it.rotation_hz == sensor.scan_rate_hz
        assert it.beamwidth_az_deg == sensor.beamwidth_az_deg


def test_reflector_of_a_map_returns_by_the_radar_equation() -> None:
    corner = Reflector("corner", (20.0, 0.0, EYE.z), trihedral=0.1)
    scene = Scene("corner", "Corner", reflectors=(corner,))
    which = radar(carrier_ghz=77)
    power = which.spectrum(scene, EYE, generator_for(0)).echo_power[0]
    rcs = 10 ** (14.41 / 10)  # 4 pi a^4 / (3 lambda^2)
    expected = received_power(which.settings, rcs, 20.0)
    assert db(power.sum() / expected) == pytest.approx(0, abs=0.1)
    assert which.ranges[power.argmax()] == pytest.approx(20, abs=0.03)


def test_reflector_behind_a_wall_is_hidden() -> None:
    corner = Reflector("corner", (20.0, 0.0, EYE.z), trihedral=0.1)
    wall = wall_at(10).parts
    scene = Scene("corner", "Corner", wall, reflectors=(corner,))
    which = radar(bins=600)
    power = which.spectrum(scene, EYE, generator_for(0)).echo_power[0]
    assert power[which.ranges > 15].sum() < 1e-30  # W


@pytest.mark.parametrize("name", ["marulan_trial", "forest_edge"])
def test_share_of_bright_bins_is_about_that_of_real_images(name: str) -> None:
    """In images of the Oxford data set 7.1 % of the bins are over 60 counts."""
    scene = radarsim.load_map(name)
    start = scene.starts[0].pose
    place = (start.x, start.y, start.yaw)
    which = radarsim.load_sensor("navtech_cts350x")
    counts = which.spectrum(scene, place, generator_for(0)).counts
    assert 0.0355 < (counts > 60).mean() < 0.142


def test_spectrum_of_the_beat_signal_is_the_power(foliage_room: Scene) -> None:
    """A plain FFT behind the window, and the tilt of the receiver by its definition."""
    tilt = {"azimuths": 50, "bins": 500, "noise_tilt_db": 6.0}
    which = radarsim.load_sensor("navtech_cts350x", fmcw=tilt)
    turn = which.spectrum(foliage_room, PLACE, 3)
    samples = which.beat_signal(foliage_room, PLACE, 3)
    assert samples.dtype == np.float32
    assert samples.shape[0] == 50
    window = np.blackman(samples.shape[1] + 1)[:-1]
    length = fft_length(turn.settings)
    spectra = np.fft.rfft(samples * window / window.sum(), length)[:, :500]
    power = np.abs(spectra) ** 2 * 10 ** (np.linspace(3, -3, 500) / 10)
    # Rounded to 32 bits, relative to the strongest of each direction.
    error = np.abs(np.sqrt(power) - np.sqrt(turn.power))
    assert (error < 1e-5 * np.sqrt(turn.power.max(axis=1))[:, None]).all()
