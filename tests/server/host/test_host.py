"""What a client receives from the host in the ``compat`` dialect."""

import re
import tracemalloc
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from host_client import GREETING, STARTS

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import load_robot, robot_names
from radarsim.protocol.reports import GroundTruth, Ins, decode_report
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene, StartPose
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

INIT = b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\r\n"
GEO = (
    b"GEO {Type GroundVehicle} {Name P3AT} {Dimensions 0.5520,0.4970,0.4600} "
    b"{COG 0.0000,0.0000,0.0000} {WheelRadius 0.0980} {WheelSeparation 0.3600} "
    b"{WheelBase 0.2480}\r\n"
)


@pytest.fixture
def host(empty_room: Scene) -> Host:
    return Host(empty_room)


def connected(host: Host) -> int:
    number = host.connect()
    host.take(number)
    return number


def spawned(host: Host, init: bytes = INIT) -> int:
    number = connected(host)
    reported = host.receive(number, init)
    assert [each for each in reported if each.kind != "outside"] == []
    assert host.has_robot(number)
    return number


def run_ticks(host: Host, ticks: int) -> None:
    for _ in range(ticks):
        host.step()


def heads(data: bytes) -> list[str]:
    """Return the verb of each line, or the type of a reading."""
    lines = data.decode("ascii").split("\r\n")[:-1]
    return [
        re.findall(r"{Type (\w+)}", line)[0] if line.startswith("SEN") else line[:3]
        for line in lines
    ]


def test_client_is_greeted_once_and_at_once(host: Host) -> None:
    number = host.connect()
    assert host.unsent_bytes(number) == len(GREETING)
    assert host.take(number) == GREETING
    host.receive(number, INIT)
    run_ticks(host, 30)
    assert b"Gametype" not in host.take(number)


def test_only_clients_with_bytes_are_to_be_sent_something(host: Host) -> None:
    silent, asking, driving = connected(host), connected(host), connected(host)
    assert host.clients_to_send() == []
    host.receive(asking, b"GETSTARTPOSES\r\n")
    assert host.clients_to_send() == [asking]
    host.receive(driving, INIT)
    run_ticks(host, 10)
    assert host.clients_to_send() == [asking, driving]
    for number in (silent, asking, driving):
        host.take(number)
    assert host.clients_to_send() == []


def test_what_editors_and_telnet_send_is_skipped_and_utf_16_is_an_error(
    host: Host,
) -> None:
    telnet = b"\xff\xfb\x1f\xff\xf1"
    number = connected(host)
    assert host.receive(number, telnet) == []
    assert host.receive(number, b"GETSTARTPOSES\r\n\0" * 3) == []
    assert host.take(number) == STARTS * 3
    number = connected(host)
    host.receive(number, "GETSTARTPOSES\r\n".encode("utf-16-le"))
    assert host.take(number).startswith(b"NFO {Error verb 'G")
    web = connected(host)
    host.receive(web, telnet + b"GET / HTTP/1.1\r\n")
    assert host.close_reason(web) == "an HTTP request, expected commands"


def test_start_poses_are_sent_at_once_without_a_robot(host: Host) -> None:
    number = connected(host)
    assert host.receive(number, b"GETSTARTPOSES\r\n") == []
    assert host.take(number) == STARTS
    run_ticks(host, 100)
    assert host.take(number) == b""
    assert host.simulation.vehicles == ()


def test_replies_wait_for_the_tick_when_there_is_a_robot(host: Host) -> None:
    number = spawned(host)
    host.receive(number, b"GETGEO {Type Robot}\r\n")
    assert host.take(number) == b""
    host.step()
    assert host.take(number) == GEO


def test_requests_in_the_packet_of_init_are_answered(host: Host) -> None:
    number = connected(host)
    asked = b"GETSTARTPOSES\r\n" + INIT + b"GETGEO {Type Robot} {Name R1}\r\n"
    host.receive(number, asked)
    host.step()
    assert host.take(number) == STARTS + GEO


