import pytest

from radarsim.protocol.dialect import COMPAT, MAX_WHEEL_SPEEDS, UDK, get_dialect


def test_dialects_are_found_by_name() -> None:
    assert get_dialect("compat") is COMPAT
    assert get_dialect("udk") is UDK


def test_unknown_dialect_error_lists_the_known_ones() -> None:
    problem = "^dialect 'ut2004', expected 'compat' or 'udk'$"
    with pytest.raises(ValueError, match=problem):
        get_dialect("ut2004")


def test_both_dialects_have_the_same_top_wheel_speed() -> None:
    turn = 2 * 3.141592653589793
    assert (
        pytest.approx(MAX_WHEEL_SPEEDS[UDK.drive_unit] * turn, abs=0.005)
        == (MAX_WHEEL_SPEEDS[COMPAT.drive_unit])
    )
    assert (COMPAT.drive_unit, UDK.drive_unit) == ("rad_per_s", "rev_per_s")
