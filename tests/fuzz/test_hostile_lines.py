"""Bytes of hostile clients, which must not harm the host or disturb another client."""

import os
import random
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.reports import decode_report
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box
from radarsim.server.host import Diagnostic, Host
from radarsim.simulation.config import SimulationConfig

pytestmark = pytest.mark.slow

SEEDS = 10
BYTES = 500_000  # of each case; 1e7 in all
HOSTILE_CLIENTS = 6
MAX_CPU_SECONDS = 45.0  # of a case, with a margin of ten
MAX_GROWTH = 16.0  # MB of resident memory in the second half of a case
MAX_UNSENT = 262_144 + 4_194_304 + 2**16  # bytes of one client
MAX_COPIES = 4_194_304 + 1_048_576 + 2**16  # bytes of what it watches
MAX_LOG_TEXT = 1000  # characters of a diagnostic
CELL = (40.0, 40.0)  # x, y of a closed box outside the room, m

LINE = re.compile(
    rb"(SEE \{Robot [^{}]+\} )?(NFO|STA|MISSTA|ASTA|SEN|CONF|GEO)( ?\{[ -z|~]+\})+\r\n"
)
VALID = (
    b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}",
    b"INIT {ClassName USARBot.P2AT} {Location 0,2,0} {Rotation 0,0,1.5}",
    b"INIT {ClassName USARBot.Hummer} {Name Car} {Location 5,2,0}",
    b"INIT {ClassName USARBot.Kenaf} {Name K} {Location 5,-3,0}",
    b"INIT {ClassName USARBot.AirRobot} {Name Air} {Location 5,0,-3}",
    b"INIT {ClassName USARBot.ARDrone} {Location -5,-3,-1}",
    b"DRIVE {AltitudeVelocity 0.5} {LinearVelocity 1} {LateralVelocity -0,5} "
    b"{RotationalVelocity 0.3} {Normalized false}",
    *(b"DRIVE {AltitudeVelocity -50} {Normalized true}", b"DRIVE {LinearVelocity 2}"),
    *(b"DRIVE {Speed 3} {FrontSteer 0.2} {RearSteer -0,1}", b"DRIVE {Speed 1}"),
    *(b"MULTIDRIVE {FRFlipper 0.5} {RLFlipper -9}", b"ACT {Name Flippers} {Link 2}"),
    *(b"DRIVE {Name FLFlipper} {Order 1} {Value -0.5}", b"GETGEO {Type Actuator}"),
    b"MISPKG {Name CameraPanTilt} {Link 1} {Value 0.1} {Order 10} {Link 2} {Value 1}",
    *(b"GETGEO {Type MisPkg}", b"GETCONF {Type Actuator}", b"GETCONF {Type IMU}"),
    b"SET {Type Joint} {Name FRFlipper} {Opcode Angle} {Params 0.3}",
    b"INIT {ClassName P3AT_Compare} {Name Compare} {Location -6.5 -3 0}",
    *(b"SET {Type Camera} {Opcode Zoom} {Params 0.5}", b"GETCONF {Type Camera}"),
    *(b"SET {Type Viewports} {Config 1} {Viewport2 Camera}", b"GETGEO {Type Camera}"),
    *(b"SET {Type Camera} {Robot R1} {Name Camera} {Client 127.0.0.1}",),
    b"MISPKG {Name CameraPanTilt} {Rotation 0,-0.5,0.2} {Order 1}",
    *(b"GETSTARTPOSES", b"PING", b"MISPKG {Name CameraPanTilt} {Link 1} {Value 0.5}"),
    *(b"DRIVE {Left 3} {Right 2,5}", b"DRIVE {Left -8.17} {Right 8.17} {Light true}"),
    *(b"DRIVE {Left 90} {Right -90} {Normalized True}", b"DRIVE {Flip true}"),
    *(b"DRIVE {Left 1}", b"DRIVE {Speed 0} {Name R1} {Normalized false}"),
    *(b"GETGEO {Type Robot}", b"GETCONF {Type Robot} {Name R1}"),
    *(b"GETGEO {Type RangeScanner} {Name lms200}", b"GETCONF {Type RangeScanner}"),
    *(b"GETGEO {Type INS}", b"GETCONF {Type Encoder}", b"GETCONF {Type MisPkg}"),
    *(b"GETCONF {Type Touch}", b"GETGEO {Type Odometry}", b"GETCONF {Type Tachometer}"),
    *(b"GETCONF {Type GroundTruth}", b"GETGEO {Type Sonar}", b"GETCONF {Type Echoes}"),
    b"SET {Type RangeScanner} {Name lms200} {Opcode SCAN} {Params 0}",
    b"SET {Type RangeScanner} {Opcode ECHOES} {Params true}",
    b"SET {Type RangeScanner} {Opcode ECHOES} {Params false}",
    b"SET {Type INS} {Opcode POSE} {Params 1,2,-3,0,0,0.5}",
    b"SET {Type RangeScanner} {Opcode SETTING} {Params max_range=9 side_offset_uu=5}",
    b"WATCH {Robots All} {Echoes true}",
    *(b"WATCH {Robots R1,Compare}", b"WATCH {Robots None}"),
    b"INIT {ClassName USARBotAPI.WorldController} {Location 0, 0, 0}",
    b"CONTROL {Type Create} {ClassName WCCrate} {Name c1} {Location 2,-1,0} "
    b"{Scale 1,1,1} {Physics RigidBody}",
    b"CONTROL {Type Create}{ClassName WCCrate}{Name 2}{Start R1}{Permanent true}",
    b"CONTROL {Type AbsMove} {Name c1} {Location 1,2,-1} {Rotation 0,0,0.5}",
    *(b"CONTROL {Type RelMove} {Name c1} {Location 1,0,0}", b"CONTROL {Type GetSTA}"),
    *(b"CONTROL {Type Kill} {Name c1}", b"CONTROL {Type KillAll} {MinPos 0,0,0}"),
    *(b"Trace {On True} {Interval 0.1} {Color Red}", b"TRACE {On false}"),
    *(b"SET {Type Odometry} {Opcode RESET}", b"SET {Type Encoder} {Opcode RESET}"),
    *(b"SET {Type Tachometer} {Name TachTest} {Opcode RESET}", b"SET {Type Joint}"),
)
NUMBERS = (
    *(b"nan", b"-inf", b"1e400", b"-1e999999999", b"1e9", b"-1e9", b"1e-400", b"-0"),
    *(b"0x10", b"1_0", b"1.2.3", b"1,,2", b"--1", b"+", b".", b"e5", b"9" * 400),
    *(b"0." + b"0" * 400 + b"1", b"2147483648", b"\xb2", b"8.17", b"", b"1 2 3 4 5 6"),
)
TEXTS = (
    *(b"\x1b[2J\x1b]0;owned\x07", b"\x00", b"\x08" * 20, b"\t\x0b\x0c", b"%s%n{0}"),
    *(b"\xff\xfe", b"\x85", b"\xa0", b"../../etc/passwd", b"P3AT\x00.yaml", b"."),
    *(b"A" * 300, b"R1 (2)", b"$(reboot)", b"\xc3\xa9", b"__class__", b" " * 50),
)
LINE_ENDS = (b"\r\n",) * 6 + (b"\n", b"\r", b"\n\r", b"\r\n \r\n\t\r\n", b"")
NUMBER = re.compile(rb"[-+]?[0-9][0-9.]*")
WORD = re.compile(rb"[A-Za-z]+[0-9]*")


