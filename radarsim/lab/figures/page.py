"""The page with all figures: one HTML file that needs only the pictures beside it.

Its style sheet and its script are in it.
"""

import re
from collections.abc import Iterable
from html import escape
from typing import Final

from radarsim import __version__
from radarsim.files import PAGE_MARK
from radarsim.lab.figures.catalogue import RenderedFigure
from radarsim.lab.figures.figure import png_size

# Pictures have a white background; on a dark page they lie on a white card.
STYLE: Final = """
  :root { color-scheme: light dark; --page: #fff; --text: #222; --quiet: #5b6470;
          --link: #1f4e9c; --line: #d5dbe3; --code: #f4f5f2; }
  @media (prefers-color-scheme: dark) {
    :root { --page: #16191d; --text: #e3e6ea; --quiet: #a2abb6; --link: #8db7ff;
            --line: #363d46; --code: #22272d; }
    .picture { padding: .6rem; border-radius: .5rem; }
  }
  * { box-sizing: border-box; }
  html { scroll-padding-top: 1rem; }
  body { margin: 0 auto; max-width: 72rem; padding: 1.5rem 1rem 4rem;
         background: var(--page); color: var(--text);
         font: 1rem/1.55 system-ui, sans-serif; }
  header, nav { max-width: 48rem; margin: 0 auto; }
  h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .6rem; }
  a { color: var(--link); }
  :focus-visible { outline: .2rem solid var(--link); outline-offset: .2rem; }
  nav ul { columns: 22rem 2; column-gap: 2rem; margin: 1.5rem 0 3rem; padding: 0;
           list-style: none; }
  nav li { break-inside: avoid; padding-left: 2.6rem; text-indent: -2.6rem; }
  nav a { display: block; padding: .1rem 0; text-decoration: none; }
  nav a:hover { text-decoration: underline; }
  nav span { display: inline-block; width: 2.6rem; text-indent: 0;
             color: var(--quiet); }
  figure { margin: 0 0 4rem; }
  .picture { display: block; width: fit-content; max-width: 100%; margin: 0 auto 1rem;
             background: #fff; cursor: zoom-in; }
  .picture img { display: block; max-width: 100%; height: auto; }
  figcaption { max-width: 48rem; margin: 0 auto; }
  h2 { font-size: 1.15rem; line-height: 1.35; margin: 0 0 .4rem; }
  h2 span { margin-right: .3rem; color: var(--quiet); font-weight: normal; }
  figcaption p { margin: 0 0 .5rem; }
  details { border-left: .2rem solid var(--line); padding-left: .8rem; }
  summary { width: fit-content; color: var(--quiet); cursor: pointer; }
  details p { margin-top: .5rem; }
  pre { margin: .5rem 0; padding: .5rem .7rem; background: var(--code);
        border-radius: .3rem; overflow-x: auto;
        font: .82rem/1.6 ui-monospace, monospace; }
  code { font: inherit; }
  dialog { width: 100vw; height: 100vh; max-width: none; max-height: none; margin: 0;
           border: 0; padding: 0; background: #fff; color: #222; color-scheme: light; }
  dialog[open] { display: flex; flex-direction: column; }
  dialog p { display: flex; justify-content: space-between; align-items: center;
             gap: 1rem; margin: 0; padding: .4rem .8rem; }
  dialog button { font: inherit; padding: .2rem .9rem; cursor: pointer; }
  dialog div { flex: 1; min-height: 0; overflow: auto; text-align: center; }
  dialog img { max-width: 100%; height: 100%; object-fit: contain; cursor: zoom-out; }
  @media (max-width: 45rem) {
    dialog img { max-width: none; height: auto; width: 220vw; }
  }
"""

# Enlarges a picture in the dialog: a click or Enter opens it, the arrow keys show its
# neighbours, Escape or another click closes it. Without a script the link opens the
# file.
SCRIPT: Final = """
  const pictures = [...document.querySelectorAll("a.picture")];
  const dialog = document.getElementById("enlarged");
  const frame = dialog.querySelector("div");
  const show = (picture) => {
    const image = picture.querySelector("img").cloneNode();
    image.loading = "eager";
    const name = picture.parentElement.querySelector("h2");
    dialog.querySelector("strong").textContent = name.textContent;
    frame.replaceChildren(image);
    dialog.shown = picture;
    if (!dialog.open) dialog.showModal();
  };
  for (const picture of pictures) {
    picture.addEventListener("click", (event) => {
      if (event.ctrlKey || event.metaKey || event.shiftKey) return;
      event.preventDefault();
      show(picture);
    });
  }
  frame.addEventListener("click", () => dialog.close());
  dialog.querySelector("button").addEventListener("click", () => dialog.close());
  dialog.addEventListener("close", () => dialog.shown.focus());
  dialog.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const next = step && pictures[pictures.indexOf(dialog.shown) + step];
    if (next) show(next);
  });
"""


FILE: Final = "index.html"
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
{PAGE_MARK}
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
