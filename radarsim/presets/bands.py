"""The bands of radars for which materials have numbers."""

from typing import Final

BANDS_GHZ: Final = (24, 77, 94)
