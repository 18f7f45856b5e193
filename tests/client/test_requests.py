"""Requests to scripted servers that reply little, in simulated time."""

import math
from collections.abc import Callable, Sequence
from math import inf
from typing import Any

import pytest

from radarsim.client import Client, ClientError, ClientTimeout
from radarsim.geometry import Pose3
from radarsim.protocol.reports import (
    Greeting,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    RobotJoined,
    RobotLeft,
    Status,
)

STATUS = "STA {Time 1.00} {Battery 9}"
SCAN = "SEN {Type RangeScanner} {Name S} {Resolution 0.5} {FOV 1.0} {Range 1,2,3}"
INIT = "INIT {ClassName USARBot.P3AT} {FreeStart true}"
OTHER_SCAN = SCAN.replace("Name S", "Name T")
ROBOT_GEO = (
    "GEO {Type GroundVehicle} {Name P3AT} {Dimensions 0.6,0.5,0.4} {COG 0,0,0}"
    " {WheelRadius 0.1} {WheelSeparation 0.4} {WheelBase 0.3}"
)
ROBOT_CONF = "CONF {Type GroundVehicle} {Name P3AT} {MaxSpeed 8}"
GEO = (
    "GEO {Type RangeScanner} {Name S Location 0.2,0,-0.1 Orientation 0,0,0 Mount HARD}"
)
CONF = "CONF {Type RangeScanner} {Name S} {MaxRange 20} {Resolution 0.5} {Fov 1}"
ABOUT_ROBOT = {"GETGEO {Type Robot}": ROBOT_GEO, "GETCONF {Type Robot}": ROBOT_CONF}


class ScriptedServer:
    """A transport to a server with fixed replies and the same reports every 0.1 s."""

    def __init__(self, answers: dict[str, str], chatter: list[str]) -> None:
        self.heard: list[str] = []
        self.closed = False
        self._answers = answers
        self._chatter = chatter
        self._ticks = 0
        self._waiting = ""

    def send(self, data: bytes) -> None:
        for line in data.decode().splitlines():
            self.heard.append(line)
            if line in self._answers:
                self._waiting += self._answers[line] + "\r\n"

    def receive(self, timeout: float) -> bytes:
        until = self.time() + timeout
        while not self._waiting:
            if self.time() >= until:
                raise TimeoutError
            self._ticks += 1
            self._waiting = "".join(f"{line}\r\n" for line in self._chatter)
        data, self._waiting = self._waiting, ""
        return data.encode()

    def time(self) -> float:
        return self._ticks / 10

    def close(self) -> None:
        self.closed = True


def test_all_scanners_are_requested_at_once() -> None:
    answers = ABOUT_ROBOT | {
        "GETGEO {Type RangeScanner}": GEO,
        "GETCONF {Type RangeScanner}": CONF,
    }
    server = ScriptedServer(answers, [SCAN])
    (scanner,) = Client(server).robot_info().scanners
    assert (scanner.mount, scanner.max_range, scanner.beams) == (
        Pose3(0.2, 0, 0.1),
        20,
        3,
    )
    assert server.heard == list(answers)
    assert server.time() == pytest.approx(0.1)


def test_scanners_are_requested_by_name_without_a_reply_for_all() -> None:
    answers = ABOUT_ROBOT | {
        "GETGEO {Type RangeScanner} {Name S}": GEO,
        "GETCONF {Type RangeScanner} {Name S}": CONF,
        "GETGEO {Type RangeScanner} {Name T}": GEO.replace("Name S", "Name T"),
    }
    server = ScriptedServer(answers, [STATUS, SCAN, OTHER_SCAN])
    scanners = Client(server).robot_info().scanners
    assert [s.name for s in scanners] == ["S", "T"]
    assert [s.max_range for s in scanners] == [20, inf]
    assert scanners[0].mount == scanners[1].mount == Pose3(0.2, 0, 0.1)
    assert 4 <= server.time() < 4.5  # for all, and for T


