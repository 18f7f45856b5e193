"""Noise of quiet directions, against that of real images.

The values were measured in 18 images of the RADIATE data set, in directions without
echoes: deviations of counts from the median, and their correlations. These images have
been through JPEG, and so has the noise here.
"""

import numpy as np
import pytest
from fmcw_scenes import beat_spectrum, correlation, no_echoes

import radarsim
from radarsim.addons.fmcw.beat_signal import NO_TONES
from radarsim.addons.fmcw.image_files import through_jpeg
from radarsim.addons.fmcw.radar_equation import noise_power
from radarsim.addons.fmcw.spectrum import counts_of

BEYOND = 40  # bins, in which the leakage is


@pytest.fixture(scope="module")
def turns() -> np.ndarray:
    """Return the counts of two turns of nothing, (2, A, B)."""
    settings = radarsim.load_sensor("navtech_cts350x_radiate").fmcw.settings
    silence = no_echoes(settings)
    power = [
        beat_spectrum(settings, silence, NO_TONES, radarsim.generator_for(seed))
        for seed in (1, 2)
    ]
    counts = [
        through_jpeg(counts_of(settings, each * np.float32(noise_power(settings))))
        for each in power
    ]
    return np.array(counts, np.float64)[:, :, BEYOND:]


def test_deviations_from_the_median_are_those_of_real_noise(turns: np.ndarray) -> None:
    off = turns - np.median(turns)
    assert np.sqrt((off**2).mean()) == pytest.approx(8.95, rel=0.05)
    found = np.percentile(off, [1, 5, 10, 25, 75, 95, 99])
    assert found == pytest.approx([-17, -15, -12.5, -7, 6, 14, 20], abs=1)


def test_neighbouring_bins_are_correlated_as_in_real_noise(turns: np.ndarray) -> None:
    for lag, expected in ((1, 0.66), (2, 0.19), (3, 0.02)):
        found = correlation(turns[..., :-lag], turns[..., lag:])
        assert found == pytest.approx(expected, abs=0.05)


def test_directions_and_turns_are_as_independent_as_in_real_noise(
    turns: np.ndarray,
) -> None:
    assert correlation(turns[:, :-1], turns[:, 1:]) == pytest.approx(0.02, abs=0.03)
    assert abs(correlation(turns[0], turns[1])) < 0.04
