"""Noise, speckle and points in a spectrum, against closed forms."""

import math
from statistics import NormalDist

import numpy as np
import pytest
from fmcw_scenes import beat_spectrum, db, dbm, no_echoes, radar, received_power
from scipy.signal import get_window

from radarsim.addons.fmcw import beat_signal
from radarsim.addons.fmcw.antenna import fixed_viewpoints
from radarsim.addons.fmcw.beat_signal import NO_TONES, NumberedStreams, Power, Tones
from radarsim.addons.fmcw.point_echoes import Points, Ways, point_tones
from radarsim.addons.fmcw.radar_equation import (
    fft_length,
    noise_power,
    sample_count,
    window_of,
)
from radarsim.engine import engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.rng import generator_for

FINE = 32  # bins within c/2B


def tone(row: int, distance: float, power: float) -> Tones:
    one = np.ones(1)
    return Tones(np.array([row]), distance * one, 0 * one, power * one)


def spectrum_of(settings: FmcwSettings, tones: Tones, seed: int = 0) -> Power:
    return beat_spectrum(settings, no_echoes(settings), tones, generator_for(seed))


def one_point(window: str) -> tuple[FmcwSettings, Power]:
    """Return the spectrum of a single strong point, relative to its peak, dB."""
    resolution = radar().settings.resolution
    settings = radar(
        window=window, azimuths=4, bins=16384, bin_size=resolution / FINE
    ).settings
    tones = tone(0, 0.4 * settings.max_range, 1e14)
    power = spectrum_of(settings, tones, 1)[0]
    return settings, np.asarray(db(np.maximum(power / power.max(), 1e-20)))


def noise(settings: FmcwSettings) -> Power:
    return spectrum_of(settings, NO_TONES, 3)


@pytest.mark.parametrize("window", ["rectangular", "hann", "hamming", "blackman"])
def test_windows_are_those_of_scipy_to_the_bit(window: str) -> None:
    for bins in (100, 1001):
        settings = radar(window=window, bins=bins).settings
        name = {"rectangular": "boxcar"}.get(window, window)
        expected = get_window(name, sample_count(settings))
        assert np.array_equal(window_of(settings), expected / expected.sum())


def test_noise_in_a_bin_is_ktbf_of_the_window() -> None:
    settings = radar(bins=1884).settings
    assert dbm(noise_power(settings)) == pytest.approx(-124.56, abs=0.01)
    mean = noise(settings).mean(dtype=np.float64)
    assert db(mean) == pytest.approx(0, abs=0.05)


def test_noise_of_one_look_is_exponential() -> None:
    power = noise(radar().settings).astype(np.float64)
    assert power.std() / power.mean() == pytest.approx(1, rel=0.01)
    assert db(power).std() == pytest.approx(5.57, rel=0.01)
    assert db(power).mean() - db(power.mean()) == pytest.approx(-2.51, rel=0.01)


@pytest.mark.parametrize(
    ("window", "level", "width"),
    [
        ("rectangular", -13.26, 0.886),
        ("hann", -31.48, 1.443),
        ("hamming", -42.68, 1.305),
        ("blackman", -58.11, 1.646),
    ],
)
def test_sidelobe_and_half_power_width_are_those_of_the_window(
    window: str, level: float, width: float
) -> None:
    settings, shape = one_point(window)
    found = (shape > -3.0103).sum() * settings.bin_size / settings.resolution
    assert found == pytest.approx(width, rel=0.02)
    at = int(shape.argmax())
    while shape[at + 1] < shape[at]:
        at += 1
    # A real signal has the same tone below zero, whose sidelobes reach as far as this.
    assert shape[at : at + 40 * FINE].max() == pytest.approx(level, abs=0.1)


def test_radar_equation_of_a_square_metre_at_20_m() -> None:
    settings = radar().settings
    assert dbm(received_power(settings, 1.0, 20.0)) == pytest.approx(-52.08, abs=0.02)
    points = Points(np.array([[20.0, 0, 0]]), np.ones(1))
    view = fixed_viewpoints(Pose3(0, 0, 0), radar().times(0))
    straight = Ways(np.zeros(1, np.int64), points.positions, np.ones(1))
    tones = point_tones(settings, view, range(400), points, straight)
    power = spectrum_of(settings, tones)
    peak = dbm(power[0].max() * noise_power(settings))
    assert peak == pytest.approx(-52.08, abs=0.1)


