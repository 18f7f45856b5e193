from html.parser import HTMLParser

import numpy as np
from matplotlib.figure import Figure

from radarsim.figures.catalogue import RenderedFigure
from radarsim.figures.figure import DrawnFigure, is_radarsim_figure, png_size
from radarsim.figures.page import figure_block, render_page, split_page

COMMAND = "radarsim scan room --set a=1 --seed 0"


def png(width: float = 2.0) -> bytes:
    return DrawnFigure((Figure(figsize=(width, 1), dpi=50),), "a caption").as_png()


def made(number: str, caption: str = "See 3 < 4 & more.") -> RenderedFigure:
    file = f"figure_{number}.png"
    return RenderedFigure(number, "Walls & bushes", file, caption, (COMMAND,), png())


class ScanBuilder(HTMLParser):
    """Collects what a browser would fetch, and the text of captions."""

    VOID = frozenset({"meta", "img"})

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        described = dict(attrs)
        self.fetched += [
            str(described[key]) for key in ("src", "srcset") if key in described
        ]
        self.links += [str(described["href"])] if "href" in described else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data if "figcaption" in self.open else ""


def read(page: str) -> ScanBuilder:
    reader = ScanBuilder()
    reader.feed(page)
    assert not reader.open
    return reader


def test_page_shows_all_figures_with_captions() -> None:
    reader = read(render_page([figure_block(made("1")), figure_block(made("5b"))]))
    assert reader.fetched == ["figure_1.png", "figure_5b.png"]
    assert reader.links == ["#figure-1", "#figure-5b"]
    assert reader.tags.count("figcaption") == 2
    assert reader.text.count("See 3 < 4 & more.") == 2
    assert reader.text.count(COMMAND) == 2


def test_page_loads_only_its_pictures_and_has_no_script() -> None:
    page = render_page([figure_block(made("1", "</figure><script>alert(1)</script>"))])
    assert "script" not in read(page).tags
    assert "http" not in page
    assert "url(" not in page
    assert "@import" not in page


def test_figures_of_an_existing_page_are_preserved() -> None:
    blocks = [figure_block(made(number)) for number in ("1", "5b", "14")]
    page = render_page(blocks)
    assert list(split_page(page).values()) == blocks
    assert render_page(split_page(page).values()) == page
    assert split_page("<p>someone else's</p>") == {}


def test_pictures_have_size_and_software_metadata() -> None:
    picture = png(3.0)
    assert png_size(picture) == (150, 50)
    assert 'width="100" height="50"' in figure_block(made("1"))
    assert is_radarsim_figure(picture)
    assert not is_radarsim_figure(b"\x89PNG\r\n\x1a\n" + bytes(100))


def test_drawings_of_different_widths_are_stacked() -> None:
    drawings = tuple(Figure(figsize=(width, 1), dpi=50) for width in (2, 4))
    width, height = png_size(DrawnFigure(drawings, "").as_png())
    assert width == 200
    assert height > 100


def test_the_same_drawing_gives_the_same_bytes() -> None:
    assert png() == png()
    drawn = Figure(figsize=(2, 1), dpi=50)
    drawn.add_subplot().plot(np.arange(3))
    assert DrawnFigure((drawn,), "").as_png() != png()
