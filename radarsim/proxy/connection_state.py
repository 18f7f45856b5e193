"""What one connection has told of its robot, to who only listens; no sockets, no clock.

A listener may not ask. What it must know of a scanner it has from the answers to the
client's own questions; where the client does not ask, from who started the listener;
and for the rest it looks at the scans themselves.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from radarsim.client import ScannerInfo, Session
from radarsim.client.robot_info import DEFAULT_MOUNT, ScannerDescriptions, same_name
from radarsim.client.session import RANGE_SCANNER
from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.commands import (
    Command,
    Init,
    SetItem,
    parse_command,
    parse_switch,
)
from radarsim.protocol.dialect import COMPAT
from radarsim.protocol.reports import (
    ItemGeo,
    RangeScan,
    Report,
    RobotGeo,
    ScannerConf,
)

ALIKE: Final = 4  # beams of a scan that read the same, and most: no wall does that
ANY: Final = ""  # instead of a name: all items of a type


@dataclass(frozen=True, slots=True)
class ScannerDefaults:
    """What to take where the server is not asked.

    Attributes:
        mount: Of the scanner, in the body frame; None for the body's own place.
        max_range: Of the scanner, m; None for the largest range that several beams of
            one scan have read, and no limit before that.
    """

    mount: Pose3 | None = None
    max_range: float | None = None


NO_DEFAULTS: Final = ScannerDefaults()


@dataclass(slots=True, eq=False)
class ConnectionState:
    """All that was heard on one connection.

    Attributes:
        number: Of the connection.
        session: What the server has said.
        robot: The newest order to make one; None if there was none.
        geometry: What the robot has told of its shape; None if nothing.
        unread: How many lines of the client were skipped.
    """

    number: int
    session: Session = field(default_factory=Session)
    robot: Init | None = None
    geometry: RobotGeo | None = None
    unread: int = 0
    _mounts: dict[str, ItemGeo] = field(default_factory=dict)
    _settings: dict[str, ScannerConf] = field(default_factory=dict)
    _limits: dict[str, float] = field(default_factory=dict)
    _echoes: dict[str, bool] = field(default_factory=dict)

    def receive_server_line(self, text: str) -> Report | None:
        """Take in a line of the server, and give what it says, if that is known."""
        for report in self.session.receive(text.encode("latin-1") + b"\n"):
            self._remember(report)
            return report
        return None

    def receive_client_line(self, text: str) -> Command | None:
        """Take in a line of the client, and give what it asks for, if that is known."""
        try:
            command = parse_command(text, COMPAT)
        except MalformedMessage:
            self.unread += 1
            return None
        if isinstance(command, Init):
            self.robot = command
        elif isinstance(command, SetItem):
            self._note_order(command)
        return command

    def asks_for_echoes(self, scanner: str) -> bool:
        """Tell whether the client has told a scanner to send echoes."""
        return self._echoes.get(scanner.lower(), self._echoes.get(ANY, False))

    def is_described(self, scanner: str) -> bool:
        """Tell whether the server has told a scanner's place and its limits."""
        key = scanner.casefold()
        return key in self._mounts and key in self._settings

    def scanner(
        self, name: str | None = None, given: ScannerDefaults = NO_DEFAULTS
    ) -> ScannerInfo | None:
        """Tell what is known of a scanner; the more was heard, the better.

        Args:
            name: None for the one whose scans came first.
            given: What to take where the server was not asked.

        Returns:
            None before its first scan.
        """
        scans = self.session.scans
        scan = scans.get(next(iter(scans), "") if name is None else name)
        if scan is None:
            return None
        told = ScannerDescriptions()
        told.add(self._mounts.get(scan.name.casefold()) or _supposed_mount(scan, given))
        told.add(
            self._settings.get(scan.name.casefold())
            or self._supposed_limit(scan, given)
        )
        all_told = told.scanners({scan.name: scan})
        return next(facts for facts in all_told if same_name(facts.name, scan.name))

    def _note_order(self, order: SetItem) -> None:
        is_of_scanners = order.type.lower() == RANGE_SCANNER.lower()
        if not is_of_scanners or order.opcode.upper() != "ECHOES":
            return
        with suppress(MalformedMessage):
            on = parse_switch(order.params)
            if order.name is None:
                self._echoes = {ANY: on}
            else:
                self._echoes[order.name.lower()] = on

    def _remember(self, report: Report) -> None:
        if isinstance(report, RobotGeo):
            self.geometry = report
        elif isinstance(report, ItemGeo):
            self._mounts |= {name.casefold(): report for name, _ in report.mounts}
        elif isinstance(report, ScannerConf):
            self._settings |= {name.casefold(): report for name, *_ in report.items}
        elif isinstance(report, RangeScan):
            self._look_for_a_limit(report)

    def _look_for_a_limit(self, scan: RangeScan) -> None:
        largest = float(scan.ranges.max(initial=0.0))
        if np.count_nonzero(scan.ranges == largest) >= ALIKE:
            self._limits[scan.name] = max(largest, self._limits.get(scan.name, 0.0))

    def _supposed_limit(self, scan: RangeScan, given: ScannerDefaults) -> ScannerConf:
        limit = given.max_range
        if limit is None:
            limit = self._limits.get(scan.name, math.inf)
        return ScannerConf(
            RANGE_SCANNER, ((scan.name, limit, 0.0, math.nan, math.nan),)
        )


def _supposed_mount(scan: RangeScan, given: ScannerDefaults) -> ItemGeo:
    return ItemGeo(RANGE_SCANNER, ((scan.name, given.mount or DEFAULT_MOUNT),), "")
