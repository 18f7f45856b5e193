"""Parsers of clients in the field that read fields by position, or by any text.

As in ``client_parsers``, an exception is where the client throws or loses the line.
"""

import re
from typing import Any, ClassVar

from client_parsers import (
    READ_BUFFER,
    SONARS,
    Reading,
    degrees_of,
    flag,
    groups_of,
    named_ranges,
    numbers,
)


class MaldoParser:
    """maldo's Java controller: the fields after the type by position.

    An exception ends its thread, which both reads and drives.
    """

    sensors = frozenset(
        ("RangeScanner", "GroundTruth", "INS", "Odometry", "Touch", "Sonar", "GPS")
    )
    FIELDS: ClassVar = {
        "RangeScanner": ("Name", "Resolution", "FOV", "Range"),
        "GroundTruth": ("Name", "Location", "Orientation"),
        "INS": ("Name", "Location", "Orientation"),
        "Odometry": ("Name", "Pose"),
    }

    def parse(self, line: str) -> Reading | None:
        """Parse a line; one that its framing has damaged at the start is skipped."""
        if line.startswith("STA "):
            return self.status(line)
        if not line.startswith("SEN "):
            return None
        groups = groups_of(line)
        at = next(i for i, group in enumerate(groups) if group.startswith("Type "))
        kind, after = groups[at].split(" ")[1], groups[at + 1 :]
        others = {"Touch": self.touch, "Sonar": self.sonars, "GPS": self.gps}
        if kind in others:
            return others[kind](after)
        if kind not in self.FIELDS:
            return None
        keys = self.FIELDS[kind]
        words = [after[i].split(" ") for i in range(len(keys))]
        assert [word[0] for word in words] == [*keys]
        values = {word[0]: numbers(word[1]) for word in words[1:]}
        return Reading(kind, words[0][1], values)

    def touch(self, after: list[str]) -> Reading:
        """Parse a touch sensor: the fourth word of its first group."""
        words = after[0].split(" ")
        return Reading("Touch", words[1], {"Touch": flag(words[3])})

    def sonars(self, after: list[str]) -> Reading:
        """Parse sixteen sonars, the front ones first: the fourth word of each group."""
        words = [after[i].split(" ") for i in range(len(SONARS))]
        assert tuple(word[1] for word in words) == SONARS
        assert all([word[0], word[2]] == ["Name", "Range"] for word in words)
        ranges = {word[1]: float(word[3]) for word in words}
        return Reading("Sonar", "", {"Range": ranges})

    def gps(self, after: list[str]) -> Reading:
        """Parse a GPS: with a fix the second and the third group after the type."""
        values: dict[str, Any] = {}
        if "Fix 0" not in after:
            for key, group in (("Latitude", after[1]), ("Longitude", after[2])):
                values[key] = degrees_of(group.split(" ")[1])
        values["Satellites"] = int(after[-1].removeprefix("Satellites "))
        return Reading("GPS", "", values)

    def status(self, line: str) -> Reading:
        """Parse a status: six fields besides time and type, in the air four."""
        fields = dict(group.split(" ") for group in groups_of(line))
        values: dict[str, Any] = {"LightToggle": flag(fields["LightToggle"])}
        steers = (
            () if fields["Type"] == "AerialVehicle" else ("FrontSteer", "RearSteer")
        )
        for key in steers:
            values[key] = float(fields[key])
        for key in ("LightIntensity", "Battery", "View"):
            values[key] = int(fields[key])
        return Reading("STA", "", values)


class StudentParser:
    """Students' Python scripts for the P2DX: braces and words by position.

    The type is the second of them, or the third after a time stamp.
    """

    sensors = frozenset(("RangeScanner", "Odometry", "Sonar"))

    def parse(self, line: str) -> Reading | None:
        """Parse a line."""
        words = re.findall(r"\{[^\}]*\}|\S+", line)
        if words[0] == "STA":
            assert words[1] == "{Type GroundVehicle}"
            return Reading("STA", "", {})
        if words[0] != "SEN":
            return None
        if words[1] == "{Type Odometry}" or words[2] == "{Type Odometry}":
            return Reading("Odometry", "", {"Pose": self.value(words[3], "Pose", 3)})
        if "{Type Sonar}" in words[1:3]:
            return Reading("Sonar", "", {"Range": named_ranges(line)})
        if words[2] == "{Type RangeScanner}":
            return Reading("RangeScanner", "", {"Range": self.value(words[6], "Range")})
        return None

    def value(self, word: str, key: str, count: int | None = None) -> list[float]:
        """Parse the numbers of one group."""
        assert word.startswith(f"{{{key} ")
        return numbers(word.removeprefix(f"{{{key} ").removesuffix("}"), count)


