"""What is said to the log when a client asks for something in vain."""

from dataclasses import dataclass

from radarsim.errors import MalformedMessage
from radarsim.protocol.wire import decode_message

# The fields that have a meaning here; clients of other servers send others too.
FIELDS: dict[str, tuple[str, ...]] = {
    "INIT": ("ClassName", "Name", "Start", "Location", "Rotation"),
    "DRIVE": ("Left", "Right", "Normalized", "Light", "Flip"),
    "GETGEO": ("Type", "Name"),
    "GETCONF": ("Type", "Name"),
    "SET": ("Type", "Name", "Opcode", "Params"),
    "GETSTARTPOSES": (),
}


@dataclass(frozen=True, slots=True)
class Notice:
    """Something that a client did and that had no effect, or not the one it asked for.

    Attributes:
        kind: The same for all notices alike, so that a log need say it only once.
        text: What came, and what was expected.
    """

    kind: str
    text: str


def malformed(line: str, error: MalformedMessage) -> Notice:
    """Tell of a line that is no command; those of one verb are alike."""
    verb = line.partition("{")[0].strip().upper()
    return Notice(f"malformed {verb if verb in FIELDS else 'line'}", str(error))


def unknown_fields(line: str) -> Notice | None:
    """Tell of the fields of a command that have no meaning here, if it has any."""
    message = decode_message(line)
    verb = message.verb.upper()
    known = FIELDS[verb]
    lowered = {key.lower() for key in known}
    strange = [key for key, _ in message.segments if key.lower() not in lowered]
    if not strange:
        return None
    return Notice(
        f"{verb} fields", f"{verb} {strange[0][:80]!r}, expected of {list(known)}"
    )