def test_scanner_info_is_taken_from_replies_without_scans() -> None:
    answers = ABOUT_ROBOT | {
        "GETGEO {Type RangeScanner}": GEO,
        "GETCONF {Type RangeScanner}": CONF,
    }
    server = ScriptedServer(answers, [STATUS])
    (scanner,) = Client(server).robot_info().scanners
    assert (scanner.fov, scanner.beams) == (1, 3)
    assert 2 <= server.time() < 2.5
    assert Client(ScriptedServer(ABOUT_ROBOT, [STATUS])).robot_info().scanners == ()


def test_robot_info_times_out_without_the_robot_configuration() -> None:
    del (answers := dict(ABOUT_ROBOT))["GETCONF {Type Robot}"]
    server = ScriptedServer(answers, [STATUS])
    with pytest.raises(ClientTimeout, match=r"no CONF of Robot within 3 s, .* 'STA"):
        Client(server, timeout=3).robot_info()
    assert 3 <= server.time() < 3.2


def test_timeout_holds_while_other_reports_arrive() -> None:
    server = ScriptedServer({}, [STATUS, SCAN])
    client = Client(server)
    with pytest.raises(ClientTimeout, match=r"no Odometry of 'Odo' within 1\.5 s"):
        client.wait_for(Odometry, name="Odo", timeout=1.5)
    with pytest.raises(ClientTimeout, match="no start poses within 5 s"):
        client.start_poses()
    assert server.time() == pytest.approx(6.5)


def test_reports_around_the_awaited_one_can_still_be_read() -> None:
    client = Client(ScriptedServer({}, [SCAN, STATUS, OTHER_SCAN]))
    assert client.wait_for(Status).battery == 9
    assert [scan.name for scan in client.read()] == ["S", "T"]  # type: ignore[union-attr]
    assert [type(report) for report in client.read()] == [RangeScan, Status, RangeScan]
    assert client.wait_for(RangeScan, name="T").name == "T"
    assert client.wait_for(RangeScan, name="S").name == "S"


class TellingServer(ScriptedServer):
    """A server that sends lines once, those of one string at a time."""

    def __init__(self, *chunks: str) -> None:
        super().__init__({}, [])
        self._chunks = list(chunks)

    def receive(self, timeout: float) -> bytes:
        if self._chunks:
            return self._chunks.pop(0).replace("\n", "\r\n").encode()
        return super().receive(timeout)


def _odometry(time: float) -> str:
    return f"SEN {{Time {time:.2f}}} {{Type Odometry}} {{Name O}} {{Pose {time},0,0}}\n"


def _scan(time: float) -> str:
    return SCAN.replace("SEN", f"SEN {{Time {time:.2f}}}") + "\n"


def test_a_wait_for_one_type_loses_no_other() -> None:
    joined = "NFO {Joined R1} {ClassName P3AT}\nNFO {Joined R2} {ClassName P3AT}\n"
    client = Client(TellingServer(joined + _odometry(1), _scan(1), _scan(2)))
    assert client.wait_for(RangeScan).time == 1
    assert client.wait_for(Odometry).time == 1
    robots = [client.wait_for(RobotJoined).robot for _ in range(2)]
    assert robots == ["R1", "R2"]
    assert client.wait_for(RangeScan).time == 2
    with pytest.raises(ClientTimeout, match="no RobotJoined within 1 s"):
        client.wait_for(RobotJoined, timeout=1)


def test_of_passed_readings_a_wait_returns_the_newest_and_read_returns_all() -> None:
    chunks = [_odometry(time) + _scan(time) for time in range(1, 6)]
    client = Client(TellingServer(*chunks))
    for time in range(1, 4):
        assert client.wait_for(RangeScan).time == time
    assert client.wait_for(Odometry).time == 3
    assert client.wait_for(RangeScan).time == 4
    assert client.wait_for(RangeScan).time == 5
    times = [report.time for report in client.read()]  # type: ignore[union-attr]
    assert times == [4, 5]


def test_unread_scans_of_a_burst_are_returned_one_by_one() -> None:
    burst = "".join(_odometry(time) + _scan(time) for time in range(1, 4))
    client = Client(TellingServer(burst))
    assert [client.wait_for(RangeScan).time for _ in range(3)] == [1, 2, 3]


