import pytest

from radarsim.figures.catalogue import entries_of, make, make_all
from radarsim.figures.figure import is_ours, size_of


def test_the_same_seed_gives_the_same_figure() -> None:
    one, two = make("5b", 4), make("5b", 4)
    assert one == two
    assert make("5b", 5).png != one.png


def test_a_figure_tells_what_draws_it() -> None:
    made = make("6", 2)
    assert (made.number, made.file) == ("6", "figure_06.png")
    assert made.commands[-1] == "radarsim figures OUT --only 6 --seed 2"
    assert is_ours(made.png)
    assert min(size_of(made.png)) > 500


@pytest.mark.slow
def test_several_processes_make_the_same_as_one() -> None:
    wanted = entries_of(["4", "6"])
    alone = {made.number: made for made in make_all(wanted, 0, workers=1)}
    shared = {made.number: made for made in make_all(wanted, 0, workers=2)}
    assert alone == shared
