import pytest

from radarsim.lab.bench.addons import recording_robots


@pytest.mark.slow
def test_robots_are_measured_with_and_without_a_recording() -> None:
    rows = {row.name: row for row in recording_robots(1.5, robots=2)}
    late = [row.value for name, row in rows.items() if "late" in name]
    assert 0 <= late[0] <= late[1]
    (writer,) = (row for name, row in rows.items() if "process that writes" in name)
    assert 0 < writer.value < 100
    (written,) = (row for row in rows.values() if row.unit == "MiB")
    assert 0.01 < written.value < 100
