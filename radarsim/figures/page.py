"""The page with all figures: one HTML file that needs only the pictures beside it."""

import re
from collections.abc import Iterable
from html import escape
from typing import Final

from radarsim import __version__
from radarsim.figures.catalogue import RenderedFigure
from radarsim.figures.figure import png_size
from radarsim.figures.page_style import SCRIPT, STYLE

FILE: Final = "index.html"
GENERATOR: Final = '<meta name="generator" content="radarsim">'
TITLE: Final = "Navigation using a radar sensor in USARSim: the figures"
_BLOCK: Final = re.compile(
    r'<figure id="figure-(?P<number>[\w-]+)">.*?</figure>\n', re.DOTALL
)
_TITLE: Final = re.compile(r"<h2>.*?</span> (.*?)</h2>")


def figure_block(figure: RenderedFigure) -> str:
    """Return the HTML of one figure.

    The picture is a link to its file, which the page's script turns into enlarging;
    details and commands are folded away.
    """
    width, height = png_size(figure.png)
    title = escape(figure.title)
    commands = "\n".join(escape(text) for text in figure.commands)
    details = "".join(
        f"  <p>{escape(text)}</p>\n" for text in figure.details.splitlines()
    )
    said = escape(figure.headline or figure.title)
    return (
        f'<figure id="figure-{figure.number}">\n'
        f'  <a class="picture" href="{figure.file}"><img src="{figure.file}"'
        f' width="{width}" height="{height}" alt="{said}" loading="lazy"></a>\n'
        "  <figcaption>\n"
        f"  <h2><span>{_name(figure.number)}</span> {title}</h2>\n"
        f'  <p class="caption">{escape(figure.caption)}</p>\n'
        "  <details>\n"
        "  <summary>Numbers and commands</summary>\n"
        f"{details}"
        f"  <pre><code>{commands}</code></pre>\n"
        "  </details>\n"
        "  </figcaption>\n"
        "</figure>\n"
    )


def split_page(page: str) -> dict[str, str]:
    """Return the HTML of each figure of a page, by its number."""
    return {found["number"]: found[0] for found in _BLOCK.finditer(page)}


def render_page(blocks: Iterable[str]) -> str:
    """Return a page with the given figures."""
    body = "".join(blocks)
    links = "\n".join(_link(*each) for each in split_page(body).items())
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
{GENERATOR}
<title>{TITLE}</title>
<style>{STYLE}</style>
</head>
<body>
<header>
<h1>{TITLE}</h1>
<p>Drawn by radarsim {__version__} from runs of the program itself. Press on a picture
to enlarge it; under each are the numbers that were counted in its run, and the commands
that repeat it.</p>
</header>
<nav aria-label="Figures">
<ul>
{links}
</ul>
</nav>
<main>
{body}</main>
<dialog id="enlarged" aria-label="Enlarged figure">
<p><strong></strong> <button type="button">Close</button></p>
<div></div>
</dialog>
<script>{SCRIPT}</script>
</body>
</html>
"""


def _name(number: str) -> str:
    """Return the name of a figure, such as ``Figure 8`` or ``Figures 2 to 5``."""
    first, dash, last = number.partition("-")
    return f"Figures {first} to {last}" if dash else f"Figure {number}"


def _link(number: str, block: str) -> str:
    """Return the entry of a figure in the list of contents."""
    found = _TITLE.search(block)
    title = found[1] if found else ""
    shown = number.replace("-", "\N{EN DASH}")
    return f'<li><a href="#figure-{number}"><span>{shown}</span> {title}</a></li>'
