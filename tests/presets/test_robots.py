import math
from pathlib import Path

import pytest

from radarsim.errors import PresetError
from radarsim.geometry import Pose3
from radarsim.presets.robots import (
    Item,
    RobotModel,
    load_robot,
    read_robot,
    robot_names,
)

NAMES = (
    "ARDrone",
    "ATRVJr",
    "AirRobot",
    "BasicAckermanRobot",
    "FrontAckerman",
    "Hummer",
    "Kenaf",
    "Kurt2D",
    "P2AT",
    "P2DX",
    "P3AT",
    "P3AT_Compare",
    "P3AT_Compare360",
    "P3AT_Hokuyo",
    "P3AT_Navtech",
    "P3AT_Radar360",
    "P3AT_Rescue",
    "P3AT_SICK",
    "Rugbot",
    "Sedan",
    "Talon",
    "TeleMax",
    "pioneer3at_with_sensors",
    "pioneer3at_with_sensors_r",
)
DRONES = ("ARDrone", "AirRobot")
NOT_SOURCED = {"name", "about", "sources", "generation"}
BODY = """\
name: Toy
length: 0.4
width: 0.3
height: 0.2
origin_height: 0.1
wheel_radius: 0.05
wheel_separation: 0.2
wheel_base: 0.2
track: 0.2
wheels: [right, left]
mass: 1
max_torque: 2
"""


def write(folder: Path, text: str, name: str = "Toy") -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(text)
    return path


def test_shipped_classes_are_the_known_ones() -> None:
    assert robot_names() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_class_is_named_like_its_file_in_any_case(name: str) -> None:
    assert load_robot(name).name == name
    assert load_robot(name.lower()) == load_robot(name.upper()) == load_robot(name)


@pytest.mark.parametrize("name", NAMES)
def test_hull_covers_the_wheels(name: str) -> None:
    model = load_robot(name)
    if name in DRONES:
        assert model.height > model.origin_height
        return
    assert model.width >= model.wheel_separation
    assert model.length >= model.wheel_base
    assert model.height > model.origin_height >= model.wheel_radius
    assert set(model.wheels) == {"left", "right"}


@pytest.mark.parametrize("name", NAMES)
def test_every_class_has_pose_sensors_bumper_battery_and_scanner(name: str) -> None:
    model = load_robot(name)
    for item_type in ("GroundTruth", "INS", "Odometry", "Touch", "Battery"):
        rolls = item_type != "Odometry" or name not in DRONES
        assert len(model.items_of(item_type)) == rolls
    assert model.items_of("rangescanner")


@pytest.mark.parametrize("name", NAMES)
def test_every_class_says_what_it_is_and_where_its_keys_come_from(name: str) -> None:
    model = load_robot(name)
    assert model.about.endswith(".")
    sourced = {key for source in model.sources for key in source.of}
    assert model.model_fields_set - NOT_SOURCED - {"wheels"} <= sourced


def test_names_of_other_servers_mean_a_p3at() -> None:
    plain = load_robot("P3AT")
    for name in ("pioneer3at_with_sensors", "pioneer3at_with_sensors_r"):
        same = {"name": "P3AT", "about": plain.about}
        assert load_robot(name).model_copy(update=same) == plain


def test_kenaf_has_the_wheels_of_the_original() -> None:
    model = load_robot("Kenaf")
    assert (model.wheel_base, model.wheel_separation) == (2 * 0.145, 2 * 0.076)
    parts = 1.0 + 4 * 0.1 + 4 * (0.1 + 0.1 + 0.1)  # body, wheels, flippers
    assert model.mass == pytest.approx(parts)


def test_unknown_class_is_rejected_with_the_known_names() -> None:
    with pytest.raises(PresetError) as caught:
        load_robot("KR6" * 50)
    names = list(NAMES)
    shown = ("KR6" * 50)[:80]
    assert str(caught.value) == f"robot class {shown!r}, expected one of {names}"


def test_p3at_has_the_dimensions_of_the_original() -> None:
    model = load_robot("P3AT")
    assert model.mass == 11.9
    assert model.max_torque == 50000
    assert model.origin_height == pytest.approx(0.048 + 0.098)
    assert (model.wheel_radius, model.wheel_separation, model.wheel_base) == (
        0.098,
        0.36,
        0.248,
    )
    assert model.dimensions == (0.552, 0.497, 0.46)
    assert model.wheels == ("right", "left", "right", "left")


def test_p3at_carries_in_the_udk_dialect_what_the_original_mounts() -> None:
    names = [item.name for item in load_robot("P3AT").in_dialect("udk").items]
    sensors = ["GndTruth", "InsTest", "TachTest", "W1", "W2"]
    assert names == [*sensors, "battery", "Camera", "lms200"]


