"""Lines between the forwarding and the observing thread, and which are dropped."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.proxy.line_queue import (
    Line,
    LineQueue,
    ScanPart,
    Side,
    classify_line,
)

SCAN_LINE = "SEN {Time 1.00} {Type RangeScanner} {Name lms200} {Range 1,2}"
ECHO_LINE = "SEN {Time 1.00} {Type Echoes} {Name lms200} {Line 1}"


@pytest.mark.parametrize(
    ("side", "text", "part"),
    [
        pytest.param("server", SCAN_LINE, "ranges", id="a scan"),
        pytest.param("server", ECHO_LINE, "echoes", id="echoes"),
        pytest.param("server", "sen {type  RANGESCANNER}", "ranges", id="any case"),
        pytest.param(
            "server", "SEN {Range 1} {Type RangeScanner }", "ranges", id="end"
        ),
        pytest.param("server", "SEN {Type INS} {Name a}", None, id="a pose"),
        pytest.param("server", "GEO {Type RangeScanner}", None, id="an answer"),
        pytest.param("server", "SENT {Type RangeScanner}", None, id="another verb"),
        pytest.param("client", SCAN_LINE, None, id="said by a client"),
    ],
)
def test_lines_of_scans_are_recognised_by_their_type(
    side: Side, text: str, part: ScanPart | None
) -> None:
    line = classify_line(3, side, text)
    assert (line.number, line.side, line.text) == (3, side, text)
    assert line.scan_part == part


ScanLine = Callable[..., str]
ECHOES = "SEN {{Time {0:.2f}}} {{Type Echoes}} {{Name lms200}} {{Line 1}} {{Lines 1}}"
STATUS = "STA {{Type GroundVehicle}} {{Time {0:.2f}}} {{Battery 99}}"
WORDS = st.sampled_from(["DRIVE {Left 1}", "NFO {Level a}", "\xff{{", "x y"])


def put(
    backlog: LineQueue, *texts: str, number: int = 1, side: Side = "server"
) -> None:
    for text in texts:
        backlog.put(number, side, f"{text}\r\n".encode("latin-1"))


def drain(backlog: LineQueue) -> list[Line]:
    backlog.end()
    return list(iter(backlog.take, None))


def texts(lines: list[Line]) -> list[str]:
    return [line.text for line in lines]


@given(st.lists(WORDS, max_size=5), st.lists(st.integers(0, 80), max_size=6))
def test_lines_are_complete_for_any_chunks(words: list[str], cuts: list[int]) -> None:
    data = "".join(f"{word}\r\n" for word in words).encode("latin-1")
    places = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    backlog = LineQueue()
    for start, end in pairwise(places):
        backlog.put(1, "client", data[start:end])
    assert texts(drain(backlog)) == words


def test_lines_are_separate_for_each_side_and_connection() -> None:
    backlog = LineQueue()
    backlog.put(1, "client", b"GETSTART")
    backlog.put(1, "server", b"NFO {Level a}\r\nSTA")
    backlog.put(2, "client", b"GETGEO {Type Robot}\r\n")
    backlog.put(1, "client", b"POSES\r\n")
    assert [(line.number, line.side, line.text) for line in drain(backlog)] == [
        (1, "server", "NFO {Level a}"),
        (2, "client", "GETGEO {Type Robot}"),
        (1, "client", "GETSTARTPOSES"),
    ]


def test_endless_line_is_dropped_and_the_next_is_read() -> None:
    backlog = LineQueue()
    put(backlog, "STA {Time 1}", "x" * 70_000, "STA {Time 2}")
    assert texts(drain(backlog))[0] == "STA {Time 1}"
    backlog = LineQueue()
    for _ in range(70):
        backlog.put(1, "server", b"x" * 1000)
    put(backlog, "", "STA {Time 2}")
    assert texts(drain(backlog))[-1] == "STA {Time 2}"


@given(st.lists(st.sampled_from(["scan", "echoes", "status"]), max_size=40))
def test_newest_scans_with_their_echoes_and_other_lines_are_kept(
    kinds: list[str],
) -> None:
    made = {"scan": SCAN, "echoes": ECHOES, "status": STATUS}
    lines = [made[kind].format(k) for k, kind in enumerate(kinds)]
    backlog = LineQueue(max_scans=3)
    put(backlog, *lines)
    scans = [k for k, kind in enumerate(kinds) if kind == "scan"]
    lost_until = scans[-4] if len(scans) > 3 else -1
    assert texts(drain(backlog)) == [
        line for k, line in enumerate(lines) if k > lost_until or kinds[k] == "status"
    ]
    assert backlog.dropped == max(0, len(scans) - 3)


SCAN = "SEN {{Time {0:.2f}}} {{Type RangeScanner}} {{Name lms200}} {{Range 1,2}}"


def test_oldest_lines_are_dropped_first(scan_line: ScanLine) -> None:
    lines = [scan_line(0), *[STATUS.format(k) for k in range(100)]]
    backlog = LineQueue(max_characters=1000)
    put(backlog, *lines)
    kept = texts(drain(backlog))
    assert kept == lines[-len(kept) :]
    assert 900 < sum(map(len, kept)) <= 1000
    assert backlog.dropped == 1


def test_lines_of_other_connections_are_dropped() -> None:
    backlog = LineQueue(max_scans=1)
    put(backlog, SCAN.format(1), "NFO {Level b}", number=2)
    put(backlog, SCAN.format(2), "NFO {Level a}", number=1)
    put(backlog, "DRIVE {Left 1}", number=2, side="client")
    backlog.keep_only(1)
    put(backlog, SCAN.format(3), "NFO {Level c}", number=2)
    put(backlog, "NFO {Level d}", number=1)
    assert texts(drain(backlog)) == [SCAN.format(2), "NFO {Level a}", "NFO {Level d}"]


def test_lines_that_wait_can_be_taken_after_the_end() -> None:
    backlog = LineQueue()
    put(backlog, "NFO {Level a}")
    backlog.end()
    put(backlog, "NFO {Level b}")
    assert texts(drain(backlog)) == ["NFO {Level a}"]
    assert backlog.take() is None


@pytest.mark.parametrize("ends", [False, True])
def test_take_waits_for_a_line_or_the_end(ends: bool) -> None:
    backlog = LineQueue()
    with ThreadPoolExecutor(1) as pool:
        line = pool.submit(backlog.take)
        assert not line.done()
        if ends:
            backlog.end()
            assert line.result(5) is None
        else:
            put(backlog, "NFO {Level a}")
            assert line.result(5) == Line(1, "server", "NFO {Level a}", None)
