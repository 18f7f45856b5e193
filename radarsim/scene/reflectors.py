"""Point reflectors: small targets whose radar cross section is known.

Theory of operation
===================
What is smaller than a beam returns a power that its radar cross section determines, not
its size. A trihedral, three triangular plates of metal at right angles, returns a wave
to where it came from, with a cross section of 4 pi a^4 / (3 lambda^2) for plates whose
legs are a long. Eight of them back to back make the octahedron that ships carry, which
returns from all sides alike; so a reflector has a position, but no direction.

A radar that computes power takes the cross section. To the rays of a range scanner, and
to robots, a reflector is an opaque octahedron of that size. A reflector of which only
the cross section is known is ``POINT_EDGE`` large.

Source of the cross sections: any textbook on radar; all hold for a target that is much
larger than the wavelength, and far away.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import octahedron

# What reflectors are made of. Their faces return nothing, in addition to the point.
REFLECTOR: Final = Material("reflector", backscatter_db=-math.inf)
POINT_EDGE: Final = 0.05  # m


@dataclass(frozen=True, slots=True)
class Reflector:
    """A point reflector: a trihedral, or a target of known cross section.

    Attributes:
        name: Name of the object in the map.
        position: x, y, z, m, map frame.
        trihedral: Length of the legs of the trihedral's plates, m; None if it is none.
        rcs_dbsm: Radar cross section of another target, at every wavelength, dBsm.

    Raises:
        ValueError: Unless exactly one of ``trihedral`` and ``rcs_dbsm`` is given.
    """

    name: str
    position: tuple[float, float, float]
    trihedral: float | None = None
    rcs_dbsm: float | None = None

    def __post_init__(self) -> None:
        if (self.trihedral is None) == (self.rcs_dbsm is None):
            raise ValueError(
                f"trihedral {self.trihedral} and rcs_dbsm {self.rcs_dbsm}, expected"
                " exactly one of them"
            )

    def rcs(self, wavelength: float) -> float:
        """Return the radar cross section at a wavelength in m, m^2."""
        if self.trihedral is not None:
            return trihedral_rcs(self.trihedral, wavelength)
        return float(10 ** ((self.rcs_dbsm or 0.0) / 10))

    @property
    def hull(self) -> Part:
        """The octahedron that stops rays and robots, in the map frame."""
        vertices, faces = octahedron(self.trihedral or POINT_EDGE)
        return Part(self.name, REFLECTOR, vertices + np.array(self.position), faces)


def trihedral_rcs(edge: float, wavelength: float) -> float:
    """Return the cross section of a trihedral that is seen along its axis, m^2.

    Args:
        edge: Length of the legs of its triangular plates, m.
        wavelength: m.

    >>> round(10 * math.log10(trihedral_rcs(0.1, 299792458 / 77e9)), 2)
    14.41
    """
    return 4 * math.pi * edge**4 / (3 * wavelength**2)