class LineSource:
    """Lines of a hostile client: valid ones, mutations of them, and garbage."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng

    def __iter__(self) -> Iterator[bytes]:
        makers = (
            *(self.valid, self.replaced, self.replaced, self.cut, self.spliced),
            *(self.braces, self.garbage, self.long, self.blank),
        )
        weights = (20, 20, 20, 10, 10, 1, 4, 0.05, 1)
        while True:
            (make,) = self._rng.choices(makers, weights)
            yield make() + self._rng.choice(LINE_ENDS)

    def valid(self) -> bytes:
        line = self._rng.choice(VALID)
        # A spawn blocks the client for some ticks, so that few bytes are fed.
        return line if self._rng.random() < 0.3 else self._rng.choice(VALID[6:])

    def replaced(self) -> bytes:
        """Replace numbers or words."""
        pattern, values = self._rng.choice(((NUMBER, NUMBERS), (WORD, TEXTS)))
        line = self.valid()
        matches = list(pattern.finditer(line)) or list(WORD.finditer(line))
        start, end = self._rng.choice(matches).span()
        return line[:start] + self._rng.choice(values) + line[end:]

    def cut(self) -> bytes:
        """Cut out, repeat, or change some bytes."""
        line = self.valid()
        start, end = sorted(self._rng.choices(range(len(line) + 1), k=2))
        changed = self._rng.choice((b"", line[start:end] * 2, self.garbage()[:9]))
        return line[:start] + changed + line[end:]

    def spliced(self) -> bytes:
        """Join the beginning of a line and the end of another."""
        one, other = self.valid(), self.valid().swapcase()
        return one[: self._rng.randrange(len(one))] + b" ".join([other] * 3)

    def braces(self) -> bytes:
        verb = self.valid().partition(b" ")[0]
        count = self._rng.randrange(1, 300)
        pieces = self._rng.choices((b"{", b"}", b"{}", b"{ }", b"{a b}", b"{a}"), k=9)
        return verb + b" " + b"".join(pieces) * count

    def garbage(self) -> bytes:
        return self._rng.randbytes(self._rng.randrange(1, 200))

    def long(self) -> bytes:
        """Return a long line: some are longer than lines may be, most are not."""
        unit = self._rng.choice((b"x", b"{a b}", b"{", b"1,", b" ", b"{Name \xff}"))
        size = self._rng.choice((9_000, 30_000, 65_000, 65_536, 70_000))
        line = (self.valid() + unit * size)[:size]
        return line if self._rng.random() < 0.5 else line + b"}"

    def blank(self) -> bytes:
        return self._rng.choice((b" \n", b"\r\n", b"\t\r")) * self._rng.randrange(400)


class HostileClient:
    """Sends pieces of one byte, some bytes or many, and at times connects again."""

    def __init__(self, host: Host, rng: random.Random, largest: int) -> None:
        self._host = host
        self._rng = rng
        self._largest = largest
        self._lines = iter(LineSource(rng))
        self._buffer = b""
        self._allowed = 0.0  # bytes
        self._number = host.connect()
        self.sent = 0

    def send(self) -> list[Diagnostic]:
        """Send some bytes, at times many, as far as the host takes them in a tick."""
        diagnostics = []
        mean = 5000 if self._rng.random() < 0.01 else 50
        self._allowed += self._rng.expovariate(1 / mean)
        while self.sent < self._allowed and not self._host.is_busy(self._number):
            if not self._buffer:
                self._buffer = b"".join(next(self._lines) for _ in range(20))
            size = self._rng.randint(1, self._largest)
            piece, self._buffer = self._buffer[:size], self._buffer[size:]
            self.sent += len(piece)
            diagnostics += self._host.receive(self._number, piece)
        return diagnostics

    def take(self) -> bytes:
        """Read what there is, most of the time; connect again when it has to."""
        assert self._host.unsent_bytes(self._number) <= MAX_UNSENT + MAX_COPIES
        if self._host.close_reason(self._number) or self._rng.random() < 0.002:
            self._host.disconnect(self._number)
            self._number = self._host.connect()
        elif self._rng.random() < 0.1:
            return b""
        return self._host.take(self._number)


class PoliteClient:
    """Drives in a closed cell, and asks a few questions."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._number = host.connect()
        x, y = CELL
        init = (
            f"INIT {{ClassName P3AT_Compare}} {{Name Polite}} {{Location {x},{-y},0}}"
        )
        self._receive(init.encode())
        assert host.has_robot(self._number)

    def _receive(self, line: bytes) -> None:
        assert self._host.receive(self._number, line + b"\r\n") == []

    def send(self, tick: int) -> None:
        """Send the commands of a tick: seldom more than one."""
        if tick % 5 == 0:
            speeds = (3 * np.sin(tick / 70), 3 * np.cos(tick / 45))
            self._receive(b"DRIVE {Left %.3f} {Right %.3f}" % speeds)
        if tick % 40 == 3:
            self._receive(b"SET {Type RangeScanner} {Opcode SCAN}")
        if tick % 60 == 7:
            self._receive(b"GETCONF {Type RangeScanner}")
        if tick % 60 == 8:
            switch = b"true" if tick % 120 == 8 else b"false"
            line = b"SET {Type RangeScanner} {Opcode ECHOES} {Params %b}" % switch
            self._receive(line)

    def take(self) -> bytes:
        """Read everything."""
        return self._host.take(self._number)


