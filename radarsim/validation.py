"""Messages for invalid values in YAML files, settings, requests and arguments.

pydantic models find most invalid values. `yaml_reader` adds the position in the file;
`scene.map_checks` has the checks and messages for several keys of maps.
"""

import math
import re
from collections.abc import Callable
from numbers import Real
from typing import Any, Final

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from radarsim.errors import did_you_mean, expected_one_of

_DECIMAL_COMMA: Final = re.compile(r"[+-]?[0-9]{1,20},[0-9]{1,20}", re.ASCII)
_EXPECTED: Final = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "keys with values",
    "finite_number": "a finite number",
    "float_parsing": "a number",
    "float_type": "a number",
    "greater_than": "more than {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_type": "a whole number",
    "less_than": "less than {lt:g}",
    "less_than_equal": "at most {le:g}",
    "list_type": "a list",
    "enum": "{expected}",
    "literal_error": "{expected}",
    "model_type": "keys with values",
    "string_too_long": "at most {max_length} characters",
    "string_type": "text",
    "too_long": "{max_length} entries",
    "too_short": "{min_length} entries",
    "tuple_type": "a list",
}


def rejection(describe: Callable[[], str]) -> PydanticCustomError:
    """Create a validation error whose message is computed only if it is reported.

    Args:
        describe: Returns the message; the search for similar names can be slow.
    """
    return PydanticCustomError("rejected", "invalid", {"describe": describe})


def describe_invalid(details: ErrorDetails) -> str:
    """Return the message for an invalid value, with the value and the expected values.

    Args:
        details: One of the errors of a ``ValidationError``.
    """
    error_type, context = details["type"], details.get("ctx", {})
    if error_type == "missing":
        return "missing"
    # This message is computed only when needed, since most errors of an invalid file
    # are not reported.
    if error_type == "rejected":
        return str(context["describe"]())
    if error_type == "value_error":
        return str(context["error"])
    expected, meant = _expected(details, context), ""
    if error_type in ("literal_error", "enum") and isinstance(details["input"], str):
        meant = did_you_mean(details["input"], re.findall("'(.*?)'", expected))
    return f"{short_repr(details['input'])}{meant}, {expected}"


def describe_unknown_key(key: str, known: list[str]) -> str:
    """Return the message for an unknown key, with a similar key and all known keys."""
    return f"unknown key{did_you_mean(key, known)}, expected one of {known}"


def describe_settings(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Return a message for each invalid setting, with the name of the setting.

    Args:
        error: The error that the model raised.
        model: The model whose fields are the settings.
    """
    problems = []
    for details in error.errors():
        name = ".".join(str(step) for step in details["loc"])
        text = describe_invalid(details)
        if details["type"] == "extra_forbidden":
            text = f"no setting {expected_one_of(name, sorted(model.model_fields))}"
        elif details["type"] == "value_error" and name:
            text = f"{name}: {short_repr(details['input'])}, {text}"
        elif name:
            text = f"{name}: {text}"
        problems.append(text)
    return problems


def short_repr(value: object) -> str:
    """Return the repr of a value, cut to 80 characters, for messages.

    >>> short_repr("x" * 100) == "'" + "x" * 79
    True
    """
    return repr(value)[:80]


def point_hint(value: object) -> str:
    """Return a hint if a value is a number with a decimal comma; otherwise "".

    >>> point_hint("-1,5")
    ' with a decimal point, -1.5'
    """
    if isinstance(value, str) and _DECIMAL_COMMA.fullmatch(value.strip()):
        return f" with a decimal point, {value.strip().replace(',', '.')}"
    return ""


def _expected(details: ErrorDetails, context: dict[str, Any]) -> str:
    template = _EXPECTED.get(details["type"])
    if template is None:
        message = details["msg"]
        text = re.sub("^input should (be|have|match) ", "", message, flags=re.I)
        return f"expected {text[:1].lower()}{text[1:]}"
    text = f"expected {template.format(**context)}"
    if details["type"] in {"float_parsing", "float_type"}:
        text += point_hint(details["input"])
    return text


def check_number(what: str, value: float, *, above: float = -math.inf) -> None:
    """Check that a number is finite and above a limit.

    Args:
        what: Name of the number with its unit, for the message.
        value: The number.
        above: Exclusive lower limit.

    Raises:
        TypeError: If the value is not a number.
        ValueError: If the value is not finite, or not above the limit.
    """
    expected = "a finite number" if above == -math.inf else f"more than {above:g}"
    text = f"{what} {value!r}, expected {expected}"
    if not isinstance(value, Real):
        raise TypeError(text)
    if not above < value < math.inf:
        raise ValueError(text)


def check_port(port: object) -> None:
    """Check that a number is valid as a TCP port.

    Raises:
        ValueError: If the value is not a whole number from 0 to 65535.
    """
    if not isinstance(port, int) or not 0 <= port <= 65535:
        raise ValueError(f"port {port!r}, expected a whole number from 0 to 65535")
