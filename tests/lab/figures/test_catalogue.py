import re

import pytest

from radarsim.files import PICTURE_MARK
from radarsim.lab.figures.catalogue import (
    FIGURES,
    NUMBERS,
    FigureSpec,
    render,
    render_all,
    select_figures,
)
from radarsim.lab.figures.figure import png_size

OF_THE_THESIS = ("1", "2-5", "2", "3", "4", "5", "5b", *(str(n) for n in range(6, 16)))


def test_catalogue_holds_all_figures_of_the_thesis_in_order() -> None:
    assert NUMBERS == OF_THE_THESIS


def test_file_names_sort_in_the_order_of_the_figures() -> None:
    files = [entry.file for entry in FIGURES if "-" not in entry.number]
    assert all(re.fullmatch(r"figure_\d\db?\.png", file) for file in files)
    assert sorted(set(files)) == files
    assert select_figures(["5b"])[0].file == "figure_05b.png"
    assert select_figures(["2-5"])[0].file == "figures_02_to_05.png"


def test_selected_figures_are_unique_and_in_catalogue_order() -> None:
    found = select_figures(["8", "5b", "8"])
    assert [entry.number for entry in found] == ["5b", "8"]


@pytest.mark.parametrize("number", ["0", "16", "07", "", "x" * 200])
def test_unknown_figure_numbers_are_refused(number: str) -> None:
    with pytest.raises(ValueError, match="expected some of") as caught:
        select_figures(["7", number])
    assert repr(number[:80]) in str(caught.value)
    assert len(str(caught.value)) < 300


def test_the_same_seed_gives_the_same_figure() -> None:
    one, two = render("5b", 4), render("5b", 4)
    assert one == two
    assert render("5b", 5).png != one.png


def test_figure_has_the_command_that_draws_it() -> None:
    made = render("6", 2)
    assert (made.number, made.file) == ("6", "figure_06.png")
    assert made.commands[-1] == "radarsim figures OUT --only 6 --seed 2"
    assert PICTURE_MARK in made.png[:1024]
    assert min(png_size(made.png)) > 500


@pytest.mark.slow
def test_several_processes_render_the_same_bytes_as_one() -> None:
    wanted = select_figures(["4", "6"])
    alone = {made.number: made for made in render_all(wanted, 0, workers=1)}
    shared = {made.number: made for made in render_all(wanted, 0, workers=2)}
    assert alone == shared


@pytest.mark.parametrize("entry", FIGURES[:14], ids=lambda entry: str(entry.number))
def test_caption_has_two_sentences_and_the_picture_a_title_in_words(
    entry: FigureSpec,
) -> None:
    drawn = entry.draw(0)
    assert len(re.findall(r"\.(?: |$)", drawn.caption)) == 2
    assert len(drawn.caption.split()) < 60
    assert drawn.details
    title = drawn.drawing.texts[0].get_text()
    assert len(title.split()) > 3
    assert "_" not in title
