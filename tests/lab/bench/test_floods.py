from radarsim.lab.bench.server import FLOODS, floods, lateness_beside_floods


def test_floods_add_time_to_a_tick() -> None:
    rows = list(floods(ticks=10))
    assert len(rows) == len(FLOODS)
    assert all(row.value > 0 for row in rows)


def test_scans_come_beside_a_flood() -> None:
    flood = {"2 clients that ask": (2, b"GETCONF {Type RangeScanner}")}
    median, p99 = lateness_beside_floods(1, 0.5, flood)
    assert median.name == "10 robots beside 2 clients that ask: late, median"
    assert median.value <= p99.value
    assert all(row.note.endswith(" ms beside silence") for row in (median, p99))
