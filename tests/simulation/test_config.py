from typing import Any

import pytest

from radarsim.errors import PresetError
from radarsim.presets.robots import Item, load_robot, robot_names
from radarsim.presets.sensors import load_settings
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.simulation.clock import TICK, seconds, ticks_of
from radarsim.simulation.config import SimulationConfig

ITEM_NAMES = sorted(
    {item.name for name in robot_names() for item in load_robot(name).items}
)


def item(name: str, class_name: str = "P3AT") -> Item:
    return next(i for i in load_robot(class_name).items if i.name == name)


def test_item_settings_override_the_dialect() -> None:
    config = SimulationConfig(UDK, item_settings={"LMS200": {"max_range": 33}})
    assert config.scanner(item("lms200")).settings.max_range == 33
    assert config.scanner(item("lms200", "P3AT_SICK")).settings.max_range == 33
    full_circle = config.scanner(item("lms200", "P3AT_Radar360")).settings
    assert (full_circle.max_range, full_circle.fov_deg) == (33, 359)


def test_interval_of_an_item_overrides_the_dialect() -> None:
    slow = item("lms200").model_copy(update={"interval": 0.7})
    assert SimulationConfig(UDK).interval(slow) == 0.7


def test_scanner_of_another_item_type_is_an_error() -> None:
    with pytest.raises(ValueError, match="item 'W1': type Encoder, expected a scanner"):
        SimulationConfig().scanner(item("W1"))


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
@pytest.mark.parametrize(
    "settings",
    [
        pytest.param({}, id="none"),
        pytest.param({"lms200": {"side_offset_uu": 0}}, id="scanner"),
        pytest.param({"instest": {"sigma": 0}}, id="ins in any case"),
        pytest.param({"Odometer": {}}, id="nothing of an item"),
    ],
)
def test_valid_settings_pass_the_check(
    dialect: Dialect, settings: dict[str, Any]
) -> None:
    SimulationConfig(dialect, item_settings=settings).check()


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        pytest.param(
            {"lms": {"max_range": 3}},
            f"item 'lms' (did you mean 'lms200'?), expected one of {ITEM_NAMES}",
            id="unknown item",
        ),
        pytest.param(
            {"F1": {"fov_deg": 3}},
            "item F1: sonar: no setting 'fov_deg', expected one of ['beam_angle_deg', "
            "'max_incidence_deg', 'max_range', 'min_range']",
            id="setting of a scanner for a sonar",
        ),
        pytest.param(
            {"Odometer": {"sigma": 0}},
            "item 'Odometer': type Odometry has no settings",
            id="item without settings",
        ),
        pytest.param(
            {"InsTest": {"sigma": -1}},
            "item InsTest: ins: sigma: -1, expected at least 0",
            id="negative drift",
        ),
    ],
)
def test_invalid_settings_are_refused(settings: dict[str, Any], text: str) -> None:
    with pytest.raises(PresetError) as caught:
        SimulationConfig(item_settings=settings).check()
    assert str(caught.value) == text


def test_changed_settings_replace_those_under_any_spelling_of_the_name() -> None:
    (item,) = load_robot("P3AT").items_of("RangeScanner")
    first = SimulationConfig(
        item_settings={"LMS200": {"max_range": 9, "fov_deg": 90}, "InsTest": {}}
    )
    changed = first.with_settings(item, {"max_range": 7})
    settings = changed.scanner_settings(item)
    assert (settings.max_range, settings.fov_deg) == (7, 90)
    assert first.scanner_settings(item).max_range == 9
    assert "InsTest" in changed.item_settings
    with pytest.raises(PresetError, match="max_range"):
        first.with_settings(item, {"max_range": -7})


SCANNER = load_robot("P3AT").items_of("RangeScanner")[0]


@pytest.mark.parametrize("dialect", [COMPAT, UDK])
def test_another_sensor_replaces_all_settings(dialect: Dialect) -> None:
    """Settings of the class and the dialect hold for the original sensor only."""
    wide = load_robot("P3AT_Radar360").items_of("RangeScanner")[0]
    for item in (SCANNER, wide):
        settings = {"LMS200": {"sensor": "k2pi", "min_range": 1.0}}
        config = SimulationConfig(dialect=dialect, item_settings=settings)
        config.check()
        scanner = config.scanner(item)
        assert scanner.name == "k2pi"
        assert scanner.settings == load_settings("k2pi", min_range=1.0)
        assert config.interval(item) == 1.0  # one turn in a second


def test_setting_the_same_sensor_keeps_the_settings_of_the_class() -> None:
    wide = load_robot("P3AT_Radar360").items_of("RangeScanner")[0]
    same = SimulationConfig(item_settings={"lms200": {"sensor": "radar"}})
    assert same.scanner(wide).settings == SimulationConfig().scanner(wide).settings


def test_scan_rate_setting_overrides_the_dialect() -> None:
    fast = SimulationConfig(dialect=UDK, item_settings={"lms200": {"scan_rate_hz": 20}})
    assert fast.interval(SCANNER) == pytest.approx(0.05)
    assert SimulationConfig(dialect=UDK).interval(SCANNER) == pytest.approx(0.2)


def test_unknown_sensor_is_refused_by_the_check() -> None:
    with pytest.raises(PresetError, match=r"sensor 'k3pi' .*, expected one of"):
        SimulationConfig(item_settings={"lms200": {"sensor": "k3pi"}}).check()
    with pytest.raises(PresetError, match="sensor"):
        SimulationConfig(item_settings={"InsTest": {"sensor": "radar"}}).check()


def test_tick_time_has_no_rounding_error_in_its_digits() -> None:
    assert [repr(seconds(n)) for n in (0, 1, 7, 29, 30, 360_010)] == [
        *("0.0", "0.01", "0.07", "0.29", "0.3", "3600.1")
    ]


@pytest.mark.parametrize(
    ("interval", "ticks"),
    [
        pytest.param(0.1, 10, id="tenth of a second"),
        pytest.param(0.3, 30, id="three tenths"),
        pytest.param(0.004, 1, id="less than a tick"),
        pytest.param(TICK, 1, id="a tick"),
    ],
)
def test_interval_is_converted_to_whole_ticks(interval: float, ticks: int) -> None:
    assert ticks_of(interval) == ticks
