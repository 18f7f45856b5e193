"""Changes of a scanner's settings, checked here before the server is asked."""

import json
import math
from typing import Any

from pydantic import ValidationError

from radarsim.addons.web.own_robot import OwnRobot
from radarsim.addons.web.requests import BadRequest, Setting
from radarsim.addons.web.robot_view import RobotView, Scanner
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.validation import describe_invalid


def change_setting(robot: OwnRobot, view: RobotView, request: Setting) -> None:
    """Change a setting from the next scan on.

    Raises:
        BadRequest: If there is no such scanner or setting, or the value is wrong.
    """
    scanner = view.scanners.get(request.scanner.casefold())
    if scanner is None:
        names = [each.name for each in view.scanners.values()]
        raise BadRequest(f"no scanner {request.scanner!r}, expected one of {names}")
    value = _value(request)
    settings = _changed(scanner, request.key, value) if scanner.settings else {}
    if settings:
        view.last_change = scanner, scanner.settings
        _take(scanner, settings)
    robot.change_setting(scanner.name, request.key, _as_text(value))


def undo_setting(view: RobotView) -> None:
    """Take back the last change, which the server has refused."""
    if view.last_change is not None:
        _take(*view.last_change)
        view.last_change = None


def _take(scanner: Scanner, settings: dict[str, Any]) -> None:
    scanner.settings = settings
    scanner.max_range = settings["max_range"]


def _value(request: Setting) -> Any:
    """Return the value; without one, power is unlimited, and others are by default."""
    if request.value is None and request.key == "penetration_power":
        return math.inf
    return request.value


def _changed(scanner: Scanner, key: str, value: Any) -> dict[str, Any]:
    """Return the settings with a change: as they are shown, so numbers stay numbers.

    Raises:
        BadRequest: If there is no such setting, or the value is wrong.
    """
    if key == "medium":
        raise BadRequest("medium: cannot be changed here")
    settings = {"medium": scanner.medium, **scanner.settings, key: value}
    try:  # as JSON: its arrays are tuples, and no text is a number
        changed = SensorSettings.model_validate_json(json.dumps(settings), strict=True)
    except ValidationError as error:
        problem = error.errors()[0]
        path = ".".join(str(step) for step in problem["loc"]) or key
        raise BadRequest(f"{path}: {describe_invalid(problem)}") from None
    return changed.model_dump(mode="json", exclude={"medium"})


def _as_text(value: Any) -> str:
    """Return a value as it stands behind an equals sign."""
    if value is None:
        return "null"
    if value == math.inf:
        return ".inf"
    return str(value).lower() if isinstance(value, bool) else str(value)
