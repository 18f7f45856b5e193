import re
from html.parser import HTMLParser

import numpy as np
from matplotlib.figure import Figure

from radarsim.files import PICTURE_MARK
from radarsim.lab.figures.catalogue import RenderedFigure
from radarsim.lab.figures.figure import DrawnFigure, png_size
from radarsim.lab.figures.page import figure_block, render_page, split_page

COMMAND = "radarsim scan room --set a=1 --seed 0"


def png(width: float = 2.0) -> bytes:
    return DrawnFigure(Figure(figsize=(width, 1), dpi=50), "a caption").as_png()


def made(number: str, caption: str = "See 3 < 4 & more.") -> RenderedFigure:
    file = f"figure_{number}.png"
    title, details = f"Walls & bushes {number}", "Counted: 5 < 6.\nAnd 7."
    return RenderedFigure(
        number, title, file, caption, (COMMAND,), png(), details, "5 beams pass & see"
    )


class PageReader(HTMLParser):
    """Collects what a browser would fetch, links, and texts by the element around."""

    VOID = frozenset({"meta", "img"})

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.ids: list[str] = []
        self.texts: dict[str, str] = {}
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        described = dict(attrs)
        sources = ("src", "srcset", "data", "poster", "action", "background", "style")
        self.fetched += [str(described[key]) for key in sources if key in described]
        if "href" in described:
            kept = self.links if tag == "a" else self.fetched
            kept.append(str(described["href"]))
        self.ids += [str(described["id"])] if "id" in described else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        for tag in set(self.open):
            self.texts[tag] = self.texts.get(tag, "") + data


def read(page: str) -> PageReader:
    reader = PageReader()
    reader.feed(page)
    assert not reader.open
    return reader


def test_page_shows_all_figures_with_names_and_captions() -> None:
    reader = read(render_page([figure_block(made("1")), figure_block(made("5b"))]))
    assert reader.fetched == ["figure_1.png", "figure_5b.png"]
    assert reader.texts["figcaption"].count("See 3 < 4 & more.") == 2
    for tag in ("nav", "h2"):
        assert "Walls & bushes 1" in reader.texts[tag]
        assert "Walls & bushes 5b" in reader.texts[tag]


def test_numbers_and_commands_are_folded_away() -> None:
    block = figure_block(made("1"))
    folded = read(block).texts["details"]
    assert COMMAND in folded
    assert "Counted: 5 < 6." in folded
    assert "<p>And 7.</p>" in block
    open_caption = block.split("<details>")[0]
    assert COMMAND not in open_caption
    assert "See 3 &lt; 4" in open_caption


def test_alternative_text_is_what_the_picture_says_and_not_its_name() -> None:
    block = figure_block(made("1"))
    assert 'alt="5 beams pass &amp; see"' in block
    drawing = Figure()
    drawing.text(0, 1, "What one sees")
    drawing.add_subplot().set_title("a panel", loc="left")
    assert DrawnFigure(drawing, "").headline == "What one sees"
    without = Figure()
    for axes, title in zip(without.subplots(1, 2), ("one", "two"), strict=True):
        axes.set_title(title, loc="left")
    assert DrawnFigure(without, "").headline == "one; two"


def test_list_of_contents_and_pictures_lead_somewhere() -> None:
    numbers = ("1", "2-5", "5b")
    reader = read(render_page([figure_block(made(number)) for number in numbers]))
    anchors = {f"#{name}" for name in reader.ids}
    files = {f"figure_{number}.png" for number in numbers}
    assert set(reader.links) <= anchors | files
    assert set(reader.links) >= {f"#figure-{number}" for number in numbers} | files
    assert len(set(reader.ids)) == len(reader.ids)
    assert "Figures 2 to 5" in reader.texts["h2"]


def test_page_fetches_nothing_but_its_pictures() -> None:
    page = render_page([figure_block(made("1"))])
    assert read(page).fetched == ["figure_1.png"]
    loads = ("http", "//", "url(", "@import", "fetch(", "import(", "XMLHttp", ".src")
    without_comments = re.sub(r"<!DOCTYPE html>", "", page)
    assert not [each for each in loads if each in without_comments]


def test_captions_cannot_bring_scripts_along() -> None:
    hostile = figure_block(made("1", "</figure><script>alert(1)</script>"))
    assert "script" not in read(hostile).texts
    assert list(split_page(render_page([hostile])).values()) == [hostile]


def test_page_follows_the_dark_mode_of_the_browser() -> None:
    style = read(render_page([])).texts["style"]
    assert "prefers-color-scheme: dark" in style
    assert "color-scheme: light dark" in style


def test_figures_of_an_existing_page_are_preserved() -> None:
    blocks = [figure_block(made(number)) for number in ("1", "2-5", "5b", "14")]
    page = render_page(blocks)
    assert list(split_page(page).values()) == blocks
    assert render_page(split_page(page).values()) == page
    assert split_page("<p>someone else's</p>") == {}


def test_pictures_have_size_and_software_metadata() -> None:
    picture = png(3.0)
    assert png_size(picture) == (150, 50)
    assert 'width="100" height="50"' in figure_block(made("1"))
    assert PICTURE_MARK in picture[:1024]


def test_the_same_drawing_gives_the_same_bytes() -> None:
    assert png() == png()
    drawn = Figure(figsize=(2, 1), dpi=50)
    drawn.add_subplot().plot(np.arange(3))
    assert DrawnFigure(drawn, "").as_png() != png()
