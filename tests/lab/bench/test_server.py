import pytest

from radarsim.lab.bench.server import capacity, lateness, start_up


@pytest.mark.slow
def test_a_few_robots_get_their_scans() -> None:
    rows = {row.name.partition(": ")[2]: row for row in lateness(3, 1.0)}
    # a busy machine may be late at the end of the second
    assert 1 < rows["scans per second and robot"].value < 11
    late = [rows[f"late, {name}"].value for name in ("median", "99th percentile")]
    assert 0 <= late[0] <= late[1] <= rows["late, worst"].value
    assert rows["late, 99th percentile"].limit is None


@pytest.mark.slow
def test_robots_are_added_while_they_are_simulated_in_time() -> None:
    (row,) = capacity(0.5, swarms=(1, 2))
    assert row.value in (0, 1, 2)  # as busy as the machine is
    assert row.note.startswith("of ")


@pytest.mark.slow
def test_the_program_starts() -> None:
    help_, serve = start_up(times=1)
    assert help_.value > 0
    assert serve.value > 0