def test_reports_that_nobody_reads_do_not_fill_the_memory() -> None:
    chatter = [_odometry(time) + f"NFO {{Left R{time}}}\n" for time in range(1500)]
    client = Client(TellingServer("NFO {Left first}\n", *chatter))
    with pytest.raises(ClientTimeout):
        client.wait_for(RangeScan, timeout=1)
    reports = client.read()
    assert len(reports) <= 1000
    assert reports[-1] == RobotLeft("R1499")


def test_errors_of_settings_are_raised_by_the_call_that_caused_them() -> None:
    set_it = "SET {Type RangeScanner} {Name S} {Opcode SETTING} {Params %s=1}"
    error = "NFO {Error SET SETTING: sensor S: %s: 1, expected no such thing}"
    poses = "NFO {StartPoses 1} {S 0,0,0 0,0,0}"
    answers = {set_it % "odd": error % "odd", "GETSTARTPOSES": poses}
    answers[(set_it % "odd").replace("SETTING", "setting")] = error % "odd"
    server = ScriptedServer(answers, [SCAN])
    client = Client(server)
    with pytest.raises(ClientError, match=r"^SET SETTING: sensor S: odd: 1, ex"):
        client.change_settings("S", odd=1)
    client.change_settings("S", even=1)
    params = {"kind": "RangeScanner", "name": "S", "params": "odd=1"}
    with pytest.raises(ClientError, match="sensor S: odd"):
        client.set_item(opcode="setting", **params)
    assert set_it % "even" in server.heard
    # Nothing is left over that a later call would take for its answer.
    assert [type(report) for report in client.read()] == [RangeScan]


class LateServer(ScriptedServer):
    """A server that holds its answers back until it is asked to send them."""

    def __init__(self, answers: dict[str, str]) -> None:
        super().__init__(answers, [SCAN])
        self.is_late = True
        self._held = ""

    def receive(self, timeout: float) -> bytes:
        if self.is_late:
            self._held, self._waiting = self._held + self._waiting, ""
        else:
            self._held, self._waiting = "", self._held + self._waiting
        return super().receive(timeout)


@pytest.mark.parametrize("call", ["settings", "start poses"])
def test_late_answer_of_a_call_that_timed_out_is_not_that_of_the_next_one(
    call: str,
) -> None:
    set_it = "SET {Type RangeScanner} {Name S} {Opcode SETTING} {Params %s=1}"
    error = "NFO {Error SET SETTING: %s: 1, expected no such thing}"
    answers = {set_it % key: error % key for key in ("odd", "strange")}
    answers["GETSTARTPOSES"] = "NFO {StartPoses 1} {S 0,0,0 0,0,0}"
    server = LateServer(answers)
    client = Client(server)
    with pytest.raises(ClientTimeout):
        client.change_settings(
            "S", odd=1
        ) if call == "settings" else client.start_poses()
    server.is_late = False
    client.change_settings("S", even=1)
    with pytest.raises(ClientError, match=r"^SET SETTING: strange: 1, exp"):
        client.change_settings("S", strange=1)
    assert [type(report) for report in client.read()] == [RangeScan]


@pytest.mark.parametrize(
    ("pose", "place"),
    [
        ((1, 2), "1.0,-2.0,0.0} {Rotation 0.0,0.0,0.0}"),
        ([1, 2, 0.5], "1.0,-2.0,0.0} {Rotation 0.0,0.0,-0.5}"),
        ((1, 2, 3, 0.1, 0.2, 0.3), "1.0,-2.0,-3.0} {Rotation 0.1,-0.2,-0.3}"),
    ],
)
def test_pose_can_be_numbers(pose: Sequence[float], place: str) -> None:
    init = f"INIT {{ClassName USARBot.P3AT}} {{Location {place}"
    server = ScriptedServer({init: STATUS}, [])
    Client(server).spawn("P3AT", pose=pose)
    assert server.heard == [init]


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (
            (1,),
            r"^pose \(1,\), expected a Pose2, a Pose3, x, y or x, y, yaw, or six num",
        ),
        ((1, math.nan), r"^pose \(1, nan\), expected a Pose2"),
        (7, r"^pose 7, expected a Pose2"),
    ],
)
def test_wrong_poses_are_reported(pose: Any, message: str) -> None:
    server = ScriptedServer({}, [])
    with pytest.raises(ValueError, match=message):
        Client(server).spawn("P3AT", pose=pose)
    assert server.heard == []


