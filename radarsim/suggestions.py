"""Messages about unknown names: what was expected, and what was probably meant."""

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from itertools import islice
from typing import Final

CUTOFF: Final = 0.6  # of difflib's ratio, from 0 to 1, above which names are similar
MAX_LENGTH: Final = 80  # of a name in a message
MAX_NAMES: Final = 100  # that are listed in a message, and that are compared


def expected_one_of(name: str, known: Collection[str]) -> str:
    """Return the message for a name that is not among the known ones.

    Args:
        name: What was given.
        known: What would have been valid, in the order of the message.

    >>> expected_one_of("sqare", ["circle", "square"])
    "'sqare', expected one of ['circle', 'square']; did you mean 'square'?"
    >>> expected_one_of("line", ["circle", "square"])
    "'line', expected one of ['circle', 'square']"
    """
    return (
        f"{name[:MAX_LENGTH]!r}, expected one of {list_names(known)}"
        f"{did_you_mean(name, known)}"
    )


def list_names(names: Collection[str]) -> str:
    """Return a list of names for a message; of many, the first and how many more.

    >>> list_names(["circle", "square"])
    "['circle', 'square']"
    """
    first = [name[:MAX_LENGTH] for name in islice(names, MAX_NAMES)]
    more = len(names) - len(first)
    return f"{first} and {more} more" if more else f"{first}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of such a message; empty if no known name is similar.

    Upper and lower case are equal. Only the first of very many names are compared.

    >>> did_you_mean("RADRA", ["laser", "radar"])
    "; did you mean 'radar'?"
    """
    names = {each.casefold(): each for each in islice(known, MAX_NAMES)}
    wanted = name[:MAX_LENGTH].casefold()
    similar = get_close_matches(wanted, names, n=1, cutoff=CUTOFF)
    return f"; did you mean {names[similar[0]]!r}?" if similar else ""
