"""Clients that look for victims and tags, with their own parsers, for a minute each.

An exception is where the real client would stop.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene, Tag, Victim
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

INIT = "INIT {ClassName USARBot.P3AT_Rescue} {Name R1} {Location -8,0,0}\r\n"
PARTS = {"HEAD", "ARM", "HAND", "CHEST", "PELVIS", "LEG", "FOOT"}


def lines_of(scene: Scene, seconds: float, dialect: Dialect = COMPAT) -> list[str]:
    """Return what a client is sent that drives towards a victim."""
    victim = Victim("Becky", (-3.5, 0.0, 0.1), 1.0, True, 60.0, 1.5, 4.0)
    tags = (Tag(11137, (-5.0, 1.0, 0.2)), Tag(11138, (-4.0, -1.0, 0.2)))
    scene = replace(scene, victims=(victim,), tags=tags)
    host = Host(scene, config=SimulationConfig(dialect))
    number = host.connect()
    host.receive(number, INIT.encode())
    host.receive(number, b"DRIVE {Left 0.3} {Right 0.3}\r\n")
    received = b""
    for _ in range(round(100 * seconds)):
        host.step()
        received += host.take(number)
    return received.decode("ascii").split("\r\n")[:-1]


class Maldo:
    """maldo's Java controller: groups after the type, by position."""

    def parse(self, line: str) -> tuple[str, Any] | None:
        kind = line.partition("{Type ")[2].partition("}")[0]
        parse = getattr(self, kind.lower(), None)
        if parse is None:
            return None
        after = line[line.index(kind) :].split("} {")
        return kind, parse(after)

    def victsensor(self, after: list[str]) -> list[tuple[str, float, float, float]]:
        name = after[1].split(" ")[1]
        assert name
        if "Status" in after[2]:
            return []
        found = []
        for i in range(2, len(after), 2):
            part = after[i].split(" ")[1]
            assert part.upper() in PARTS
            x, y, z = after[i + 1].split(",")
            place = float(x.split(" ")[1]), float(y), float(z.split("}")[0])
            found.append((part, *place))
        return found

    def humanmotion(self, after: list[str]) -> float:
        return float(after[2].split(" ")[2].split("}")[0])

    def sound(self, after: list[str]) -> tuple[float, float]:
        duration = after[3].split(" ")[1].split("}")[0]
        return float(after[2].split(" ")[1]), float(duration)

    def co2sensor(self, after: list[str]) -> float:
        text = " ".join(after)
        assert text.partition("Gas ")[2].split(" ")[0]
        return float(text.partition("Density ")[2].partition("}")[0])


class Commander:
    """UsarCommander: pairs of groups, a label and then a location."""

    def parse(self, line: str) -> tuple[str, Any] | None:
        keys = {"RFID": "ID", "VictSensor": "PARTNAME"}
        kind = line.partition("{Type ")[2].partition("}")[0]
        if kind not in keys:
            return None
        label, found = "", []
        for group in line.split("{")[1:]:
            parts = group.strip().removesuffix("}").split(" ")
            if parts[0].upper() == keys[kind]:
                label = parts[1]
            elif parts[0].upper() == "LOCATION":
                x, y, z = map(float, parts[1].strip().split(","))
                found.append((label, x, y, z))
        if kind == "RFID":
            assert all(label.isdecimal() for label, *_ in found)
        return kind, found


class Mrl:
    """MRL's VictRFID: pairs of segments from the third or the fourth on."""

    def parse(self, line: str) -> tuple[str, Any] | None:
        if "{Type VictSensor}" not in line:
            return None
        segments = [each.split("}")[0] for each in line.split("{")[1:]]
        found = []
        if not any(each.startswith("Status") for each in segments):
            shift = 3 if segments[0].startswith("Time") else 2
            for i in range(shift, len(segments), 2):
                key, part = segments[i].split(" ")
                place = segments[i + 1].removeprefix("Location ").split(",")
                assert key == "PartName"
                found.append((part, *map(float, place)))
        return "VictSensor", found


class UsFiducial:
    """Player's us_fiducial: words after keys, y and z flipped."""

    def parse(self, line: str) -> list[tuple[int, float, float, float]] | None:
        if "{Name " not in line or "{Type RFID}" not in line:
            return None
        found: list[tuple[int, float, float, float]] = []
        rest = line
        while True:
            number, rest = self.value(rest, "ID")
            if number is None:
                return found
            place, rest = self.value(rest, "Location")
            assert place is not None
            x, y, z = map(float, place.split(","))
            found.append((int(number), x, -y, -z))

    def value(self, text: str, key: str) -> tuple[str | None, str]:
        """Return the word after a key, and the text behind it."""
        start = text.find(f"{{{key}")
        if start == -1:
            return None, text
        word, _, rest = text[text.index(" ", start) + 1 :].partition(" ")
        return word.removesuffix("}"), rest


