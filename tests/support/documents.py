"""The README and the manual as code blocks and links.

A comment ``<!-- test: WORDS -->`` before a block says how the tests treat it:

    server=MAP  it needs a server of that map on port 3000
    pytest      it is a module of a test suite
    fragment    it is a part of a file
    parse       its commands take too long; only their options are checked
    skip        it is for a shell that installs something
    slow        it runs with the slow tests
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
MANUAL = ROOT / "radarsim" / "docs"
PAGES = (ROOT / "README.md", *sorted(MANUAL.glob("*.md")))

_BLOCK = re.compile(
    r"(?:^<!-- test: (?P<flags>[^\n]+) -->\n)?"
    r"^```(?P<language>\w*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
_FILE_NAME = re.compile(r"# ([\w.]+\.\w+)\n")
_LINK = re.compile(r"\]\(([^)\s]+)\)")


@dataclass(frozen=True)
class Snippet:
    """A code block of a page."""

    page: Path
    line: int
    language: str
    flags: tuple[str, ...]
    text: str

    @property
    def name(self) -> str:
        return f"{self.page.stem}:{self.line}"

    @property
    def file_name(self) -> str | None:
        """The name of the file that the block's first line says it is."""
        named = _FILE_NAME.match(self.text)
        return None if named is None else named[1]

    @property
    def served_map(self) -> str | None:
        """The map of the server that it needs."""
        maps = (flag.removeprefix("server=") for flag in self.flags if "=" in flag)
        return next(maps, None)


def snippets_of(page: Path) -> Iterator[Snippet]:
    """Find the code blocks of a page."""
    text = page.read_text(encoding="utf-8")
    for block in _BLOCK.finditer(text):
        line = text.count("\n", 0, block.start("language")) + 1
        flags = tuple((block["flags"] or "").split())
        language = "suite" if "pytest" in flags else block["language"]
        yield Snippet(page, line, language, flags, block["text"])


def links_of(page: Path) -> list[str]:
    """Find the targets of a page's links and pictures, outside of code blocks."""
    text = _BLOCK.sub("", page.read_text(encoding="utf-8"))
    return _LINK.findall(text)


def anchors_of(page: Path) -> set[str]:
    """Return the names of a page's headings, as links use them."""
    text = _BLOCK.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading).lower() for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}
