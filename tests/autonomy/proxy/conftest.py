"""Lines of servers for the tests of the proxy."""

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
    """Return a function of time, ranges and scanner name that returns a scan's line."""
    return _scan_line
