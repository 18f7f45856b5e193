"""Plans: dataclasses for the Python API whose fields are also command-line options.

A field is documented once, in the section ``Attributes:`` of its class, and its range
is part of its type: ``speed: Annotated[float, Gt(0), Unit("m/s")] = 0.3``. Plans can
share base classes. A plan may have these class variables:

- ``option_group``: heading of the options in the help of commands;
- ``one_required``: sets of fields, from each of which exactly one must be given;
- ``at_most_one``: sets of fields that exclude each other.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from enum import Enum
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Final,
    Literal,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

Sets: TypeAlias = tuple[tuple[str, ...], ...]  # sets of names of fields
REQUIRED: Final = inspect.Parameter.empty  # marks a field without a default
_SECTION: Final = re.compile(r"\n(?:Attributes|Args):\n((?:(?: +.*)?\n)*)")
_ENTRY: Final = re.compile(r"^ {4}(\w+): (.*(?:\n {5,}.*)*)", re.MULTILINE)

Marker = TypeVar("Marker")


@dataclass(frozen=True, slots=True)
class Option:
    """Properties of the command-line option of a field, in addition to name and type.

    Attributes:
        names: Option names, such as ``("-o", "--output")``; by default the name of the
            field with hyphens.
        is_argument: Whether the field is a positional argument.
        metavar: Placeholder of the value in the help.
        is_rare: Whether only ``--help-all`` lists the option.
        words: Values for shell completion: ``maps``, ``sensors`` or ``robots``.
        needs: Fields, one of which must be given with this option.
        is_config_file: Whether the value is a file with values of the other options.
        may_be_infinite: Whether a number may be ``inf``.
    """

    names: tuple[str, ...] = ()
    is_argument: bool = False
    metavar: str = ""
    is_rare: bool = False
    words: Literal["", "maps", "sensors", "robots"] = ""
    needs: tuple[str, ...] = ()
    is_config_file: bool = False
    may_be_infinite: bool = False


RARE: Final = Option(is_rare=True)


@dataclass(frozen=True, slots=True)
class Form:
    """The text format of an option's value, such as ``X,Y``.

    Attributes:
        name: Description of the format, such as ``X,Y``.
        read: Parses a text; raises ValueError if the format is wrong.
    """

    name: str
    read: Callable[[str], object]


@dataclass(frozen=True, slots=True)
class PlanField:
    """A field of a plan, or a parameter of a function.

    Attributes:
        name: Name in Python.
        type: Type of the value; type of one element if the field is repeated.
        markers: Metadata that ``Annotated`` adds to the type.
        is_repeated: Whether the field has any number of values.
        default: Default value; ``REQUIRED`` if there is none.
        help: Documentation of the field.
        group: ``option_group`` of the class that defines the field.
    """

    name: str
    type: Any
    markers: tuple[object, ...]
    is_repeated: bool
    default: object
    help: str
    group: str = ""

    def marker(self, kind: type[Marker]) -> Marker | None:
        """Return the last marker of a type, or None if there is none."""
        found = [each for each in self.markers if isinstance(each, kind)]
        return found[-1] if found else None

    @property
    def option(self) -> Option:
        """All ``Option`` markers merged into one; later markers take precedence."""
        merged = Option()
        for each in self.markers:
            if isinstance(each, Option):
                own = {f.name: getattr(each, f.name) for f in fields(Option)}
                # Unset attributes are skipped, so a marker such as RARE keeps the
                # attributes that an earlier marker has set.
                merged = replace(merged, **{k: v for k, v in own.items() if v})
        return merged

    @property
    def choices(self) -> tuple[str, ...]:
        """The allowed words of a Literal or an Enum; empty for other types."""
        if get_origin(self.type) is Literal:
            return tuple(map(str, get_args(self.type)))
        if isinstance(self.type, type) and issubclass(self.type, Enum):
            return tuple(str(each.value) for each in self.type)
        return ()


def read_point(text: str) -> tuple[float, float]:
    """Parse a point in the format ``X,Y``.

    Raises:
        ValueError: If the text does not consist of two finite numbers.
    """
    x, y = read_numbers(text)
    return x, y


def read_numbers(text: str) -> list[float]:
    """Parse finite numbers separated by commas.

    Raises:
        ValueError: If a part is not a finite number.
    """
    numbers = [float(number) for number in text.split(",")]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("expected finite numbers")
    return numbers


PointXY = Annotated[tuple[float, float], Form("X,Y", read_point)]


def plan_fields(plan: type) -> tuple[PlanField, ...]:
    """Return the fields of a plan; its own fields come before inherited fields."""
    texts: dict[str, str] = {}
    owners: dict[str, type] = {}
    # Base classes are read first, so subclasses can override the texts of fields.
    for owner in reversed(plan.__mro__):
        texts |= read_help(owner.__doc__ or "")
        owners |= dict.fromkeys(vars(owner).get("__annotations__", ()), owner)
    hints = get_type_hints(plan, include_extras=True)
    found = []
    # The sort is stable, so fields of one class keep their order.
    known = sorted(fields(plan), key=lambda each: plan.__mro__.index(owners[each.name]))
    for each in known:
        default = REQUIRED if each.default is MISSING else each.default
        if each.default_factory is not MISSING:
            default = each.default_factory()
        help_ = texts.get(each.name, "")
        parts = _split_hint(hints[each.name])
        group = getattr(owners[each.name], "option_group", "")
        found.append(PlanField(each.name, *parts, default, help_, group))
    return tuple(found)


def parameter_fields(function: Callable[..., object]) -> tuple[PlanField, ...]:
    """Return the parameters of a function with their documentation."""
    texts = read_help(function.__doc__ or "")
    hints = get_type_hints(function, include_extras=True)
    return tuple(
        PlanField(name, *_split_hint(hints[name]), each.default, texts.get(name, ""))
        for name, each in inspect.signature(function).parameters.items()
    )


def read_help(docstring: str) -> Mapping[str, str]:
    r"""Return the documentation of fields or parameters by their names.

    Args:
        docstring: Docstring of a class or a function, in Google's style.

    >>> read_help("Drive.\n\nAttributes:\n    speed: Maximum, ``m/s``.")
    {'speed': 'Maximum, m/s.'}
    """
    section = _SECTION.search(f"{inspect.cleandoc(docstring)}\n")
    entries = _ENTRY.findall(section[1]) if section else []
    return {name: " ".join(text.replace("``", "").split()) for name, text in entries}


def _split_hint(hint: Any) -> tuple[Any, tuple[object, ...], bool]:
    """Split a type hint: value type, markers, and whether the option is repeatable."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        if any(isinstance(each, Form) for each in inner[1:]):
            return inner[0], inner[1:], False  # The format reads the text as a whole.
        kind, markers, is_repeated = _split_hint(inner[0])
        return kind, (*markers, *inner[1:]), is_repeated
    if origin in (Union, UnionType):
        # A field may have only one type in addition to None, since a text could be
        # ambiguous for several types. With several types, this unpacking fails when the
        # command is created.
        (kept,) = (each for each in inner if each is not NoneType)
        return _split_hint(kept)
    if origin is list or (origin is tuple and inner[-1] is Ellipsis):
        kind, markers, _ = _split_hint(inner[0])
        return kind, markers, True
    return hint, (), False