@pytest.mark.parametrize("kind", ["RangeScan", 3])
def test_wrong_classes_of_reports_are_reported(kind: Any) -> None:
    with pytest.raises(TypeError, match=r"^kind .*, expected a class of reports such"):
        Client(ScriptedServer({}, [])).wait_for(kind)


def test_loop_over_a_client_yields_all_reports_until_it_is_closed() -> None:
    client = Client(TellingServer(_odometry(1) + _scan(1) + _odometry(2), _scan(2)))
    kinds = []
    for report in client:
        kinds.append(type(report))
        if len(kinds) == 2:
            break  # the rest is still there
    assert kinds == [Odometry, RangeScan]
    assert client.wait_for(Odometry).time == 2
    for report in client:
        assert isinstance(report, RangeScan)
        assert report.time == 2
        client.close()
    assert list(client) == []


def test_newest_report_of_a_type_has_been_read_or_not() -> None:
    client = Client(TellingServer(_odometry(1) + _scan(1), _scan(2)))
    assert client.newest(RangeScan) is None
    assert client.wait_for(Odometry).time == 1
    newest = client.newest(RangeScan)
    assert newest is not None
    assert newest.time == 1
    assert client.wait_for(RangeScan) is newest
    client.read()
    assert client.newest(RangeScan) is not newest
    assert client.newest(Ins) is None


def test_refused_watch_raises() -> None:
    watch = "WATCH {Robots All}"
    refusal = "NFO {Error WATCH of one watcher more, expected at most 16}"
    client = Client(ScriptedServer({watch: refusal}, [SCAN]))
    with pytest.raises(ClientError, match=r"^WATCH of one watcher more"):
        client.watch()
    with pytest.raises(ClientTimeout, match="no answer to WATCH within 5 s"):
        Client(ScriptedServer({}, [SCAN])).watch()


def test_first_reports_of_a_robot_can_be_read_after_spawn() -> None:
    client = Client(
        ScriptedServer({INIT: f"NFO {{Level a}}\r\n{STATUS}\r\n{SCAN}"}, [])
    )
    client.spawn("P3AT")
    assert [type(report) for report in client.read()] == [Status, RangeScan]
    assert client.greeting() == Greeting("a")


def test_first_start_of_the_map_is_the_default() -> None:
    poses = "NFO {StartPoses 2} {A 1,2,0 0,0,0 B 3,4,0 0,0,0}"
    init = INIT.replace(" {Free", " {Start A} {Free")
    server = ScriptedServer({"GETSTARTPOSES": poses}, [STATUS])
    client = Client(server)
    client.spawn("P3AT")
    client.spawn("P3AT")
    assert server.heard == ["GETSTARTPOSES", init, init, "GETSTARTPOSES"]


def test_what_is_unread_of_the_robot_before_is_not_of_the_next_one() -> None:
    truth = "SEN {Type GroundTruth} {Name G} {Location %d,0,0} {Orientation 0,0,0}"
    init = INIT.replace(" {Free", " {Start A} {Free")
    poses = "NFO {StartPoses 1} {A 1,2,0 0,0,0}"
    answers = {"GETSTARTPOSES": poses, init: truth % 1}
    server = ScriptedServer(answers, [truth % 3])
    client = Client(server)
    client.spawn("P3AT")
    client.spawn("P3AT")  # after which lines of the first still come
    assert client.wait_for(GroundTruth).pose.x == 3


def test_spawn_clears_the_scans_of_the_previous_robot() -> None:
    client = Client(ScriptedServer({INIT: STATUS}, [SCAN]))
    client.read()
    assert [*client.session.scans] == ["S"]
    client.spawn("P3AT")
    assert not client.session.scans
    assert client.newest(RangeScan) is None