class ThafParser:
    """swe-thaf's ``sonar.py``: eight sonars from the fourth word on.

    The type is the third word. A line of fewer words ends the program.
    """

    def parse(self, line: str) -> list[float] | None:
        """Parse a line of sonars."""
        words = re.findall(r"\{[^\}]*\}|\S+", line)
        if words[0] != "SEN" or words[2] != "{Type Sonar}":
            return None
        assert len(words) == 3 + 8
        return [
            float(word.removeprefix(f"{{Name F{number} Range ").removesuffix("}"))
            for number, word in enumerate(words[3:], 1)
        ]


class IridiumParser:
    """Iridium: splits at braces; what its panels show are texts.

    Of a key that comes again it keeps the last, under another name. So it shows the
    first and the last link of a mission package, numbered from 0.
    """

    sensors = frozenset(
        ("RangeScanner", "GroundTruth", "INS", "Odometry", "Tachometer", "Encoder")
    )

    def parse(self, line: str) -> Reading | None:
        """Parse a line."""
        head, *pieces = re.split(r"[{}]", line)
        fields: dict[str, str] = {}
        for piece in pieces:
            if piece.strip():
                key, value = piece.split(" ", 1)
                fields[f"{key}_0" if key in fields else key] = value
        head = head.strip()
        if head == "STA":
            assert "Type" in fields, "a null pointer"
            return Reading(head, "", {"Battery": int(fields["Battery"])})
        if head == "NFO":
            assert "Level" in fields or "StartPoses" in fields
            return Reading(head, "", fields)
        if head == "ASTA":
            return None
        if head == "MISSTA":
            return Reading(head, fields["Name"], {"Links": self.links(fields)})
        kind = fields["Type"] if head == "SEN" else f"{head} {fields['Type']}"
        values: dict[str, Any] = dict(fields)
        for key in ("Range", "Location", "Orientation", "Pose"):
            if key in fields:
                values[key] = numbers(fields[key])
        return Reading(kind, fields.get("Name", ""), values)

    def links(self, fields: dict[str, str]) -> dict[int, float]:
        """Return the values of links by their numbers."""
        values: dict[int, float] = {}
        link = 0
        for key, text in fields.items():
            if key.lower().startswith("link"):
                link = int(text) - 1
            elif key.lower().startswith("value"):
                values[link] = float(text)
        return values


class LcmProxyParser:
    """LcmProxy: a literal type, and as many ranges as its printed angles say."""

    sensors = frozenset(("RangeScanner",))
    LARGEST_ARRAY = 228

    def parse(self, line: str) -> Reading | None:
        """Parse a line; only scans matter here."""
        if not line.startswith("SEN") or "{Type RangeScanner}" not in line:
            return None
        fields = dict(group.split(" ", 1) for group in groups_of(line))
        count = int(float(fields["FOV"]) / float(fields["Resolution"])) + 1
        ranges = numbers(fields["Range"], count)
        assert len(ranges) <= self.LARGEST_ARRAY
        return Reading("RangeScanner", fields["Name"], {"Range": ranges})


class ToolboxParser:
    """The AUT toolbox for MATLAB: searches for texts, in any order."""

    sensors = frozenset(
        ("Sonar", "GPS", "Odometry", "GroundTruth", "INS", "RangeScanner")
    )
    KEYS: ClassVar = {
        "Odometry": ("Pose",),
        "GroundTruth": ("Location", "Orientation"),
        "INS": ("Location", "Orientation"),
        "RangeScanner": ("Range",),
    }

    def parse(self, line: str) -> Reading | None:
        """Parse a line."""
        assert len(line) + 2 <= READ_BUFFER
        if not line.startswith("SEN"):
            return None
        if "Type Sonar" in line:
            return Reading("Sonar", "", {"Range": named_ranges(line)})
        if "Type GPS" in line:
            return Reading("GPS", "", self.position(line))
        for kind, keys in self.KEYS.items():
            if f"Type {kind}" in line:
                values = {key: numbers(self.text(line, key)) for key in keys}
                return Reading(kind, self.text(line, "Name"), values)
        return None

    def position(self, line: str) -> dict[str, Any]:
        """Parse latitude and longitude: degrees, minutes, side; none without a fix."""
        keys = () if self.text(line, "Fix") == "0" else ("Latitude", "Longitude")
        return {key: degrees_of(self.text(line, key)) for key in keys}

    def text(self, line: str, key: str) -> str:
        """Return the text after a key."""
        match = re.search(rf"\{{{key} ([^}}]*)\}}", line)
        assert match, f"no {key}"
        return match[1]
