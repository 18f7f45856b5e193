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
    """

    name: str
    density: float = OPAQUE
    laser_density: float = OPAQUE
    solid: bool = True
    sheet_loss: float | None = None

    @property
    def penetrable(self) -> bool:
        """Whether radar or laser beams get into it, so that its inside counts."""
        return math.isfinite(self.density) or math.isfinite(self.laser_density)
