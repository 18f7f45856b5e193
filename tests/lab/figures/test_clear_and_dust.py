"""What figures 2 to 5 count of radar and laser in dust, as laws."""

import pytest

from radarsim.lab.figures.dust import (
    LASER,
    RADAR,
    Counts,
    count_readings,
)


@pytest.fixture(scope="module")
def dusty() -> dict[str, Counts]:
    return {sensor: count_readings(sensor, "dust", 0) for sensor in (RADAR, LASER)}


@pytest.mark.parametrize("sensor", [RADAR, LASER])
def test_in_clear_air_all_objects_are_read_and_nothing_changes(sensor: str) -> None:
    counts = count_readings(sensor, "clear", 0)
    assert counts.objects == counts.all_objects == 18
    assert counts.cloud == 0
    assert (counts.unchanged, counts.unchanged + counts.beside) == (
        counts.crossing,
        counts.clear,
    )


def test_radar_readings_do_not_change_in_dust(dusty: dict[str, Counts]) -> None:
    radar = dusty[RADAR]
    assert radar.unchanged == radar.crossing > 0
    assert radar.cloud == 0
    assert radar.objects == radar.all_objects


def test_laser_reads_the_dust_instead_of_objects_behind_it(
    dusty: dict[str, Counts],
) -> None:
    laser = dusty[LASER]
    assert laser.unchanged < 0.01 * laser.crossing  # exp(-2 a 10 m) is 0.0105
    assert laser.cloud > laser.crossing
    assert laser.beside == laser.clear - laser.crossing > 0
    assert laser.objects <= 2 + laser.unchanged  # two objects stand beside the dust
