"""The option ``--navtech`` of ``radarsim serve``: which radar is served, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import click

from radarsim.cli.output import print_now
from radarsim.cli.server_options import ServedMap, ServeExtension
from radarsim.errors import join_address
from radarsim.plans import Option

if TYPE_CHECKING:
    from radarsim.addons.fmcw.navtech.server import NavtechServer
    from radarsim.server.host import Host

OPTION = "--navtech"


@dataclass(frozen=True, slots=True)
class NavtechOptions:
    """The option.

    Attributes:
        navtech: Serve a robot's FMCW radar, such as that of a P3AT_Navtech, on this
            port as well, in its maker's protocol; the real one's is 6317. Without a
            name, the first robot that carries one.
    """

    option_group: ClassVar = "Beside the server"

    navtech: Annotated[str | None, Option(metavar="PORT[:ROBOT]", is_rare=True)] = None

    def extension(self, _: ServedMap) -> NavtechExtension | None:
        """See ``ExtensionOptions.extension``."""
        if self.navtech is None:
            return None
        port, colon, robot = self.navtech.partition(":")
        problem = ""
        # Other digits of Unicode are digits to isdigit() as well, and some of them none
        # to int().
        if not (port.isascii() and port.isdigit() and int(port) <= 65535):
            problem = "a port from 0 to 65535, and a robot after a colon"
        elif colon and not robot:
            problem = "the name of a robot after the colon"
        if problem:
            text = f"{self.navtech!r}, expected {problem}"
            raise click.BadParameter(text, param_hint=OPTION)
        return NavtechExtension(int(port), robot or None)


class NavtechExtension(ServeExtension):
    """A server of a radar beside the server of its robot."""

    def __init__(self, port: int, robot: str | None) -> None:
        """Plan a server; arguments are those of ``NavtechServer``."""
        self.ports = {OPTION: port}
        self._robot = robot
        self._server: NavtechServer

    def attach(self, host: Host) -> None:
        """See ``ServeExtension.attach``."""
        from radarsim.addons.fmcw.navtech.server import NavtechServer

        self._server = NavtechServer(port=self.ports[OPTION], robot=self._robot)
        host.add_observer(self._server)

    async def start(self, address: str) -> None:
        """See ``ServeExtension.start``."""
        await self._server.start(address)

    def announce(self, _: tuple[str, int]) -> None:
        """Tell on stdout that clients of a radar can connect."""
        print_now(f"radarsim: radar on {join_address(*self._server.address)}")

    async def stop(self) -> None:
        """See ``ServeExtension.stop``."""
        await self._server.stop()
