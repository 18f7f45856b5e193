"""A kind of sensor that is added as CONTRIBUTING.md says."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar

import pytest
from pydantic import BaseModel
from tick_readings import readings_of

from radarsim.errors import PresetError
from radarsim.geometry import Pose2
from radarsim.presets.robots import Item, load_robot
from radarsim.protocol.dialect import UDK
from radarsim.protocol.fields import ItemReport, Number
from radarsim.raycast.rays import Traces
from radarsim.scene.scene import Scene
from radarsim.sensors import sensor
from radarsim.sensors.sensor import Mounting, Sensor
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import Simulation


class Temperature(ItemReport):
    """The temperature at a thermometer, degrees Celsius."""

    sensor_type: ClassVar[str] = "Thermometer"

    celsius: Annotated[float, Number("Celsius", "robot")]


class ThermometerSettings(BaseModel, extra="forbid"):
    at_floor: float = 20.0


@pytest.fixture(autouse=True)
def _thermometer(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    sensor.kinds()  # those of the package, before one is added
    monkeypatch.setattr(sensor, "_KINDS", known := dict(sensor.kinds()))

    class Thermometer(Sensor, types=["Thermometer"]):
        """A thermometer: 1 degree less for each 100 m of height."""

        settings: ClassVar[type[BaseModel]] = ThermometerSettings

        def __init__(self, mounting: Mounting) -> None:
            super().__init__(mounting)
            self._at_floor = mounting.settings.at_floor

        def read(self, time: float, _: Traces) -> Sequence[Temperature]:
            celsius = self._at_floor - self.pose.z / 100
            return [Temperature(time, self.item.name, celsius)]

    assert known["Thermometer"] is Thermometer
    sensor.kinds.cache_clear()
    yield
    sensor.kinds.cache_clear()


def test_robots_carry_it_and_report_what_it_reads(empty_room: Scene) -> None:
    items = (Item(type="Thermometer", name="T1", position=(0, 0, 2.0)),)
    model = load_robot("P3AT").model_copy(update={"items": items})
    config = SimulationConfig(UDK, item_settings={"T1": {"at_floor": 7.0}})
    simulation = Simulation(empty_room, config=config)
    vehicle = simulation.spawn("R", model, Pose2(0, 0))
    assert vehicle is not None
    for _ in range(10):
        simulation.step()
        outputs = simulation.collect_reports()
    (report,) = readings_of(outputs[vehicle.number])
    assert isinstance(report, Temperature)
    assert math.isclose(report.celsius, 7.0 - (2.0 + model.origin_height) / 100)
    line = "SEN {Time 0.1000} {Type Thermometer} {Name T1} {Celsius 6.9785}"
    assert report.encode(UDK) == line


def test_its_settings_are_checked() -> None:
    model = load_robot("P3AT").model_copy(
        update={"name": "Warm", "items": (Item(type="Thermometer", name="T1"),)}
    )
    settings = {"T1": {"at_flor": 1}}
    config = SimulationConfig(item_settings=settings, robots=(model,))
    with pytest.raises(PresetError, match=r"^thermometer: no setting 'at_flor'"):
        config.check()


def test_type_that_no_kind_has_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'Termometer' \(did you mean 'Thermom"):
        Item(type="Termometer", name="T1")
