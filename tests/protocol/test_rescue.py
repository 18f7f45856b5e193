"""Lines of the sensors that look for victims and tags."""

import pytest

from radarsim.protocol import reports
from radarsim.protocol.rescue import Sighting

LINES = [
    pytest.param(
        reports.VictimParts(
            1.5,
            "VictSensor",
            (Sighting("Leg", (2.05, -0.33, -0.46)), Sighting("Arm", (2.5, -0.44, 0))),
        ),
        "SEN {Time 1.50} {Type VictSensor} {Name VictSensor}"
        " {PartName Leg} {Location 2.0500,0.3300,0.4600}"
        " {PartName Arm} {Location 2.5000,0.4400,0.0000}",
        id="parts",
    ),
    pytest.param(
        reports.VictimParts(1.5, "VictSensor", ()),
        "SEN {Time 1.50} {Type VictSensor} {Name VictSensor} {Status NoVictims}",
        id="no victims",
    ),
    pytest.param(
        reports.RfidTags(1.5, "RFID", (Sighting("118", (-0.5, 0.25, -0.04)),)),
        "SEN {Time 1.50} {Type RFID} {Name RFID}"
        " {ID 118} {Location -0.5000,-0.2500,0.0400}",
        id="a tag",
    ),
    pytest.param(
        reports.HumanMotion(1.5, "HMD", 0.25),
        "SEN {Time 1.50} {Type HumanMotion} {Name HMD} {Prob  0.2500}",
        id="motion",
    ),
    pytest.param(
        reports.Sound(1.5, "Sound", 54.0, 2.0),
        "SEN {Time 1.50} {Type Sound} {Name Sound} {Loudness 54.0000}"
        " {Duration 2.0000}",
        id="sound",
    ),
    pytest.param(
        reports.GasDensity(1.5, "CO2", "CO2", 0.0),
        "SEN {Time 1.50} {Type CO2Sensor} {Name CO2} {Gas CO2} {Density 0.0000}",
        id="gas",
    ),
]


@pytest.mark.parametrize(("report", "line"), LINES)
def test_line_is_read_as_the_report(report: reports.SensorReport, line: str) -> None:
    decoded = reports.decode_report(line)
    assert decoded is not None
    assert type(decoded) is type(report)
    for field in type(report).__dataclass_fields__:
        assert getattr(decoded, field) == getattr(report, field)
