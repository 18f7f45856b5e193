"""Frames along a street of the town, beside real ones of RADIATE.

Real values are those of images of its city and suburb sequences. They differ from place
to place, and so do those of towns of other seeds: the limits are wide.
"""

from pathlib import Path

import numpy as np
import pytest
from frame_statistics import FrameStatistics, statistics_of

import radarsim
from radarsim.generators.town import town_yaml
from radarsim.geometry import Pose3

ROOF = 1.9  # m, height of an antenna on a car
FRAMES = 10


def frames_along_a_street(seed: int, folder: Path) -> list[FrameStatistics]:
    """Return the statistics of frames at starts along the street in the middle."""
    path = folder / f"town{seed}.yaml"
    path.write_text(town_yaml(seed))
    scene = radarsim.load_map(path)
    radar = radarsim.load_sensor("navtech_cts350x_radiate")
    found = []
    for number, start in enumerate(scene.starts[1 : FRAMES + 1]):
        pose = Pose3(start.pose.x, start.pose.y, ROOF, 0.0, 0.0, start.pose.yaw)
        turn = radar.spectrum(scene, pose, radarsim.generator_for(number))
        found.append(statistics_of(turn.counts, turn.settings.bin_size))
    return found


@pytest.mark.slow("sampled")
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_frames_of_a_street_are_about_as_real_ones(seed: int, tmp_path: Path) -> None:
    found = frames_along_a_street(seed, tmp_path)
    near, middle, far = np.mean([each.bright for each in found], axis=0)
    assert near == pytest.approx(10.3, rel=0.35)
    assert middle == pytest.approx(6.4, rel=0.4)
    assert far < 3 * 2.1
    assert 4.5 < np.mean([each.spread for each in found]) < 11
    assert 25 < np.mean([each.raised for each in found]) < 90
    assert np.mean([each.leakage for each in found]) == pytest.approx(59, abs=10)
    assert np.mean([each.percentile for each in found]) == pytest.approx(95, abs=20)
    assert 400 < np.mean([each.cen2018 for each in found]) < 750
    assert 1700 < np.mean([each.cen2019 for each in found]) < 2400
