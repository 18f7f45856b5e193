"""``radarsim serve``: the ports of the original server besides that of the robots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from radarsim.cli.fields import Port
from radarsim.cli.output import print_now
from radarsim.cli.server_options import ServedMap, ServeExtension
from radarsim.errors import join_address
from radarsim.plans import RARE

if TYPE_CHECKING:
    from radarsim.server.host import Host
    from radarsim.server.image_server import ImageServer
    from radarsim.server.question_server import QuestionServer

SERVED: Final = {  # what is served, by the options of the ports
    "--image-port": "images",
    "--truth-port": "truth",
    "--wireless-port": "wireless",
    "--wss-port": "wss",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SidePorts:
    """Ports beside that of the robots.

    Attributes:
        image_port: Serve pictures of the first robot's camera on this port as well; the
            original's is 5003.
        truth_port: Tell where all robots are on this port as well (USARTruth); the
            original's is 3989.
        wireless_port: Answer a wireless server (WSS) on this port as well; the
            original's is 7435.
        wss_port: Be a wireless server (WSS) on this port as well, through which robots
            talk that hear each other; the original's is 50000.
    """

    option_group: ClassVar = "Beside the server"

    image_port: Annotated[Port | None, RARE] = None
    truth_port: Annotated[Port | None, RARE] = None
    wireless_port: Annotated[Port | None, RARE] = None
    wss_port: Annotated[Port | None, RARE] = None

    def extension(self, _: ServedMap) -> SideServers:
        """See ``ExtensionOptions.extension``."""
        ports = zip(SERVED, asdict(self).values(), strict=True)
        return SideServers({key: port for key, port in ports if port is not None})


class SideServers(ServeExtension):
    """The servers at ports beside that of the robots."""

    def __init__(self, ports: Mapping[str, int]) -> None:
        """Plan servers; the ports are those of ``SidePorts`` by their options."""
        self.ports = ports
        self._servers: dict[str, ImageServer | QuestionServer] = {}

    def attach(self, host: Host) -> None:
        """See ``ServeExtension.attach``."""
        simulation = host.simulation
        for option, port in self.ports.items():
            if option == "--image-port":
                from radarsim.server.image_server import ImageServer, PictureProcess

                image_type = host.config.dialect.image_type
                pictures = PictureProcess(host.scene, image_type)
                self._servers[option] = ImageServer(simulation, pictures, port=port)
            elif option == "--wss-port":
                from radarsim.server.wireless_server import WirelessServer

                self._servers[option] = WirelessServer(simulation, port=port)
            else:
                from radarsim.server.question_server import (
                    QuestionServer,
                    truth_answer,
                    wireless_answer,
                )

                is_truth = option == "--truth-port"
                answer = truth_answer if is_truth else wireless_answer
                ask = partial(answer, simulation)
                self._servers[option] = QuestionServer(ask, port=port)

    async def start(self, address: str) -> None:
        """See ``ServeExtension.start``."""
        for server in self._servers.values():
            await server.start(address)

    def announce(self, _: tuple[str, int]) -> None:
        """Tell on stdout what is served, and where."""
        for option, server in self._servers.items():
            for host in server.addresses:
                place = join_address(host, server.address[1])
                print_now(f"radarsim: {SERVED[option]} on {place}")

    async def stop(self) -> None:
        """See ``ServeExtension.stop``."""
        for server in self._servers.values():
            await server.stop()
