import re

import pytest

from radarsim.figures.catalogue import FIGURES, NUMBERS, entries_of

OF_THE_THESIS = ("1", "2", "3", "4", "5", "5b", *(str(n) for n in range(6, 16)))


def test_all_figures_of_the_thesis_are_there_in_their_order() -> None:
    assert NUMBERS == OF_THE_THESIS


def test_files_have_two_digits_and_sort_as_the_figures_do() -> None:
    files = [entry.file for entry in FIGURES]
    assert all(re.fullmatch(r"figure_\d\db?\.png", file) for file in files)
    assert sorted(set(files)) == files
    assert entries_of(["5b"])[0].file == "figure_05b.png"


def test_figures_come_once_and_in_the_order_of_the_table() -> None:
    found = entries_of(["8", "5b", "8"])
    assert [entry.number for entry in found] == ["5b", "8"]


@pytest.mark.parametrize("number", ["0", "16", "07", "", "x" * 200])
def test_what_is_not_in_the_table_is_refused(number: str) -> None:
    with pytest.raises(ValueError, match="expected some of") as caught:
        entries_of(["7", number])
    assert repr(number[:80]) in str(caught.value)
    assert len(str(caught.value)) < 300
