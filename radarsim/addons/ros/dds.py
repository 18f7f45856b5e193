"""The side of DDS: topics as ROS 2 itself has them, without ROS.

The types are those of ROS, with names as its middleware has them: the topic ``/tf`` is
``rt/tf``, and ``tf2_msgs/msg/TFMessage`` is ``tf2_msgs::msg::dds_::TFMessage_``.
"""

import asyncio
from functools import cache
from typing import Any, Final
from xml.sax.saxutils import quoteattr

from radarsim.addons.recording.message_types import Field, fields_of
from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.ros.live_topics import TWIST, DriveCallback
from radarsim.errors import ServerError, import_optional

EXTRA: Final = "dds"
LOOPBACK: Final = "lo"
POLL: Final = 0.02  # s between looks for commands
DEPTH: Final = 10  # messages that are kept, as the default of ROS
_CONFIG: Final = """<CycloneDDS><Domain>
<General>
<Interfaces><NetworkInterface name={interface}/></Interfaces>
<AllowMulticast>{multicast}</AllowMulticast>
</General>
<Discovery>{discovery}</Discovery>
</Domain></CycloneDDS>"""
# Loopback has no multicast: participants are found at their ports.
_LOCAL: Final = (
    "<ParticipantIndex>auto</ParticipantIndex>"
    '<Peers><Peer address="127.0.0.1"/></Peers>'
)


class DdsParticipant:
    """A participant of a DDS domain."""

    def __init__(self, domain: int, interface: str = LOOPBACK) -> None:
        """Join a domain.

        Args:
            domain: Number of the domain, as ``ROS_DOMAIN_ID``.
            interface: Network interface; no other one is used.

        Raises:
            MissingPackage: If cyclonedds is not installed.
            ServerError: If it cannot join, as there is no such interface.
        """
        self._domains = import_optional("cyclonedds.domain", EXTRA)
        core = import_optional("cyclonedds.core", EXTRA)
        is_local = interface == LOOPBACK
        config = _CONFIG.format(
            interface=quoteattr(interface),
            multicast=str(not is_local).lower(),
            discovery=_LOCAL if is_local else "",
        )
        try:
            self._domain = self._domains.Domain(domain, config)
            self._participant = self._domains.DomainParticipant(domain)
        except core.DDSException as error:
            text = f"no DDS on interface {interface!r} in domain {domain}"
            raise ServerError(f"{text}, expected one of this machine") from error
        self._topics: dict[str, Any] = {}
        self._writers: dict[str, Any] = {}
        self._readers: list[tuple[Any, DriveCallback]] = []

    def publish(self, message: TopicMessage) -> None:
        """See ``RosSide.publish``."""
        topic, encoded, latched = message
        type_ = _struct_of(encoded.type)
        writer = self._writers.get(topic)
        if writer is None:
            pub = import_optional("cyclonedds.pub", EXTRA)
            quality = _quality(latched=latched)
            writer = pub.DataWriter(
                self._participant, self._topic(topic, type_), quality
            )
            self._writers[topic] = writer
        sample = type_.__new__(type_)
        sample.encoded = encoded.data
        writer.write(sample)

    def subscribe(self, topic: str, take: DriveCallback) -> None:
        """See ``RosSide.subscribe``."""
        sub = import_optional("cyclonedds.sub", EXTRA)
        place = self._topic(topic, _struct_of(TWIST))
        reader = sub.DataReader(self._participant, place, _quality(latched=False))
        self._readers.append((reader, take))

    async def run(self) -> None:
        """See ``RosSide.run``."""
        while True:
            for reader, take in self._readers:
                for twist in reader.take(DEPTH):
                    if hasattr(twist, "linear"):  # else one that writes has left
                        take(twist.linear.x, twist.angular.z)
            await asyncio.sleep(POLL)

    def _topic(self, name: str, type_: Any) -> Any:
        topics = import_optional("cyclonedds.topic", EXTRA)
        return topics.Topic(self._participant, f"rt{name}", type_)


def _encoded(sample: Any, **_: object) -> bytes:
    """Return a message that is encoded already; see ``IdlStruct.serialize``."""
    data: bytes = sample.encoded
    return data


@cache
def _struct_of(type_: str) -> Any:
    """Return the class of cyclonedds for a type of messages."""
    idl = import_optional("cyclonedds.idl", EXTRA)
    package, _, name = type_.partition("/msg/")
    fields = {field.name: _annotation(field) for field in fields_of(type_)}
    name = f"{package}::msg::dds_::{name}_"
    struct = idl.make_idl_struct(name.rpartition("::")[2], name, fields)
    struct.serialize = _encoded
    return struct


def _annotation(field: Field) -> Any:
    types = import_optional("cyclonedds.idl.types", EXTRA)
    simple = {"string": str, "bool": bool}
    if field.type in simple:
        element: Any = simple[field.type]
    elif "/" in field.type:
        element = _struct_of(field.type)
    else:
        element = getattr(types, field.type)
    if field.length is None:
        return element
    return (
        types.array[element, field.length] if field.length else types.sequence[element]
    )


def _quality(*, latched: bool) -> Any:
    qos = import_optional("cyclonedds.qos", EXTRA)
    policy = qos.Policy
    kept = policy.Durability.TransientLocal if latched else policy.Durability.Volatile
    return qos.Qos(
        policy.Reliability.Reliable(0),  # a slow reader holds up nobody
        policy.History.KeepLast(1 if latched else DEPTH),
        kept,
        policy.DataRepresentation(use_cdrv0_representation=True),
    )
