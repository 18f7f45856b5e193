"""What a recording keeps of answers that describe a robot."""

import pytest

from radarsim.addons.recording.host_recorder import EventType, RunEvent
from radarsim.addons.recording.wire_recorder import WireRecorder


@pytest.mark.parametrize(
    "conf",
    [
        "CONF {Type GroundVehicle} {Name P3AT} {MaxSpeed 8.17}",
        "CONF {Name P3AT} {Type GroundVehicle} {MaxSpeed 1.2999}",
    ],
    ids=["compat", "udk"],
)
def test_configuration_of_a_robot_is_kept_once_whatever_comes_first(conf: str) -> None:
    events: list[RunEvent] = []
    recorder = WireRecorder(events.append)
    recorder.begin(1, "R1")
    for time in (0.1, 0.2):
        recorder.received(1, f"STA {{Time {time}}}\r\n{conf}\r\n".encode())
    told = [each.data.decode() for each in events if each.type is EventType.ROBOT]
    assert told == ["R1\r\n", f"R1\r\n{conf}\r\n"]
