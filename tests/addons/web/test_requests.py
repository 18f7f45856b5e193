import json
from typing import Any

import pytest

from radarsim.addons.web.requests import BadRequest, make_offers, parse_request
from radarsim.addons.web.robot_view import RobotView
from radarsim.autonomy.plans import Algorithm, StrategyName
from radarsim.presets.robots import Item, load_robot, robot_names
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.simulation.config import SimulationConfig


@pytest.mark.parametrize(
    "message",
    [
        {"op": "select", "robot": None},
        {"op": "spawn", "class": "USARBot.P3AT", "name": "a b", "start": "RobotStart1"},
        {"op": "stop", "robot": "R1"},
        {"op": "goto", "robot": "R1", "algorithm": "bug1", "goal": [1, 2]},
    ],
)
def test_requests_are_read(message: dict[str, Any]) -> None:
    request = parse_request(json.dumps(message))
    sent = json.loads(request.model_dump_json(by_alias=True, exclude_unset=True))
    assert sent == message


@pytest.mark.parametrize(
    ("message", "text"),
    [
        pytest.param("", "JSON", id="nothing"),
        pytest.param("[]", "message", id="no object"),
        pytest.param("{}", "op", id="no op"),
        pytest.param('{"op": "drvie"}', "did you mean 'drive'", id="unknown op"),
        pytest.param('{"op": "stop", "more": 1}', "more", id="unknown key"),
        pytest.param(
            '{"op": "drive", "robot": "R1", "v": 1.1, "w": 0}', "v", id="too fast"
        ),
        pytest.param(
            '{"op": "drive", "robot": "R1", "v": NaN, "w": 0}', "v", id="no number"
        ),
        pytest.param(
            '{"op": "spawn", "class": "P3AT", "name": "{a}"}', "name", id="braces"
        ),
        pytest.param(
            '{"op": "spawn", "class": "P3AT", "name": "a\\nINIT"}', "name", id="line"
        ),
        pytest.param('{"op": "spawn", "class": "a b"}', "class", id="class"),
        pytest.param(
            '{"op": "spawn", "class": "P3AT", "pose": [1, 2]}', "pose", id="pose"
        ),
        pytest.param('{"op": "hello", "token": "\\ud800"}', "JSON", id="half a letter"),
        pytest.param("[" * 4000, "JSON", id="deep"),
    ],
)
def test_errors_are_reported(message: str, text: str) -> None:
    with pytest.raises(BadRequest, match=text):
        parse_request(message)


def test_lists_are_the_programs_own() -> None:
    offers = make_offers(SimulationConfig())
    assert sorted(each["name"] for each in offers["classes"]) == [*robot_names()]
    assert [each["name"] for each in offers["algorithms"]] == [*Algorithm]
    labels = [each["label"] for each in offers["algorithms"]]
    assert labels == ["Bug1", "Bug2", "TangentBug", "Planned paths"]
    assert [each["name"] for each in offers["strategies"]] == [*StrategyName]
    keys = {each["key"] for each in offers["settings"]}
    assert keys == {*SensorSettings.model_fields} - {"medium", "ray_weights"}


def test_settings_show_how_they_can_be_changed() -> None:
    settings = {
        each["key"]: each for each in make_offers(SimulationConfig())["settings"]
    }
    offset = settings["side_offset_uu"]
    assert (offset["type"], offset["min"], offset["max"]) == ("number", 0, 100)
    assert (offset["label"], offset["unit"]) == ("Side offset", "UU")
    assert settings["ray_choice"]["choices"] == ["drawn", "together"]
    assert settings["band_ghz"]["choices"] == [24, 77, 94]
    assert settings["incidence_weights"]["type"] == "boolean"
    assert settings["max_bounces"]["type"] == "integer"
    assert settings["max_bounces"]["max"] == 16
    assert settings["beamwidth_az_deg"]["max"] == 90


def test_first_class_has_radar_and_laser_and_can_go_by_itself() -> None:
    first, *others = make_offers(SimulationConfig())["classes"]
    assert (
        first["label"]
        == f"{first['name']}: radar 360\N{DEGREE SIGN} + laser 360\N{DEGREE SIGN}"
    )
    assert {"name": "P3AT", "label": "P3AT: radar 180\N{DEGREE SIGN}"} in others


def test_classes_of_the_server_are_offered_and_known() -> None:
    mast = Item(type="RangeScanner", name="Mast", position=(0, 0, 1), sensor="hokuyo")
    base = load_robot("P3AT")
    tall = base.model_copy(update={"name": "Tall", "items": (*base.items, mast)})
    blind = base.model_copy(update={"name": "Blind", "items": ()})
    config = SimulationConfig(robots=(tall, blind))
    labels = {each["name"]: each["label"] for each in make_offers(config)["classes"]}
    assert labels.keys() == {*robot_names(), "Tall", "Blind"}
    degree = "\N{DEGREE SIGN}"
    assert labels["Tall"] == f"Tall: radar 180{degree} + laser 239{degree}"
    assert labels["Blind"] == "Blind: no scanner"
    scanner = RobotView("R1", "Tall", config).scanner("mast")
    assert (scanner.medium, scanner.mount.z) == ("laser", 1)
