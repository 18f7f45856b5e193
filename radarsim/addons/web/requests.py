"""What the page may ask for: one class for each kind of message, checked when parsed.

A message is a JSON object whose ``op`` tells its kind. Keys that a kind does not have,
and values of another type, are errors.
"""

from typing import Annotated, Literal, TypeAlias, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from radarsim.errors import RadarsimError, expected_one_of
from radarsim.validation import describe_invalid

LONGEST_MESSAGE = 4096  # bytes
MESSAGES_PER_SECOND = 50

Text: TypeAlias = Annotated[str, Field(max_length=200)]
RobotName: TypeAlias = Annotated[str, Field(min_length=1, max_length=210)]
# What a line of the wire can hold, also in a list of names.
OwnName: TypeAlias = Annotated[
    str, Field(pattern=r"^[!-+\--z|~]([ -+\--z|~]{0,62}[!-+\--z|~])?$")
]
Key: TypeAlias = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,63}$")]
Coordinate: TypeAlias = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Share: TypeAlias = Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]
Time: TypeAlias = Annotated[float, Field(allow_inf_nan=False)]
Colours: TypeAlias = Literal["usarcommander", "material"]
Whole: TypeAlias = Annotated[int, Field(ge=-(10**15), le=10**15)]
Word: TypeAlias = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.+-]{1,64}$")]
Value: TypeAlias = bool | Whole | Annotated[float, Field(allow_inf_nan=False)] | Word


class BadRequest(RadarsimError):
    """A message of a browser that cannot be understood."""


class Request(BaseModel):
    """A message of the page."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Hello(Request):
    """The first message; it opens all others."""

    op: Literal["hello"]
    token: Text


class Select(Request):
    """Show the echoes of one robot; None for those of none."""

    op: Literal["select"]
    robot: RobotName | None


class Look(Request):
    """Send frames while the page is on a screen, and none while it is hidden."""

    op: Literal["look"]
    on: bool


class Spawn(Request):
    """Spawn a robot at a start, or at a pose: x and y in m, yaw in rad, map frame.

    Without a name the commander chooses one; without a place, the first start.
    """

    op: Literal["spawn"]
    class_name: Annotated[
        str, Field(alias="class", pattern=r"^[A-Za-z][A-Za-z0-9_.]{0,63}$")
    ]
    name: OwnName | None = None
    start: Text | None = None
    pose: tuple[Coordinate, Coordinate, Coordinate] | None = None


class Remove(Request):
    """Remove a robot of the commander."""

    op: Literal["remove"]
    robot: RobotName


class Drive(Request):
    """Move a robot, as shares of its top speed ahead and its top turn to the left.

    It holds for ``own_robot.DEAD_MAN`` seconds.
    """

    op: Literal["drive"]
    robot: RobotName
    v: Share
    w: Share
    seq: int = 0


class Stop(Request):
    """Stop a robot and its tasks; None for all robots of the commander."""

    op: Literal["stop"]
    robot: RobotName | None = None


class Setting(Request):
    """Change a setting of a scanner; None is unlimited, or the default."""

    op: Literal["setting"]
    robot: RobotName
    scanner: RobotName
    key: Key
    value: Value | None


class Goto(Request):
    """Drive to a goal, m, map frame."""

    op: Literal["goto"]
    robot: RobotName
    algorithm: Text
    goal: tuple[Coordinate, Coordinate]


class Explore(Request):
    """Explore and map."""

    op: Literal["explore"]
    robot: RobotName
    strategy: Text


class Map(Request):
    """Make a map of what a robot senses, by default with its radar, and show it."""

    op: Literal["map"]
    robot: RobotName
    on: bool
    scanner: RobotName | None = None
    colours: Colours = "usarcommander"


class Cancel(Request):
    """Cancel a task."""

    op: Literal["cancel"]
    task: int


class Explain(Request):
    """Explain a beam of a scan: that of a time, or of the newest one."""

    op: Literal["explain"]
    robot: RobotName
    scanner: RobotName
    beam: Annotated[int, Field(ge=0, le=1_000_000)]
    t: Time | None = None


class Record(Request):
    """Begin to record all robots of the server, or end it."""

    op: Literal["record"]
    on: bool


class Triangles(Request):
    """Send the triangles of the map."""

    op: Literal["triangles"]


class Ack(Request):
    """The frame of a time is shown; the next one may come."""

    op: Literal["ack"]
    t: Time | None = None


AnyRequest: TypeAlias = Annotated[
    Hello
    | Select
    | Look
    | Spawn
    | Remove
    | Drive
    | Stop
    | Setting
    | Goto
    | Explore
    | Map
    | Cancel
    | Explain
    | Record
    | Triangles
    | Ack,
    Field(discriminator="op"),
]

OPS = [
    get_args(kind.model_fields["op"].annotation)[0]
    for kind in get_args(get_args(AnyRequest)[0])
]
_ADAPTER: TypeAdapter[AnyRequest] = TypeAdapter(AnyRequest)


def parse_request(text: str) -> AnyRequest:
    """Parse a message of the page.

    Raises:
        BadRequest: If it is no JSON, of an unknown kind, or has wrong values; names
            the first of them.
    """
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        raise BadRequest(_describe(error.errors()[0])) from None


def _describe(problem: ErrorDetails) -> str:
    """Return what is wrong, and where."""
    if problem["type"] == "union_tag_invalid":
        return f"op {expected_one_of(problem['ctx']['tag'], OPS)}"
    if problem["type"] in ("json_invalid", "union_tag_not_found"):
        return problem["msg"]
    place = ".".join(str(step) for step in problem["loc"])
    return f"{place or 'message'}: {describe_invalid(problem)}"
