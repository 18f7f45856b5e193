"""Mission packages (such as arms): orders, state reports, and GEO and CONF lines.

UT2004 servers call them mission packages and report their state in MISSTA lines; UDK
servers call them actuators and use ASTA lines. Both write the links one after the
other, each beginning with the key ``Link``.
"""

from collections.abc import Iterator, Sequence
from math import nan
from typing import Annotated, Any, ClassVar, Final, NamedTuple

from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import Field, LineReport, Number, Segment, Text
from radarsim.protocol.line_template import (
    NumberFormat,
    marks,
    reduce_text,
    vector_marks,
)
from radarsim.protocol.message import Message, parse_number

ABSOLUTE, RATE = 0, 1  # types of orders: target angle, rad; speed, rad/s
BANG_BANG, RELATIVE = 3, 10  # target angle, rad; change of the angle, rad


class LinkOrder(NamedTuple):
    """An order for one link of a mission package, such as an arm or a camera mount.

    Attributes:
        name: Name of the package, or of the link.
        link: Number of the link in the package, from 1; None if ``name`` is the name of
            the link.
        value: An angle, rad, or a speed, rad/s.
        order: Type of the order, such as ``ABSOLUTE``. Torque orders (2) are ignored.
    """

    name: str
    link: int | None
    value: float
    order: int = ABSOLUTE


ACTUATOR: Final = "actuator"  # the type of packages on UDK servers
_TORQUE: Final = NumberFormat(2)


def _links_of(message: Message) -> Iterator[Message]:
    """Split a line about a mission package into a message for each of its links."""
    link: list[tuple[str, str]] = []
    for key, value in message.segments:
        if key.lower() == "link" or (link and key.lower() == "name"):
            if link:
                yield Message(message.verb, tuple(link))
            link = []
        if key.lower() == "link" or link:
            link.append((key, value))
    if link:
        yield Message(message.verb, tuple(link))


class LinkStates(Field[tuple[tuple[float, float], ...]]):
    """A field with angle and torque of each link of a package; UDK has no torque."""

    def read(self, message: Message) -> tuple[tuple[float, float], ...]:
        return tuple(
            (link.parse("Value", parse_number), link.number_or_nan("Torque"))
            for link in _links_of(message)
        )

    def write(
        self, value: tuple[tuple[float, float], ...], dialect: Dialect
    ) -> Sequence[Segment]:
        segments = []
        for number, (angle, torque) in enumerate(value, 1):
            segments.append(Segment(self.key, str(number)))
            segments.append(Segment("Value", marks(dialect.plain), (angle,)))
            if not dialect.has_actuators:
                segments.append(Segment("Torque", _TORQUE.format(torque)))
        return segments


class PackageState(LineReport):
    """The state of a mission package, such as an arm, a flipper or a camera mount.

    Attributes:
        time: Simulated time, s; NaN if the line has none.
        name: Name of the package.
        links: Angle, rad, and torque of each link; NaN if the line has no torque.
    """

    verb: ClassVar[str] = "MISSTA"

    time: Annotated[float, Number("Time", "time", default=nan)]
    name: Annotated[str, Text("Name")]
    links: Annotated[tuple[tuple[float, float], ...], LinkStates("Link")]

    def head(self, dialect: Dialect) -> str:
        return "ASTA" if dialect.has_actuators else self.verb


class PackageConf(LineReport):
    """The limits of all links of mission packages, such as arms; never decoded.

    Attributes:
        type: Type of the packages in the spelling of the request.
        packages: Name and links of each package; a link has the attributes of
            ``presets.robots.Link``.
    """

    verb: ClassVar[str] = "CONF"

    type: str
    packages: tuple[tuple[str, Sequence[Any]], ...]

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        is_actuator = self.type.lower() == ACTUATOR
        number = marks(dialect.plain)
        # Three generations of servers use different keys, which are known from sources
        # of servers and from comments in clients.
        speed = "MaxRotationSpeed" if dialect.has_actuators else "MaxSpeed"
        low, high = "MinRange", "MaxRange"
        if is_actuator:
            low, high = "MinValue", "MaxValue"
        segments = [Segment("Type", reduce_text(self.type))]
        for name, links in self.packages:
            segments.append(Segment("Name", reduce_text(name)))
            for count, link in enumerate(links, 1):
                segments.append(Segment("Link", str(count)))
                segments.append(Segment("JointType", "Revolute"))
                if not is_actuator:
                    segments.append(Segment(speed, number, (link.max_speed,)))
                limits = (link.max_torque, link.min_angle, link.max_angle)
                for key, value in zip(("MaxTorque", low, high), limits, strict=True):
                    segments.append(Segment(key, number, (value,)))
        return segments


class PackageGeo(LineReport):
    """The poses of all links of mission packages, such as arms; never decoded.

    Attributes:
        type: Type of the packages in the spelling of the request.
        packages: Name of each package and poses of its links. The first pose is in the
            body frame of the robot, the others in the frame of the previous link.
        robot: Class of the robot that carries the packages; empty if not reported.
    """

    verb: ClassVar[str] = "GEO"

    type: str
    packages: tuple[tuple[str, tuple[Pose3, ...]], ...]
    robot: str

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        place = vector_marks(dialect.mount)
        is_actuator = self.type.lower() == ACTUATOR
        parent = "Parent" if is_actuator else "ParentLink"
        segments = [Segment("Type", reduce_text(self.type))]
        for name, links in self.packages:
            segments.append(Segment("Name", reduce_text(name)))
            if is_actuator:  # the pose of the package is that of its first link
                numbers = links[0].numbers()
                segments.append(Segment("Location", place, numbers[:3]))
                segments.append(Segment("Orientation", place, numbers[3:]))
                segments.append(Segment("Mount", reduce_text(self.robot)))
            for count, link in enumerate(links):
                numbers = link.numbers()
                segments.append(Segment("Link", str(count + 1)))
                segments.append(Segment(parent, str(count or -1)))
                segments.append(Segment("Location", place, numbers[:3]))
                segments.append(Segment("Orientation", place, numbers[3:]))
        return segments