def test_point_falls_by_12_db_as_its_distance_doubles() -> None:
    power = received_power(radar().settings, 1.0, np.array([10.0, 20, 40, 80]))
    assert np.diff(db(power)) == pytest.approx([-12.04] * 3, abs=0.05)


def test_two_points_in_a_cell_beat_with_their_phase() -> None:
    settings = radar(azimuths=4, window="rectangular").settings
    apart = 0.6 * settings.resolution
    for phase in np.linspace(0, 2 * math.pi, 9):
        rows, one = np.zeros(2, np.int64), np.ones(2)
        ranges = np.array([20.0, 20.0 + apart])
        tones = Tones(rows, ranges, np.array([0, phase]), 1e8 * one)
        power = spectrum_of(settings, tones)
        middle = 20.0 + apart / 2
        at = round(middle / settings.bin_size)
        found = power[0, at] / 1e8
        # Two tones of sinc shape, whose phases are those in the middle of the sweep.
        offsets = at * settings.bin_size - ranges
        fields = np.sinc(offsets / settings.resolution)
        fields = fields * np.exp(1j * np.array([0, phase]))
        expected = abs(fields.sum()) ** 2
        assert found == pytest.approx(expected, rel=0.02, abs=0.02)


def powers_of_pairs(settings: FmcwSettings, gaps: Floats) -> Floats:
    """Return the greatest power of two points 20 m ahead, by their gaps, m."""
    view = fixed_viewpoints(Pose3(0, 0, 0), radar().times(0)[:1])
    found = []
    for gap in gaps.tolist():
        points = Points(np.array([[20.0, 0, 0], [20 + gap, 0, 0]]), np.ones(2))
        straight = Ways(np.arange(2), points.positions, np.ones(2))
        tones = point_tones(settings, view, range(1), points, straight)
        found.append(spectrum_of(settings, tones)[0].max())
    return np.array(found)


def test_two_points_interfere_at_the_carrier() -> None:
    """The law 2 + 2 cos(4 pi d / lambda), over three waves of 3.92 mm around 5 cm."""
    settings, wavelength = radar(azimuths=4).settings, 299_792_458 / 76.5e9
    gaps = 0.05 + np.linspace(-1.5, 1.5, 61) * wavelength
    law = 2 + 2 * np.cos(4 * math.pi * gaps / wavelength)
    found = powers_of_pairs(settings, gaps)
    assert np.corrcoef(found, law)[0, 1] > 0.999


def test_profile_of_two_points_is_that_of_a_stepped_sweep() -> None:
    """The echo exp(4 pi i f R / c) at the frequency of each sample, and a DFT."""
    settings, gap = radar(azimuths=4).settings, 0.2
    count, ranges = sample_count(settings), np.array([20.0, 20.0 + gap])
    # 863 MHz, but for the whole number of samples.
    width = 299_792_458 / (2 * settings.bin_size) * count / fft_length(settings)
    sweep = (np.arange(count) / count - 0.5) * width
    waves = 4j * math.pi * (76.5e9 + sweep)[:, None] / 299_792_458
    samples = (np.exp(waves * ranges) / ranges**2).sum(axis=1) * window_of(settings)
    bins = np.arange(440, 480)
    turns = np.outer(bins, np.arange(count)) / fft_length(settings)
    profile = np.abs(np.exp(-2j * math.pi * turns) @ samples) ** 2
    view = fixed_viewpoints(Pose3(0, 0, 0), radar().times(0)[:1])
    points = Points(np.column_stack([ranges, 0 * ranges, 0 * ranges]), np.ones(2))
    straight = Ways(np.arange(2), points.positions, np.ones(2))
    tones = point_tones(settings, view, range(1), points, straight)
    found = spectrum_of(settings, tones)[0, bins]
    shape = found / found.max() - profile / profile.max()
    assert np.abs(shape).max() < 0.002


