"""What figures 2 to 5 say of radar and laser in dust, as laws."""

import numpy as np
import pytest

from radarsim.figures.clear_and_dust import (
    COUNT,
    LASER,
    RADAR,
    Counts,
    count_readings,
    draw_readings,
    shot_of,
)


@pytest.fixture(scope="module")
def dusty() -> dict[str, Counts]:
    return {sensor: count_readings(sensor, "dust", 0) for sensor in (RADAR, LASER)}


@pytest.mark.parametrize("sensor", [RADAR, LASER])
def test_in_clear_air_everything_is_read_and_all_is_the_same(sensor: str) -> None:
    counts = count_readings(sensor, "clear", 0)
    assert counts.things == counts.all_things == 18
    assert counts.cloud == 0
    assert (counts.kept, counts.kept + counts.beside) == (counts.crossing, counts.clear)


def test_the_radar_does_not_notice_dust(dusty: dict[str, Counts]) -> None:
    radar = dusty[RADAR]
    assert radar.kept == radar.crossing > 0
    assert radar.cloud == 0
    assert radar.things == radar.all_things


def test_the_laser_reads_dust_instead_of_what_is_behind(
    dusty: dict[str, Counts],
) -> None:
    laser = dusty[LASER]
    assert laser.kept == 0 < laser.crossing
    assert laser.cloud > laser.crossing
    assert laser.beside == laser.clear - laser.crossing > 0
    assert laser.things == 2  # what stands beside the dust


@pytest.mark.parametrize(
    ("sensor", "verdict"),
    [(RADAR, "does not trouble it"), (LASER, "sees the dust instead")],
)
def test_the_caption_draws_the_conclusion(
    dusty: dict[str, Counts], sensor: str, verdict: str
) -> None:
    plate = draw_readings(0, sensor=sensor, air="dust")
    counts = dusty[sensor]
    assert verdict in plate.caption
    assert f"Of the {counts.crossing} readings" in plate.caption
    assert f" {counts.kept} are the same" in plate.caption
    assert plate.commands == (shot_of(sensor, "dust", 0).command,)


def test_points_are_those_of_all_scans() -> None:
    plate = draw_readings(0, sensor=LASER, air="dust")
    lines = plate.drawings[0].axes[0].lines
    dots = [np.size(line.get_xdata()) for line in lines if line.get_marker() == "."]
    counts = count_readings(LASER, "dust", 0)
    assert sorted(dots) == [counts.beside, counts.cloud]
    assert counts.cloud % COUNT == 0
