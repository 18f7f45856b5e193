"""``radarsim ros``: the robots of a server as topics of ROS 2."""

from __future__ import annotations

import asyncio
import logging
import sys
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.cli.options import (
    DriveUnit,
    DriveUnitOption,
    HostOption,
    PortOption,
    server_address,
)
from radarsim.cli.output import print_message, start_log
from radarsim.cli.serve import cure_of_port

if TYPE_CHECKING:
    from radarsim.ros.bridge import BridgeSettings, RosSide

ROSBRIDGE_PORT = 9090


class Bridge(StrEnum):
    """Ways to programs of ROS."""

    ROSBRIDGE = "rosbridge"
    DDS = "dds"


def ros(
    *,
    bridge: Annotated[
        Bridge,
        typer.Option(
            help="JSON over a WebSocket, for roslibpy, roslibjs and Foxglove; or DDS,"
            " for ROS 2 itself, which needs the extra 'dds'."
        ),
    ] = Bridge.ROSBRIDGE,
    host: HostOption = None,
    port: PortOption = None,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="CLASS",
            help="Spawn a robot of this class, which follows cmd_vel.",
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="Name of that robot.")] = "R1",
    start: Annotated[str | None, typer.Option(help="Name of its start pose.")] = None,
    echoes: Annotated[
        bool, typer.Option(help="Publish the echoes of all scanners as well.")
    ] = False,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
    web_host: Annotated[
        str, typer.Option(help="Address on which rosbridge listens.")
    ] = "127.0.0.1",
    web: Annotated[
        int,
        typer.Option(min=0, max=65535, help="Port of rosbridge; 0 takes a free one."),
    ] = ROSBRIDGE_PORT,
    origin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="Site whose pages may use rosbridge, such as http://localhost:8080;"
            " repeat it for others.",
        ),
    ] = None,
    domain: Annotated[
        int, typer.Option(min=0, max=232, help="Domain of DDS, as ROS_DOMAIN_ID.")
    ] = 0,
    interface: Annotated[
        str, typer.Option(help="Network interface of DDS; lo stays on this machine.")
    ] = "lo",
) -> None:
    """Publish what the robots of a server sense as topics of ROS 2, and drive one."""
    from radarsim.ros.bridge import BridgeSettings

    start_log(logging.WARNING, "%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("uvicorn").setLevel(logging.ERROR)  # peers cannot fill the log
    settings = BridgeSettings(
        server=server_address(host, port),
        robot_class=robot,
        robot_name=name,
        start=start,
        echoes=echoes,
        drive_unit=drive_unit.value,
    )
    if bridge is Bridge.DDS:
        from radarsim.ros.dds import DdsParticipant

        side: RosSide = DdsParticipant(domain, interface)
        typer.echo(f"radarsim: DDS domain {domain} on {interface}")
        sys.stdout.flush()
    else:
        from radarsim.ros.rosbridge_server import RosbridgeServer

        if web_host not in ("127.0.0.1", "localhost", "::1"):
            print_message(f"whoever reaches {web_host} can drive the robot")
        side = RosbridgeServer(web_host, web, announce, origin or ())
    with cure_of_port({"--web": web}):
        raise typer.Exit(asyncio.run(_run(settings, side)))


async def _run(settings: BridgeSettings, side: RosSide) -> int:
    """Bridge until a signal comes."""
    from radarsim.ros.bridge import run_bridge
    from radarsim.server.lifecycle import exit_code_of_signal

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
