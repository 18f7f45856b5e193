"""Read numbers, vectors and truth values from lines.

This accepts what existing clients send: decimal commas of their locale, blanks
or commas between the numbers of a vector. ``nan``, ``1e400`` and ``abc`` are refused,
so that no such number reaches the simulation.
"""

import re
from collections.abc import Sequence

from radarsim.errors import MalformedMessage

LARGEST_COMMANDED = 1e9  # m, rad, rad/s; what follows from it can still be written
# compiled into kernels
LARGEST = 2.0**31  # in reports; the original casts to 32 bit integers

_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
_LIST = re.compile(r"[-+0-9.eE, ]*")  # float() would also accept nan, inf and 1_0


def parse_number(text: str, *, largest: float = LARGEST) -> float:
    """Parse one number with a decimal point or a decimal comma.

    >>> parse_number("-0,5"), parse_number(".4"), parse_number("+1")
    (-0.5, 0.4, 1.0)

    Raises:
        MalformedMessage: If the text is not a number, or larger than ``largest``.
    """
    digits = text.strip()
    if not _NUMBER.fullmatch(digits):
        raise MalformedMessage(f"{text[:80]!r}, expected a number")
    number = float(digits.replace(",", "."))
    if abs(number) > largest:
        raise MalformedMessage(f"{text[:80]!r}, expected at most {largest:g}")
    return number


def parse_numbers(
    text: str, count: int, *, largest: float = LARGEST
) -> tuple[float, ...]:
    """Parse a vector of at least two numbers in any form that clients send.

    If there are as many words as numbers, blanks separate them, and a comma inside a
    word is the decimal comma of the client's locale. Otherwise commas separate them.

    >>> parse_numbers("4.5,1.9,1.8", 3) == parse_numbers("4,5, 1,9, 1,8", 3)
    True

    Raises:
        MalformedMessage: If the text is not that many numbers, or one of them is
            larger than ``largest``.
    """
    joined = " ".join(text.split()).replace(" ,", ",")
    words = joined.split()
    if len(words) == count:
        parts = [word.removesuffix(",") for word in words]
    else:
        parts = joined.split(",")
    if len(parts) != count:
        raise MalformedMessage(f"{text[:80]!r}, expected {count} numbers")
    return tuple(parse_number(part, largest=largest) for part in parts)


def parse_list(text: str) -> list[float]:
    """Parse one or more numbers separated by commas, blanks or both.

    Only decimal points are accepted: when the count is unknown, a decimal comma cannot
    be distinguished from a separator.

    Raises:
        MalformedMessage: If the list is empty, or a number in it is not readable or
            above ``LARGEST``.
    """
    return parse_words(text.replace(",", " ").split(), text)


def parse_words(words: Sequence[str], text: str) -> list[float]:
    """Parse the words of a list of numbers; see ``parse_list``.

    Args:
        words: The words, without commas.
        text: The words with blanks or commas between them.

    Raises:
        MalformedMessage: As ``parse_list`` does.
    """
    if not words or not _LIST.fullmatch(text):
        raise MalformedMessage(f"{text[:80]!r}, expected numbers")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise MalformedMessage(f"{text[:80]!r}, expected numbers") from None
    if max(numbers) > LARGEST or min(numbers) < -LARGEST:
        raise MalformedMessage(f"{text[:80]!r}, expected at most {LARGEST:g} each")
    return numbers


def parse_flag(text: str, *, any_case: bool = True) -> bool:
    """Parse a truth value: ``true`` is true, everything else is false.

    Args:
        text: Value of the field.
        any_case: Whether ``True`` is true as well.
    """
    return (text.lower() if any_case else text) == "true"
