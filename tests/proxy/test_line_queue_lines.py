"""What is of a scan is known by its type, wherever that stands."""

import pytest

from radarsim.proxy.line_queue import ScanPart, Side, classify_line

SCAN = "SEN {Time 1.00} {Type RangeScanner} {Name lms200} {Range 1,2}"
ECHOES = "SEN {Time 1.00} {Type Echoes} {Name lms200} {Line 1}"


@pytest.mark.parametrize(
    ("side", "text", "part"),
    [
        pytest.param("server", SCAN, "ranges", id="a scan"),
        pytest.param("server", ECHOES, "echoes", id="echoes"),
        pytest.param("server", "sen {type  RANGESCANNER}", "ranges", id="any case"),
        pytest.param(
            "server", "SEN {Range 1} {Type RangeScanner }", "ranges", id="end"
        ),
        pytest.param("server", "SEN {Type INS} {Name a}", None, id="a pose"),
        pytest.param("server", "GEO {Type RangeScanner}", None, id="an answer"),
        pytest.param("server", "SENT {Type RangeScanner}", None, id="another verb"),
        pytest.param("client", SCAN, None, id="said by a client"),
    ],
)
def test_a_line_is_of_a_scan_by_its_type(
    side: Side, text: str, part: ScanPart | None
) -> None:
    line = classify_line(3, side, text)
    assert (line.number, line.side, line.text) == (3, side, text)
    assert line.scan_part == part
