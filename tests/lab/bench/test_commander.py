import pytest

from radarsim.lab.bench.addons import commander_beside_robots


@pytest.mark.slow
def test_robots_are_measured_with_and_without_viewers() -> None:
    rows = {row.name: row for row in commander_beside_robots(1.0, robots=2, deaf=2)}
    ratios = [row.value for row in rows.values() if row.unit == "x"]
    assert len(ratios) == 2
    assert min(ratios) > 0
    late = [row.value for name, row in rows.items() if "late" in name]
    shown = [row.value for name, row in rows.items() if "viewer that reads" in name]
    assert 0 <= late[0] <= late[1]
    assert shown[0] <= shown[1]
