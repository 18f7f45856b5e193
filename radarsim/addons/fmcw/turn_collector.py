"""Collects what the antenna of an FMCW radar receives until a turn is complete."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.image_files import encoder_counts, put_metadata

if TYPE_CHECKING:
    from radarsim.addons.fmcw.antennas import SeenSector


class RecordedTurn(NamedTuple):
    """A turn of a radar.

    Attributes:
        scanner: Name of the scanner item.
        time: When it began, s.
        bin_size: Distance between range bins, m.
        rows: (A, 11 + B) uint8, a row for each direction as images of Oxford's data set
            have them: 11 bytes of time, encoder and validity, and the counts.
    """

    scanner: str
    time: float
    bin_size: float
    rows: NDArray[np.uint8]

    def to_bytes(self) -> bytes:
        """Return the turn as the data of a call."""
        head = (self.scanner, self.time, self.bin_size, self.rows.shape)
        return json.dumps(head).encode() + b"\n" + self.rows.tobytes()

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Read what ``to_bytes`` has returned."""
        head, _, rows = data.partition(b"\n")
        scanner, time, bin_size, shape = json.loads(head)
        return cls(
            scanner, time, bin_size, np.frombuffer(rows, np.uint8).reshape(shape)
        )


class TurnCollector:
    """Collects the turns of one scanner."""

    def __init__(self, scanner: str, tell: Callable[[RecordedTurn], None]) -> None:
        """Wait for the beginning of a turn.

        Args:
            scanner: Name of the scanner item.
            tell: Called with each turn, once it is complete.
        """
        self._scanner, self._tell = scanner, tell
        self._began = 0.0  # s
        self._rows: list[NDArray[np.uint8]] = []

    def take(self, seen: SeenSector) -> None:
        """Add what is received from neighbouring directions."""
        sector, settings = seen.sector, seen.sector.spectrum.settings
        if sector.first == 0:
            self._began = seen.time
            self._rows.clear()  # of one that the antenna did not end
        elif not self._rows:  # the turn began before anybody listened
            return
        rows = np.arange(len(sector.spectrum.counts))
        times = np.rint(1e6 * (seen.time + rows * settings.sweep_time))
        encoder = encoder_counts(settings.azimuths)[sector.first + rows]
        packed = put_metadata(sector.spectrum.counts, times.astype(np.int64), encoder)
        self._rows.append(packed)
        if sector.ends_turn:
            turn = np.concatenate(self._rows)
            self._rows.clear()
            size = settings.bin_size
            self._tell(RecordedTurn(self._scanner, self._began, size, turn))
