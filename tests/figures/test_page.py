from html.parser import HTMLParser

import numpy as np
from matplotlib.figure import Figure

from radarsim.figures.catalogue import Made
from radarsim.figures.figure import Plate, is_ours, size_of
from radarsim.figures.page import block_of, blocks_in, page_of

COMMAND = "radarsim scan room --set a=1 --seed 0"


def png(width: float = 2.0) -> bytes:
    return Plate((Figure(figsize=(width, 1), dpi=50),), "a caption").as_png()


def made(number: str, caption: str = "See 3 < 4 & more.") -> Made:
    file = f"figure_{number}.png"
    return Made(number, "Walls & bushes", file, caption, (COMMAND,), png())


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
        told = dict(attrs)
        self.fetched += [str(told[key]) for key in ("src", "srcset") if key in told]
        self.links += [str(told["href"])] if "href" in told else []
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


def test_a_page_shows_all_figures_with_their_captions() -> None:
    reader = read(page_of([block_of(made("1")), block_of(made("5b"))]))
    assert reader.fetched == ["figure_1.png", "figure_5b.png"]
    assert reader.links == ["#figure-1", "#figure-5b"]
    assert reader.tags.count("figcaption") == 2
    assert reader.text.count("See 3 < 4 & more.") == 2
    assert reader.text.count(COMMAND) == 2


def test_a_page_fetches_nothing_but_its_pictures_and_runs_nothing() -> None:
    page = page_of([block_of(made("1", "</figure><script>alert(1)</script>"))])
    assert "script" not in read(page).tags
    assert "http" not in page
    assert "url(" not in page
    assert "@import" not in page


def test_figures_of_a_page_can_be_taken_over() -> None:
    blocks = [block_of(made(number)) for number in ("1", "5b", "14")]
    page = page_of(blocks)
    assert list(blocks_in(page).values()) == blocks
    assert page_of(blocks_in(page).values()) == page
    assert blocks_in("<p>someone else's</p>") == {}


def test_pictures_say_their_size_and_that_they_are_ours() -> None:
    picture = png(3.0)
    assert size_of(picture) == (150, 50)
    assert 'width="100" height="50"' in block_of(made("1"))
    assert is_ours(picture)
    assert not is_ours(b"\x89PNG\r\n\x1a\n" + bytes(100))


def test_drawings_of_different_widths_stand_below_each_other() -> None:
    drawings = tuple(Figure(figsize=(width, 1), dpi=50) for width in (2, 4))
    width, height = size_of(Plate(drawings, "").as_png())
    assert width == 200
    assert height > 100


def test_the_same_drawing_gives_the_same_bytes() -> None:
    assert png() == png()
    drawn = Figure(figsize=(2, 1), dpi=50)
    drawn.add_subplot().plot(np.arange(3))
    assert Plate((drawn,), "").as_png() != png()
