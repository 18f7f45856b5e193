"""Lines of servers of all generations; that ours are undone is tested with encoding."""

from math import isnan, pi

import numpy as np
import pytest

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import (
    EchoLine,
    Encoder,
    Greeting,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    StartPoses,
    Status,
    Tachometer,
    Touch,
    decode_report,
)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        pytest.param(
            "NFO {Gametype BotDeathMatch} {Level DM-Yard} {TimeLimit 20}",
            Greeting("DM-Yard"),
            id="greeting",
        ),
        pytest.param("NFO {Level }", Greeting(""), id="a map without a name"),
        pytest.param(
            "NFO {StartPoses 2} {A 1,2,3 0,0,1.57 B 0,0,0 0,0,4}",
            StartPoses(
                (
                    ("A", Pose3(1, -2, -3, 0, 0, -1.57)),
                    ("B", Pose3(0, 0, 0, 0, 0, 2 * pi - 4)),
                )
            ),
            id="start poses",
        ),
        pytest.param("NFO {StartPoses 0}", StartPoses(()), id="no start pose"),
        pytest.param(
            "STA {Type LeggedRobot} {Time 4.5} {Battery 12.7} {LightToggle true}",
            Status(4.5, 12, True),
            id="status",
        ),
        pytest.param(
            "STA {Time 4.5}", Status(4.5, 0, False), id="status of nothing but time"
        ),
        pytest.param(
            "SEN {Time 1} {Type groundtruth} {Name G} {Location 1 2 3}"
            " {Orientation 0, 0, 6.0}",
            GroundTruth(1, "G", Pose3(1, -2, -3, 0, 0, 2 * pi - 6)),
            id="whole turns, blanks, any case",
        ),
        pytest.param(
            "SEN {Type Odometry} {Pose 1,2,7} {Time 3}",
            Odometry(3, "", Pose2(1, -2, -7)),
            id="odometry of no name counts turns",
        ),
        pytest.param(
            "SEN {Time 2} {Type Tachometer} {Name T} {Vel 1} {Pos 2, 3}",
            Tachometer(2, "T", (1.0,), (2.0, 3.0)),
            id="wheels",
        ),
        pytest.param(
            "SEN {Time 2} {Type Encoder} {Name ECLeft} {Tick -50} {Name R} {Tick 3}",
            Encoder(2, (("ECLeft", -50), ("R", 3))),
            id="encoders",
        ),
        pytest.param(
            "SEN {Time 2} {Type Encoder}", Encoder(2, ()), id="no encoder at all"
        ),
        pytest.param(
            "SEN {Time 2} {Type Touch} {Name T} {Touch true}",
            Touch(2, "T", True),
            id="touch",
        ),
    ],
)
def test_what_other_servers_write(line: str, expected: Report) -> None:
    assert decode_report(line) == expected


def test_a_time_that_is_missing_is_not_a_number() -> None:
    read = decode_report("SEN {Type INS} {Name I} {Location 1,2,3} {Orientation 0,0,0}")
    assert isinstance(read, Ins)
    assert isnan(read.time)


@pytest.mark.parametrize(
    "ranges",
    [
        pytest.param("1.5,2,3.25", id="commas"),
        pytest.param("1.5, 2, 3.25", id="commas and blanks"),
        pytest.param("1.5 2 3.25", id="blanks"),
        pytest.param("1.5,2,3.25,", id="a comma at the end"),
    ],
)
def test_ranges_are_read_however_they_are_separated(ranges: str) -> None:
    read = decode_report(
        f"SEN {{Range {ranges}}} {{FOV 2}} {{Resolution 1}} {{Type RangeScanner}}"
    )
    assert isinstance(read, RangeScan)
    assert np.array_equal(read.ranges, [1.5, 2, 3.25])
    assert (read.name, read.resolution, read.fov) == ("", 1, 2)


