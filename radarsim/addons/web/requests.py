"""The requests that the page may send: one class for each kind, checked when parsed.

A request is a JSON object whose ``op`` names its kind. Unknown keys and values of
another type are errors.

Many requests name a robot class, an algorithm or a setting. The page offers the names
that ``make_offers`` lists from the program's own tables, so the choices are always up
to date. Each choice has a name for requests and a label for display.
"""

import math
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from radarsim.autonomy.plans import Algorithm, StrategyName
from radarsim.errors import RadarsimError, expected_one_of
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.simulation.config import SimulationConfig
from radarsim.validation import describe_invalid

LONGEST_MESSAGE = 4096  # bytes
MESSAGES_PER_SECOND = 50

Text: TypeAlias = Annotated[str, Field(max_length=200)]
RobotName: TypeAlias = Annotated[str, Field(min_length=1, max_length=210)]
# Names that can be part of a line of the protocol, even in a list with commas.
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
    """Raised if a request of a browser is malformed, or cannot be executed."""


class Request(BaseModel):
    """A request of the page; ``op`` is the name of its class in lower case."""

    # Strict mode does not convert types: 1 is not True, and "1" is not a number.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    op: str = ""


class Hello(Request):
    """Send the token; it has to be the first message."""

    token: Text


class Select(Request):
    """Select the robot whose echoes are shown; None for none."""

    robot: RobotName | None


class Look(Request):
    """Switch frames on when the page becomes visible, and off when it is hidden."""

    on: bool


class Spawn(Request):
    """Spawn a robot at a start, or at a pose: x and y in m, yaw in rad, map frame.

    Without a name, the commander chooses one. Without a start and a pose, the robot
    takes the first free start.
    """

    class_name: Annotated[
        str, Field(alias="class", pattern=r"^[A-Za-z][A-Za-z0-9_.]{0,63}$")
    ]
    name: OwnName | None = None
    start: Text | None = None
    pose: tuple[Coordinate, Coordinate, Coordinate] | None = None


class Remove(Request):
    """Remove a robot of the commander."""

    robot: RobotName


class Drive(Request):
    """Drive a robot ahead and turn it left, as shares of its top speed and turn rate.

    The robot stops after ``own_robot.DEAD_MAN`` seconds without another command.
    """

    robot: RobotName
    v: Share
    w: Share


class Stop(Request):
    """Stop a robot and its task; None stops all robots of the commander."""

    robot: RobotName | None = None


class Setting(Request):
    """Change a setting of a scanner; None means unlimited or the default value."""

    robot: RobotName
    scanner: RobotName
    key: Key
    value: Value | None


class Goto(Request):
    """Drive to a goal, m, and turn to a heading, rad (None: any), in the map frame."""

    robot: RobotName
    algorithm: Algorithm
    goal: tuple[Coordinate, Coordinate]
    heading: Coordinate | None = None

    def __str__(self) -> str:
        """Return the goal as a text for display."""
        text = f"drive to {self.goal[0]:.2f}, {self.goal[1]:.2f}"
        if self.heading is not None:
            text += f", facing {math.degrees(self.heading):.0f}\N{DEGREE SIGN}"
        return text


class Explore(Request):
    """Explore the area with a robot, and map it."""

    robot: RobotName
    strategy: StrategyName


class Map(Request):
    """Start or end a map from the scans of a robot, by default from its radar."""

    robot: RobotName
    on: bool
    scanner: RobotName | None = None
    colours: Colours = "usarcommander"


class Cancel(Request):
    """Cancel a task."""

    task: int


class Record(Request):
    """Start or end a recording of all robots of the server."""

    on: bool


class Pace(Request):
    """Pause, resume, pause after a step, s, or change the speed; None keeps a value.

    The speed is in simulated seconds per second.
    """

    paused: bool | None = None
    speed: Annotated[float, Field(ge=0.05, le=20, allow_inf_nan=False)] | None = None
    step: Annotated[float, Field(ge=0.01, le=10, allow_inf_nan=False)] | None = None


class Seek(Request):
    """Jump to another time of the recording that is played, s."""

    t: Time


class Triangles(Request):
    """Request the triangles of the map."""


class Ack(Request):
    """Acknowledge a shown frame by the frame's time, and request the next frame."""

    t: Time | None = None