@pytest.mark.parametrize("name", NAMES)
def test_all_items_are_carried_in_the_compat_dialect(name: str) -> None:
    model = load_robot(name)
    carried = model.in_dialect("compat").items
    kept = [item.name for item in model.items if item.dialect != "udk"]
    assert [item.name for item in carried] == kept


def test_items_of_a_p2dx_report_five_times_a_second_as_recorded() -> None:
    model = load_robot("P2DX")
    assert {item.interval for item in model.in_dialect("compat").items} == {0.2}
    assert {item.interval for item in model.in_dialect("udk").items} == {None}


def test_p3at_variants_differ_only_in_what_they_scan_or_search_with() -> None:
    plain = load_robot("P3AT")
    others = {"RangeScanner", "RFID", "VictSensor", "HumanMotion", "Sound", "CO2Sensor"}
    for name in NAMES:
        if name.startswith("P3AT_"):
            variant = load_robot(name)
            rest = [item for item in variant.items if item.type not in others]
            assert rest == list(plain.items[:-1])
            same = {"name": "P3AT", "about": plain.about, "items": plain.items}
            assert variant.model_copy(update=same) == plain


def test_mount_is_converted_to_radians() -> None:
    item = Item(type="INS", name="I", position=(1, 2, 3), rotation_deg=(90, 0, -180))
    assert item.mount == Pose3(1, 2, 3, math.pi / 2, 0, -math.pi)


def test_file_without_base_is_read(tmp_path: Path) -> None:
    model = read_robot(write(tmp_path, BODY))
    assert isinstance(model, RobotModel)
    assert model.items == ()
    assert model.cog == (0, 0, 0)


def test_based_on_inherits_replaces_and_adds_items(tmp_path: Path) -> None:
    items = "items: [{type: INS, name: A}, {type: Touch, name: B}]\n"
    write(tmp_path, BODY + items)
    text = """\
based_on: Toy
name: Toy2
mass: 5
items: [{type: Touch, name: C}, {type: Odometry, name: A}]
"""
    model = read_robot(write(tmp_path, text, "Toy2"))
    assert (model.name, model.mass, model.length) == ("Toy2", 5, 0.4)
    types = [(item.type, item.name) for item in model.items]
    assert types == [("Odometry", "A"), ("Touch", "B"), ("Touch", "C")]


def test_based_on_can_add_items_to_a_class_without_items(tmp_path: Path) -> None:
    write(tmp_path, BODY)
    text = "based_on: Toy\nname: Toy2\nitems: [{type: Touch, name: C}]\n"
    assert [item.name for item in read_robot(write(tmp_path, text, "T")).items] == ["C"]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("wheel: 3\n", ":13:1: wheel: "),
        ("cog: [1, 2]\n", ":13:6: cog"),
        ("items: [{type: GSP, name: A}]\n", ":13:16: items.0.type"),
        ("items: [{type: INS, name: 'A B'}]\n", ":13:27: "),
        ("items: [{type: RangeScanner, name: A}]\n", ":13:9: items.0"),
        ("items: [{type: INS, name: A, sensor: sick}]\n", ":13:9: "),
        ("items: [{type: INS, name: A}, {type: INS, name: a}]\n", ":1:1: "),
        ("mass: 2\n", ":13:1: mass: "),
        (
            "sources: [{of: [masss], source: me, confidence: choice}]\n",
            ":1:1: source for key 'masss' (did you mean 'mass'?), expected",
        ),
        ("steering: {max_front_deg: 90}\n", ":13:27: "),
    ],
)
def test_invalid_file_is_reported_with_its_place(
    tmp_path: Path, text: str, place: str
) -> None:
    path = write(tmp_path, BODY + text)
    with pytest.raises(PresetError) as caught:
        read_robot(path)
    assert str(caught.value).startswith(f"{path}{place}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "items",
    ["3", "[3]", "[{type: INS}]", "{name: A}"],
    ids=["number", "3", "nameless", "map"],
)
def test_invalid_items_are_rejected(tmp_path: Path, items: str) -> None:
    write(tmp_path, BODY + "items: []\n")
    text = f"based_on: Toy\nname: Toy2\nitems: {items}\n"
    with pytest.raises(PresetError, match="items"):
        read_robot(write(tmp_path, text, "Toy2"))


def test_file_that_is_not_a_mapping_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(PresetError, match=r"Toy\.yaml:1:1: "):
        read_robot(write(tmp_path, "[1, 2]\n"))


@pytest.mark.parametrize(
    ("dialect", "name"), [("compat", "CameraPanTilt"), ("udk", "cam")]
)
def test_camera_of_the_airrobot_hangs_on_the_package_of_its_dialect(
    dialect: str, name: str
) -> None:
    model = load_robot("AirRobot").in_dialect(dialect)
    (package,) = model.items_of("MisPkg")
    (camera,) = model.items_of("Camera")
    assert (package.name, camera.parent, len(package.links)) == (name, name, 1)
