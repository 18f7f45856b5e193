import pytest

from radarsim.protocol.dialect import COMPAT, UDK, get_dialect


def test_dialects_are_found_by_name() -> None:
    assert get_dialect("compat") is COMPAT
    assert get_dialect("udk") is UDK


def test_unknown_dialect_error_lists_the_known_ones() -> None:
    problem = "^dialect 'ut2004', expected 'compat' or 'udk'$"
    with pytest.raises(ValueError, match=problem):
        get_dialect("ut2004")