def test_write_is_status_replies_poses_other_readings_scan(host: Host) -> None:
    number = spawned(host)
    run_ticks(host, 9)
    assert host.take(number) == b""
    host.receive(number, b"GETGEO {Type Robot}\r\nGETSTARTPOSES\r\n")
    host.step()
    assert heads(host.take(number)) == [
        *("STA", "GEO", "NFO", "GroundTruth", "INS", "Odometry", "Tachometer"),
        *("Encoder", "Encoder", "Touch", "RangeScanner"),
    ]


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (
            b"DRVE {Left 1}",
            "verb 'DRVE' (did you mean 'DRIVE'?), expected one of ['ACT', ",
        ),
        (
            b"INIT {ClassName USARBot.KR6} {Location .4, .4, 1.8}",
            f"robot class 'KR6', expected one of {list(robot_names())}",
        ),
        (b"DRIVE {Left 1} {Right 1}", "DRIVE without a robot, expected INIT"),
        (b"GETSTARTPOSES {Which all}", "GETSTARTPOSES field 'Which', expected none"),
    ],
)
def test_invalid_command_gives_a_diagnostic_and_no_effect(
    host: Host, line: bytes, text: str
) -> None:
    number = connected(host)
    (diagnostic,) = host.receive(number, line + b"\r\n")
    assert diagnostic.text.startswith(text)
    run_ticks(host, 20)
    assert host.take(number) in (b"", STARTS)
    assert host.receive(number, b"GETSTARTPOSES\r\n") == []
    assert host.take(number) == STARTS
    assert host.simulation.vehicles == ()


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("DRIVE {Left 1}", "DRIVE without Right, expected Left and Right"),
        (
            "DRIVE {Left 1} {Rigth 1}",
            "DRIVE field 'Rigth' (did you mean 'Right'?), expected one of ['Left', ",
        ),
        (
            "DRIVE {Speed 1} {FrontSteer .2} {rearsteer 0}",
            "DRIVE with FrontSteer of P3AT, which is skid-steered, expected Left",
        ),
        (
            "DRIVE {Propeller 1} {Rudder .2}",
            "DRIVE field 'Propeller', expected one of ['Left', ",
        ),
        ("MULTIDRIVE {FRFlipper 1}", "not supported: MULTIDRIVE"),
        (
            "GETGEO {Type RangeScanner} {Name Scanner1}",
            "GETGEO of RangeScanner 'Scanner1', expected one of ['lms200']",
        ),
        (
            "GETCONF {Type Enc} {Name W1}",
            "GETCONF of type 'Enc' (did you mean 'Encoder'?), expected one of ['Robot'",
        ),
        ("GETCONF {Type actuator}", "GETCONF of type 'actuator', expected one of"),
        (
            "SET {Type Joint} {Name FRFlipper} {Opcode Stiffness} {Params 1}",
            "opcode 'Stiffness', expected one of ['Angle', 'Target']",
        ),
        (
            "SET {Type Joint} {Name FRFlipper} {Opcode Angle} {Params up}",
            "SET Angle: 'up', expected a number",
        ),
        ("SET {Type Effecter} {Grip 1}", "'SET {Type Effecter} {Grip 1}', expected a"),
        ("SET {Type INS} {Opcode MOVE}", "opcode 'MOVE', expected one of ['SCAN', "),
        (
            "SET {Type INS} {Opcode POSE} {Params 1,2,3}",
            "SET POSE: '1,2,3', expected 6 numbers",
        ),
    ],
)
def test_command_that_does_not_fit_the_robot_gives_a_diagnostic(
    host: Host, line: str, text: str
) -> None:
    number = spawned(host)
    (diagnostic,) = host.receive(number, line.encode() + b"\r\n")
    assert diagnostic.text.startswith(text)
    run_ticks(host, 20)
    sent = host.take(number)
    assert b"-8.0000,0.0000,-0.1460" in sent
    assert b"{LightToggle True}" not in sent
    assert set(heads(sent)) <= {
        *("STA", "GroundTruth", "INS", "Odometry", "Tachometer"),
        *("Encoder", "Touch", "RangeScanner"),
    }


@pytest.mark.parametrize(
    "line",
    [
        b"DRIVE {Speed 0}",
        b"DRIVE {name r1} {Left 1} {Right 1}",
        b"DRIVE {Left 1} {SPEED 2} {Right 1}",
        b"DRIVE {Left 0} {Right 0} {Speed 0} {AltitudeVelocity 0}",  # of Iridium
    ],
)
def test_needless_fields_of_drive_are_no_news(host: Host, line: bytes) -> None:
    number = spawned(host)
    assert host.receive(number, line + b"\r\n") == []
    run_ticks(host, 20)
    is_driven = b"Left 1" in line
    assert (host.simulation.vehicles[0].robot.pose.x > -8) is is_driven


