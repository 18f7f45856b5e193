from radarsim.addons.web.requests import make_offers
from radarsim.addons.web.robot_view import RobotView
from radarsim.autonomy.exploration.plans import StrategyName
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.presets.robots import Item, load_robot, robot_names
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.simulation.config import SimulationConfig


def test_lists_are_the_programs_own() -> None:
    offers = make_offers(SimulationConfig())
    assert sorted(each["name"] for each in offers["classes"]) == [*robot_names()]
    assert [each["name"] for each in offers["algorithms"]] == [*Algorithm]
    assert [each["name"] for each in offers["strategies"]] == [*StrategyName]
    keys = {each["key"] for each in offers["settings"]}
    assert keys == {*SensorSettings.model_fields} - {"medium", "ray_weights"}


def test_settings_tell_how_they_can_be_changed() -> None:
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
