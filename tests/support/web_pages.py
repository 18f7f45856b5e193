"""A browser without a window, which sends and receives the page's messages."""

import asyncio
import json
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import websockets
from served_page import Served
from websockets.asyncio.client import ClientConnection
from websockets.typing import Origin

TIMEOUT = 240.0  # s; machines that run tests are busy


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame as the page reads it."""

    header: dict[str, Any]
    ranges: Any

    def robot(self, name: str) -> dict[str, Any]:
        found = [robot for robot in self.header["robots"] if robot["name"] == name]
        return found[0] if found else {}

    def scan(self, robot: str, scanner: str) -> Any:
        """Return the ranges of a scan, cm."""
        (scan,) = [s for s in self.robot(robot)["scans"] if s["scanner"] == scanner]
        return self.ranges[scan["offset"] : scan["offset"] + scan["count"]]


def read_frame(data: bytes) -> Frame:
    (length,) = struct.unpack_from("<I", data)
    header = json.loads(data[4 : 4 + length])
    return Frame(header, np.frombuffer(data[4 + length :], "<u2"))


@dataclass
class Page:
    """A page that acknowledges each frame at once."""

    socket: ClientConnection
    texts: list[dict[str, Any]] = field(default_factory=list)
    frame: Frame | None = None
    frames: int = 0
    hello: dict[str, Any] = field(default_factory=dict)

    async def send(self, op: str, **keys: Any) -> None:
        await self.socket.send(json.dumps({"op": op, **keys}))

    async def spawn(self, kind: str = "P3AT", **keys: Any) -> str:
        """Spawn a robot of the commander, and return its name once it has scanned."""
        await self.send("spawn", **{"class": kind, **keys})
        name: str = (await self.hear("spawned"))["robot"]
        await self.see(lambda f: f.robot(name).get("scans") and f.robot(name)["mine"])
        return name

    async def hear(self, op: str, **keys: Any) -> dict[str, Any]:
        """Return the next message of a kind that has these values, and drop it."""
        while True:
            for text in self.texts:
                if text["op"] == op and text.items() >= keys.items():
                    self.texts.remove(text)
                    return text
            await self._take()

    async def see(self, condition: Any) -> Frame:
        """Return the first frame for which a condition holds."""
        while self.frame is None or not condition(self.frame):
            await self._take()
        return self.frame

    async def _take(self) -> None:
        data = await asyncio.wait_for(self.socket.recv(), TIMEOUT)
        if isinstance(data, str):
            self.texts.append(json.loads(data))
            return
        self.frame = read_frame(data)
        self.frames += 1
        await self.send("ack", t=self.frame.header["t"])


@asynccontextmanager
async def open_page(served: Served, *, waits: bool = True) -> AsyncIterator[Page]:
    """Open a page, and say hello."""
    origin = Origin(f"http://{served.web}")
    async with websockets.connect(
        f"ws://{served.web}/ws", origin=origin, max_size=None
    ) as socket:
        page = Page(socket)
        await page.send("hello", token=served.token)
        page.hello = await page.hear("hello")
        while waits and not page.hello["level"]:  # the commander is not connected yet
            page.hello = await page.hear("hello")
        yield page