def test_unknown_key_does_not_affect_the_others(host: Host) -> None:
    number = spawned(host)
    host.receive(number, b"DRIVE {Light True} {Beep 1} {Left 1} {Right 1}\r\n")
    run_ticks(host, 20)
    assert b"{LightToggle True}" in host.take(number)
    assert host.simulation.vehicles[0].robot.pose.x > -8


def test_drive_holds_until_it_is_changed(host: Host) -> None:
    number = spawned(host)
    host.receive(number, b"Drive {left 2,0} {RIGHT +2}\n\r")
    run_ticks(host, 300)
    pose = host.simulation.vehicles[0].robot.pose
    assert pose.x == pytest.approx(-8 + 2 * 0.098 * 3)
    host.receive(number, b"DRIVE {Light True}\r\nDRIVE {Flip true}\r\n")
    run_ticks(host, 100)
    pose = host.simulation.vehicles[0].robot.pose
    assert pose.x == pytest.approx(-8 + 2 * 0.098 * 4)


@pytest.mark.parametrize(
    ("fields", "pose"),
    [
        ("{Location 1,2,-2.25} {Rotation 0,0,1.5}", (1, -2, -1.5)),
        ("{Name 7}", (0, 0, 0)),
        ("{Name } {Start robotSTART2}", (-8, 3.5, 0)),
        ("{Start RobotStart3} {Location 1,1,1}", (-8, -3.5, 0)),
    ],
)
def test_robot_is_spawned_at_the_pose_of_init(
    host: Host, fields: str, pose: tuple[float, float, float]
) -> None:
    init = f"INIT {{Classname USARBot.p3at}} {fields} \n\r"
    spawned(host, init.encode())
    robot = host.simulation.vehicles[0].robot
    assert (robot.pose.x, robot.pose.y, robot.pose.yaw) == pytest.approx(pose)
    assert robot.body.z == pytest.approx(0.146)


def test_unknown_start_is_the_origin_with_a_diagnostic(host: Host) -> None:
    number = connected(host)
    (diagnostic,) = host.receive(number, b"INIT {ClassName P3AT} {Start Nowhere}\r\n")
    assert diagnostic.kind == "start"
    assert diagnostic.text == (
        "start 'Nowhere', expected one of ['RobotStart1', 'RobotStart2', 'RobotStart3']"
        "; the origin is used"
    )
    assert host.simulation.vehicles[0].robot.pose.x == 0


