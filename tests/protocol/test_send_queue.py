from hypothesis import given
from hypothesis import strategies as st

from radarsim.server.host.connection import SendQueue

LINES = st.lists(
    st.tuples(st.binary(min_size=1, max_size=12), st.booleans()), max_size=60
)


@given(LINES)
def test_data_within_the_limit_is_returned_unchanged(
    lines: list[tuple[bytes, bool]],
) -> None:
    queue = SendQueue(limit=10_000)
    for line, keep in lines:
        queue.put(line, keep=keep)
    whole = b"".join(line for line, _ in lines)
    assert len(queue) == len(whole)
    assert queue.take() == whole
    assert len(queue) == 0
    assert queue.take() == b""
    assert queue.dropped == 0


@given(LINES, st.integers(1, 40))
def test_oldest_readings_are_dropped_whole_beyond_the_limit(
    lines: list[tuple[bytes, bool]], limit: int
) -> None:
    queue = SendQueue(limit=limit)
    for number, (_, keep) in enumerate(lines):
        queue.put(b"%d%s\n" % (number, b"k" if keep else b"r"), keep=keep)
    kept = queue.take().split(b"\n")[:-1]
    numbers = [int(line[:-1]) for line in kept]
    assert numbers == sorted(numbers)
    readings = [n for n in numbers if not lines[n][1]]
    all_readings = [n for n, (_, keep) in enumerate(lines) if not keep]
    assert readings == all_readings[len(all_readings) - len(readings) :]
    assert queue.dropped == len(all_readings) - len(readings)
    assert sum(len(b"%dr\n" % n) for n in readings) <= limit
    assert [n for n in numbers if lines[n][1]] == [
        n for n, (_, keep) in enumerate(lines) if keep
    ]


@given(st.lists(LINES, max_size=9), st.integers(1, 200))
def test_readings_that_are_added_together_are_dropped_one_by_one(
    ticks: list[list[tuple[bytes, bool]]], limit: int
) -> None:
    together, apart = SendQueue(limit=limit), SendQueue(limit=limit)
    for lines in ticks:
        readings = [b"%d\n" % len(line) for line, _ in lines]
        together.put_readings(b"".join(readings))
        together.put(b"reply\n", keep=True)
        for line in readings:
            apart.put(line, keep=False)
        apart.put(b"reply\n", keep=True)
        assert together.dropped == apart.dropped
        assert len(together) == len(apart)
    assert together.take() == apart.take()


def test_half_of_the_readings_remain_after_a_drop() -> None:
    queue = SendQueue(limit=100)
    for number in range(11):
        queue.put(b"%8d\r\n" % number, keep=False)
    assert queue.take().split() == [b"6", b"7", b"8", b"9", b"10"]
    assert queue.dropped == 6


def test_unread_replies_beyond_the_ceiling_overflow() -> None:
    queue = SendQueue(limit=10, ceiling=30)
    for _ in range(5):
        queue.put(b"123456789\n", keep=False)
    for _ in range(3):
        queue.put(b"123456789\n", keep=True)
    assert not queue.overflowed
    queue.put(b"1", keep=True)
    assert queue.overflowed
    queue.take()
    assert queue.overflowed  # an overflow is final


def test_time_per_reply_does_not_grow_with_the_queue() -> None:
    queue = SendQueue(limit=100)
    for _ in range(200_000):
        queue.put(b"CONF {Type MisPkg}\r\n", keep=True)
        queue.put(b"S\r\n", keep=False)
        if queue.dropped > 100:
            break
    assert queue.dropped > 100
    for _ in range(100_000):  # a scan of all lines for each would take minutes
        queue.put(b"CONF {Type MisPkg}\r\n", keep=True)
    assert queue.overflowed is False
