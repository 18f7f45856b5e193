"""Materials: how they attenuate and reflect beams, and whether they stop robots."""

import math
from dataclasses import dataclass, fields

OPAQUE = math.inf


@dataclass(frozen=True, slots=True, repr=False)
class Material:
    """A named material.

    Attributes:
        name: Name, as the map file spells it.
        density: Penetration power that a radar beam loses per metre inside;
            ``math.inf`` is opaque: the beam ends at the surface.
        laser_density: Penetration power that a laser beam loses per metre inside.
        solid: Whether it stops a robot.
        sheet_loss: Power that a radar beam loses at each surface crossed, for objects
            without an inside, such as single leaves; None for volumes and opaque
            surfaces. With a sheet loss only surfaces attenuate, even closed ones: a
            finite density is ignored, and a laser beam that a finite
            ``laser_density`` lets in loses nothing.
        radar_db: (3,) one-way attenuation of radar waves inside, dB/m, in each of
            ``BANDS_GHZ``; in addition to the density, converted to power by the
            sensor's margin.
        laser_db: One-way attenuation of light inside, dB/m.
        absorption_db: Part of a radar wave that an opaque surface absorbs, dB; a beam
            without so much margin does not return. ``math.inf`` absorbs everything.
        laser_absorption_db: Part of a light beam that an opaque surface absorbs, dB.
        radar_mirror: Whether an opaque surface is a mirror to radar waves.
        laser_mirror: Whether an opaque surface is a mirror to light.
        rain: Rain rate inside, mm/h; a radar sees the drops.
        transmission_db: (3,) what a radar wave loses on its way through a pane whose
            surfaces are mirrors, one way, dB, in each of ``BANDS_GHZ``, half of it at
            each; None for what no wave passes.
        attenuation_db: (3,) one-way attenuation of radar waves inside, dB/m, in each of
            ``BANDS_GHZ``, instead of ``density`` and ``radar_db``, for a radar that
            counts in decibels; None where these two hold for it too.
        sheet_attenuation_db: (3,) one-way attenuation by each surface crossed, dB,
            instead of ``sheet_loss``, likewise.
        backscatter_db: What a radar receives from an opaque surface that it meets
            head-on: its radar cross section per area seen, gamma 0, dB. What the
            surface absorbs is missing from it.
        constant_gamma: Whether an opaque surface has the same gamma at all angles, as
            open ground has, which goes on beyond the edge of the map in a spectrum;
            else it follows Lambert's law.
        specular_db: What the facets of an opaque surface reflect to a radar that they
            face, dB: 0 is all; None for a surface that is rough everywhere.
        slope_deg: Rms slope of these facets against the surface, degrees.
        albedo: The share of what a volume or a sheet takes from a radar wave that it
            scatters to all sides; the rest turns into heat. The drops of ``rain`` come
            on top.
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
    attenuation_db: tuple[float, float, float] | None = None
    sheet_attenuation_db: tuple[float, float, float] | None = None
    backscatter_db: float = -10.0
    albedo: float = 0.2
    constant_gamma: bool = False
    specular_db: float | None = None
    slope_deg: float = 2.0
    transmission_db: tuple[float, float, float] | None = None

    def __repr__(self) -> str:
        """Return the call that makes it, without what is by default."""
        others = [
            f"{field.name}={getattr(self, field.name)!r}"
            for field in fields(self)[1:]
            if getattr(self, field.name) != field.default
        ]
        return f"Material({', '.join([repr(self.name), *others])})"

    @property
    def penetrable(self) -> bool:
        """Whether radar or laser beams enter it, so that its inside matters."""
        return math.isfinite(self.density) or math.isfinite(self.laser_density)
