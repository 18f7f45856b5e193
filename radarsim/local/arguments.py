"""Checks of what programs pass, whose errors say what came and what was expected."""

import math
from numbers import Real


def check_number(what: str, value: float, *, above: float = -math.inf) -> None:
    """Check a number.

    Args:
        what: What it is, with its unit.
        value: The number.
        above: What it has to exceed.

    Raises:
        TypeError: If it is no number.
        ValueError: If it is not finite, or too small.
    """
    expected = "a finite number" if above == -math.inf else f"more than {above:g}"
    text = f"{what} {value!r}, expected {expected}"
    if not isinstance(value, Real):
        raise TypeError(text)
    if not above < value < math.inf:
        raise ValueError(text)


def check_port(port: object) -> None:
    """Check the number of a TCP port.

    Raises:
        ValueError: If it is none.
    """
    if not isinstance(port, int) or not 0 <= port <= 65535:
        raise ValueError(f"port {port!r}, expected a whole number from 0 to 65535")