@pytest.mark.parametrize(
    "call",
    [
        lambda client: client.read(1),
        lambda client: client.wait_for(Ins, timeout=1),
        lambda client: client.geometry("INS"),
        lambda client: next(iter(client)),
    ],
)
def test_calls_wait_exactly_the_timeout_when_the_server_is_silent(
    call: Callable[[Client], object],
) -> None:
    server = ScriptedServer({}, [])
    with pytest.raises(ClientTimeout, match="within 1 s, no complete line was"):
        call(Client(server, timeout=1))
    assert server.time() == pytest.approx(1)


def test_robot_is_stopped_when_an_error_leaves_the_context() -> None:
    server = ScriptedServer({INIT: STATUS}, [])

    def drive_into_an_error() -> None:
        with Client(server) as client:
            client.spawn("P3AT")
            client.drive(1, 1)
            client.read()
            client.read(0.5)

    with pytest.raises(ClientError, match=r"no report within 0\.5 s"):
        drive_into_an_error()
    assert server.heard[-1] == "DRIVE {Left 0.0} {Right 0.0}"
    assert server.closed


def test_close_without_a_robot_sends_nothing() -> None:
    server = ScriptedServer({}, [])
    Client(server).close()
    assert server.closed
    assert not server.heard


class BusyServer(ScriptedServer):
    """A server that executes INIT, and what comes after it, only at a certain time."""

    def __init__(self, begins: float, *, has_place: bool = True) -> None:
        super().__init__({}, [])
        self._begins = begins
        self._has_place = has_place
        self._waiting = "NFO {Gametype BotDeathMatch} {Level a} {TimeLimit 0}\r\n"

    def receive(self, timeout: float) -> bytes:
        until = self.time() + timeout
        while not self._waiting and self.time() < until:
            self._ticks += 1
            self._execute()
        return super().receive(0.0)

    def _execute(self) -> None:
        commands, self.heard = self.heard, []
        for line in commands:
            if self.time() < self._begins and (self.heard or line.startswith("INIT")):
                self.heard.append(line)
            elif line == "GETSTARTPOSES":
                self._waiting += "NFO {StartPoses 1} {S 0,0,0 0,0,0}\r\n"
            elif self._has_place:
                self._waiting += f"{STATUS}\r\n"


def test_robot_is_waited_for_while_the_server_is_busy() -> None:
    server = BusyServer(begins=50.0)
    client = Client(server)
    assert [*client.start_poses()] == ["S"]
    client.spawn("P3AT")
    assert server.time() == pytest.approx(50, abs=0.5)
    assert isinstance(client.read()[0], Status)


@pytest.mark.parametrize(
    ("begins", "has_place", "timeout", "text", "ends"),
    [
        (inf, True, None, "within 60 s.* server is busy", 60),
        (inf, True, 7.0, "within 7 s.* server is busy", 7),
        (inf, True, 300.0, "within 300 s.* server is busy", 300),
        (4.0, False, 7.0, "within 7 s.* no free place", 7),
        (297.0, False, 300.0, "within 300 s.* no free place", 300),
        (0.0, False, None, "within 5 s.* no free place", 5),
        (50.0, False, None, "within 5 s.* no free place", 55),
        (0.0, False, 120.0, "within 5 s.* no such class", 7),
    ],
)
def test_wait_for_a_robot_ends(
    begins: float, has_place: bool, timeout: float | None, text: str, ends: float
) -> None:
    """A busy server is given as long as the caller says, or 60 s."""
    server = BusyServer(begins=begins, has_place=has_place)
    with pytest.raises(ClientTimeout, match=text):
        Client(server).spawn("P3AT", timeout=timeout)
    assert server.time() == pytest.approx(ends, abs=0.5)


def test_server_that_answers_no_question_is_not_waited_for() -> None:
    server = BusyServer(begins=inf)
    client = Client(server)
    client.greeting()
    server.send(b"INIT {ClassName P3AT}\r\n")  # which keeps it from answering
    with pytest.raises(ClientTimeout, match="no start poses within 5 s"):
        client.start_poses()
    with pytest.raises(ClientTimeout, match="no reading of the robot 'P3AT' within 5"):
        client.spawn("P3AT")
