"""Computes the backscatter of the parts of a scene for the engine.

The backscatter of a surface is given by gamma = sigma0 / cos: its radar cross section
per square metre across the ray. By Lambert's law a wall has a gamma of gamma0 cos; open
ground has the same gamma at all angles. Smooth surfaces also reflect: the slopes of
their facets are normally distributed, and facets that face the radar glint. If the
facets reflect the share Gamma^2 and the rms slope is s, geometrical optics gives

    sigma0 = Gamma^2 / (2 s^2 cos^4) e^(-tan^2 / (2 s^2)).

Integrated over the lobe, this equals the echo of a flat mirror, pi Gamma^2 R^2. The
deflection of a metal sheet rises with the fourth power of its side, so its slopes rise
with the third power. Small sheets are therefore flat, and diffraction determines their
lobe: an area A returns 4 pi A^2 / lambda^2. For round objects see ``round_metal``.

A reflected wave meets other objects. One second bounce is modelled, by its mean: the
share Gamma^4 of gamma2, the mean gamma of streets, returns on the same path. The extra
length of this path has an exponential distribution, like measured delays in streets.

Volumes scatter a share of the absorbed power, the albedo omega: an opaque canopy has a
gamma of omega / 2. A sheet has no depth, so its gamma is omega times the share of the
power that it absorbs.

Gamma, albedo, reflection and slope come from the materials of the map. Sources: F. T.
Ulaby, R. K. Moore and A. K. Fung, Microwave Remote Sensing, volume 2; for the bending
of plates, S. Timoshenko and S. Woinowsky-Krieger, Theory of Plates and Shells; for
delays, A. A. M. Saleh and R. A. Valenzuela, A Statistical Model for Indoor Multipath
Propagation, IEEE Journal on Selected Areas in Communications 5(2), 1987.

A ray that grazes level ground illuminates many metres of it, so ground has a model of
its own. Open ground continues beyond the edge of the map, where rays also hit it. If
open ground has several materials, a raster stores gamma by position, since a single ray
illuminates several patches.

Open ground may be uneven: the power density of its heights along a line falls with the
square of the spatial frequency, as ISO 8608 describes for roads. The heights are a
texture of the map that repeats after 128 m. As seen from an antenna, rising ground
covers a larger angle in elevation than level ground, and hidden ground covers none. The
power of level ground is multiplied by the ratio of these angles.
"""

import math
from functools import lru_cache
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.round_metal import round_parts
from radarsim.addons.fmcw.speckle import TEXTURE_CELL, TEXTURE_CELLS
from radarsim.engine import Packed, engine
from radarsim.geometry import Floats
from radarsim.raycast.rays import RayClass, Rays
from radarsim.raycast.tracer import Tracer
from radarsim.rng import generator_for
from radarsim.scene.material import Material, rain_reflectivity
from radarsim.scene.scene import Part

PATCH: Final = 0.5  # m, side of the cells of the raster of ground
MOST_PATCHES: Final = 1000  # along each side
_ABOVE: Final = 0.3  # m, height above open ground from which rays are cast down


