"""``radarsim ros``: the robots of a server as topics of ROS 2."""

from __future__ import annotations

import asyncio
import logging
import sys
from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.cli.completion import complete_robot
from radarsim.cli.options import (
    DriveUnit,
    DriveUnitOption,
    HostOption,
    PortOption,
    server_address,
)
from radarsim.cli.output import print_message, start_log
from radarsim.cli.serve import cure_of_port
from radarsim.errors import import_optional

if TYPE_CHECKING:
    from radarsim.addons.ros.bridge import BridgeSettings, RosSide

ROSBRIDGE_PORT = 9090


class Bridge(StrEnum):
    """Ways to programs of ROS."""

    ROSBRIDGE = "rosbridge"
    DDS = "dds"


BridgeOption = Annotated[
    Bridge,
    typer.Option(
        help="JSON over a WebSocket, for roslibpy, roslibjs and Foxglove; or DDS, for"
        " ROS 2 itself, which needs the extra 'dds'."
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        metavar="CLASS",
        autocompletion=complete_robot,
        help="Spawn a robot of this class, which follows cmd_vel.",
    ),
]
NameOption = Annotated[str, typer.Option(help="Name of that robot.")]
StartNameOption = Annotated[str | None, typer.Option(help="Name of its start pose.")]
EchoesOption = Annotated[
    bool, typer.Option(help="Publish the echoes and targets of all scanners as well.")
]
MappedOption = Annotated[
    str | None,
    typer.Option(
        "--map",
        metavar="ROBOT",
        help="Map this robot, and publish the map each second.",
    ),
]
WebHostOption = Annotated[str, typer.Option(help="Address on which rosbridge listens.")]
WebPortOption = Annotated[
    int, typer.Option(min=0, max=65535, help="Port of rosbridge; 0 takes a free one.")
]
OriginOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="URL",
        help="Site whose pages may use rosbridge, such as http://localhost:8080; repeat"
        " it for others.",
    ),
]
DomainOption = Annotated[
    int, typer.Option(min=0, max=232, help="Domain of DDS, as ROS_DOMAIN_ID.")
]
InterfaceOption = Annotated[
    str, typer.Option(help="Network interface of DDS; lo stays on this machine.")
]


def ros(
    *,
    bridge: BridgeOption = Bridge.ROSBRIDGE,
    host: HostOption = None,
    port: PortOption = None,
    robot: RobotOption = None,
    name: NameOption = "R1",
    start: StartNameOption = None,
    echoes: EchoesOption = False,
    mapped: MappedOption = None,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
    web_host: WebHostOption = "127.0.0.1",
    web: WebPortOption = ROSBRIDGE_PORT,
    origin: OriginOption = None,
    domain: DomainOption = 0,
    interface: InterfaceOption = "lo",
) -> None:
    """Publish what the robots of a server sense as topics of ROS 2, and drive one."""
    from radarsim.addons.ros.bridge import BridgeSettings

    start_log(logging.WARNING, "%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("uvicorn").setLevel(logging.ERROR)  # peers cannot fill the log
    settings = BridgeSettings(
        server=server_address(host, port),
        robot_class=robot,
        robot_name=name,
        start=start,
        echoes=echoes,
        mapped=mapped,
        drive_unit=drive_unit.value,
    )
    if bridge is Bridge.DDS:
        side = _join_domain(domain, interface)
    else:
        side = _make_server(web_host, web, origin or ())
    with cure_of_port({"--web": web}):
        raise typer.Exit(asyncio.run(_run(settings, side)))


def _join_domain(domain: int, interface: str) -> RosSide:
    """Return the side of DDS.

    Raises:
        MissingPackage: If a package is missing; it names the extra.
        ServerError: If it cannot join.
    """
    for package in ("cyclonedds.domain", "rosbags.typesys"):
        import_optional(package, "dds")
    from radarsim.addons.ros.dds import DdsParticipant

    side = DdsParticipant(domain, interface)
    typer.echo(f"radarsim: DDS domain {domain} on {interface}")
    sys.stdout.flush()
    return side


def _make_server(host: str, port: int, origins: Sequence[str]) -> RosSide:
    """Return the side of rosbridge, which does not listen yet."""
    from radarsim.addons.ros.rosbridge_server import RosbridgeServer

    if host not in ("127.0.0.1", "localhost", "::1"):
        print_message(f"whoever reaches {host} can drive the robot")
    return RosbridgeServer(host, port, announce, origins)


async def _run(settings: BridgeSettings, side: RosSide) -> int:
    """Bridge until a signal comes."""
    from radarsim.addons.ros.bridge import run_bridge
    from radarsim.listening import exit_code_of_signal

    with exit_code_of_signal() as exit_code:
        running = asyncio.ensure_future(run_bridge(settings, side))
        pending: set[asyncio.Future[object]] = {running, exit_code}  # type: ignore[arg-type]
        await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
        if running.done():
            running.result()  # raises what ended it
            return 1
        running.cancel()
        await asyncio.wait({running})
        return exit_code.result()


def announce(address: tuple[str, int]) -> None:
    """Tell programs on stdout that clients of rosbridge can connect."""
    typer.echo(f"radarsim: rosbridge on ws://{address[0]}:{address[1]}")
    sys.stdout.flush()
