"""What parts of the program add to ``radarsim serve``: options, and what they start.

A part hands in a dataclass of options in the group ``radarsim.serve``; see
``radarsim.plugins``. Its fields become options of the command. With their values, it
says what is to run beside the server.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Final, Protocol, get_type_hints

from radarsim import plugins

if TYPE_CHECKING:
    from radarsim.cli.server_options import ServerOptions
    from radarsim.server.host import Host
    from radarsim.simulation.simulation import Simulation

GROUP: Final = "radarsim.serve"


@dataclass(frozen=True, slots=True)
class ServedMap:
    """What a server serves.

    Attributes:
        map: Name of the map, or path of its file; @VARIANT may follow.
        options: How the server speaks.
        seed: Seed of all random numbers.
    """

    map: str
    options: ServerOptions
    seed: int


class ServeExtension:
    """Something that runs beside a server.

    Its methods are called in the order in which they stand here, and ``close`` in any
    case. Each does nothing unless a subclass overrides it.

    Attributes:
        ports: Ports that it listens on, by the options that set them.
        address: Address of these ports; None for that of the server.
    """

    ports: Mapping[str, int] = {}
    address: str | None = None

    def open(self) -> None:
        """Prepare before the map is read, which may take long."""

    def attach(self, host: Host) -> None:
        """Use the host, whose simulation has not begun."""

    async def start(self, address: str) -> None:
        """Listen.

        Args:
            address: Address that the server listens on.

        Raises:
            ServerError: If that is not possible.
        """

    def announce(self, address: tuple[str, int]) -> None:
        """Tell that clients can connect; to the server, at host and port."""

    async def begin(self, simulation: Simulation) -> None:
        """Use the simulation, which has begun."""

    async def stop(self) -> None:
        """End what ``start`` has begun; never raises."""

    def close(self) -> None:
        """End what ``open`` has begun."""


class ExtensionOptions(Protocol):
    """Options of a part: a dataclass; its fields are annotated as those of commands."""

    def extension(self, served: ServedMap) -> ServeExtension | None:
        """Return what is to run beside a server; None for nothing.

        Raises:
            typer.BadParameter: If the options are wrong.
        """


def with_extensions(run: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the options of all parts beside its own.

    Args:
        run: Takes its own options, and as ``extensions`` those of the parts.
    """
    parts = [plugins.load(GROUP, name) for name in plugins.names(GROUP)]

    def command(**values: object) -> None:
        options: Sequence[ExtensionOptions] = [
            part(**{field.name: values.pop(field.name) for field in fields(part)})
            for part in parts
        ]
        run(**values, extensions=options)

    # typer reads options from a signature: that of the command, and one for each field.
    hints = get_type_hints(run, include_extras=True)
    own = [
        parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(run).parameters.items()
        if name != "extensions"
    ]
    added = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=get_type_hints(part, include_extras=True)[field.name],
        )
        for part in parts
        for field in fields(part)
    ]
    command.__name__, command.__doc__ = run.__name__, run.__doc__
    command.__annotations__ = {each.name: each.annotation for each in (*own, *added)}
    command.__signature__ = inspect.Signature([*own, *added])  # type: ignore[attr-defined]
    return command
