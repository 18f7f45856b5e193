"""The parser of UsarCommander, by its source; as those of ``client_parsers``."""

from collections.abc import Callable, Mapping
from typing import Any

from client_parsers import (
    VEHICLES,
    Reading,
    degrees_of,
    flag,
    groups_of,
    numbers,
    scanner_of,
)


class UsarCommanderParser:
    """UsarCommander: keys in any order and case, the first of two equal ones counts."""

    # It prints others, such as the last of these.
    HEADS = ("SEN", "NFO", "STA", "MISSTA", "GEO", "CONF", "RES", "ASTA")

    def __init__(self, class_name: str) -> None:
        self.scanner = scanner_of(class_name)
        is_old = self.scanner == "Scanner1"
        self.wheel_names = (
            ["ecleft", "ecright"] if is_old else ["enctestw1", "enctestw2"]
        )
        self.parsers: dict[str, Callable[[dict[str, str]], dict[str, Any]]] = {
            "RangeScanner": self.scan,
            "INS": self.pose,
            "GroundTruth": self.pose,
            "GPS": self.position,
            "Tachometer": self.wheels,
            "Encoder": self.ticks,
            "Sonar": self.sonars,
        }
        self.sensors = frozenset(self.parsers)

    def parse(self, line: str) -> Reading | None:
        """Parse a line: a head, a blank, and parts in braces."""
        head = line[: line.index(" ")]  # without a blank its thread ends
        assert head in self.HEADS
        fields: dict[str, str] = {}
        is_named = head == "SEN" and ("Type Sonar" in line or "Type Encoder" in line)
        for part in groups_of(line):
            key, _, value = part.strip().partition(" ")
            if is_named and len(words := part.split(" ")) > 2:
                key, value = words[1], words[3]  # ``Name F1 Range 3.2``
            fields.setdefault(key.lower(), value)
        if head == "STA":
            return Reading(head, "", self.status(fields))
        if head in ("GEO", "CONF"):
            kind = "Robot" if fields["type"] in VEHICLES else fields["type"]
            values = fields if head == "CONF" else self.geometry(kind, fields, line)
            return Reading(f"{head} {kind}", fields.get("name", ""), values)
        if head == "NFO":
            return Reading(head, "", fields)
        parse = self.parsers.get(fields.get("type", ""))
        if parse is None:
            return None  # not mounted
        name = fields.get("name", "")
        if fields["type"] == "RangeScanner" and name != self.scanner:
            return None
        return Reading(fields["type"], name, parse(fields))

    def status(self, fields: dict[str, str]) -> dict[str, Any]:
        """Parse a status; it pauses at an empty battery."""
        assert int(fields["battery"]) >= 1
        values: dict[str, Any] = {
            key: int(fields[key])
            for key in ("battery", "view", "lightintensity")
            if key in fields
        }
        return values | {"lighttoggle": flag(fields["lighttoggle"])}

    def geometry(
        self, kind: str, fields: dict[str, str], line: str
    ) -> Mapping[str, Any]:
        """Parse the sizes of a robot, or the mount of its scanner in one part."""
        if kind == "Robot":
            wheels = ["wheelradius", "wheelseparation", "wheelbase"]
            single = [] if fields["type"] == "AerialVehicle" else wheels
            vectors = ("dimensions", "cog")
            sizes = {key: numbers(fields[key], 1) for key in single}
            return sizes | {key: numbers(fields[key], 3) for key in vectors}
        for part in groups_of(line):
            words = part.split(" ")
            if words[:2] == ["Name", self.scanner] and words[-1] == "HARD":
                assert len(words) == 8
                return {"Location": numbers(words[3], 3)}
        return {"Location": [0.0, 0.0, 0.0]}  # no harm, but it is taken as not offset

    def scan(self, fields: dict[str, str]) -> dict[str, Any]:
        """Parse a scan, which it turns round: its own list begins at the left."""
        fov, step = float(fields["fov"]), float(fields["resolution"])
        ranges = numbers(fields["range"])
        assert round(fov / step) + 1 >= len(ranges)  # the size of its array
        return {"FOV": fov, "Resolution": step, "Range": ranges}

    def pose(self, fields: dict[str, str]) -> dict[str, Any]:
        """Parse place and angles."""
        return {
            "Location": numbers(fields["location"], 3),
            "Orientation": numbers(fields["orientation"], 3),
        }

    def position(self, fields: dict[str, str]) -> dict[str, Any]:
        """Parse latitude and longitude, which are there if there is a fix."""
        values: dict[str, Any] = {"Fix": int(fields["fix"])}
        values["Satellites"] = int(fields["satellites"])
        if values["Fix"] == 1:
            for key in ("Latitude", "Longitude"):
                values[key] = degrees_of(fields[key.lower()])
        return values

    def wheels(self, fields: dict[str, str]) -> dict[str, Any]:
        """Parse speeds and angles of four wheels."""
        return {"Vel": numbers(fields["vel"], 4), "Pos": numbers(fields["pos"], 4)}

    def ticks(self, fields: dict[str, str]) -> dict[str, Any]:
        """Parse an encoder: a key of its own for each wheel ends its thread."""
        wheels = [key for key in fields if key.startswith(("ec", "enc"))]
        assert wheels in ([], self.wheel_names)
        return {"Tick": {wheel: int(fields[wheel]) for wheel in wheels}}

    def sonars(self, fields: dict[str, str]) -> dict[str, Any]:
        """Parse sonars: a number after F, and a range; those behind are skipped."""
        names = [key for key in fields if key.startswith("f")]
        assert all(int(name[1:]) > 0 for name in names)
        return {"Range": {name.upper(): float(fields[name]) for name in names}}
