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


def test_rates_are_10_hz_in_compat_and_those_of_usarsim_in_udk() -> None:
    names = ("radar", "sick", "hokuyo")
    assert [COMPAT.scan_interval_of(name) for name in names] == [0.1, 0.1, 0.1]
    assert [UDK.scan_interval_of(name) for name in names] == [0.2, 0.2, 0.3]
    assert (COMPAT.ins_interval, UDK.ins_interval) == (0.1, 0.2)
    assert (COMPAT.tachometer_interval, UDK.tachometer_interval) == (0.1, 0.2)


def test_range_limit_and_battery_depend_on_the_dialect() -> None:
    assert (COMPAT.battery_start, COMPAT.battery_runs_out) == (3600, False)
    assert (UDK.battery_start, UDK.battery_runs_out) == (1200, True)
    assert (COMPAT.laser_max_range, UDK.laser_max_range) == (None, 20)
