"""Readings of the sensors that look for victims and for RFID tags.

Places are in the frame of the sensor. Source of the lines: the comments and the parsers
of clients of servers for UT2004, the only servers that have these sensors.
"""

from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar, Final, NamedTuple

from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import Field, ItemReport, Number, Segment, Text
from radarsim.protocol.line_template import marks, reduce_text, vector_marks
from radarsim.protocol.message import Message, Triple, parse_flipped, parse_number

CO2: Final = "CO2"


class Sighting(NamedTuple):
    """Something that a sensor sees.

    Attributes:
        label: Which part of a body, or the number of a tag.
        place: x, y, z, m, in the frame of the sensor.
    """

    label: str
    place: Triple


class Sightings(Field[tuple[Sighting, ...]]):
    """What a sensor sees: a label and a place of each, one after the other."""

    def __init__(self, key: str, nothing: Segment | None = None) -> None:
        """Describe the field.

        Args:
            key: Key of the labels.
            nothing: Segment that is written if the sensor sees nothing.
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
    """The tags that a reader reads, with their numbers as labels."""

    sensor_type: ClassVar[str] = "RFID"

    tags: Annotated[tuple[Sighting, ...], Sightings("ID")]


class VictimParts(ItemReport):
    """The parts of bodies that a sensor sees, such as ``Head``."""

    sensor_type: ClassVar[str] = "VictSensor"

    parts: Annotated[
        tuple[Sighting, ...],
        Sightings("PartName", nothing=Segment("Status", "NoVictims")),
    ]


class Probability(Field[float]):
    """A number from 0 to 1, after two blanks as the original writes it."""

    def read(self, message: Message) -> float:
        return message.parse(self.key, parse_number)

    def write(self, value: float, dialect: Dialect) -> Sequence[Segment]:
        # One client takes what comes after the second blank.
        return (Segment(self.key, f" {marks(dialect.robot)}", (value,)),)


class HumanMotion(ItemReport):
    """How likely it is that somebody moves in front of a sensor."""

    sensor_type: ClassVar[str] = "HumanMotion"

    probability: Annotated[float, Probability("Prob")]


class Sound(ItemReport):
    """How loud it is at a microphone, dB, and how long the loudest sound lasts, s."""

    sensor_type: ClassVar[str] = "Sound"

    loudness: Annotated[float, Number("Loudness", "robot")]
    duration: Annotated[float, Number("Duration", "robot")]


class GasDensity(ItemReport):
    """The share of a gas in the air, %."""

    sensor_type: ClassVar[str] = "CO2Sensor"

    gas: Annotated[str, Text("Gas")]
    density: Annotated[float, Number("Density", "robot")]