def test_leakage_has_its_level_and_a_tail() -> None:
    settings = radar(leakage_db=22, leakage_range=1.65, bin_size=0.1736).settings
    power = noise(settings)
    assert db(power[:, 2:8].mean()) == pytest.approx(22, abs=0.3)
    assert 2 < db(power[:, 16].mean()) < 12
    assert db(power[:, 24:].mean()) == pytest.approx(0, abs=0.1)
    # It is another in each direction: 59 +- 14 counts in images of RADIATE.
    counts = 17 + 2 * db(power[:, 2:8] / math.log(2))
    assert counts.mean() == pytest.approx(59, abs=2)
    assert counts.std() == pytest.approx(14, abs=3.5)


def harmonic(level: float, skew: float, number: int) -> float:
    """Return the power of a harmonic of a clipped cosine, whose own is 1.

    The Fourier coefficient of cos(x), clipped at -(1 - skew) level and at level.
    """
    angle = (np.arange(100_000) + 0.5) * 2 * math.pi / 100_000
    clipped = np.clip(np.cos(angle), -(1 - skew) * level, level)
    return float((2 * np.mean(clipped * np.cos(number * angle))) ** 2)


@pytest.mark.parametrize("distance", [20.0, 70.0])
def test_clipped_echo_shows_at_twice_and_three_times_its_range(distance: float) -> None:
    """Beyond the end of the spectrum the harmonics fold back."""
    skew, over = 0.2, 10.0  # dB over full scale
    settings = radar(azimuths=4, full_scale_dbm=-40, clip_skew=skew).settings
    full_scale = 1e-3 * 10**-4 / noise_power(settings)
    strong = full_scale * 10 ** (over / 10)
    power = spectrum_of(settings, tone(0, distance, strong))[0]
    end = fft_length(settings) / 2 * settings.bin_size
    for number in (1, 2, 3):
        place = distance * number
        place = place if place < end else 2 * end - place
        at = round(place / settings.bin_size)
        if at >= settings.bins:
            continue
        found = power[at - 3 : at + 4].max() / strong
        expected = harmonic(10 ** (-over / 20), skew, number)
        assert db(found / expected) == pytest.approx(0, abs=0.3)
    # A receiver of two channels would have it at -3 R, which is the far end.
    last = round((2 * end - 3 * distance) / settings.bin_size)
    if distance < 50 and last < settings.bins:
        assert db(power[last - 5 : last + 6].max() / strong) < -60


def test_strong_echo_raises_the_floor_of_its_direction() -> None:
    """By the phase noise: 80 dB over the noise, -70 dB of that in each bin."""
    settings = radar(azimuths=40, phase_noise_db=-70).settings
    strong = tone(2, 20.0, 1e8)
    power = spectrum_of(settings, strong)
    floor = power[:, 2000:].mean(axis=1)
    assert db(floor[2]) == pytest.approx(db(1 + 10), abs=0.7)
    assert db(np.delete(floor, 2).mean()) == pytest.approx(0, abs=0.1)


def test_noise_falls_from_the_first_bin_to_the_last() -> None:
    power = noise(radar(noise_tilt_db=6).settings).mean(axis=0)
    near, far = power[:300].mean(), power[-300:].mean()
    assert db(near / far) == pytest.approx(6 * (1 - 300 / 3768), abs=0.2)


def test_clipped_direction_is_lifted_as_a_whole() -> None:
    settings = radar(full_scale_dbm=-60, azimuths=8).settings
    count = 20
    ranges = generator_for(9).uniform(5, 60, count)
    level = 1e-3 * 10 ** (-45 / 10) / noise_power(settings)
    rows, power = np.full(count, 2), np.full(count, level)
    strong = Tones(rows, ranges, 100 * ranges, power)
    found = spectrum_of(settings, strong)
    quiet = np.delete(np.arange(8), 2)
    assert db(np.median(found[2]) / np.median(found[quiet])) > 10


