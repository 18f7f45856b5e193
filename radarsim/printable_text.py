"""Text from maps, clients, servers and command lines, safe to be shown on a terminal.

A terminal obeys escape sequences, and text can change the direction of what stands
around it. Names of objects and files may contain either.
"""


def escape_unprintable(text: str) -> str:
    r"""Return a text with all characters escaped that Python calls not printable.

    These are control characters, also line ends, marks that change the direction of
    text, invisible separators, and halves of characters; ``repr`` escapes the same
    ones. What is escaped already stays as it is.

    >>> escape_unprintable("wall\x1b[2J\n")
    'wall\\x1b[2J\\n'
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def escape_lines(text: str) -> str:
    r"""Return a text of several lines, each with ``escape_unprintable``.

    >>> escape_lines("wall\x07\nbush")
    'wall\\x07\nbush'
    """
    return "\n".join(map(escape_unprintable, text.split("\n")))