class _AnyRequest(BaseModel):
    op: str


_KINDS: Final = {kind.__name__.lower(): kind for kind in Request.__subclasses__()}


def parse_request(text: str) -> Request:
    """Parse a message of the page.

    Raises:
        BadRequest: If the text is no JSON, its kind is unknown, or a value is wrong;
            the message names the first wrong value.
    """
    try:
        op = _AnyRequest.model_validate_json(text).op
        if op in _KINDS:
            return _KINDS[op].model_validate_json(text)
        problem = f"op {expected_one_of(op, [*_KINDS])}"
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "message"
        problem = f"{place}: {describe_invalid(first)}"
        if first["type"] == "json_invalid":
            problem = first["msg"]
    raise BadRequest(problem)


# Smallest value, largest value and step of each setting with a slider. The most useful
# settings come first. All other numeric settings have an input field.
SLIDERS: Final[Mapping[str, tuple[float, float, float]]] = {
    "side_offset_uu": (0, 100, 1),
    "penetration_power": (0, 5, 0.05),
    "max_range": (1, 80, 1),
    "ray_choice": (0, 0, 0),  # a choice has no limits; only the order counts
    "return_mode": (0, 0, 0),
}
FIRST_CLASS: Final = "P3AT_Compare360"  # with a 360° radar and a 360° laser
_LABELS: Final = {"tangentbug": "TangentBug", "planned": "Planned paths"}
_UNITS: Final = {
    "deg": "°",
    "uu": "UU",
    "hz": "Hz",
    "ghz": "GHz",
    "db": "dB",
    "dbsm": "dBsm",
}
# The last word of a setting's name, if the setting is in metres.
_METRES: Final = ("distance", "range", "noise", "quantum", "resolution")


def make_offers(config: SimulationConfig) -> dict[str, Any]:
    """Return the robot classes, algorithms, strategies and settings to choose from.

    Args:
        config: The robot classes of the server, and changed settings of their items.
    """
    return {
        "classes": list(_classes(config)),
        "algorithms": _named(Algorithm),
        "strategies": _named(StrategyName),
        "settings": list(_settings()),
    }


def _classes(config: SimulationConfig) -> Iterable[dict[str, str]]:
    """Yield the robot classes, each with the type and angle of its scanners."""
    for name in sorted(config.robot_names(), key=lambda name: name != FIRST_CLASS):
        scanners = config.robot(name).items_of("RangeScanner")
        words = []
        for settings in map(config.scanner_settings, scanners):
            # A full circle includes the gap between the last beam and the first.
            covered = settings.fov_deg + settings.resolution_deg
            angle = 360 if covered >= 360 else round(settings.fov_deg)
            words.append(f"{settings.medium} {angle}\N{DEGREE SIGN}")
        yield {"name": name, "label": f"{name}: {' + '.join(words) or 'no scanner'}"}


def _named(choices: type[StrEnum]) -> list[dict[str, str]]:
    return [{"name": each.value, "label": _label(each.value)} for each in choices]


def _settings() -> Iterable[dict[str, Any]]:
    """Yield the settings of scanners that a single control can change."""
    schema = SensorSettings.model_json_schema()["properties"]
    for key in (*SLIDERS, *(key for key in schema if key not in SLIDERS)):
        described = schema[key]
        # The schema of an optional setting is ``anyOf`` a value and null.
        described = described.get("anyOf", [described])[0]
        kind, choices = described["type"], described.get("enum")
        if key == "medium" or kind == "array":
            continue
        least, most = described.get("minimum"), described.get("maximum")
        step = 1.0 if kind == "integer" and choices is None else None
        slides = kind == "number" and key in SLIDERS
        if slides:
            least, most, step = SLIDERS[key]
        words, _, last = key.rpartition("_")
        unit = "m" if last in _METRES else _UNITS.get(last, "")
        yield {
            "key": key,
            "label": _label(words if last in _UNITS else key),
            "type": kind if choices is None else "choice",
            "min": least,
            "max": most,
            "step": step,
            "unit": unit,
            "choices": choices,
            "slides": slides,
        }


def _label(name: str) -> str:
    """Return the label of a name, such as "Side offset" for ``side_offset``."""
    if name in _LABELS:
        return _LABELS[name]
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]