@pytest.mark.parametrize(
    ("spread", "snr_db", "pfa", "expected"),
    [
        pytest.param(None, 13.0, 1e-8, 0.6287, id="steady"),
        pytest.param(1, 16.0, 1e-4, 0.7980, id="Swerling 1"),
        pytest.param(2, 15.2, 1e-4, 0.8846, id="Swerling 3"),
    ],
)
def test_detection_of_points_is_that_of_their_fluctuation(
    spread: int | None, snr_db: float, pfa: float, expected: float
) -> None:
    """Published probabilities; a fluctuating power is a Gamma of that shape."""
    settings = radar(azimuths=2000, bins=100, bin_size=0.17).settings
    rng, count = generator_for(2), settings.azimuths
    share = rng.gamma(spread, 1 / spread, count) if spread else np.ones(count)
    tones = Tones(
        np.arange(count),
        np.full(count, 50 * settings.bin_size),
        rng.uniform(0, 2 * np.pi, count),
        10 ** (snr_db / 10) * share,
    )
    power = [spectrum_of(settings, tones, seed)[:, 50] for seed in range(4)]
    found = (np.array(power) > -math.log(pfa)).mean()
    assert found == pytest.approx(expected, abs=0.025)


def test_detection_of_known_phase_is_that_of_published_curves() -> None:
    """A threshold on the part in phase: 12.4 dB over a Pfa of 1e-6 are 0.8733.

    A far stronger tone of the same phase makes the power follow that part alone.
    """
    settings = radar(azimuths=2000, bins=100, bin_size=0.17).settings
    count, strong = settings.azimuths, 1e3
    field = np.full(count, strong + 10 ** (12.4 / 20))
    at, rows = np.full(count, 50 * settings.bin_size), np.arange(count)
    tones = Tones(rows, at, np.zeros(count), field**2)
    power = [spectrum_of(settings, tones, seed)[:, 50] for seed in range(4)]
    in_phase = np.sqrt(np.array(power, np.float64)) - strong
    threshold = NormalDist(0, math.sqrt(0.5)).inv_cdf(1 - 1e-6)
    assert (in_phase > threshold).mean() == pytest.approx(0.8733, abs=0.015)


@pytest.mark.parametrize("threads", ["1", "2", "7"])
def test_any_number_of_threads_records_the_same(
    monkeypatch: pytest.MonkeyPatch, threads: str
) -> None:
    settings = radar(azimuths=100, bins=500).settings
    before = noise(settings)
    monkeypatch.setattr(beat_signal, "thread_count", lambda: int(threads))
    assert noise(settings).tobytes() == before.tobytes()
    nothing = np.zeros((0, 2 * settings.bins), np.float32)
    streams = NumberedStreams(generator_for(0))
    power = beat_signal.beat_rows(settings, 0, nothing, NO_TONES, streams)
    assert power.shape == (0, settings.bins)


def test_long_sweeps_are_the_same_in_any_blocks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Numpy sums rows of over 8192 numbers alone and together in different orders."""
    settings = radar(azimuths=5, bins=20_000, phase_noise_db=-20).settings
    field = np.random.default_rng(0).normal(0, 1000, (5, 40_000)).astype(np.float32)
    streams = NumberedStreams(generator_for(0))
    found = []
    for threads in (1, 5):
        monkeypatch.setattr(beat_signal, "thread_count", lambda n=threads: n)
        found.append(beat_signal.beat_rows(settings, 0, field, NO_TONES, streams))
    assert found[0].tobytes() == found[1].tobytes()


def test_engine_adds_noise_clips_and_applies_the_window_as_numpy_does() -> None:
    random = np.random.default_rng(0)
    sweeps, noise = random.normal(0, 2, (2, 3, 40)).astype(np.float32)
    amplitudes, window = random.random(3, np.float32), random.random(33, np.float32)
    samples = sweeps[:, :33] + amplitudes[:, None] * noise[:, :33]
    expected = window * np.clip(samples, np.float32(-1.5), np.float32(2.5))
    assert (samples < -1.5).any()
    assert (samples > 2.5).any()
    engine.add_noise(sweeps, noise, amplitudes, -1.5, 2.5, window)
    assert sweeps[:, :33].tobytes() == expected.tobytes()
    assert not sweeps[:, 33:].any()
    with pytest.raises(EngineError, match="inconsistent lengths"):
        engine.add_noise(sweeps, noise, amplitudes, -1.5, 2.5, np.ones(41, np.float32))
