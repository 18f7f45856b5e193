"""What the rays of a sensor are to a scene."""

from radarsim.presets.bands import BANDS_GHZ
from radarsim.presets.settings import SensorSettings
from radarsim.raycast.rays import LASER, RADAR, Kind


def kind_of(settings: SensorSettings) -> Kind:
    """Tell what the rays of a sensor have in common."""
    radar = settings.medium == "radar"
    return Kind(
        RADAR if radar else LASER,
        BANDS_GHZ.index(settings.band_ghz) if radar else 0,
        settings.power_per_db,
        settings.max_bounces,
    )
