"""Detectors, against closed forms and published values."""

import numpy as np
import pytest
from fmcw_scenes import beat_spectrum, no_echoes, radar

from radarsim.addons.fmcw.beat_signal import NO_TONES
from radarsim.addons.fmcw.detection import (
    Training,
    ca_factor,
    ca_mask,
    correlated_factor,
    os_factor,
    os_mask,
    peaks_of,
    strongest_mask,
    training_correlation,
    training_of,
)
from radarsim.rng import generator_for

NEIGHBOURS = Training(32, 2, 1)
EDGE = 40  # bins that have fewer than all training bins


@pytest.mark.parametrize(
    ("count", "pfa", "factor"),
    [
        (32, 1e-2, 4.953),
        (16, 1e-2, 5.3363),
        (20, 1e-6, 19.9052),
        (40, 1e-5, 13.3409),
    ],
)
def test_factor_of_ca(count: int, pfa: float, factor: float) -> None:
    assert ca_factor(count, pfa) == pytest.approx(factor, abs=1e-3)
    independent = (1.0,) + 199 * (0.0,)
    found = correlated_factor(Training(count, 2, 3), 2, pfa, independent)
    assert found == pytest.approx(factor, abs=1e-3)


@pytest.mark.parametrize(
    ("count", "order", "pfa", "factor"),
    [
        (32, 24, 1e-2, 3.8383),
        (16, 12, 1e-6, 20.9542),
        (32, 18, 1e-6, 26.12689),
    ],
)
def test_factor_of_os(count: int, order: int, pfa: float, factor: float) -> None:
    assert os_factor(count, order, pfa) == pytest.approx(factor, rel=1e-4)


def test_thresholds_of_ca_are_those_of_another_program() -> None:
    """Those of radarsimpy for a line of ones with a target of 20 at bin 16."""
    training = Training(20, 2, 1)
    line = np.ones((1, 64), np.float32)
    line[0, 16] = 20
    # The target is among the training bins of 20; around 45 all are ones.
    for at, threshold in ((20, 10.09809106), (45, 5.17850824)):
        for part, is_found in ((0.9999, False), (1.0001, True)):
            line_ = line.copy()
            line_[0, at] = part * threshold
            assert ca_mask(line_, training, 1e-2)[0, at] == is_found


def exponential(seed: int) -> np.ndarray:
    rng = generator_for(seed, "exponential")
    return rng.standard_exponential((400, 3768), np.float32)


def mask(detector: str, power: np.ndarray, pfa: float) -> np.ndarray:
    if detector == "ca":
        return ca_mask(power, NEIGHBOURS, pfa)
    return os_mask(power, NEIGHBOURS, pfa, 24)


@pytest.mark.parametrize("detector", ["ca", "os"])
@pytest.mark.parametrize(("pfa", "turns"), [(1e-2, 1), (1e-3, 2)])
def test_false_alarms(detector: str, pfa: float, turns: int) -> None:
    shares = [
        mask(detector, exponential(seed), pfa)[:, EDGE:-EDGE].mean()
        for seed in range(turns)
    ]
    assert np.mean(shares) == pytest.approx(pfa, rel=0.1)


@pytest.mark.parametrize("detector", ["ca", "os"])
def test_false_alarms_are_as_many_at_the_edges(detector: str) -> None:
    power = np.concatenate([exponential(seed)[:, :80] for seed in range(20)])
    found = mask(detector, power, 1e-2)
    for edge in (found[:, :10], found[:, -10:]):
        assert edge.mean() == pytest.approx(1e-2, rel=0.1)


@pytest.mark.parametrize("window", ["rectangular", "hann", "blackman"])
@pytest.mark.parametrize("detector", ["ca", "os"])
def test_false_alarms_in_a_padded_spectrum(window: str, detector: str) -> None:
    settings = radar(window=window).settings
    training = training_of(settings)
    shares = []
    for seed in range(3):
        rng = generator_for(seed)
        power = beat_spectrum(settings, no_echoes(settings), NO_TONES, rng)
        if detector == "ca":
            correlation = training_correlation(settings, training)
            found = ca_mask(power, training, 1e-3, correlation)
        else:
            found = os_mask(power, training, 1e-3, 24)
        shares.append(found.mean())
    assert np.mean(shares) == pytest.approx(1e-3, rel=0.15)


@pytest.mark.parametrize("window", ["hann", "blackman"])
def test_rare_false_alarms_in_a_windowed_spectrum(window: str) -> None:
    """At 1e-4, over some 1e7 bins: within 10 %."""
    settings = radar(window=window, bins=3768, bin_size=0.1736).settings
    training = training_of(settings)
    correlation = training_correlation(settings, training)
    shares = []
    for seed in range(7):
        power = beat_spectrum(
            settings, no_echoes(settings), NO_TONES, generator_for(seed)
        )
        shares.append(ca_mask(power, training, 1e-4, correlation).mean())
    assert np.mean(shares) == pytest.approx(1e-4, rel=0.1)


def test_detection_of_a_fluctuating_target() -> None:
    """A Swerling 1 target of 16 dB: (1 + alpha / (N (1 + S)))^-N."""
    rng = generator_for(5)
    power = rng.standard_exponential((20_000, 67), np.float32)
    snr = 10**1.6
    power[:, 33] *= 1 + snr
    found = ca_mask(power, Training(32, 0, 1), 1e-4)[:, 33].mean()
    assert (1 + ca_factor(32, 1e-4) / 32 / (1 + snr)) ** -32 == pytest.approx(
        0.7707, abs=1e-3
    )
    assert found == pytest.approx(0.7707, abs=0.02)


def test_strongest_bins_of_equal_counts_are_the_nearest() -> None:
    counts = np.array([[70, 90, 90, 50, 90, 80]], np.uint8)
    allowed = np.array([True] * 6)
    assert np.flatnonzero(strongest_mask(counts, 2, allowed, 60)[0]).tolist() == [1, 2]
    assert strongest_mask(counts, 6, allowed, 75).sum() == 4


def test_bins_that_are_too_near_take_their_place_but_are_not_kept() -> None:
    counts = np.array([[99, 98, 97, 96]], np.uint8)
    allowed = np.array([False, True, True, True])
    assert np.flatnonzero(strongest_mask(counts, 2, allowed, 60)[0]).tolist() == [1]


def test_run_of_bins_is_one_target_at_its_strongest() -> None:
    mask = np.array([[0, 1, 1, 1, 0, 1, 0]], np.bool_)
    power = np.array([[9, 1, 5, 2, 0, 3, 0]], np.float32)
    assert np.flatnonzero(peaks_of(mask, power)[0]).tolist() == [2, 5]


@pytest.mark.parametrize("pfa", [0.0, 1.0, -1.0, 2.0])
def test_impossible_rate_of_false_alarms_is_an_error(pfa: float) -> None:
    with pytest.raises(ValueError, match="expected above 0 and below 1"):
        ca_factor(32, pfa)
