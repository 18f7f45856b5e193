"""``radarsim serve``."""

import asyncio
import logging
import math
import sys
from typing import Any

import typer

from radarsim.cli.signals import ending_at_once
from radarsim.errors import PresetError
from radarsim.host import Host
from radarsim.presets.sensors import parse_setting
from radarsim.protocol.dialect import get_dialect
from radarsim.scene.map_file import load_map
from radarsim.server.tcp_server import Server
from radarsim.server.tcp_server import serve as serve_until_signal
from radarsim.simulation.config import SimulationConfig


def run_server(
    map_: str,
    *,
    address: tuple[str, int],
    seed: int,
    speed: float,
    conditions: tuple[str, Any, list[str]],
    verbose: bool,
) -> int:
    """Serve a map until a signal comes; give the exit code.

    Raises:
        RadarsimError: If the map is wrong, or the port is taken.
    """
    logging.basicConfig(
        stream=sys.stderr,
        level=logging.INFO if verbose else logging.WARNING,
        format="%(asctime)s %(levelname)s %(message)s",
    )
    if not 0 < speed < math.inf:
        raise typer.BadParameter(
            f"speed {speed}, expected above 0", param_hint="--speed"
        )
    dialect, unit, settings = conditions
    held = SimulationConfig(get_dialect(dialect), unit, item_settings(settings))
    try:
        held.check()
    except PresetError as error:
        raise typer.BadParameter(str(error), param_hint="--set") from None
    with ending_at_once(terminated=0):
        host = Host(load_map(map_), config=held, seed=seed)
    server = Server(host, speed=speed)
    return asyncio.run(serve_until_signal(server, *address, announce))


def announce(address: tuple[str, int]) -> None:
    """Say that clients can connect."""
    typer.echo(f"radarsim: listening on {address[0]}:{address[1]}")
    sys.stdout.flush()


def item_settings(texts: list[str]) -> dict[str, dict[str, Any]]:
    """Read ``ITEM.KEY=VALUE`` texts."""
    found: dict[str, dict[str, Any]] = {}
    for text in texts:
        try:
            path, value = parse_setting(text)
        except PresetError as error:
            raise typer.BadParameter(str(error), param_hint="--set") from None
        item, dot, key = path.partition(".")
        if not dot or not item or not key:
            raise typer.BadParameter(
                f"setting {text[:80]!r}, expected ITEM.KEY=VALUE", param_hint="--set"
            )
        found.setdefault(item, {})[key] = value
    return found