@pytest.mark.parametrize(
    "line",
    [
        pytest.param("RES {Type Camera}", id="other verb"),
        pytest.param("NFO {Gametype Nothing}", id="nothing in the info"),
        pytest.param("SEN {Time 1} {Type Sonar} {Name F1 Range 2}", id="other sensor"),
        pytest.param("SEN {Time 1}", id="no sensor"),
        pytest.param("hello", id="a word"),
    ],
)
def test_what_is_not_known_is_nothing(line: str) -> None:
    assert decode_report(line) is None


SCAN = "SEN {Time 1} {Type RangeScanner} {Name S} {Resolution 1}"
ECHOES = "SEN {Type Echoes} {Line 1} {Lines 1} {Object a} {Material b} {Density 1}"
ECHOES += " {Transparency 1} {LaserPasses False} {RobotPasses False}"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        pytest.param("{Type}", "expected a verb", id="no verb"),
        pytest.param("SEN {Type INS", "expected '}'", id="open brace"),
        pytest.param(
            f"{SCAN} {{Range 1}}", "expected a field '{FOV ...}'", id="no FOV"
        ),
        pytest.param(f"{SCAN} {{FOV 1}} {{Range }}", "'{Range ...}'", id="no ranges"),
        pytest.param(
            f"{SCAN} {{FOV 1}} {{Range 1,nan}}",
            "SEN Range: '1,nan', expected numbers",
            id="no number",
        ),
        pytest.param(
            f"{SCAN} {{FOV 1}} {{Range 1.2.3}}", "expected numbers", id="two points"
        ),
        pytest.param(f"{SCAN} {{FOV 1}} {{Range ,}}", "expected numbers", id="a comma"),
        pytest.param(
            f"{SCAN} {{FOV 1}} {{Range 1,1e10}}", "at most 1e.09 each", id="too far"
        ),
        pytest.param(
            f"{SCAN} {{FOV 1}} {{Range -1e10}}", "at most 1e.09 each", id="far behind"
        ),
        pytest.param("STA {Time soon}", "STA Time: 'soon', expected a num", id="time"),
        pytest.param(
            "NFO {StartPoses 1} {A 1,2,3}",
            r"start poses 'A 1,2,3', expected 'name x,y,z roll,pitch,yaw'",
            id="half a start pose",
        ),
        pytest.param(
            "NFO {StartPoses 1} {A 1,2,3 1,2}", "'1,2', expected 3", id="two angles"
        ),
        pytest.param("SEN {Type Touch} {Name T}", "'{Touch ...}'", id="no touch"),
        pytest.param(
            "SEN {Type Encoder} {Tick 1} {Tick}", "'{Tick ...}'", id="no tick"
        ),
        pytest.param(
            f"{ECHOES} {{Echoes 1,2,Hit,1}}",
            "echo '1,2,Hit,1', expected five parts",
            id="short echo",
        ),
        pytest.param(
            f"{ECHOES} {{Echoes 1,,Hit,1,1}}",
            "expected four numbers in it",
            id="echo of no range",
        ),
        pytest.param(f"{ECHOES} {{Echoes }}", "'{Echoes ...}'", id="empty echoes"),
    ],
)
def test_what_is_known_and_unreadable_is_refused(line: str, message: str) -> None:
    with pytest.raises(MalformedMessage, match=message):
        decode_report(line)


def test_echoes_of_names_with_blanks() -> None:
    line = ECHOES.replace("Object a", "Object box of tin") + " {Echoes 3,2.5,Hit,1,0.5}"
    read = decode_report(line)
    assert isinstance(read, EchoLine)
    assert isnan(read.time)
    assert read.echoes is not None
    assert (read.echoes.object, read.echoes.kinds) == ("box of tin", ("hit",))
    assert read.echoes.beams.tolist() == [3]
    assert read.echoes.beams.dtype == np.int64
    assert read.echoes.ranges.tolist() == [2.5]
