"""State of one observed connection: what its client and its server have said so far.

An observer cannot ask the server. It knows a scanner by the answers to the client's own
requests; where the client does not ask, by the defaults of the user; and otherwise by
the scans themselves.
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

SAME_RANGES: Final = 4  # equal largest ranges in a scan that are its maximum range
ANY: Final = ""  # instead of a name: all items of a type


@dataclass(frozen=True, slots=True)
class ScannerDefaults:
    """Properties of a scanner about which no client asks the server.

    Attributes:
        mount: Pose in the body frame; None for the origin of the body.
        max_range: m; None for the largest range that several beams of one scan have
            read, and no limit before that.
    """

    mount: Pose3 | None = None
    max_range: float | None = None


NO_DEFAULTS: Final = ScannerDefaults()


@dataclass(slots=True, eq=False)
class ConnectionState:
    """What was said on one connection.

    Attributes:
        number: Number of the connection.
        session: State by the reports of the server.
        robot: Newest INIT command; None if there was none.
        geometry: Newest geometry of the robot; None if there was none.
        skipped_lines: Number of lines of the client that are no commands.
    """

    number: int
    session: Session = field(default_factory=Session)
    robot: Init | None = None
    geometry: RobotGeo | None = None
    skipped_lines: int = 0
    _mounts: dict[str, ItemGeo] = field(default_factory=dict)
    _confs: dict[str, ScannerConf] = field(default_factory=dict)
    _max_ranges: dict[str, float] = field(default_factory=dict)
    _echoes: dict[str, bool] = field(default_factory=dict)

    def receive_server_line(self, text: str) -> Report | None:
        """Process a line of the server; return its report, or None if it is none."""
        for report in self.session.receive(text.encode("latin-1") + b"\n"):
            self._process_report(report)
            return report
        return None

    def receive_client_line(self, text: str) -> Command | None:
        """Process a line of the client; return its command, or None if it is none."""
        try:
            command = parse_command(text, COMPAT).command
        except MalformedMessage:
            self.skipped_lines += 1
            return None
        if isinstance(command, Init):
            self.robot = command
        elif isinstance(command, SetItem):
            self._process_set(command)
        return command

    def asks_for_echoes(self, scanner: str) -> bool:
        """Return whether the client has switched on the echoes of a scanner."""
        return self._echoes.get(scanner.lower(), self._echoes.get(ANY, False))

    def is_described(self, scanner: str) -> bool:
        """Return whether the server has sent the mount and the limits of a scanner."""
        key = scanner.casefold()
        return key in self._mounts and key in self._confs

    def scanner(
        self, name: str | None = None, defaults: ScannerDefaults = NO_DEFAULTS
    ) -> ScannerInfo | None:
        """Return what is known of a scanner; None before its first scan.

        Args:
            name: None for the one that scanned first.
            defaults: Properties about which the server was not asked.
        """
        scans = self.session.scans
        scan = scans.get(next(iter(scans), "") if name is None else name)
        if scan is None:
            return None
        key = scan.name.casefold()
        descriptions = ScannerDescriptions()
        descriptions.add(self._mounts.get(key) or _default_mount(scan, defaults))
        descriptions.add(self._confs.get(key) or self._default_conf(scan, defaults))
        scanners = descriptions.scanners({scan.name: scan})
        return next(each for each in scanners if same_name(each.name, scan.name))

    def _process_set(self, command: SetItem) -> None:
        is_of_scanners = command.type.lower() == RANGE_SCANNER.lower()
        if not is_of_scanners or command.opcode.upper() != "ECHOES":
            return
        with suppress(MalformedMessage):
            on = parse_switch(command.params)
            if command.name is None:
                self._echoes = {ANY: on}
            else:
                self._echoes[command.name.lower()] = on

    def _process_report(self, report: Report) -> None:
        if isinstance(report, RobotGeo):
            self.geometry = report
        elif isinstance(report, ItemGeo):
            self._mounts |= {name.casefold(): report for name, _ in report.mounts}
        elif isinstance(report, ScannerConf):
            self._confs |= {name.casefold(): report for name, *_ in report.items}
        elif isinstance(report, RangeScan):
            self._infer_max_range(report)

    def _infer_max_range(self, scan: RangeScan) -> None:
        largest = float(scan.ranges.max(initial=0.0))
        if np.count_nonzero(scan.ranges == largest) >= SAME_RANGES:
            self._max_ranges[scan.name] = max(
                largest, self._max_ranges.get(scan.name, 0.0)
            )

    def _default_conf(self, scan: RangeScan, defaults: ScannerDefaults) -> ScannerConf:
        max_range = defaults.max_range
        if max_range is None:
            max_range = self._max_ranges.get(scan.name, math.inf)
        item = (scan.name, max_range, 0.0, math.nan, math.nan)
        return ScannerConf(RANGE_SCANNER, (item,))


def _default_mount(scan: RangeScan, defaults: ScannerDefaults) -> ItemGeo:
    mount = defaults.mount or DEFAULT_MOUNT
    return ItemGeo(RANGE_SCANNER, ((scan.name, mount),), "")
