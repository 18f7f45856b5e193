"""Frames along a street of the town, compared with real ones of RADIATE.

Real values are those of images of its city and suburb sequences. They differ from place
to place, and so do those of towns of other seeds: the limits are wide.
"""

from pathlib import Path

import numpy as np
import pytest
from frame_statistics import FrameStatistics, statistics_of
from town_maps import town_yaml

import radarsim
from radarsim.addons.fmcw.image_files import through_jpeg
from radarsim.geometry import Floats, Pose3

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
        counts = through_jpeg(turn.counts)
        found.append(statistics_of(counts, turn.settings.bin_size))
    return found


@pytest.mark.slow("sampled")
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_frames_of_a_street_are_about_as_real_ones(seed: int, tmp_path: Path) -> None:
    found = frames_along_a_street(seed, tmp_path)

    def median(name: str) -> Floats:
        return np.asarray(np.median([getattr(each, name) for each in found], axis=0))

    # The least and the largest value of 18 real frames are 3.9 and 11.5 %, 3.9 and
    # 10.1, 9.2 and 11.5, 4.3 and 8.7, 1.3 and 3.5, which are of one street.
    bright = median("bright")
    assert (bright > (0, 4, 6, 3, 1.3)).all()
    assert (bright < (16, 16, 14, 9, 5)).all()
    assert median("percentiles") == pytest.approx([95, 124, 159], abs=8)
    assert median("even") < 1.9  # 0.4 to 1.9 %
    assert median("dark") == pytest.approx(63, abs=6)  # 59 to 68 %
    assert median("dark_behind") == pytest.approx(29, abs=6)  # 26 to 34 %
    assert median("correlation") == pytest.approx(0.62, abs=0.1)  # 0.59 to 0.66
    assert median("kurtosis") == pytest.approx(3.8, abs=0.85)  # 3.8 to 3.9
    assert 2.5 < np.mean([each.spread for each in found]) < 11
    assert np.mean([each.leakage for each in found]) == pytest.approx(59, abs=10)
    assert 300 < np.mean([each.cen2018 for each in found]) < 750
    assert 1700 < np.mean([each.cen2019 for each in found]) < 2400