def _find_ground(tracer: Tracer, gamma: Floats, edges: Floats) -> dict[str, Any]:
    """Return the fields of the engine's ``Scattering`` that describe open ground.

    Args:
        tracer: Tracer of the scene.
        gamma: Gamma of each part at normal incidence, (P,).
        edges: Output, (P, 4) m: minimum x and y of each part, then maximum x and y,
            map frame; infinite for open ground.
    """
    open_part, area = -1, 0.0
    for i, part in enumerate(tracer.parts):
        if not part.faces.size:
            continue
        low, high = part.bounds
        edges[i] = low[0], low[1], high[0], high[1]
        own = float((high[0] - low[0]) * (high[1] - low[1]))
        if part.material.constant_gamma:
            # Open ground has no edges: it continues beyond the edge of the map.
            edges[i] = -math.inf, -math.inf, math.inf, math.inf
            if own > area:
                open_part, area = i, own
    found: dict[str, Any] = {
        "open_part": open_part,
        "open_height": 0.0,
        "open_gamma": 0.0,
        "patches": np.zeros((0, 0)),
        "corner": np.zeros(2),
        "cell": PATCH,
        "relief": np.zeros((0, 0)),
        "open_relief": 0.0,
        "heights": np.zeros((0, 0), np.float32),
    }
    if open_part >= 0:
        low, high = tracer.parts[open_part].bounds
        found["open_height"], found["open_gamma"] = high[2], gamma[open_part]
        found["corner"] = np.array(low[:2])
        found["cell"] = max(PATCH, float((high - low)[:2].max()) / MOST_PATCHES)
        relief = np.sqrt([part.material.roughness_cm3 for part in tracer.parts])
        found["open_relief"] = relief[open_part]
        grounds = [i for i in range(len(relief)) if _is_open(tracer, i)]
        if len(set(gamma[grounds])) > 1 or relief[grounds].any():
            ground = _look_down(tracer, open_part, found["cell"])
            found["patches"], found["relief"] = gamma[ground], relief[ground]
        if relief[grounds].any():
            found["heights"] = ground_heights()
    return found


def _is_open(tracer: Tracer, part: int) -> bool:
    return tracer.parts[part].material.constant_gamma


def _look_down(tracer: Tracer, open_part: int, cell: float) -> NDArray[np.int64]:
    """Return, for each position of a raster, the index of the ground's part, (X, Y).

    Positions that other objects cover from above have the index ``open_part``.
    """
    low, high = tracer.parts[open_part].bounds
    x, y = (
        np.arange(low[axis] + cell / 2, high[axis], cell).astype(np.float64)
        for axis in range(2)
    )
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    eyes = np.column_stack([places, np.full(len(places), high[2] + _ABOVE)])
    down = np.tile([0.0, 0.0, -1.0], (len(eyes), 1))
    seen = tracer.trace(Rays.uniform(eyes, down, max_range=2 * _ABOVE)).parts
    is_open = np.array([_is_open(tracer, i) for i in range(len(tracer.parts))])
    met = (seen >= 0) & is_open[seen]
    return np.where(met, seen, open_part).reshape(len(x), len(y))


@lru_cache(maxsize=1)
def ground_heights() -> NDArray[np.float32]:
    """Return a raster of heights of ground with a roughness of 1 cm^3, (N, N) m."""
    noise = generator_for(0, "relief").standard_normal([TEXTURE_CELLS] * 2)
    waves = np.fft.fftfreq(TEXTURE_CELLS, TEXTURE_CELL)  # per metre
    steep = np.maximum(np.hypot(*np.meshgrid(waves, waves)), waves[1])
    # A power density of C / k^3 in the plane gives a density of 4 C / k^2 along a line.
    density = 1e-6 * 0.1**2 / 4 / steep**3
    heights = np.fft.ifft2(np.fft.fft2(noise) * np.sqrt(density)).real / TEXTURE_CELL
    return np.asarray(heights - heights.mean(), np.float32)


NEPER_DB: Final = 10 / math.log(10)  # dB of power in a neper of power, 4.343
DENT_AREA: Final = 1.0  # m^2, area from which metal sheets have full slope; estimate
GRAZING: Final = 1e-3  # the smallest cosine of an angle of incidence
MIRROR_DB: Final = -30.0  # gamma of mirrors without their reflection; estimate
ROBOT_DB: Final = -5.0  # gamma of robots; estimate
MIRROR_SLOPE_DEG: Final = 1.0  # rms slope of the material of mirrors; estimate


_known: WeakKeyDictionary[Tracer, dict[RayClass, Packed]] = WeakKeyDictionary()


