"""A slow reader of report lines, for comparison: characters, words, exact fractions.

It shares no code with ``radarsim.protocol``. Each function returns None for what a
client has to refuse.
"""

import re
from fractions import Fraction

LARGEST = 2**31


def read_segments(line: str) -> tuple[str, list[tuple[str, str]]] | None:
    """Return the verb of a line and key and value of each segment."""
    head, brace, rest = line.partition("{")
    if len(head.split()) != 1:
        return None
    segments, inside = [], "" if brace else None
    for sign in rest:
        if inside is None:
            inside = "" if sign == "{" else None
        elif sign == "{":
            return None
        elif sign == "}":
            words = inside.strip()
            key = words.split()[0] if words else ""
            if key:
                segments.append((key, words[len(key) :].strip()))
            inside = None
        else:
            inside += sign
    return None if inside is not None else (head.strip(), segments)


def read_number(text: str, points: str = ".,") -> float | None:
    """Return the float nearest to a number, whose point is one of some characters."""
    match = re.fullmatch(
        rf"([+-]?)([0-9]*)[{points}]?([0-9]*)([eE][+-]?[0-9]+)?", text.strip()
    )
    if match is None:
        return None
    sign, whole, decimals, exponent = match.groups()
    if not whole + decimals:
        return None
    power = int((exponent or "e0")[1:]) - len(decimals)
    power = min(power, 400)  # beyond all limits, or zero
    size = Fraction(int(whole + decimals)) * Fraction(10) ** max(power, -800)
    if size > 2 * LARGEST or float(size) > LARGEST:
        return None
    return -float(size) if sign == "-" else float(size)


def read_list(text: str) -> list[float] | None:
    """Return numbers with commas or blanks between them, at least one."""
    words = text.replace(",", " ").split(" ")
    numbers = [read_number(word, ".") for word in words if word]
    is_plain = not any(sign.isspace() and sign != " " for sign in text)
    found = [number for number in numbers if number is not None]
    return found if is_plain and found and len(found) == len(numbers) else None


def read_triple(text: str) -> list[float] | None:
    """Return three numbers with commas, or with blanks, which admit decimal commas."""
    words = re.sub(r"\s+,", ",", text).split()
    if len(words) == 3:
        parts = [word.removesuffix(",") for word in words]
    else:
        parts = " ".join(words).split(",")
    numbers = [read_number(part) for part in parts]
    found = [number for number in numbers if number is not None]
    return found if len(numbers) == len(found) == 3 else None