def test_misspelt_field_is_reported_with_its_effect(host: Host) -> None:
    spawned(host, b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    number = connected(host)
    run_ticks(host, 100)
    init = b"INIT {ClassName P3AT} {Strat RobotStart1}\r\n"
    (diagnostic,) = host.receive(number, init)
    assert diagnostic.kind == "INIT fields, moved"
    assert "INIT field 'Strat' (did you mean 'Start'?), expected" in diagnostic.text
    assert "]; INIT: robot moved from (0.00, 0.00)" in diagnostic.text


def test_init_inside_a_wall_takes_the_nearest_free_place(host: Host) -> None:
    number = connected(host)
    (diagnostic,) = host.receive(
        number, b"INIT {ClassName P3AT} {Location 10.4,1,0}\r\n"
    )
    assert diagnostic.kind == "moved"
    assert re.fullmatch(
        r"INIT: robot moved from \(10\.40, -1\.00\) to \([0-9.]+, -[0-9.]+\), "
        "the nearest free place",
        diagnostic.text,
    )
    pose = host.simulation.vehicles[0].robot.pose
    assert abs(pose.x - 10.4) + abs(pose.y + 1) < 1


def test_spawns_are_spread_over_ticks(host: Host) -> None:
    numbers = [connected(host) for _ in range(30)]
    for i, number in enumerate(numbers):
        place = f"{{Location {-9 + 1.2 * (i % 6):.1f},{-3 + i // 6 * 1.2:.1f},0}}"
        host.receive(number, f"INIT {{ClassName P3AT}} {place}\r\n".encode())
    counts = [len(host.simulation.vehicles)]
    while counts[-1] < len(numbers):
        host.step()
        counts.append(len(host.simulation.vehicles))
        assert counts[-1] - counts[-2] <= counts[0] < len(numbers) / 2


def test_client_that_sends_no_more_gets_the_replies_of_the_tick(host: Host) -> None:
    number = connected(host)
    host.receive(number, INIT + b"GETGEO {Type Robot}\r\n" * 5)
    assert host.finish(number).count(b"GEO ") == 5
    assert host.finish(number) == b""


def test_floods_of_all_clients_together_are_limited_in_a_tick(
    empty_room: Scene,
) -> None:
    executed: list[int] = []
    for flood in (
        b"GETSTARTPOSES\r\n",
        b"FOO\r\n",  # which needs a suggestion
        b"DRIVE {Foo 1}\r\n",
        b"SET {Type INS} {Opcode RESET}\r\n",
        b"F" * 5000 + b"\r\n",
    ):
        host = Host(empty_room)
        numbers = [connected(host) for _ in range(50)]
        for number in numbers:
            host.receive(number, flood * 100)
            host.take(number)
        counts = set()
        for _ in range(5):
            diagnostics = host.step()
            replies = sum(host.take(n).count(b"StartPoses") for n in numbers)
            counts.add(len(diagnostics) + replies)
        executed += counts
    light, *heavy = executed  # as many in each tick
    assert len(heavy) == 4
    assert 0 < max(heavy) < light / 2 < 50


def test_clients_whose_commands_wait_take_turns(host: Host) -> None:
    numbers = [connected(host) for _ in range(100)]
    host.receive(numbers[0], b"GETSTARTPOSES\r\n" * 20)
    for number in numbers:
        host.take(number)
        host.receive(number, b"FOO\r\n" * 100)
    served: Counter[int] = Counter()
    for _ in range(60):
        served.update(number for number, _ in host.step())
    assert max(served.values()) - min(served.values()) <= 1
    assert len(served) == len(numbers)


def test_flood_of_others_does_not_delay_a_command(host: Host) -> None:
    number = spawned(host)
    flooding = [connected(host) for _ in range(50)]
    for other in flooding:
        host.receive(other, b"GETSTARTPOSES\r\n" * 1000)
    for _ in range(10):
        host.step()
        for other in flooding:
            host.receive(other, b"GETSTARTPOSES\r\n" * 10)
        host.receive(number, b"GETGEO {Type Robot}\r\n")
        assert not host.is_busy(number)
    assert host.finish(number).count(GEO) == 10


def test_bursts_of_others_in_the_same_tick_do_not_delay_a_command(host: Host) -> None:
    number = spawned(host)
    for _ in range(10):
        host.step()
        for other in [connected(host) for _ in range(10)]:
            host.receive(other, b"GETSTARTPOSES\r\n" * 20)
        host.receive(number, b"GETGEO {Type Robot}\r\n")
        assert not host.is_busy(number)
    assert host.finish(number).count(GEO) == 10


def test_first_commands_of_all_clients_in_a_tick_are_limited(host: Host) -> None:
    numbers = [connected(host) for _ in range(300)]
    host.receive(numbers[0], b"GETSTARTPOSES\r\n")  # the reply is kept for the others
    host.step()
    for number in numbers:
        host.receive(number, b"GETSTARTPOSES\r\n")
    waits = [host.is_busy(n) for n in numbers]
    assert waits == sorted(waits)
    assert 50 < sum(waits) < 250


def test_replies_of_a_class_do_not_depend_on_what_others_have_asked(
    empty_room: Scene,
) -> None:
    questions = [
        *(b"GETGEO {Type Robot}\r\n", b"GETCONF {Type Robot}\r\n"),
        *(b"GETCONF {Type RangeScanner}\r\n", b"GETCONF {Type rangescanner}\r\n"),
        *(b"GETGEO {Type INS} {Name }\r\n", b"GETGEO {Type INS} {Name Ins}\r\n"),
    ]

    def replies(host: Host, robot: bytes, place: bytes) -> bytes:
        number = spawned(
            host, b"INIT {ClassName %b} {Location %b}\r\n" % (robot, place)
        )
        host.take(number)
        for question in questions:
            host.receive(number, question)
            host.step()
        lines = host.take(number).split(b"\r\n")
        return b"".join(line for line in lines if line[:3] in (b"GEO", b"CON"))

    for robot in (b"P3AT", b"P2DX"):
        asked = Host(empty_room)
        replies(asked, b"P2DX", b"5,0,0")
        replies(asked, b"P3AT", b"0,0,0")
        assert replies(asked, robot, b"-5,0,0") == replies(
            Host(empty_room), robot, b"-5,0,0"
        )


def test_memory_for_replies_is_bounded(host: Host) -> None:
    number = spawned(host)

    def ask(questions: range) -> int:
        """Ask, each time in another spelling, and return the memory in use, bytes."""
        for i in questions:
            bits = f"{i:012b}"
            letters = zip("rangescanner", bits, strict=True)
            name = "".join(c.upper() if bit == "1" else c for c, bit in letters)
            host.receive(number, f"GETCONF {{Type {name}}}\r\n".encode())
            if i % 20 == 0:
                host.step()
                host.take(number)
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        full = ask(range(1000))
        growth = ask(range(1000, 2000)) - full
    finally:
        tracemalloc.stop()
    assert growth < 100 * 1000  # bytes; a reply is longer


def test_spawns_pause_after_a_search_for_a_free_place(foliage_room: Scene) -> None:
    host = Host(foliage_room)
    bush = b"INIT {ClassName P3AT} {Location 0.5,1.64,0}\r\n"
    taken = b"INIT {ClassName P3AT} {Start RobotStart1}\r\n"  # a free place is near
    for line in (bush, bush, bush, taken, taken, taken):
        host.receive(connected(host), line)
    reported = [tick for tick in range(100) for _ in host.step()]
    assert len(reported) == 5
    assert min(b - a for a, b in pairwise(reported)) > 1


def test_robots_are_spawned_in_the_order_in_which_they_were_asked_for(
    foliage_room: Scene,
) -> None:
    """One that comes when the pause is over does not go before those that wait."""
    host = Host(foliage_room)
    bush = b"INIT {ClassName P3AT} {Location 0.5,1.64,0}\r\n"
    late, patient, first = (connected(host) for _ in range(3))
    host.receive(first, bush)
    host.receive(patient, INIT)
    while host.is_busy(first):
        host.step()
    assert not host.simulation.vehicles
    while not host.has_robot(late):
        host.receive(late, b"INIT {ClassName P3AT} {Start RobotStart2}\r\n")
        host.step()
        assert host.has_robot(late) <= host.has_robot(patient)


def test_no_robot_is_spawned_without_a_free_place(host: Host) -> None:
    first = connected(host)
    host.receive(first, INIT)
    diagnostics = []
    clients = [connected(host) for _ in range(10)]
    for number in clients:
        run_ticks(host, 50)
        diagnostics += host.receive(number, INIT + b"GETGEO {Type Robot}\r\n")
        while host.is_busy(number):
            diagnostics += [diagnostic for _, diagnostic in host.step()]
    kinds = [diagnostic.kind for diagnostic in diagnostics]
    assert kinds[:3] == ["moved"] * 3
    assert kinds[-2:] == ["no place", "GETGEO without robot"]
    assert not host.has_robot(clients[-1])
    assert diagnostics[-2].text == (
        "INIT at (-8.00, 0.00) in ['R1'], expected a free place within 1 m,"
        " or another start"
    )
    host.disconnect(first)
    run_ticks(host, 200)
    assert host.receive(clients[-1], INIT) == []
    assert host.has_robot(clients[-1])


def test_place_outside_the_map_is_accepted_and_reported(
    empty_room: Scene, tmp_path: Path
) -> None:
    host = Host(empty_room)
    number = connected(host)
    (reported,) = host.receive(number, b"INIT {ClassName P3AT} {Location 300,-2,0}\r\n")
    assert host.has_robot(number)
    assert reported.kind == "outside"
    assert reported.text.startswith(
        "INIT at (300.00, 2.00), which is outside the map: x from -10"
    )
    box = "objects: [{name: a, box: [1, 1, 1], position: [50, 0, 1], material: brick}]"
    (tmp_path / "far.yaml").write_text(f"version: 1\n{box}\n")
    far = Host(load_map(tmp_path / "far.yaml"))
    number = connected(far)
    (reported,) = far.receive(number, b"INIT {ClassName P3AT} {Start Nowhere}\r\n")
    assert reported.kind == "start, outside"
    nothing = Host(Scene("nothing", "DM-Nothing"))
    number = connected(nothing)
    assert nothing.receive(number, b"INIT {ClassName P3AT}\r\n") == []


def test_robots_without_a_client_drive_unheard(host: Host) -> None:
    model, place = load_robot("P2AT"), Pose2(0.0, 0.0, 0.0)
    first = host.simulation.spawn("Alone", model, place)
    number = spawned(host)
    assert first is not None
    first.robot.drive(5.0, 5.0)
    run_ticks(host, 100)
    assert first.robot.pose.x > 0.1
    names = re.findall(rb"{Name (\w+)}", host.take(number))
    assert names
    assert b"Sonar" not in names


def test_disconnect_removes_the_robot_and_frees_its_name(host: Host) -> None:
    first = spawned(host)
    other = connected(host)
    host.receive(other, b"INIT {ClassName P3AT} {Name R1} {Location 0,0,0}\r\n")
    assert [v.robot.name for v in host.simulation.vehicles] == ["R1", "R1_2"]
    host.disconnect(first)
    assert [v.robot.name for v in host.simulation.vehicles] == ["R1_2"]
    spawned(host)
    assert [v.robot.name for v in host.simulation.vehicles] == ["R1_2", "R1"]


def test_default_name_of_a_robot_is_its_class(host: Host) -> None:
    spawned(host, b"INIT {ClassName USARBot.P2DX} {Location 0,0,0}\r\n")
    spawned(host, b"INIT {ClassName USARBot.P2DX} {Location 0,2,0} {Name }\r\n")
    names = [vehicle.robot.name for vehicle in host.simulation.vehicles]
    assert names == ["P2DX", "P2DX_2"]


def test_repeated_init_replaces_the_robot_after_a_cooldown(host: Host) -> None:
    number = connected(host)
    other = INIT.replace(b"P3AT", b"P2AT")
    host.receive(number, INIT * 2 + other + b"DRIVE {Left 1} {Right 1}\r\n")
    assert host.waits_to_spawn(number)
    seen, ticks = [], 0
    while host.is_busy(number):
        seen.append(host.simulation.vehicles[0].number)
        host.step()
        ticks += 1
    assert not host.waits_to_spawn(number)
    assert ticks > 20
    (vehicle,) = host.simulation.vehicles
    assert [*dict.fromkeys(seen), vehicle.number] == [1, 2, 3]
    assert vehicle.model.name == "P2AT"
    assert vehicle.robot.pose.x > -8


def test_commands_beyond_the_limit_wait_for_the_next_ticks(host: Host) -> None:
    number = spawned(host)
    other = spawned(host, b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    drives = b"".join(
        b"DRIVE {Left %d} {Right %d}\r\n" % (k % 9, k % 9) for k in range(1000)
    )
    host.receive(number, drives + b"GETGEO {Type Robot}\r\n")
    assert host.is_busy(number)
    assert not host.is_busy(other)
    ticks = 0
    while host.is_busy(number):
        host.step()
        ticks += 1
    assert 20 < ticks < 200
    assert GEO in host.take(number)


def test_diagnostics_of_delayed_commands_are_returned_by_step(host: Host) -> None:
    number = connected(host)
    at_once = host.receive(number, b"FOO\r\n" * 30)
    later = host.step()
    assert 0 < len(at_once) < 30
    assert len(at_once) + len(later) == 30
    assert {(who, each.kind) for who, each in later} == {(number, "malformed line")}


def test_endless_line_closes_after_the_commands_before_it(host: Host) -> None:
    number = connected(host)
    assert not host.close_reason(number)
    (diagnostic,) = host.receive(number, b"GETSTARTPOSES\r\n" + b"x" * 70_000)
    assert diagnostic.kind == "line"
    assert diagnostic.text == "line of 70000 bytes, expected at most 65536"
    assert host.close_reason(number)
    assert host.take(number) == STARTS
    assert host.receive(number, b"\r\nGETSTARTPOSES\r\n") == []
    assert host.take(number) == b""


@pytest.mark.parametrize(
    "request_line",
    [
        b"POST / HTTP/1.1",
        b"M-SEARCH /{a} HTTP/1.1",
        b"!#$%&'*+.^_`|~0x  /  http/1.1",
        b"\x16\x03\x01\x02\x00 of TLS",
    ],
)
@pytest.mark.parametrize("cut", [0, 3, 20])
def test_http_request_is_closed_and_nothing_after_it_is_executed(
    host: Host, request_line: bytes, cut: int
) -> None:
    number = connected(host)
    data = request_line + b"\r\nHost: a\r\n\r\n" + INIT + b"GETSTARTPOSES\r\n"
    assert host.receive(number, data[:cut]) + host.receive(number, data[cut:]) == []
    assert host.close_reason(number)
    assert "HTTP" in host.close_reason(number)
    host.receive(number, INIT)
    run_ticks(host, 20)
    assert host.take(number) == b""
    assert host.simulation.vehicles == ()


def test_http_request_after_a_command_is_one_bad_line(host: Host) -> None:
    number = spawned(host)
    diagnostics = host.receive(number, b"GET / HTTP/1.1\r\nGETGEO {Type Robot}\r\n")
    assert len(diagnostics) == 1
    host.step()
    assert host.take(number) == GEO
    assert not host.close_reason(number)


def test_client_that_asks_without_reading_must_be_closed(empty_room: Scene) -> None:
    starts = tuple(StartPose(f"RobotStart{n}", Pose3(n, 0, 0)) for n in range(99))
    host = Host(replace(empty_room, starts=starts))
    number = connected(host)
    host.receive(number, b"GETSTARTPOSES\r\n")
    size = host.unsent_bytes(number)
    assert 4000 < size < 4096  # as many as fit into one read
    while host.unsent_bytes(number) + size <= 4 * 2**20:
        assert not host.close_reason(number)
        host.receive(number, b"GETSTARTPOSES\r\n")
        host.step()
    host.receive(number, b"GETSTARTPOSES\r\n")
    assert host.close_reason(number)


def test_client_that_does_not_read_loses_readings_but_no_replies(host: Host) -> None:
    number = spawned(host)
    host.receive(number, b"GETGEO {Type Robot}\r\n")
    run_ticks(host, 2000)
    assert host.dropped_readings(number) > 100
    assert host.unsent_bytes(number) < 270_000
    sent = host.take(number)
    assert sent.startswith(GEO)
    assert b"{Time 20.00}" in sent
    assert b"{Time 5.00}" not in sent
    assert sent.endswith(b"}\r\n")


@pytest.mark.parametrize(
    "order",
    [
        b"SET {Type RangeScanner} {Opcode SCAN}",
        b"set {TYPE rangescanner} {Name LMS200} {Opcode scan} {Params 0}",
    ],
)
def test_set_scan_gives_one_extra_scan_and_no_reply(host: Host, order: bytes) -> None:
    number = spawned(host)
    run_ticks(host, 15)
    host.take(number)
    host.receive(number, order + b"\r\n")
    run_ticks(host, 1)
    assert heads(host.take(number)) == ["RangeScanner"]
    run_ticks(host, 10)
    assert heads(host.take(number)).count("RangeScanner") == 1


def test_set_pose_sets_the_ins_in_the_wire_frame(host: Host) -> None:
    number = spawned(host)
    host.receive(number, b"SET {Type INS} {Opcode POSE} {Params 1,2,-3,0,0,0.5}\r\n")
    run_ticks(host, 10)
    assert (
        b"{Type INS} {Name InsTest} {Location 1.0000,2.0000,-3.0000} "
        b"{Orientation 0.0000,0.0000,0.5000}"
    ) in host.take(number)


def test_poses_that_drift_beyond_the_largest_that_is_commanded_can_be_read(
    empty_room: Scene,
) -> None:
    edge = b"{Location 1e9,1e9,0} {Rotation 0,0,0.785}"
    host = Host(empty_room)
    number = spawned(host, b"INIT {ClassName P3AT} %b\r\n" % edge)
    host.receive(number, b"SET {Type INS} {Opcode POSE} {Params 1e9,1e9,0,0,0,0.7}\r\n")
    host.receive(number, b"DRIVE {Left 8} {Right 8}\r\n")
    run_ticks(host, 100)
    lines = host.take(number).decode("ascii").splitlines()
    reports = [decode_report(line) for line in lines]
    poses = [report.pose for report in reports if isinstance(report, GroundTruth | Ins)]
    assert len(poses) == 20
    assert poses[-2].x > 1e9
    assert poses[-1].x > 1e9


def test_map_without_starts_sends_zero_start_poses(empty_room: Scene) -> None:
    host = Host(replace(empty_room, starts=()))
    number = connected(host)
    host.receive(number, b"GETSTARTPOSES\r\n")
    assert host.take(number) == b"NFO {StartPoses 0}\r\n"
    spawned(host, b"INIT {ClassName P3AT} {Location 1,1,0}\r\n")


def test_configuration_is_that_of_the_simulation(empty_room: Scene) -> None:
    config = SimulationConfig(drive_unit="rev_per_s")
    assert Host(empty_room, config=config).config == config
    with pytest.raises(TypeError, match=r"config .*expected a Simul"):
        Host(empty_room, config={})  # type: ignore[arg-type]
