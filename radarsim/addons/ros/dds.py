"""Publishes topics over DDS, like a ROS 2 node, without ROS installed.

Topics and types have the names of the ROS 2 middleware: the topic ``/tf`` is ``rt/tf``
in DDS, and ``tf2_msgs/msg/TFMessage`` is ``tf2_msgs::msg::dds_::TFMessage_``. This
module imports the packages of the extra ``dds``.
"""

import asyncio
from functools import cache
from typing import Any, Final
from xml.sax.saxutils import quoteattr

from cyclonedds import core, qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc

from radarsim.addons.recording.cdr import encode, typestore
from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.ros.bridge import TWIST, DriveCallback
from radarsim.errors import ServerError

LOOPBACK: Final = "lo"
POLL: Final = 0.02  # s between two checks for commands
DEPTH: Final = 10  # messages in the history; 10 is the default of ROS
_CONFIG: Final = """<CycloneDDS><Domain>
<General>
<Interfaces><NetworkInterface name={interface}/></Interfaces>
<AllowMulticast>{multicast}</AllowMulticast>
</General>
<Discovery>{discovery}</Discovery>
</Domain></CycloneDDS>"""
# The loopback interface has no multicast, so participants find each other by unicast.
_LOCAL: Final = (
    "<ParticipantIndex>auto</ParticipantIndex>"
    '<Peers><Peer address="127.0.0.1"/></Peers>'
)


class DdsParticipant:
    """A participant of a DDS domain, which publishes topics like a ROS 2 node."""

    def __init__(self, domain: int, interface: str = LOOPBACK) -> None:
        """Join a DDS domain.

        Args:
            domain: Number of the domain, as ``ROS_DOMAIN_ID``.
            interface: The only network interface that is used.

        Raises:
            ServerError: If the domain cannot be joined on this interface.
        """
        is_local = interface == LOOPBACK
        config = _CONFIG.format(
            interface=quoteattr(interface),
            multicast=str(not is_local).lower(),
            discovery=_LOCAL if is_local else "",
        )
        try:
            self._domain = Domain(domain, config)  # lives as long as this object
            self._participant = DomainParticipant(domain)
        except core.DDSException as error:
            text = f"no DDS on {interface!r} in domain {domain}, expected an interface"
            raise ServerError(f"{text} of this machine") from error
        self._writers: dict[str, DataWriter[IdlStruct]] = {}
        self._readers: list[tuple[DataReader[Any], DriveCallback]] = []

    def publish(self, message: TopicMessage) -> None:
        """Publish a message; see ``RosSide.publish``."""
        topic, type_ = message.topic, _struct_of(message.type)
        if topic not in self._writers:
            place = Topic(self._participant, f"rt{topic}", type_)
            quality = _quality(latched=message.latched)
            self._writers[topic] = DataWriter(self._participant, place, quality)
        # The constructor of a message requires all fields, but only ``encoded`` is
        # used.
        sample = type_.__new__(type_)
        sample.encoded = encode(message)
        self._writers[topic].write(sample)

    def subscribe(self, topic: str, take: DriveCallback) -> None:
        """Subscribe to velocity commands; see ``RosSide.subscribe``."""
        place = Topic(self._participant, f"rt{topic}", _struct_of(TWIST))
        reader = DataReader(self._participant, place, _quality(latched=False))
        self._readers.append((reader, take))

    async def run(self) -> None:
        """Receive commands until cancelled; see ``RosSide.run``."""
        while True:
            for reader, take in self._readers:
                # Readers are polled, because listeners of cyclonedds are called in
                # another thread.
                for twist in reader.take(DEPTH):
                    if hasattr(twist, "linear"):  # else a writer has left
                        take(twist.linear.x, twist.angular.z)
            await asyncio.sleep(POLL)


@cache
def _struct_of(type_: str) -> Any:  # a class whose objects get other attributes
    """Return the cyclonedds class for a ROS message type."""
    package, _, name = type_.partition("/msg/")
    fields = {name: _annotation(desc) for name, desc in typestore().fielddefs[type_][1]}
    struct = make_idl_struct(f"{name}_", f"{package}::msg::dds_::{name}_", fields)
    # Messages are encoded as in ROS bags, and cyclonedds only sends the encoded bytes.
    struct.serialize = lambda sample, **_: sample.encoded  # type: ignore[method-assign]
    return struct


def _annotation(described: FieldDesc) -> Any:  # a class, or an array of cyclonedds
    """Return the cyclonedds type of a message field that rosbags describes."""
    match described:
        case Nodetype.NAME, str(name):
            return _struct_of(name)
        case Nodetype.BASE, ("string", _):
            return str
        case Nodetype.BASE, ("bool", _):
            return bool
        case Nodetype.BASE, (str(name), _):
            return getattr(types, name)
        case Nodetype.ARRAY, (element, length):
            return types.array[_annotation(element), length]  # type: ignore[misc]
        case _, (element, _):
            return types.sequence[_annotation(element)]  # type: ignore[misc]


def _quality(*, latched: bool) -> qos.Qos:
    policy = qos.Policy
    kept = policy.Durability.TransientLocal if latched else policy.Durability.Volatile
    return qos.Qos(
        policy.Reliability.Reliable(0),  # writing never waits for a slow reader
        policy.History.KeepLast(1 if latched else DEPTH),
        kept,
        policy.DataRepresentation(use_cdrv0_representation=True),
    )
