"""Executes CONTROL commands of world controllers, which create and move crates."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from radarsim.errors import expected_one_of, list_names
from radarsim.geometry import Pose3
from radarsim.protocol.commands import CONTROLLER, LARGEST_PLACE, Action, Control
from radarsim.protocol.message import Triple
from radarsim.protocol.reports import CrateStates
from radarsim.scene.scene import LARGEST, MOST_CRATES, SMALLEST, Crate
from radarsim.server.host.connection import Client, Diagnostic
from radarsim.simulation.crates import CRATE

if TYPE_CHECKING:
    from radarsim.simulation.crates import Crates, PlacedCrate
    from radarsim.simulation.simulation import Simulation

MAX_CRATE_NAME: Final = 64  # characters


def control(
    simulation: Simulation, client: Client, command: Control
) -> Diagnostic | None:
    """Create, move, remove or list crates.

    Crates that are not permanent are removed when their client disconnects.
    """
    if not client.controls:
        expected = f"expected INIT of {CONTROLLER}"
        text = f"CONTROL by a client that is not a controller, {expected}"
        return Diagnostic("no controller", text)
    crates, problem = simulation.crates, None
    match command.action:
        case Action.GET_STATE:
            if states := _states(crates, command):
                client.reply(CrateStates(states), simulation.config.dialect)
        case Action.CREATE:
            problem = _create(simulation, command, client.number)
        case Action.KILL_ALL:
            for placed in crates:
                if placed.owner is not None and _is_within(placed, command):
                    crates.remove(placed)
        case _:
            problem = _change(crates, command)
    return problem


def _change(crates: Crates, command: Control) -> Diagnostic | None:
    """Move or remove one crate."""
    placed = crates.find(_name_of(command))
    if placed is None:
        names = [each.crate.name for each in crates]
        wanted = expected_one_of(command.name or "", names)
        return Diagnostic("crate", f"CONTROL {command.action} of {wanted}")
    if command.action is Action.KILL:
        crates.remove(placed)
        return None
    return _move(crates, placed, command)


def _name_of(command: Control) -> str:
    return (command.name or "")[:MAX_CRATE_NAME]


def _states(crates: Crates, command: Control) -> tuple[tuple[str, Triple, Pose3], ...]:
    """Return name, size and pose of each crate that the command selects."""
    wanted = _name_of(command).casefold()
    is_of_class = (command.class_name or CRATE).casefold() == CRATE.casefold()
    return tuple(
        (
            placed.crate.name,
            placed.crate.size,
            Pose3(*placed.crate.position, yaw=placed.crate.yaw),
        )
        for placed in crates
        if is_of_class and wanted in ("", placed.crate.name.casefold())
    )


def _create(simulation: Simulation, command: Control, owner: int) -> Diagnostic | None:
    crates, name = simulation.crates, _name_of(command)
    if (command.class_name or "").casefold() != CRATE.casefold():
        what = f"CONTROL Create of {(command.class_name or 'no class')[:80]!r}"
        return Diagnostic.of_unsupported(what, f", expected {CRATE}")
    if not name or crates.find(name) is not None or crates.is_full:
        expected = f"a new name, and at most {MOST_CRATES} crates"
        return Diagnostic("crate name", f"CONTROL Create {name!r}, expected {expected}")
    length, width, height = command.scale
    if not all(SMALLEST <= side <= LARGEST for side in command.scale):
        text = f"CONTROL Create of {length:g} x {width:g} x {height:g} m"
        return Diagnostic("crate size", f"{text}, expected {SMALLEST} to {LARGEST} m")
    position, yaw = command.position, command.rotation[2]
    if command.start is not None:
        start = simulation.scene.start(command.start)
        if start is None:
            names = [each.name for each in simulation.scene.starts]
            wanted = expected_one_of(command.start, names)
            return Diagnostic("start", f"CONTROL Create at start {wanted}")
        x, y, z = start.pose.position().tolist()
        position, yaw = (x, y, z + height / 2), start.pose.yaw
    in_way = crates.create(
        Crate(name, command.scale, position, yaw),
        falls=command.falls,
        owner=None if command.stays else owner,
    )
    return _hindrance(command, in_way)


def _move(crates: Crates, placed: PlacedCrate, command: Control) -> Diagnostic | None:
    crate = placed.crate
    x, y, z = command.position
    yaw = command.rotation[2]
    if command.action is Action.MOVE_BY:
        was_x, was_y, was_z = crate.position
        x, y, z = x + was_x, y + was_y, z + was_z
        yaw = math.remainder(yaw + crate.yaw, 2 * math.pi)
    if max(abs(x), abs(y), abs(z)) > LARGEST_PLACE:
        text = f"CONTROL {command.action} to ({x:g}, {y:g}, {z:g}) m"
        return Diagnostic("place", f"{text}, expected at most {LARGEST_PLACE:g} m")
    moved = Crate(crate.name, crate.size, (x, y, z), yaw)
    return _hindrance(command, crates.move(placed, moved))


def _hindrance(command: Control, in_way: list[str]) -> Diagnostic | None:
    if not in_way:
        return None
    text = f"CONTROL {command.action} to a place occupied by {list_names(in_way)}"
    return Diagnostic("no place", f"{text}, expected a free place")


def _is_within(placed: PlacedCrate, command: Control) -> bool:
    if command.corners is None:
        return True
    low, high = command.corners
    each = zip(low, placed.crate.position, high, strict=True)
    return all(a < at < b for a, at, b in each)
