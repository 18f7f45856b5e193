"""Echo reports go to the clients that request them and change no other output."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from host_client import DIALECTS, HostClient

from radarsim.protocol.dialect import COMPAT, Dialect
from radarsim.protocol.message import Message, decode_message
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.spawning import SPAWN_COOLDOWN
from radarsim.simulation.config import SimulationConfig

INIT = b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\r\n"
INIT_TWO_SCANNERS = (
    b"INIT {ClassName USARBot.P3AT_Compare} {Name R1} {Start RobotStart1}\r\n"
)
ECHOES_ON = b"SET {Type RangeScanner} {Name lms200} {Opcode ECHOES} {Params true}\r\n"
ECHOES_OFF = ECHOES_ON.replace(b"true", b"false")
DRIVE = b"DRIVE {Left 8} {Right 5}\r\n"
ECHO_TYPE = b"{Type Echoes}"


def spawn_client(
    scene: Scene,
    init: bytes = INIT,
    *,
    dialect: Dialect = COMPAT,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
) -> HostClient:
    config = SimulationConfig(dialect, item_settings=settings or {})
    return HostClient(Host(scene, config=config), init)


def receive_lines(client: HostClient, ticks: int) -> list[bytes]:
    """Let time pass and return the lines, with their line ends."""
    return client.read(ticks).splitlines(keepends=True)


def echoes_in(lines: list[bytes]) -> list[Message]:
    return [decode_message(line.decode("ascii")) for line in lines if ECHO_TYPE in line]


def without_echoes(lines: list[bytes]) -> list[bytes]:
    return [line for line in lines if ECHO_TYPE not in line]


def name_of(message: Message) -> str:
    return message.get("Name") or ""


def echo_values(message: Message) -> list[list[str]]:
    """Return beam, range, kind, power and strength of each echo."""
    return [echo.split(",") for echo in (message.get("Echoes") or "").split()]


def test_requested_echoes_come_before_each_scan(foliage_room: Scene) -> None:
    client = spawn_client(foliage_room)
    assert client.send(ECHOES_ON) == []
    for _ in range(3):
        types = re.findall(rb"{Type (\w+)}", b"".join(receive_lines(client, 10)))
        assert types[-1] == b"RangeScanner"
        count = types.count(b"Echoes")
        assert count > 5
        assert types[:-1] == [
            *(b"GroundVehicle", b"GroundTruth", b"INS", b"Odometry", b"Tachometer"),
            *(b"Encoder", b"Encoder", b"Touch"),
            *[b"Echoes"] * count,
        ]


def test_requested_targets_come_before_each_scan_of_a_detector(
    empty_room: Scene,
) -> None:
    client = spawn_client(empty_room, INIT.replace(b"P3AT", b"P3AT_Navtech"))
    targets_on = ECHOES_ON.replace(b"ECHOES", b"TARGETS")
    assert client.send(targets_on.replace(b"lms200", b"Navtech")) == []
    lines = [each for each in receive_lines(client, 60) if b"{Name Navtech}" in each]
    types = re.findall(rb"{Type (\w+)}", b"".join(lines))
    assert len(types) > 1
    assert types == [b"RadarTargets"] * (len(types) - 1) + [b"RangeScanner"]


@DIALECTS
def test_echo_lines_have_the_time_of_the_scan_and_are_numbered(
    foliage_room: Scene, dialect: Dialect
) -> None:
    client = spawn_client(foliage_room, dialect=dialect)
    client.send(ECHOES_ON)
    lines = receive_lines(client, 20)[:-1] + receive_lines(client, 20)
    scan = decode_message(lines[-1].decode("ascii"))
    found = [m for m in echoes_in(lines) if m.get("Time") == scan.get("Time")]
    assert [int(m.get("Line") or "") for m in found] == [*range(1, len(found) + 1)]
    assert {m.get("Lines") for m in found} == {str(len(found))}
    assert {name_of(m) for m in found} == {"lms200"}


@DIALECTS
def test_echoes_do_not_change_the_other_lines(
    foliage_room: Scene, dialect: Dialect
) -> None:
    asking, silent = (
        spawn_client(foliage_room, INIT_TWO_SCANNERS, dialect=dialect) for _ in range(2)
    )
    asking.send(b"SET {Type RangeScanner} {Opcode ECHOES} {Params true}\r\n")
    for client in (asking, silent):
        client.send(DRIVE + b"GETGEO {Type Robot}\r\n")
    for ticks in (200, 7, 95):
        for client in (asking, silent):
            client.send(b"SET {Type RangeScanner} {Opcode SCAN}\r\n")
        heard = receive_lines(asking, ticks)
        assert echoes_in(heard)
        assert without_echoes(heard) == receive_lines(silent, ticks)


def test_echoes_do_not_change_the_bytes_of_other_clients(foliage_room: Scene) -> None:
    heard = {}
    for asks in (False, True):
        host = Host(foliage_room)
        asker = HostClient(host, INIT)
        bystander = HostClient(host, INIT.replace(b"1}", b"2}"))
        if asks:
            asker.send(ECHOES_ON)
        for client in (asker, bystander):
            client.send(DRIVE)
        heard[asks] = receive_lines(bystander, 250)
        assert bool(echoes_in(receive_lines(asker, 0))) is asks
    assert heard[True] == heard[False]


def test_echoes_can_be_switched_off(foliage_room: Scene) -> None:
    client, silent = spawn_client(foliage_room), spawn_client(foliage_room)
    client.send(ECHOES_ON + ECHOES_ON)
    assert echoes_in(receive_lines(client, 10))
    assert client.send(ECHOES_OFF.replace(b"false", b"FALSE")) == []
    receive_lines(silent, 10)
    assert receive_lines(client, 30) == receive_lines(silent, 30)
    assert client.send(ECHOES_OFF + ECHOES_ON) == []
    assert echoes_in(receive_lines(client, 10))


@DIALECTS
@pytest.mark.parametrize(
    "order",
    [
        b"set {TYPE rangescanner}{opcode echoes}{params TRUE}",
        b"SET {Name } {Type RangeScanner} {Params True} {Opcode Echoes}",
    ],
)
def test_echoes_are_requested_in_any_case_and_order(
    foliage_room: Scene, dialect: Dialect, order: bytes
) -> None:
    client = spawn_client(foliage_room, dialect=dialect)
    assert client.send(order + b"\r\n") == []
    assert echoes_in(receive_lines(client, 20))


@pytest.mark.parametrize(
    ("name", "heard"),
    [
        (b"", {"lms200", "Hokuyo"}),
        (b"{Name lms200}", {"lms200"}),
        (b"{Name HOKUYO}", {"Hokuyo"}),
    ],
)
def test_name_selects_one_scanner(
    foliage_room: Scene, name: bytes, heard: set[str]
) -> None:
    client = spawn_client(foliage_room, INIT_TWO_SCANNERS)
    client.send(ECHOES_ON.replace(b"{Name lms200}", name))
    lines = receive_lines(client, 10)
    assert {name_of(m) for m in echoes_in(lines)} == heard
    assert [line[:40].count(b"RangeScanner") for line in lines[-2:]] == [1, 1]


def test_echoes_are_off_for_the_next_robot(foliage_room: Scene) -> None:
    client = spawn_client(foliage_room)
    client.send(ECHOES_ON)
    assert echoes_in(receive_lines(client, SPAWN_COOLDOWN))
    assert client.send(INIT) == []
    assert echoes_in(receive_lines(client, 30)) == []
    client.send(ECHOES_ON)
    assert echoes_in(receive_lines(client, 10))


@pytest.mark.parametrize(
    ("order", "text"),
    [
        (
            ECHOES_ON.replace(b"true", b"1"),
            "SET ECHOES: '1', expected 'true' or 'false'",
        ),
        (
            ECHOES_ON.replace(b"lms200", b"InsTest"),
            "SET of RangeScanner 'InsTest', expected one of ['lms200']",
        ),
        (
            ECHOES_ON.replace(b"RangeScanner", b"Echoes"),
            "SET of type 'Echoes' (did you mean 'Encoder'?), expected one of "
            "['GroundTruth', 'INS', 'Odometry', 'Tachometer', 'Encoder', 'Touch', "
            "'Battery', 'Camera', 'RangeScanner']",
        ),
        (
            b"SET {Type INS} {Opcode ECHOES} {Params true}\r\n",
            "SET ECHOES of type 'INS', expected RangeScanner",
        ),
    ],
)
def test_invalid_request_gives_a_diagnostic_and_no_effect(
    foliage_room: Scene, order: bytes, text: str
) -> None:
    client = spawn_client(foliage_room)
    (diagnostic,) = client.host.receive(client.number, order)
    assert diagnostic.text == text
    assert echoes_in(receive_lines(client, 20)) == []
    client.send(ECHOES_ON + order)
    assert echoes_in(receive_lines(client, 10))


@DIALECTS
def test_spent_beams_and_hits_have_different_kinds(
    foliage_room: Scene, dialect: Dialect
) -> None:
    client = spawn_client(foliage_room, dialect=dialect)
    client.send(ECHOES_ON)
    kinds: dict[str, set[str]] = {}
    for message in echoes_in(receive_lines(client, 20)):
        material = message.get("Material") or ""
        assert message.get("Density") == (
            "0.7000" if material == "foliage" else "Opaque"
        )
        assert message.get("Transparency") == (
            "0.3000" if material == "foliage" else "0.0000"
        )
        assert message.get("LaserPasses") == message.get("RobotPasses") == "False"
        for _, _, kind, power, strength in echo_values(message):
            kinds.setdefault(material, set()).add(kind)
            assert kind != "Spent" or power == strength == "0.0000"
    assert kinds == {
        "foliage": {"Enter", "Leave", "Spent"},
        "concrete": {"Hit"},
        "wood": {"Hit"},
    }


def test_beam_into_a_bush_enters_and_is_spent(foliage_room: Scene) -> None:
    client = spawn_client(foliage_room, settings={"lms200": {"side_offset_uu": 0}})
    client.send(ECHOES_ON)
    found = [
        m for m in echoes_in(receive_lines(client, 10)) if m.get("Object") == "bush_4"
    ]
    (bush,) = found
    assert [",".join(echo) for echo in echo_values(bush) if echo[0] == "92"] == [
        "92,7.54,Enter,1.0000,1.0000",
        "92,8.97,Spent,0.0000,0.0000",
    ]


@DIALECTS
@pytest.mark.parametrize(
    "settings",
    [{}, {"ray_choice": "together"}, {"range_noise": 0.1, "range_quantum": 0.07}],
)
def test_farthest_end_of_a_beam_equals_its_range(
    foliage_room: Scene, dialect: Dialect, settings: dict[str, Any]
) -> None:
    client = spawn_client(foliage_room, dialect=dialect, settings={"lms200": settings})
    client.send(ECHOES_ON)
    lines = receive_lines(client, 20)
    scan = decode_message(lines[-1].decode("ascii"))
    ranges = (scan.get("Range") or "").split(",")
    ends: dict[int, str] = {}
    for message in echoes_in(lines):
        if message.get("Time") != scan.get("Time"):
            continue
        for beam, far, kind, _, _ in echo_values(message):
            if kind in ("Hit", "Spent"):
                ends[int(beam)] = max(ends.get(int(beam), "0"), far, key=float)
    assert len(ends) > 150
    assert {beam: ranges[beam] for beam in ends} == ends
    missed = {ranges[beam] for beam in range(len(ranges)) if beam not in ends}
    assert missed <= {dialect.ranges.format(80 if dialect is COMPAT else 20)}


def test_smoke_is_passed_by_robots_and_some_lasers(smoke_room: Scene) -> None:
    client = spawn_client(smoke_room, INIT_TWO_SCANNERS)
    client.send(b"SET {Type RangeScanner} {Opcode ECHOES} {Params true}\r\n")
    lines = receive_lines(client, 10)
    clouds = {name_of(m): m for m in echoes_in(lines) if m.get("Material") == "smoke"}
    assert {m.get("RobotPasses") for m in clouds.values()} == {"True"}
    assert {m.get("LaserPasses") for m in clouds.values()} == {"True"}
    assert clouds["lms200"].get("Transparency") == "1.0000"
    assert {kind for _, _, kind, _, _ in echo_values(clouds["lms200"])} <= {
        "Enter",
        "Leave",
    }


def test_scan_that_hits_nothing_has_one_empty_echo_line(empty_room: Scene) -> None:
    client = spawn_client(empty_room, b"INIT {ClassName P3AT} {Location 500,0,0}\r\n")
    client.send(ECHOES_ON)
    lines = receive_lines(client, 10)
    assert lines[-2] == (
        b"SEN {Time 0.10} {Type Echoes} {Name lms200} {Line 0} {Lines 0}\r\n"
    )
    assert lines[-1].endswith(b",80.00,80.00}\r\n")


def test_requested_scan_has_its_echoes(foliage_room: Scene) -> None:
    client = spawn_client(foliage_room)
    client.send(ECHOES_ON)
    receive_lines(client, 15)
    client.send(b"SET {Type RangeScanner} {Opcode SCAN}\r\n")
    *lines, scan = receive_lines(client, 1)
    assert b"{Type RangeScanner}" in scan
    assert len(lines) == len(echoes_in(lines)) > 0


@DIALECTS
@pytest.mark.parametrize("name", [b"", b" {Name LMS200}", b" {Name }"])
@pytest.mark.parametrize("verb", [b"GETGEO", b"GETCONF"])
def test_geometry_and_settings_of_the_echoes_type_are_those_of_the_scanner(
    foliage_room: Scene, dialect: Dialect, name: bytes, verb: bytes
) -> None:
    client = spawn_client(foliage_room, dialect=dialect)
    answers = []
    for kind in (b"RangeScanner", b"echoEs"):
        assert client.send(verb + b" {Type " + kind + b"}" + name + b"\r\n") == []
        (answer,) = receive_lines(client, 1)
        answers.append(answer)
    assert answers[0].replace(b"RangeScanner", b"echoEs") == answers[1]
    assert answers[0] != answers[1]


@DIALECTS
def test_every_line_is_readable_by_all_clients(
    foliage_room: Scene, dialect: Dialect
) -> None:
    materials = {
        material: replace(material, name="ma{teri}al \N{LEAF FLUTTERING IN WIND}" * 50)
        for material in foliage_room.materials.values()
    }
    parts = [
        replace(
            part,
            object_name=f"{'x' * 199}\N{BROCCOLI}_{10_000 + i}",
            material=materials[part.material],
        )
        for i, part in enumerate(foliage_room.parts)
    ]
    settings = {"lms200": {"resolution_deg": 0.05, "side_offset_uu": 100}}
    client = spawn_client(
        replace(foliage_room, parts=tuple(parts)), dialect=dialect, settings=settings
    )
    client.send(ECHOES_ON + DRIVE)
    found = 0
    for _ in range(3):
        for line in receive_lines(client, 20):
            text = line.decode("ascii")
            if ECHO_TYPE not in line:
                continue
            found += 1
            assert len(line) <= 4095
            assert re.fullmatch(r"SEN( \{[^{}\s]+( [^{}\s]+)+\})+\r\n", text)
            numbers = text.partition("{Density ")[2]
            assert not re.search(r"[0-9]e|nan|inf|-|,[ }]", numbers.lower())
    assert found > 100
