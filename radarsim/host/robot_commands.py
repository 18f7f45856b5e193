"""Commands to a robot and its items."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

from radarsim.errors import MalformedMessage, PresetError
from radarsim.host.connection import Diagnostic
from radarsim.host.replies import find_items
from radarsim.presets.robots import Item
from radarsim.presets.sensors import parse_settings
from radarsim.protocol.commands import Drive, SetItem, parse_pose, parse_switch
from radarsim.suggestions import expected_one_of

if TYPE_CHECKING:
    from radarsim.simulation.vehicle import Vehicle

SETTING: Final = "SETTING"
MAX_PROBLEMS: Final = 800  # characters; a client can have many settings wrong
TARGETS: Final = "TARGETS"
OPCODES: Final = ("SCAN", "RESET", "POSE", "ECHOES", TARGETS, SETTING)


def drive(vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    """Set wheel speeds and lamps; return what is wrong with the command, or None."""
    vehicle.robot.drive(
        command.left,
        command.right,
        normalized=command.normalized,
        light=command.light,
    )
    if (command.left is None) != (command.right is None):
        missing = "Left" if command.left is None else "Right"
        text = f"DRIVE without {missing}, expected Left and Right, or none of them"
        return Diagnostic("one side", text)
    return None


def set_items(
    vehicle: Vehicle, command: SetItem, others: Iterable[Vehicle]
) -> Diagnostic | None:
    """Apply an opcode to items; return what is wrong with the command, or None.

    Args:
        vehicle: The robot.
        command: The command.
        others: Robots of other clients.
    """
    items = find_items(vehicle.model, command.type, command.name)
    if not items:
        named = " ".join(filter(None, (command.type, command.name)))
        return Diagnostic("no item", f"SET of {named[:80]!r}, which is not there")
    opcode = command.opcode.upper()
    if opcode not in OPCODES:
        text = f"opcode {expected_one_of(command.opcode, OPCODES)}"
        return Diagnostic("opcode", text)
    try:
        if opcode == SETTING and items[0].type == "RangeScanner":
            vehicle.change_settings(items, parse_settings(command.params), others)
            return None
        return _apply_opcode(vehicle, items, opcode, command.params)
    except (MalformedMessage, PresetError) as error:
        problems = "; ".join(str(error).splitlines())[:MAX_PROBLEMS]
        return Diagnostic(f"malformed {opcode}", f"SET {opcode}: {problems}")


def _apply_opcode(
    vehicle: Vehicle, items: Sequence[Item], opcode: str, params: str
) -> Diagnostic | None:
    """Apply an opcode to items of one type.

    Raises:
        MalformedMessage: If the parameters are not those of the opcode.
        PresetError: If they are not settings of the items.
    """
    apply: Callable[[Item], None]
    match opcode:
        case "SCAN":
            apply = vehicle.request_scan
        case "RESET":
            apply = vehicle.reset
        case "POSE":
            apply = partial(vehicle.set_ins, pose=parse_pose(params))
        # All of the items have the same type.
        case _ if items[0].type != "RangeScanner":
            text = f"SET {opcode} of type {items[0].type!r}, expected RangeScanner"
            return Diagnostic("opcode", text)
        case "TARGETS":
            apply = partial(vehicle.enable_targets, enabled=parse_switch(params))
        case _:
            apply = partial(vehicle.enable_echoes, enabled=parse_switch(params))
    for item in items:
        apply(item)
    return None
