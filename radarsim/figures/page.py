"""The page with all figures: one HTML file that needs only the pictures beside it."""

import re
from collections.abc import Iterable
from html import escape
from typing import Final

from radarsim import __version__
from radarsim.figures.catalogue import RenderedFigure
from radarsim.figures.figure import png_size

FILE: Final = "index.html"
GENERATOR: Final = '<meta name="generator" content="radarsim">'
TITLE: Final = "Navigation using a radar sensor in USARSim: the figures"
_BLOCK: Final = re.compile(
    r'<figure id="figure-(?P<number>\w+)">.*?</figure>\n', re.DOTALL
)
_STYLE: Final = """
  :root { color-scheme: light; }
  body { margin: 0 auto; max-width: 62rem; padding: 1.5rem 1rem 4rem;
         background: #fff; color: #222; font: 1rem/1.55 system-ui, sans-serif; }
  h1 { font-size: 1.5rem; line-height: 1.25; margin: 0 0 .6rem; }
  nav { margin: 1rem 0 2rem; }
  nav a { display: inline-block; min-width: 1.6rem; margin: 0 .25rem .25rem 0;
          padding: .1rem .4rem; text-align: center; color: #1f4e9c;
          text-decoration: none; border: 1px solid #c9d3e3; border-radius: .3rem; }
  nav a:hover { background: #eef3fb; }
  figure { margin: 0 0 3.5rem; }
  figure img { display: block; max-width: 100%; height: auto; margin: 0 auto .8rem; }
  figcaption { max-width: 48rem; margin: 0 auto; }
  figcaption p { margin: 0 0 .5rem; }
  code { display: block; padding: .15rem .6rem; background: #f5f5f2; overflow-x: auto;
         white-space: pre; font: .82rem/1.6 ui-monospace, monospace; }
"""


def figure_block(figure: RenderedFigure) -> str:
    """Return the HTML of one figure."""
    width, height = png_size(figure.png)
    name = f"Figure {figure.number}"
    commands = "\n".join(f"  <code>{escape(text)}</code>" for text in figure.commands)
    return (
        f'<figure id="figure-{figure.number}">\n'
        f'  <img src="{figure.file}" width="{width}" height="{height}"'
        f' alt="{escape(figure.title)}" loading="lazy">\n'
        "  <figcaption>\n"
        f"  <p><strong>{name}.</strong> {escape(figure.title)}.</p>\n"
        f"  <p>{escape(figure.caption)}</p>\n"
        f"{commands}\n"
        "  </figcaption>\n"
        "</figure>\n"
    )


def split_page(page: str) -> dict[str, str]:
    """Return the HTML of each figure of a page, by its number."""
    return {found["number"]: found[0] for found in _BLOCK.finditer(page)}


def render_page(blocks: Iterable[str]) -> str:
    """Return a page with the given figures."""
    body = "".join(blocks)
    numbers = split_page(body)
    links = "\n".join(f'  <a href="#figure-{n}">{n}</a>' for n in numbers)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
{GENERATOR}
<title>{TITLE}</title>
<style>{_STYLE}</style>
</head>
<body>
<h1>{TITLE}</h1>
<p>Drawn by radarsim {__version__} from runs of the program itself. Under each figure
stands what takes the same scans, drives the same way or shows more of it, and what
draws the figure again.</p>
<nav>
{links}
</nav>
{body}</body>
</html>
"""
