import pytest

from radarsim.errors import did_you_mean, expected_one_of

NAMES = ["foliage_room", "smoke_room", "empty_room"]


def test_a_similar_name_is_suggested_before_the_list() -> None:
    text = expected_one_of("foliage_rom", NAMES)
    meant = "(did you mean 'foliage_room'?)"
    assert text == f"'foliage_rom' {meant}, expected one of {NAMES}"


@pytest.mark.parametrize("name", ["castle", "", "_"])
def test_nothing_is_suggested_for_a_name_like_none(name: str) -> None:
    assert expected_one_of(name, NAMES) == f"{name!r}, expected one of {NAMES}"


def test_upper_and_lower_case_are_equal() -> None:
    assert "'smoke_room'" in did_you_mean("SMOKE_ROM", NAMES)


def test_only_the_start_of_an_endless_name_is_shown() -> None:
    assert len(expected_one_of("x" * 10_000, NAMES)) < 200
