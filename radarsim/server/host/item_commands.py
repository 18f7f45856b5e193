"""Executes commands to a robot's items, and commands that choose cameras to show.

Each function executes one type of command. It returns a ``Diagnostic`` if the command
had no effect or another one than requested.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from radarsim.errors import MalformedMessage, PresetError, expected_one_of, list_names
from radarsim.presets.sensors import parse_settings
from radarsim.protocol.commands import (
    GetConf,
    GetGeo,
    SetItem,
    SetViewports,
    ShowCamera,
    parse_pose,
    parse_switch,
)
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import LARGEST_COMMANDED, parse_number
from radarsim.protocol.packages import LinkOrder
from radarsim.server.host.connection import Diagnostic
from radarsim.server.host.replies import CAMERA, find_items

if TYPE_CHECKING:
    from collections.abc import Sequence

    from radarsim.presets.robots import Item
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

SETTING: Final = "SETTING"
SCANNER_OPCODES: Final = ("ECHOES", "TARGETS", SETTING)
CAMERA_OPCODES: Final = ("ZOOM", "FOV")
OPCODES: Final = ("SCAN", "RESET", "POSE", *SCANNER_OPCODES, *CAMERA_OPCODES)
MAX_PROBLEMS: Final = 800  # characters; a command can have many wrong settings
DISABLE: Final = "disable"  # the name that leaves a viewport without a camera
MOST_SHOWN: Final = 64  # machines for which a camera can be chosen


def move_links(
    vehicle: Vehicle, verb: str, orders: Sequence[LinkOrder]
) -> Diagnostic | None:
    """Execute orders for links; return a diagnostic for links that do not exist."""
    missing = [
        order.name if order.link is None else f"{order.name} {order.link}"
        for order in orders
        if not vehicle.move_link(order)
    ]
    if not missing:
        return None
    model = vehicle.model
    packages = model.items_of("MisPkg")
    if not packages:
        return Diagnostic.of_unsupported(verb)
    known = [f"{item.name} 1 to {len(item.links)}" for item in packages]
    known += [link.name for item in packages for link in item.links if link.name]
    text = f"{verb} of {list_names(missing)[:80]}, which {model.name} does not have"
    return Diagnostic("link", f"{text}, expected one of {known}")


def set_items(
    simulation: Simulation, vehicle: Vehicle, command: SetItem
) -> Diagnostic | None:
    """Apply an opcode to items of one type."""
    if command.type == "Joint":  # case-sensitive, as in the original server
        return _set_joint(vehicle, command)
    items = find_items(vehicle.model, command.type, command.name)
    if not items:
        of_type = vehicle.model.items_of(command.type)
        return describe_missing(vehicle, command, of_type)
    opcode, params = command.opcode.upper(), command.params
    if opcode not in OPCODES:
        text = f"opcode {expected_one_of(command.opcode, OPCODES)}"
        return Diagnostic("opcode", text)
    kinds = (SCANNER_OPCODES, "RangeScanner"), (CAMERA_OPCODES, CAMERA)
    for opcodes, kind in kinds:
        if opcode in opcodes and items[0].type != kind:
            text = f"SET {opcode} of type {items[0].type!r}, expected {kind}"
            return Diagnostic("opcode", text)
    try:
        if opcode == SETTING:
            settings = parse_settings(params)
            vehicle.change_settings(items, settings, simulation.vehicles)
        else:
            _apply_opcode(vehicle, items, opcode, params)
    except (MalformedMessage, PresetError) as error:
        problems = "; ".join(str(error).splitlines())[:MAX_PROBLEMS]
        return Diagnostic(f"malformed {opcode}", f"SET {opcode}: {problems}")
    return None


def _set_joint(vehicle: Vehicle, command: SetItem) -> Diagnostic | None:
    """Move a link to an angle, rad."""
    if command.opcode not in ("Angle", "Target"):
        text = f"opcode {expected_one_of(command.opcode, ['Angle', 'Target'])}"
        return Diagnostic("opcode", text)
    try:
        angle = parse_number(command.params, largest=LARGEST_COMMANDED)
    except MalformedMessage as error:
        return Diagnostic("malformed Angle", f"SET {command.opcode}: {error}")
    order = LinkOrder(command.name or "", None, angle)
    return move_links(vehicle, SetItem.verb, [order])


def _apply_opcode(
    vehicle: Vehicle, items: Sequence[Item], opcode: str, params: str
) -> None:
    """Apply an opcode other than ``SETTING`` to items.

    Raises:
        MalformedMessage: If the parameters do not fit the opcode.
    """
    if opcode == "POSE":
        pose = parse_pose(params)
        for item in items:
            vehicle.set_ins(item, pose)
    elif opcode in CAMERA_OPCODES:
        angle = parse_number(params, largest=LARGEST_COMMANDED) if params else 0.0
        for item in items:  # whole degrees, as in the original server
            vehicle.zoom(item, math.trunc(math.degrees(angle)))
    elif opcode in SCANNER_OPCODES:
        enabled = parse_switch(params)
        for scanner in vehicle.scanners:
            if scanner.item in items and opcode == "ECHOES":
                scanner.sends_echoes = enabled
            elif scanner.item in items:
                scanner.sends_targets = enabled
    else:
        act = vehicle.request_scan if opcode == "SCAN" else vehicle.reset
        for item in items:
            act(item)


def describe_missing(
    vehicle: Vehicle, command: GetGeo | GetConf | SetItem, of_type: Sequence[Item]
) -> Diagnostic:
    """Describe the item that a command names but the robot does not have.

    Args:
        vehicle: The robot.
        command: The command.
        of_type: The robot's items of the command's type.
    """
    item_type, name = command.type, command.name
    if name is not None and of_type:
        expected = expected_one_of(name, [item.name for item in of_type])
        text = f"{command.verb} of {of_type[0].type} {expected}"
        return Diagnostic("item name", text)
    types: list[str] = [*dict.fromkeys(item.type for item in vehicle.model.items)]
    if not isinstance(command, SetItem):
        types = ["Robot", *types, "Echoes", "RadarTargets"]
    text = f"{command.verb} of type {expected_one_of(item_type, types)}"
    return Diagnostic("item type", text)


def set_viewports(vehicle: Vehicle, command: SetViewports) -> Diagnostic | None:
    """Choose the cameras in pictures; change nothing if one camera is unknown."""
    names = {camera.name.casefold(): camera.name for camera in vehicle.cameras}
    chosen = list(vehicle.viewports)
    for number, wanted in enumerate(command.cameras):
        if wanted is None:
            continue
        name = names.get(wanted.casefold())
        if name is None and wanted.casefold() != DISABLE:
            expected = expected_one_of(wanted, [*names.values(), DISABLE.capitalize()])
            return Diagnostic("viewport", f"SET Viewport{number + 1} {expected}")
        chosen[number] = name
    vehicle.viewports = chosen
    if command.is_quad is not None:
        vehicle.is_quad = command.is_quad
    return None


def show_camera(simulation: Simulation, command: ShowCamera) -> Diagnostic | None:
    """Choose the camera for viewers on a machine, or cancel the choice."""
    shown = simulation.shown
    shown.pop(command.client, None)
    if command.robot is None:
        return None
    for vehicle in robots_named(simulation, command.robot)[:1]:
        cameras = find_items(vehicle.model, CAMERA, command.name)
        if command.name and not cameras:
            names = [item.name for item in vehicle.cameras]
            expected = expected_one_of(command.name, names)
            return Diagnostic("item name", f"SET of Camera {expected}")
        name = cameras[0].name if command.name else None
        shown[command.client] = vehicle.number, name
        if len(shown) > MOST_SHOWN:
            del shown[next(iter(shown))]  # the oldest choice
        return None
    text = f"SET Camera of robot {command.robot[:80]!r}, which is not there"
    return Diagnostic("no robot", text)


def robots_named(simulation: Simulation, name: str) -> list[Vehicle]:
    """Return the robots with a name, case-insensitive.

    Names that differ only in characters that no line can contain count as equal, so
    several robots may have the same name.
    """
    wanted = printable_name(name).casefold()
    return [
        vehicle
        for vehicle in simulation.vehicles
        if printable_name(vehicle.robot.name).casefold() == wanted
    ]