def scene_scattering(tracer: Tracer, ray_class: RayClass) -> Packed:
    """Return the scattering properties of a scene's P parts for a class of rays.

    Returns:
        The engine's ``Scattering``: the air, the ground, and ``parts``, (P + 1,), with
        a row for each part and a last row for robots:
            gamma: Gamma of the surfaces at normal incidence.
            constant_gamma: Whether gamma is the same at all angles; if not, it follows
                Lambert's law.
            glint: Gamma^2 / (2 s^2) of smooth surfaces; 0 for rough surfaces.
            narrowness: 1 / (2 s^2) of smooth surfaces; 0 for rough surfaces.
            area: Area of the largest flat face of a mirror, m^2; 0 for other parts and
                for round mirrors.
            volume: Radar cross section per volume, m^2/m^3.
            albedo: Share of the absorbed power that a sheet scatters.
            sway: Rms speed at which the wind moves volumes and sheets, m/s.
            edges: Minimum x and y, then maximum x and y of level ground, m, map frame.
    """
    # Tracers are held by weak references, so cached entries vanish with their tracer.
    known = _known.setdefault(tracer, {})
    if ray_class in known:
        return known[ray_class]
    materials = [part.material for part in tracer.parts]
    density, air_density, _ = tracer.losses(ray_class)
    per_db = ray_class.power_per_db
    loss = np.where(np.isfinite(density), density, 0.0) / (per_db * NEPER_DB)
    sheet = np.array([each.sheet_loss is not None for each in materials], np.bool_)
    albedo = np.array([each.albedo for each in materials])
    rain = np.array([rain_reflectivity(ray_class.band, r) for r in tracer.rain_rate])
    volume = np.where(sheet, 0.0, albedo * loss) + rain
    air = 0.0
    if tracer.air_part >= 0:
        air = albedo[-1] * air_density / (per_db * NEPER_DB) + rain[-1]
    areas = [mirror_area(part) for part in tracer.parts] * ~round_parts(tracer)
    lobes = np.array(list(map(lobe_of, materials, areas))).reshape(-1, 2)
    # Gamma, the backscatter coefficient, of opaque surfaces at normal incidence, dB.
    surface_db = [MIRROR_DB if m.radar_mirror else m.backscatter_db for m in materials]
    rows = np.zeros(len(materials) + 1, engine.rows["PartScattering"])
    rows[-1]["gamma"] = 10 ** (ROBOT_DB / 10)
    parts = rows[:-1]
    parts["gamma"] = [10 ** (db / 10) for db in surface_db]
    parts["constant_gamma"] = [each.constant_gamma for each in materials]
    parts["glint"], parts["narrowness"] = lobes.T
    parts["area"] = areas
    parts["volume"], parts["albedo"] = volume, albedo
    parts["sway"] = [each.sway_m_per_s for each in materials]
    ground = _find_ground(tracer, parts["gamma"], parts["edges"])
    known[ray_class] = engine.structures["Scattering"].pack(
        parts=rows, air=float(air), **ground
    )
    return known[ray_class]


def mirror_area(part: Part) -> float:
    """Return the area of the largest flat face of a mirror, m^2; 0 for other parts."""
    if not part.material.radar_mirror or not part.faces.size:
        return 0.0
    a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a) / 2
    area = np.linalg.norm(normals, axis=1)
    flat = np.round(normals / np.maximum(area, 1e-12)[:, None], 4)
    _, which = np.unique(flat, axis=0, return_inverse=True)
    return float(np.bincount(which.ravel(), area).max())


def lobe_of(material: Material, area: float = DENT_AREA) -> tuple[float, float]:
    """Return the values ``glint`` and ``narrowness`` of a surface's specular lobe.

    Args:
        material: Material of the surface.
        area: Area of a flat piece of the surface, m^2; used only for mirrors.
    """
    reflected, slope = material.specular_db, material.slope_deg
    if material.radar_mirror and reflected is None:
        reflected, slope = -material.absorption_db, MIRROR_SLOPE_DEG
    if material.radar_mirror:
        slope *= min(area / DENT_AREA, 1.0) ** 1.5
    if reflected is None or slope == 0:
        return 0.0, 0.0
    narrowness = 0.5 / math.radians(slope) ** 2
    return 10 ** (reflected / 10) * narrowness, narrowness
