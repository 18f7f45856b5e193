"""Commands that choose which cameras viewers of pictures see."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from radarsim.errors import expected_one_of
from radarsim.protocol.commands import SetViewports, ShowCamera
from radarsim.protocol.line_template import printable_name
from radarsim.server.host.connection import Diagnostic
from radarsim.server.host.replies import CAMERA, find_items

if TYPE_CHECKING:
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

DISABLE: Final = "disable"  # for a viewport without a camera
MOST_SHOWN: Final = 64  # machines whose viewers see a camera of somebody's choice


def show_camera(
    simulation: Simulation | None, vehicles: Iterable[Vehicle], command: ShowCamera
) -> Diagnostic | None:
    """Let the viewers on a machine see a camera, or what they see without a choice.

    Args:
        simulation: Where that is kept; None if it has not begun, so without robots.
        vehicles: All robots.
        command: The choice.
    """
    wanted = printable_name(command.robot or "").casefold()
    shown = {} if simulation is None else simulation.shown
    shown.pop(command.client, None)
    if command.robot is None:
        return None
    for vehicle in vehicles:
        if printable_name(vehicle.robot.name).casefold() != wanted:
            continue
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


def set_viewports(vehicle: Vehicle, command: SetViewports) -> Diagnostic | None:
    """Show other cameras in pictures; what the robot does not have changes nothing."""
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
