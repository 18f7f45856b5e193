"""Reports of the sensors that detect victims and RFID tags.

Positions are in the frame of the sensor. The line formats come from the comments and
the parsers of clients for UT2004 servers, the only servers that have these sensors.
"""

from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar, Final, NamedTuple

from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import Field, ItemReport, Number, Segment, Text
from radarsim.protocol.line_template import marks, reduce_text, vector_marks
from radarsim.protocol.message import Message, Triple, parse_flipped, parse_number

CO2: Final = "CO2"


class Sighting(NamedTuple):
    """A detected body part or RFID tag, and its position.

    Attributes:
        label: Name of the body part, or number of the tag.
        place: x, y, z, m, in the frame of the sensor.
    """

    label: str
    place: Triple


class Sightings(Field[tuple[Sighting, ...]]):
    """A field with a list of detections, each written as a label and a position."""

    def __init__(self, key: str, nothing: Segment | None = None) -> None:
        """Create the field from the key under which labels are written.

        Args:
            key: Key of the labels.
            nothing: Segment to write if there are no detections; None for no segment.
        """
        super().__init__(key)
        self._nothing = () if nothing is None else (nothing,)

    def read(self, message: Message) -> tuple[Sighting, ...]:
        return tuple(self._read_all(message))

    def _read_all(self, message: Message) -> Iterator[Sighting]:
        label = ""
        for key, value in message.segments:
            if key.lower() == self.key.lower():
                label = value
            elif key.lower() == "location":
                yield Sighting(label, parse_flipped(value))

    def write(self, value: tuple[Sighting, ...], dialect: Dialect) -> Sequence[Segment]:
        place = vector_marks(dialect.robot)
        written = [
            segment
            for each in value
            for segment in (
                Segment(self.key, reduce_text(each.label)),
                Segment("Location", place, each.place),
            )
        ]
        return written or self._nothing


class RfidTags(ItemReport):
    """The RFID tags that a reader detects; the number of a tag is its label."""

    sensor_type: ClassVar[str] = "RFID"

    tags: Annotated[tuple[Sighting, ...], Sightings("ID")]


class VictimParts(ItemReport):
    """The body parts that a victim sensor detects, such as ``Head``."""

    sensor_type: ClassVar[str] = "VictSensor"

    parts: Annotated[
        tuple[Sighting, ...],
        Sightings("PartName", nothing=Segment("Status", "NoVictims")),
    ]


class Probability(Field[float]):
    """A field with a number from 0 to 1, written after two spaces instead of one."""

    def read(self, message: Message) -> float:
        return message.parse(self.key, parse_number)

    def write(self, value: float, dialect: Dialect) -> Sequence[Segment]:
        # The client "maldo" reads the text after the second space as the number.
        return (Segment(self.key, f" {marks(dialect.robot)}", (value,)),)


class HumanMotion(ItemReport):
    """The probability, 0 to 1, that a person moves in front of a sensor."""

    sensor_type: ClassVar[str] = "HumanMotion"

    probability: Annotated[float, Probability("Prob")]


class Sound(ItemReport):
    """Loudness at a microphone, dB, and duration of the loudest sound, s."""

    sensor_type: ClassVar[str] = "Sound"

    loudness: Annotated[float, Number("Loudness", "robot")]
    duration: Annotated[float, Number("Duration", "robot")]


class GasDensity(ItemReport):
    """The concentration of a gas in the air, %."""

    sensor_type: ClassVar[str] = "CO2Sensor"

    gas: Annotated[str, Text("Gas")]
    density: Annotated[float, Number("Density", "robot")]
