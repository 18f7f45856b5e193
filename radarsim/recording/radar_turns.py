"""Turns of FMCW radars in recordings, as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.fmcw.image_rows import ENCODER_COUNTS
from radarsim.geometry import Floats


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RadarTurn:
    """What an FMCW radar received in one turn: A directions of B range bins.

    Attributes:
        times: (A,) simulated times, s.
        angles: (A,) directions, rad, counter-clockwise from straight ahead; they fall
            from 0 to -2 pi, as the radar turns clockwise.
        ranges: (B,) m.
        counts: (A, B) uint8, the power as the radar stores it.
        frame: Frame of the radar.
    """

    times: Floats
    angles: Floats
    ranges: Floats
    counts: NDArray[np.uint8]
    frame: str

    def __repr__(self) -> str:
        azimuths, bins = self.counts.shape
        return f"<RadarTurn {self.frame}: {azimuths} azimuths of {bins} bins>"

    @classmethod
    def of(cls, image: Mapping[str, Any], layout: Mapping[str, Any]) -> Self:
        """Read a decoded message ``Image``.

        Args:
            image: The message.
            layout: Content of the topic ``spectrum/layout``.

        Raises:
            ValueError: If there are not as many bytes as rows need.
            KeyError: If the layout lacks something.
        """
        rows = image["data"].reshape(image["height"], image["width"])
        head, counts = np.split(rows, [layout["metadata_bytes"]], axis=1)
        times = head[:, :8].copy().view("<i8")[:, 0]
        encoder = head[:, 8:10].copy().view("<u2")[:, 0]
        return cls(
            times / 1e6,
            -2 * np.pi / ENCODER_COUNTS * encoder,
            layout["bin_size"] * np.arange(counts.shape[1]),
            counts,
            image["header"]["frame_id"],
        )
