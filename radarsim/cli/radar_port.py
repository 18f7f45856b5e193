"""The option ``--navtech`` of ``radarsim serve``: which radar is served, and where."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

if TYPE_CHECKING:
    from radarsim.addons.fmcw.navtech.server import NavtechServer

NavtechOption = Annotated[
    str | None,
    typer.Option(
        metavar="PORT[:ROBOT]",
        help="Serve a robot's FMCW radar, such as that of a P3AT_Navtech, on this port"
        " as well, in its maker's protocol; the real one's is 6317. Without a name, the"
        " first robot that carries one.",
    ),
]


class RadarPort(NamedTuple):
    """What ``--navtech`` says.

    Attributes:
        port: Port to listen on; None for no server.
        robot: Name of the robot; None for the first one that carries such a radar.
    """

    port: int | None
    robot: str | None

    @classmethod
    def parse(cls, text: str | None) -> RadarPort:
        """Parse ``PORT[:ROBOT]``.

        Raises:
            typer.BadParameter: If there is no port, or an empty name.
        """
        if text is None:
            return cls(None, None)
        port, colon, robot = text.partition(":")
        problem = ""
        if not (port.isascii() and port.isdigit() and int(port) <= 65535):
            problem = "a port from 0 to 65535, and a robot after a colon"
        elif colon and not robot:
            problem = "the name of a robot after the colon"
        if problem:
            raise typer.BadParameter(
                f"{text!r}, expected {problem}", param_hint="--navtech"
            )
        return cls(int(port), robot or None)

    def server(self) -> NavtechServer | None:
        """Create the server of the radar; None without a port."""
        if self.port is None:
            return None
        from radarsim.addons.fmcw.navtech.server import NavtechServer

        return NavtechServer(port=self.port, robot=self.robot)
