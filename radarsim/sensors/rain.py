"""What a radar detects of rain: speckle near the sensor.

Theory of operation
===================
Within a hundred metres rain absorbs almost nothing of a radar's beam; its drops show by
what they scatter back. A cell of the beam at range R, one range resolution deep, has
a volume of pi R^2 az el dR / (8 ln 2) m^3, for half-power widths az and el; that times
the reflectivity of the rain is its mean cross section. The drops' echoes add up with
random phases, so the power of a cell is distributed exponentially. The smallest cross
section that is detected grows with R^4. So a cell is detected with the probability
exp(-1/q), where the contrast q, the ratio of the mean to the smallest cross section,
falls with R^2: rain shows near the radar.

The nearest detected cell of each beam is an echo. A wall ahead is as far above the
detection limit as the sensor's margin; the strength of the echo is its own level above
the limit, dB, minus the loss of the beam on the way there and back, relative to that:
walls are stronger. If nothing is left of the level, no rain shows in that beam. A beam
that has no other end ends there.

Nothing is detected nearer than ``BLIND_RANGE`` or than the sensor's minimum range,
where the antenna receives its own signal.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.attenuation import Events
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import rain_reflectivity
from radarsim.sensors.echo_extraction import ECHO, EchoTable, insert_echoes

BLIND_RANGE: Final = 1.0  # m
DEFAULT_CELL: Final = 0.25  # m, for a sensor without range resolution
DEFAULT_BEAMWIDTH: Final = 2.0  # degrees, for a sensor without beamwidth
REFERENCE_RANGE: Final = 10.0  # m, where ``least_rcs_dbsm`` holds


def cell_depth(settings: SensorSettings) -> float:
    """Return the depth of a sensor's range cells, m."""
    return settings.range_resolution or settings.range_quantum or DEFAULT_CELL


def contrast(settings: SensorSettings, mm_per_h: float) -> float:
    """Return the contrast q of a cell at 1 m; at range R it is q / R^2."""
    az = math.radians(settings.beamwidth_az_deg or DEFAULT_BEAMWIDTH)
    el = math.radians(settings.beamwidth_el_deg or DEFAULT_BEAMWIDTH)
    volume = math.pi * az * el * cell_depth(settings) / (8 * math.log(2))
    band = BANDS_GHZ.index(settings.band_ghz)
    least = 10 ** (settings.least_rcs_dbsm / 10) / REFERENCE_RANGE**4
    return volume * rain_reflectivity(band, mm_per_h) / least


def find_rain(
    tracer: Tracer,
    events: Events,
    rays: NDArray[np.int64],
    random: Floats,
    settings: SensorSettings,
) -> EchoTable:
    """Find the echoes of the nearest cell of each beam in which rain is detected.

    Args:
        tracer: Tracer of the scene.
        events: EVENT of all rays, sorted by ray.
        rays: (N,) the ray that stands for each beam, in ascending order.
        random: (2, N) exponentially distributed with mean 1: how far the beam reaches,
            and how bright the detected cell is.
        settings: Settings of the sensor.
    """
    contrasts = np.zeros(len(tracer.rain_rate))
    for part in np.flatnonzero(tracer.rain_rate).tolist():
        contrasts[part] = contrast(settings, float(tracer.rain_rate[part]))
    cell = cell_depth(settings)
    # All cells are at multiples of their depth; the first is beyond the blind range.
    nearest = (math.floor(max(BLIND_RANGE, settings.min_range) / cell) + 1) * cell
    echoes = np.zeros(len(rays), ECHO)
    count = engine.find_rain(
        events,
        rays,
        random,
        tracer.air_part,
        contrasts,
        cell,
        settings.margin_db,
        nearest,
        settings.penetration_power,
        echoes,
    )
    return echoes[:count]


def add_rain(echoes: EchoTable, rain: EchoTable) -> EchoTable:
    """Insert the echoes of rain among the other echoes of their beams."""
    rain["ends"] = ~np.isin(rain["beam"], echoes["beam"][echoes["ends"]])
    return insert_echoes(echoes, rain)
