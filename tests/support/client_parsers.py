"""Parsers of clients in the field, rule by rule: what each makes of a line.

They are written from descriptions of these clients, share no code with the server, and
know nothing of dialects. ``parse`` returns None for a line that its client skips
without harm. An exception is where the client itself throws, crashes or loses the line.
A parser has no rule for a type of sensor if the client's rule is not known.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

READ_BUFFER = 4096  # bytes; of a line with its end
VEHICLES = ("GroundVehicle", "LeggedRobot", "NauticVehicle", "AerialVehicle")
SONARS = tuple(f"{end}{i}" for end in "FR" for i in range(1, 9))
HOKUYOS = ("Kenaf", "AirRobot")  # robots on which UsarCommander expects a Hokuyo
STEERING_TYPES = ("SkidSteered", "AckermanSteered", "OmniDrive")


@dataclass(frozen=True)
class Reading:
    """What a client read on a line."""

    kind: str  # of the sensor; for GEO and CONF, with the head of the line
    name: str  # empty if the client does not look at it
    values: Mapping[str, Any]


class Parser(Protocol):
    """The parser of one client."""

    sensors: frozenset[str]

    def parse(self, line: str) -> Reading | None:
        """Parse a line without its end."""


def scanner_of(class_name: str) -> str:
    """Return the name under which clients look for the scanner of a robot."""
    if class_name in HOKUYOS:
        return "Hokuyo"
    is_own = class_name.startswith(("P3AT", "ATRV"))
    return "lms200" if is_own else "Scanner1"


def numbers(text: str, count: int | None = None) -> list[float]:
    """Parse numbers that single commas separate."""
    values = [float(word) for word in text.split(",")]
    assert count is None or len(values) == count
    return values


def flag(text: str) -> bool:
    """Parse the text of a truth value as .NET and Java write it."""
    assert text in ("True", "False"), f"{text!r} is no truth value"
    return text == "True"


def degrees_of(text: str) -> tuple[int, float, str]:
    """Parse a latitude or a longitude: degrees, minutes, side."""
    degrees, minutes, side = text.split(",")
    assert len(side) == 1
    return int(degrees), float(minutes), side


def groups_of(line: str) -> list[str]:
    """Return the texts in braces, which do not nest."""
    return re.findall(r"\{([^{}]*)\}", line)


class RosParser:
    """usarsim_inf: skips braces, reads words in pairs, keys in their case.

    It warns of every reading without a time stamp, and of those that it does not
    publish.
    """

    published = frozenset(("RangeScanner", "GroundTruth", "INS"))

    sensors = frozenset(("RangeScanner", "GroundTruth", "INS", "Encoder", "Tachometer"))
    LARGEST_WORD = 1024
    MOST_BEAMS = 192

    def parse(self, line: str) -> Reading | None:
        """Parse a line as words."""
        words = re.findall(r"[^{}\s]+", line)
        values = dict(pairwise(words[1:]))
        head, kind = words[0], values.get("Type", "")
        if kind != "RangeScanner":
            assert all(len(word) < self.LARGEST_WORD for word in words)
        if head == "STA":
            assert kind == "GroundVehicle"
            return Reading(head, "", {"Time": float(values["Time"])})
        if head in ("GEO", "CONF"):
            return self.description(head, kind, words, values)
        if head != "SEN":
            return None
        if kind not in self.sensors:
            return Reading(kind, values["Name"], {})
        return Reading(kind, values["Name"], self.sensor(kind, words, values))

    def description(
        self, head: str, kind: str, words: list[str], values: dict[str, str]
    ) -> Reading | None:
        """Parse geometry or configuration."""
        if kind in VEHICLES:
            assert head == "GEO" or values["SteeringType"] in STEERING_TYPES
            sizes = ["WheelRadius", "WheelSeparation"]
            wanted = sizes if head == "GEO" else ["MaxSpeed"]
            found = {key: float(values[key]) for key in wanted}
            assert min(found.values()) > 0
            return Reading(f"{head} Robot", "", found)
        if head == "GEO":
            at = words.index("Name")
            assert words[at + 2 : at + 8 : 2] == ["Location", "Orientation", "Mount"]
            place = {"Location": numbers(words[at + 3], 3)}
            return Reading(f"GEO {kind}", words[at + 1], place)
        if kind != "RangeScanner":
            return Reading(f"CONF {kind}", values["Name"], {})
        limits = {k: float(values[k]) for k in ("MinRange", "MaxRange", "Fov")}
        return Reading("CONF RangeScanner", values["Name"], limits)

    def sensor(
        self, kind: str, words: list[str], values: dict[str, str]
    ) -> dict[str, Any]:
        """Parse the reading of a sensor."""
        if kind == "RangeScanner":
            after = words[words.index("Range") + 1 :]  # the rest are ranges
            ranges = [float(n) for word in after for n in word.split(",")]
            assert len(ranges) <= self.MOST_BEAMS
            step, fov = float(values["Resolution"]), float(values["FOV"])
            return {"FOV": fov, "Resolution": step, "Range": ranges}
        if kind in ("GroundTruth", "INS"):
            keys = ("Location", "Orientation")
            return {key: numbers(values[key], 3) for key in keys}
        if kind == "Encoder":
            return {"Tick": int(values["Tick"])}
        assert kind == "Tachometer"
        return {"Vel": numbers(values["Vel"]), "Pos": numbers(values["Pos"])}


class PlayerParser:
    """Player's us_* drivers: only lines with a name, keys in their case."""

    sensors = frozenset(
        ("RangeScanner", "Odometry", "GroundTruth", "INS", "Encoder", "Sonar")
    )

    def __init__(self, class_name: str) -> None:
        self.scanner = scanner_of(class_name)

    def parse(self, line: str) -> Reading | None:
        """Parse a line."""
        assert len(line) + 2 < READ_BUFFER
        head = line.split(" ", maxsplit=1)[0]
        if "{Name " not in line or head == "MISSTA":  # which is that of its camera
            return None
        kind = re.findall(r"\{Type (\w+)\}", line)[0]
        fields = dict(re.findall(r"\{(\w+) ([^}]*)\}", line))
        if kind in VEHICLES:
            return Reading(f"{head} Robot", "", self.robot(head, fields))
        if head == "GEO":
            match = re.search(
                r"\{Name (\w+) Location (\S+) Orientation (\S+) Mount \w+\}", line
            )
            assert match, "a segmentation fault"
            assert kind != "RangeScanner" or match[1] == self.scanner
            return Reading(f"GEO {kind}", match[1], {"Location": numbers(match[2], 3)})
        if kind == "RangeScanner":
            assert fields["Name"] == self.scanner, "a segmentation fault"
        if head == "CONF":
            return Reading(f"CONF {kind}", fields["Name"], fields)
        return self.sensor(kind, fields, line)

    def robot(self, head: str, fields: dict[str, str]) -> dict[str, Any]:
        """Parse the geometry or the configuration of the robot."""
        if head == "CONF":
            assert fields["SteeringType"]
            keys = ("Mass", "MaxSpeed", "MaxTorque", "MaxFrontSteer")
            return {key: float(fields[key]) for key in keys}
        sizes = {key: numbers(fields[key], 3) for key in ("Dimensions", "COG")}
        single = ("WheelRadius", "WheelSeparation")
        return sizes | {key: numbers(fields[key], 1) for key in single}

    def sensor(self, kind: str, fields: dict[str, str], line: str) -> Reading | None:
        """Parse the reading of a sensor."""
        match kind:
            case "RangeScanner":
                values: dict[str, Any] = {"Range": numbers(fields["Range"])}
            case "Odometry":
                values = {"Pose": numbers(fields["Pose"], 3)}
            case "GroundTruth" | "INS":
                keys = ("Location", "Orientation")
                values = {key: numbers(fields[key], 3) for key in keys}
            case "Encoder":
                return Reading(kind, "", {"Tick": named_ticks(line)})
            case "Sonar":
                return Reading(kind, "", {"Range": named_ranges(line)})
            case _:
                return None
        return Reading(kind, fields["Name"], values)


def named_ranges(line: str) -> dict[str, float]:
    """Parse the groups ``{Name F1 Range 3.2}`` of the sonars of a line.

    A P2AT has sixteen, a P2DX the eight front ones.
    """
    found = re.findall(r"\{Name (\w+) Range ([\d.]+)\}", line)
    ranges = {name: float(text) for name, text in found}
    assert tuple(ranges) in (SONARS, SONARS[:8])
    return ranges


def named_ticks(line: str) -> dict[str, int]:
    """Parse the groups ``{Name ECLeft Tick 12}`` of the encoders of a line.

    They are read word by word, from the third word after the head.
    """
    assert line.split(" ")[1:3] == ["{Type", "Encoder}"], "no wheel is read"
    found = re.findall(r"\{Name (\w+) Tick (-?\d+)\}", line)
    ticks = {name: int(text) for name, text in found}
    assert set(ticks) in ({"ECLeft"}, {"ECRight"}, {"ECLeft", "ECRight"})
    return ticks
