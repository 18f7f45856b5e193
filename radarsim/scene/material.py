"""What things are made of, as a beam and a bumper meet them."""

import math
from dataclasses import dataclass

OPAQUE = math.inf


@dataclass(frozen=True, slots=True)
class Material:
    """A named material.

    Attributes:
        name: As the map file spells it.
        density: Penetration power that a radar beam loses per metre inside;
            ``math.inf`` is opaque: the beam ends at the surface.
        laser_density: The same for a laser beam.
        solid: Whether a robot is stopped by it.
        sheet_loss: Power that a radar beam loses at each surface crossed, for things
            that have no inside, such as single leaves; None for volumes and opaque
            surfaces. With it surfaces alone cost something, even where they are
            closed: a finite density does not count, and a laser beam that a finite
            ``laser_density`` lets in passes for nothing.
        radar_db: (3,) dB that radar waves lose per metre inside, one way, in each of
            ``BANDS_GHZ``; on top of the density, at so much power per dB as a sensor's
            margin makes it.
        laser_db: The same for light.
        absorption_db: dB that an opaque surface keeps of a radar wave; what a beam has
            not to spare does not come back. ``math.inf`` keeps everything.
        laser_absorption_db: The same of light.
        radar_mirror: Whether an opaque surface reflects radar waves like a mirror.
        laser_mirror: Whether it reflects light so.
        rain: mm/h of rain in it, whose drops a radar sees.
    """

    name: str
    density: float = OPAQUE
    laser_density: float = OPAQUE
    solid: bool = True
    sheet_loss: float | None = None
    radar_db: tuple[float, float, float] = (0.0, 0.0, 0.0)
    laser_db: float = 0.0
    absorption_db: float = 0.0
    laser_absorption_db: float = 0.0
    radar_mirror: bool = False
    laser_mirror: bool = False
    rain: float = 0.0

    @property
    def penetrable(self) -> bool:
        """Whether radar or laser beams get into it, so that its inside counts."""
        return math.isfinite(self.density) or math.isfinite(self.laser_density)
