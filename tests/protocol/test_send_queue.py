from hypothesis import given
from hypothesis import strategies as st

from radarsim.protocol.send_queue import SendQueue

LINES = st.lists(
    st.tuples(st.binary(min_size=1, max_size=12), st.booleans()), max_size=60
)


@given(LINES)
def test_data_within_the_limit_is_returned_unchanged(
    lines: list[tuple[bytes, bool]],
) -> None:
    outbox = SendQueue(limit=10_000)
    for line, keep in lines:
        outbox.put(line, keep=keep)
    whole = b"".join(line for line, _ in lines)
    assert len(outbox) == len(whole)
    assert outbox.take() == whole
    assert len(outbox) == 0
    assert outbox.take() == b""
    assert outbox.dropped == 0


@given(LINES, st.integers(1, 40))
def test_oldest_readings_are_dropped_whole_beyond_the_limit(
    lines: list[tuple[bytes, bool]], limit: int
) -> None:
    outbox = SendQueue(limit=limit)
    for number, (_, keep) in enumerate(lines):
        outbox.put(b"%d%s\n" % (number, b"k" if keep else b"r"), keep=keep)
    kept = outbox.take().split(b"\n")[:-1]
    numbers = [int(line[:-1]) for line in kept]
    assert numbers == sorted(numbers)
    readings = [n for n in numbers if not lines[n][1]]
    all_readings = [n for n, (_, keep) in enumerate(lines) if not keep]
    assert readings == all_readings[len(all_readings) - len(readings) :]
    assert outbox.dropped == len(all_readings) - len(readings)
    assert sum(len(b"%dr\n" % n) for n in readings) <= limit
    assert [n for n in numbers if lines[n][1]] == [
        n for n, (_, keep) in enumerate(lines) if keep
    ]


def test_half_of_the_readings_remain_after_a_drop() -> None:
    outbox = SendQueue(limit=100)
    for number in range(11):
        outbox.put(b"%8d\r\n" % number, keep=False)
    assert outbox.take().split() == [b"6", b"7", b"8", b"9", b"10"]
    assert outbox.dropped == 6


def test_unread_replies_beyond_the_ceiling_overflow() -> None:
    outbox = SendQueue(limit=10, ceiling=30)
    for _ in range(5):
        outbox.put(b"123456789\n", keep=False)
    for _ in range(3):
        outbox.put(b"123456789\n", keep=True)
    assert not outbox.overflowed
    outbox.put(b"1", keep=True)
    assert outbox.overflowed
    outbox.take()
    assert outbox.overflowed  # what is wrong once stays wrong


def test_time_per_reply_does_not_grow_with_the_queue() -> None:
    outbox = SendQueue(limit=100)
    for _ in range(200_000):
        outbox.put(b"CONF {Type MisPkg}\r\n", keep=True)
        outbox.put(b"S\r\n", keep=False)
        if outbox.dropped > 100:
            break
    assert outbox.dropped > 100
    for _ in range(100_000):  # a walk over all lines at each would take minutes
        outbox.put(b"CONF {Type MisPkg}\r\n", keep=True)
    assert outbox.overflowed is False