@pytest.fixture(scope="module")
def room_and_cell(foliage_room: Scene) -> Scene:
    """Return a room with bushes, and a cell that nothing outside can be seen from."""
    vertices, faces = box(6.0, 6.0, 4.0)
    cell = Part("cell", Material("wall"), vertices + np.array([*CELL, 1.0]), faces)
    return replace(foliage_room, parts=(*foliage_room.parts, cell))


def resident_megabytes() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def assert_well_formed(data: bytes) -> None:
    """Check that these are whole lines of printable ASCII that clients can decode."""
    for line in data.splitlines(keepends=True):
        assert LINE.fullmatch(line), line[:200]
        assert decode_report(line.decode("ascii")) is not None, line[:200]


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux' /proc")
@pytest.mark.parametrize("seed", range(SEEDS))
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_hostile_clients_harm_neither_host_nor_polite_client(
    room_and_cell: Scene,
    dialect: Dialect,
    seed: int,
    record_property: Callable[[str, object], None],
) -> None:
    config = SimulationConfig(dialect)
    host = Host(room_and_cell, config=config, seed=seed)
    polite = PoliteClient(host)
    rng = random.Random(seed)
    sizes = (1, 1, 7, 200, 2000, 16_384)
    assert len(sizes) == HOSTILE_CLIENTS
    hostile = [HostileClient(host, random.Random(rng.random()), n) for n in sizes]
    began, writes, middle = time.process_time(), [polite.take()], 0.0
    while (sent := sum(client.sent for client in hostile)) < BYTES:
        diagnostics = [found for client in hostile for found in client.send()]
        polite.send(len(writes))
        diagnostics += [found for _, found in host.step()]
        writes.append(polite.take())
        for client in hostile:
            assert_well_formed(client.take())
        for found in diagnostics:
            assert found.text.isprintable()
            assert found.kind.isprintable()
            assert len(found.text) < MAX_LOG_TEXT
        if not middle and sent > BYTES / 2:
            middle = resident_megabytes()
    spent, growth = time.process_time() - began, resident_megabytes() - middle
    record_property("ticks, CPU seconds, MB grown", (len(writes), spent, growth))
    assert_well_formed(b"".join(writes))
    assert spent < MAX_CPU_SECONDS
    assert growth < MAX_GROWTH
    alone = Host(room_and_cell, config=config, seed=seed)
    undisturbed = PoliteClient(alone)
    for tick, write in enumerate(writes):
        if tick:
            undisturbed.send(tick)
            alone.step()
        assert undisturbed.take() == write, tick
