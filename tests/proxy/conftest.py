"""What servers say, for those who listen."""

from collections.abc import Callable

import pytest

ScanLine = Callable[..., str]


def _scan_line(
    time: float, ranges: str = "1.00,2.00,3.00", name: str = "lms200"
) -> str:
    return (
        f"SEN {{Time {time:.2f}}} {{Type RangeScanner}} {{Name {name}}} "
        f"{{Resolution 1.570796}} {{FOV 3.141593}} {{Range {ranges}}}"
    )


@pytest.fixture(scope="session")
def scan_line() -> ScanLine:
    """Give the line of a scan: its time, ranges and the scanner's name."""
    return _scan_line