class UsarsimInf:
    """usarsim_inf: keys in their case, values up to a comma or a brace."""

    def parse(self, line: str) -> list[tuple[str, int | tuple[float, ...]]] | None:
        if "{Type RFID}" not in line:
            return None
        found: list[tuple[str, int | tuple[float, ...]]] = []
        for key, text in re.findall(r"\{\s*(\S+)\s([^{}]*)\}", line):
            values = [word for word in re.split(r"[\s,{}]+", text) if word]
            if key == "ID":
                found.append((key, int(values[0])))
            elif key == "Location":
                x, y, z = map(float, values)
                found.append((key, (x, y, z)))
        return found


@pytest.fixture(scope="module")
def minute(empty_room: Scene) -> list[str]:
    return lines_of(empty_room, 60.0)


@pytest.mark.parametrize("client", [Maldo, Commander, Mrl])
def test_client_sees_the_victim_come_nearer(
    client: Callable[[], Maldo | Commander | Mrl], minute: list[str]
) -> None:
    parse = client().parse
    readings = [each for each in map(parse, minute) if each is not None]
    seen = [found for kind, found in readings if kind == "VictSensor"]
    assert len(seen) == 600
    heads = [x for found in seen for part, x, *_ in found if part == "Head"]
    assert heads == sorted(heads, reverse=True)
    assert heads[0] > heads[-1] + 1.0


def test_tags_are_read_by_their_numbers(minute: list[str]) -> None:
    readings = filter(None, map(Commander().parse, minute))
    tags = [found for kind, found in readings if kind == "RFID"]
    assert {label for found in tags for label, *_ in found} == {"11137", "11138"}


def test_fiducials_of_player_and_ros_are_the_tags_of_the_map(minute: list[str]) -> None:
    player = [each for each in map(UsFiducial().parse, minute) if each is not None]
    ros = [each for each in map(UsarsimInf().parse, minute) if each is not None]
    assert len(player) == len(ros) == 600
    for seen, read in zip(player, ros, strict=True):
        tags = {number: (x, y, z) for number, x, y, z in seen}
        assert [value for key, value in read if key == "ID"] == [*tags]
        assert [value for key, value in read if key == "Location"] == [
            (x, -y, -z) for x, y, z in tags.values()
        ]
        # Player has the left positive, where the first tag is; both are at rest.
        assert tags[11137][1] == pytest.approx(1.0)
        assert tags[11138][1] == pytest.approx(-1.0)
        assert tags[11138][0] - tags[11137][0] == pytest.approx(1.0, abs=2e-4)
    way = player[0][0][1] - player[-1][0][1]
    assert way == pytest.approx(0.3 * 0.098 * 59.9, rel=0.01)


def test_signs_of_life_become_clearer(minute: list[str]) -> None:
    readings = [each for each in map(Maldo().parse, minute) if each is not None]
    for kind in ("HumanMotion", "CO2Sensor"):
        values = [value for each, value in readings if each == kind]
        assert len(values) == 600
        assert values[-1] > values[0]
    sounds = [value for kind, value in readings if kind == "Sound"]
    assert sounds[-1][0] > sounds[0][0] > 0
    assert sounds[-1][1] == 1.5


def test_servers_for_udk_have_none_of_these_sensors(empty_room: Scene) -> None:
    lines = lines_of(empty_room, 1.0, UDK)
    assert not any("Vict" in line or "RFID" in line for line in lines)
    assert any("{Type RangeScanner}" in line for line in lines)


@pytest.mark.parametrize("item", ["RFID", "VictSensor", "HumanMotion", "Sound"])
def test_drivers_learn_where_the_sensors_are(empty_room: Scene, item: str) -> None:
    host = Host(empty_room)
    number = host.connect()
    host.receive(number, INIT.encode())
    host.step()
    host.take(number)
    asked = f"GETGEO {{Type {item}}}\r\nGETCONF {{Type {item}}}\r\n"
    host.receive(number, asked.encode())
    host.step()
    answers = host.take(number).decode()
    assert f"GEO {{Type {item}}} {{Name {item} Location " in answers
    assert f"CONF {{Type {item}}} {{Name {item}}}" in answers
