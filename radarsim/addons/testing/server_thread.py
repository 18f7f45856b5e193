"""A server in a thread of its own.

Apart from the fixtures, because it imports the engine: numba, Embree, shapely.
"""

import asyncio
import math
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import UnionType
from typing import Any

from radarsim.protocol.dialect import get_dialect
from radarsim.scene.map_file import load_map
from radarsim.server.host import Host
from radarsim.server.tcp_server import Server
from radarsim.simulation.config import SimulationConfig

STOP_TIMEOUT = 30.0  # s; it takes some milliseconds


def make_host(options: dict[str, Any]) -> Host:
    """Create the host for the options of a test.

    Raises:
        RadarsimError: If the map or the settings are wrong.
        ValueError: If another option is, or is of another type.
    """
    _check_types(options)
    seed, speed = options["seed"], options["speed"]
    if seed < 0:
        raise ValueError(f"seed {seed}, expected at least 0")
    if not 0 < speed < math.inf:
        raise ValueError(f"speed {speed}, expected above 0")
    dialect = get_dialect(options["dialect"])
    scene = load_map(options["map"])
    config = SimulationConfig(dialect, item_settings=options["settings"])
    return Host(scene, config=config, seed=seed)


def _check_types(options: dict[str, Any]) -> None:
    """Check that the options of a mark have the types that they should have.

    Raises:
        ValueError: If one does not.
    """
    settings = options["settings"]
    by_item = settings.values() if isinstance(settings, Mapping) else [None]
    are_known = {
        "map": (isinstance(options["map"], str | Path), "a name or a path"),
        "seed": (_is_number(options["seed"], int), "an integer"),
        "dialect": (isinstance(options["dialect"], str), "'compat' or 'udk'"),
        "speed": (_is_number(options["speed"], int | float), "a number above 0"),
        "settings": (
            all(isinstance(each, Mapping) for each in by_item),
            "settings by item, as {'lms200': {'max_range': 20}}",
        ),
    }
    for name, (is_known, expected) in are_known.items():
        if not is_known:
            came = repr(options[name])[:80]
            raise ValueError(f"{name} {came}, expected {expected}")


def _is_number(value: object, kind: type | UnionType) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)


class ServerThread(threading.Thread):
    """Runs a server in an event loop of its own, and collects its errors."""

    def __init__(self, host: Host, *, speed: float) -> None:
        super().__init__(name="usarsim_server", daemon=True)
        self._host = host
        self._speed = speed
        self._address = ("", 0)
        self._errors: list[Exception] = []
        self._up = threading.Event()
        self._end: Callable[[], object] = lambda: None

    def begin(self) -> tuple[str, int]:
        """Start, and wait until clients can connect.

        Returns:
            The address that it listens on.

        Raises:
            ExceptionGroup: If the server cannot start.
        """
        self.start()
        self._up.wait()
        if self._errors:
            self.finish()
        return self._address

    def finish(self) -> None:
        """Close the port and all connections, and stop the thread.

        Raises:
            ExceptionGroup: If there were errors since the start; it contains them all.
        """
        with suppress(RuntimeError):  # its loop is closed if it has failed
            self._end()
        self.join(STOP_TIMEOUT)
        if self.is_alive():
            late = f"the thread runs on, expected its end within {STOP_TIMEOUT:g} s"
            self._errors.append(TimeoutError(late))
        if self._errors:
            raise ExceptionGroup("usarsim_server failed", self._errors)

    def run(self) -> None:
        """Serve until ``finish`` is called or an error happens."""
        try:
            with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
                runner.run(self._serve())
        except Exception as error:  # noqa: BLE001 - finish() raises it
            self._errors.append(error)
        finally:
            self._up.set()

    async def _serve(self) -> None:
        loop = asyncio.get_running_loop()
        # Errors of callbacks would only be logged, and the test would pass.
        loop.set_exception_handler(self._add_error)
        task = asyncio.current_task()
        assert task is not None
        self._end = partial(loop.call_soon_threadsafe, task.cancel)
        server = Server(self._host, speed=self._speed)
        try:
            await server.start(port=0)
            self._address = server.address
            self._up.set()
            await server.wait_failed()
        except asyncio.CancelledError:
            pass  # finish() was called
        finally:
            await server.stop()

    def _add_error(self, _: object, context: dict[str, Any]) -> None:
        """Collect an error of a callback, and stop, so that clients do not wait."""
        error = context.get("exception")
        if not isinstance(error, Exception):
            error = RuntimeError(context["message"])
        self._errors.append(error)
        self._end()
