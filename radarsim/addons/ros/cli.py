"""``radarsim ros``: publish the robots of a server as ROS 2 topics, and drive one."""

from __future__ import annotations

import asyncio
import logging
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal

from annotated_types import Interval

from radarsim.cli.fields import Port, RobotName, Server
from radarsim.cli.output import print_message, print_now, start_log
from radarsim.cli.server_options import hint_of_port
from radarsim.errors import import_optional, join_address
from radarsim.plans import RARE, Option, Sets
from radarsim.protocol.dialect import DriveUnit

if TYPE_CHECKING:
    from radarsim.addons.ros.bridge import RosSide


PORTS: Final = {"rosbridge": 9090, "foxglove": 8765}  # default ports of these protocols
CLIENTS: Final = {
    "rosbridge": "radarsim.addons.ros.rosbridge:RosbridgeClient",
    "foxglove": "radarsim.addons.ros.foxglove:FoxgloveClient",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeOptions:
    """Options for the protocol and the address at which ROS programs reach the bridge.

    Attributes:
        bridge: Protocol: rosbridge, for roslibpy and roslib (JavaScript); foxglove, the
            protocol of Foxglove, which needs the extra 'record'; or dds, for ROS 2
            nodes, which needs the extra 'dds'.
        web: WebSocket port of rosbridge or Foxglove, by default 9090 or 8765; 0 selects
            a free port.
        web_host: Address on which the WebSocket of rosbridge or Foxglove is served.
        origin: Web site whose pages may connect, such as http://localhost:8080; repeat
            the option for others. Foxglove's site may always use its bridge.
        domain: DDS domain, the same as ROS_DOMAIN_ID.
        interface: Network interface for DDS; lo sends to this machine only.
    """

    option_group: ClassVar = "Bridge"

    bridge: Literal["rosbridge", "foxglove", "dds"] = "rosbridge"
    web: Port | None = None
    web_host: Annotated[str, RARE] = "127.0.0.1"
    origin: Annotated[tuple[str, ...], Option(metavar="URL", is_rare=True)] = ()
    domain: Annotated[int, Interval(ge=0, le=232), RARE] = 0
    interface: Annotated[str, RARE] = "lo"


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicOptions:
    """Options that select the topics, and set their names.

    Attributes:
        map: Build a map from this robot's scans, and publish it on /map each second.
        draw: Publish the surfaces of this map on /scene; it must be the server's map.
        true_map: Publish the true occupancy grid of the map of --draw on /map.
        no_namespace: Name topics and frames of this robot without the robot's name,
            such as /odom and base_link.
        own_localization: Publish no transform from map to odom, for use with AMCL or
            slam_toolbox; by default the true transform is published.
        echoes: Also publish the echoes and targets of all scanners.
        image_port: Publish pictures of the first robot's camera, which 'radarsim serve
            --image-port' serves on this port.
        image_rate: Pictures per second.
    """

    option_group: ClassVar = "Topics"
    at_most_one: ClassVar[Sets] = (("map", "true_map"),)

    map: Annotated[str | None, Option(metavar="ROBOT")] = None
    draw: Annotated[str | None, Option(metavar="MAP", words="maps")] = None
    true_map: Annotated[bool, Option(needs=("draw",))] = False
    no_namespace: Annotated[str | None, Option(metavar="ROBOT")] = None
    own_localization: bool = False
    echoes: Annotated[bool, RARE] = False
    image_port: Annotated[Port | None, RARE] = None
    image_rate: Annotated[
        float, Interval(gt=0, le=5), Option(metavar="HZ", is_rare=True)
    ] = 2.0


def ros(
    server: Server,
    options: BridgeOptions,
    topics: TopicOptions,
    *,
    robot: RobotName | None = None,
    start: str | None = None,
    name: Annotated[str, RARE] = "R1",
    drive_unit: Annotated[DriveUnit, RARE] = "rad_per_s",
) -> int:
    """Publish the readings of robots as ROS 2 topics, and drive a robot.

    Args:
        server: The server.
        options: How programs of ROS reach the bridge.
        topics: Which topics there are.
        robot: Spawn a robot of this class, which cmd_vel drives.
        start: Start pose of the spawned robot; by default the first free one.
        name: Name of the spawned robot.
        drive_unit: Unit of wheel speeds that the server expects.

    Returns:
        The exit code.
    """
    from radarsim.addons.ros.bridge import run_bridge
    from radarsim.listening import exit_code_of_signal, first_of

    start_log(logging.WARNING, "%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("uvicorn").setLevel(logging.ERROR)  # limits what peers can log
    side = _make_side(options)

    async def run() -> int:
        with exit_code_of_signal() as exit_code:
            bridge = run_bridge(
                server.connect,
                side,
                options=topics,
                robot_class=robot,
                robot_name=name,
                start=start,
                drive_unit=drive_unit,
            )
            code: int | None = await first_of(bridge, exit_code)
            return 1 if code is None else code

    port = PORTS.get(options.bridge) if options.web is None else options.web
    with hint_of_port({"--web": port}):
        return asyncio.run(run())


def _make_side(options: BridgeOptions) -> RosSide:
    """Return a participant of a DDS domain, or a server for rosbridge or Foxglove.

    Raises:
        MissingPackage: If a package is missing; the message names the extra.
        ServerError: If the DDS domain cannot be joined.
    """
    if options.bridge == "dds":
        # This check comes first, so that the error names the extra, not a module.
        for package in ("cyclonedds.domain", "rosbags.typesys"):
            import_optional(package, "dds")
        from radarsim.addons.ros.dds import DdsParticipant

        side = DdsParticipant(options.domain, options.interface)
        print_now(f"radarsim: DDS domain {options.domain} on {options.interface}")
        return side
    if options.web_host not in ("127.0.0.1", "localhost", "::1"):
        print_message(f"whoever reaches {options.web_host} can drive the robot")
    from radarsim.addons.ros.board import Board
    from radarsim.addons.ros.websocket_side import WebSocketSide

    port = PORTS[options.bridge] if options.web is None else options.web
    if options.bridge == "foxglove":
        import_optional("rosbags.typesys", "record")
    board = Board(resolve_name(CLIENTS[options.bridge]))
    return WebSocketSide(board, options.web_host, port, announce, options.origin)


def announce(name: str, address: tuple[str, int]) -> None:
    """Print the address of the WebSocket server on one line, for other programs."""
    print_now(f"radarsim: {name} on ws://{join_address(*address)}")
