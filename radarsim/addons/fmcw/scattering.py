"""What the parts of a scene take from a wave, and what they scatter back.

Surfaces follow gamma = sigma0 / cos: the share of the power on a square metre across
the ray that is scattered back, as if to all sides. A wall of Lambert's law has gamma0
cos; open ground has the same gamma at all angles. What is smooth also reflects: its
facets, whose slopes are normally distributed, glint where they face the radar. With the
share Gamma^2 that they reflect and the rms slope s, by geometrical optics,

    sigma0 = Gamma^2 / (2 s^2 cos^4) e^(-tan^2 / (2 s^2)).

Over the whole lobe that is what a flat mirror returns, pi Gamma^2 R^2.

Volumes scatter a share of what they take, their albedo omega: a canopy that lets
nothing through has a gamma of omega / 2. So does a sheet, which has no depth: omega
times the share that it takes.

Gamma, albedo, reflection and slope are those of the materials of the map. Source: F. T.
Ulaby, R. K. Moore and A. K. Fung, Microwave Remote Sensing, volume 2.

Rays graze level ground over a long way, so that it is treated apart. Open ground does
not end at the edge of the map: a ray that passes over that edge meets it farther on.
Where it is of several materials, a raster has what it returns at each place: a ray
stands for ground over many metres, and so for several patches.
"""

import math
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from radarsim.geometry import Floats
from radarsim.jit import njit_inline
from radarsim.raycast.attenuation import EventRow
from radarsim.raycast.rays import RayClass, Rays
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material, rain_reflectivity
from radarsim.scene.scene import Part

_LEVEL: Final = 1e-6  # how far the normal of level ground is off the vertical, at most
PATCH: Final = 0.5  # m, side of the cells of the raster of ground
MOST_PATCHES: Final = 1000  # along each side
_ABOVE: Final = 0.3  # m over open ground, from where one looks down on it


class Ground(NamedTuple):  # compiled into kernels
    """The ground of a scene; P parts.

    Attributes:
        edges: (P + 1, 4) m, least x and y of each part and greatest ones, map frame.
            Open ground has none; the last row, of robots, is empty.
        open_part: The part that is open ground; -1 for none.
        open_height: m, of that; map frame.
        open_gamma: Its gamma.
        patches: (X, Y) gamma of ground that is the same at all angles, by place; (0, 0)
            if it is everywhere that of ``open_part``.
        corner: (2,) m, least x and y of the raster.
        cell: m, side of its cells.
    """

    edges: Floats
    open_part: int
    open_height: float
    open_gamma: float
    patches: Floats
    corner: Floats
    cell: float


class Grazing(NamedTuple):
    """A ray that meets level ground.

    Attributes:
        x: m, of the place above which it starts.
        y: m, likewise.
        ahead: Part of its direction along x, of a level unit vector.
        left: Part along y.
        t: Its length, m.
        depth: m, from the antenna down to the ground.
        angle: rad, of elevations for which the ray stands.
        near: m, range at which the ground begins.
        far: m, range at which it ends.
    """

    x: float
    y: float
    ahead: float
    left: float
    t: float
    depth: float
    angle: float
    near: float
    far: float


def find_ground(tracer: Tracer, gamma: Floats) -> Ground:
    """Return the ground of a scene.

    Args:
        tracer: Tracer of the scene.
        gamma: (P,) of its parts, at normal incidence.
    """
    edges = np.zeros((len(tracer.parts) + 1, 4))
    open_part, area = -1, 0.0
    for i, part in enumerate(tracer.parts):
        if not part.faces.size:
            continue
        low, high = part.bounds
        edges[i] = low[0], low[1], high[0], high[1]
        own = float((high[0] - low[0]) * (high[1] - low[1]))
        if part.material.constant_gamma:
            # The ground of a map goes on where the map ends; the largest one is meant.
            edges[i] = -math.inf, -math.inf, math.inf, math.inf
            if own > area:
                open_part, area = i, own
    if open_part < 0:
        return Ground(edges, -1, 0.0, 0.0, np.zeros((0, 0)), np.zeros(2), PATCH)
    low, high = tracer.parts[open_part].bounds
    cell = max(PATCH, float((high - low)[:2].max()) / MOST_PATCHES)
    patches = np.zeros((0, 0))
    if len({g for i, g in enumerate(gamma) if _is_open(tracer, i)}) > 1:
        patches = _look_down(tracer, gamma, open_part, cell)
    own, corner = float(gamma[open_part]), np.array(low[:2])
    return Ground(edges, open_part, float(high[2]), own, patches, corner, cell)


def _is_open(tracer: Tracer, part: int) -> bool:
    return tracer.parts[part].material.constant_gamma


def _look_down(tracer: Tracer, gamma: Floats, open_part: int, cell: float) -> Floats:
    """Return the gamma of open ground by place, (X, Y), as seen from above.

    What stands on the ground counts as that of ``open_part``.
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
    return np.where(met, gamma[seen], gamma[open_part]).reshape(len(x), len(y))


@njit_inline
def patch_gamma(ground: Ground, grazing: Grazing, distance: float) -> float:
    """Return the gamma of patched ground at a distance along a ray, m."""
    along = np.sqrt(max(distance * distance - grazing.depth * grazing.depth, 0.0))
    x = grazing.x + along * grazing.ahead - ground.corner[0]
    y = grazing.y + along * grazing.left - ground.corner[1]
    i, j = int(np.floor(x / ground.cell)), int(np.floor(y / ground.cell))
    if 0 <= i < ground.patches.shape[0] and 0 <= j < ground.patches.shape[1]:
        return float(ground.patches[i, j])
    return ground.open_gamma


@njit_inline
def is_level(direction: Floats, cosine: float) -> bool:
    """Return whether a surface is level that a ray from above meets.

    Args:
        direction: (3,) unit vector of the ray.
        cosine: Cosine of its angle of incidence.
    """
    return bool(abs(cosine + direction[2]) < _LEVEL)


@njit_inline
def grazing_at(
    ground: Ground,
    part: int,
    event: EventRow,
    direction: Floats,
    angle: float,
    end: float,
) -> Grazing:
    """Return the ``Grazing`` of a ray that meets level ground.

    Args:
        ground: The ``Ground``.
        part: Its row there.
        event: That at which the ray meets it.
        direction: (3,) unit vector of the ray.
        angle: rad, of elevations for which it stands.
        end: m, where the view over the ground ends.
    """
    back, ahead = np.inf, np.inf
    for axis in range(2):
        step = direction[axis]
        if abs(step) > 1e-9:
            place = event.x if axis == 0 else event.y
            first = (ground.edges[part, axis] - place) / step
            second = (ground.edges[part, 2 + axis] - place) / step
            back = min(back, -min(first, second))
            ahead = min(ahead, max(first, second))
    t = event.t
    near, far = t - max(back, 0.0), min(t + max(ahead, 0.0), end)
    return over_ground(
        event.x - t * direction[0],
        event.y - t * direction[1],
        direction,
        t,
        angle,
        near,
        far,
    )


@njit_inline
def over_ground(
    x: float,
    y: float,
    direction: Floats,
    t: float,
    angle: float,
    near: float,
    far: float,
) -> Grazing:
    """Return the ``Grazing`` of a ray of a length from a place, m; others as there."""
    level = max(np.hypot(direction[0], direction[1]), 1e-9)
    ahead, left = direction[0] / level, direction[1] / level
    return Grazing(x, y, ahead, left, t, -t * direction[2], angle, near, far)


NEPER_DB: Final = 10 / math.log(10)  # dB of power in a neper of power, 4.343
GRAZING: Final = 1e-3  # the smallest cosine of an angle of incidence
MIRROR_DB: Final = -30.0  # of what a mirror scatters beside its reflection; estimate
ROBOT_DB: Final = -5.0  # gamma of robots; estimate
MIRROR_SLOPE_DEG: Final = 1.0  # rms, of what mirrors are made of; estimate


class Scattering(NamedTuple):  # compiled into kernels
    """What the parts of a scene scatter; P parts, and a last row for robots.

    Attributes:
        gamma: (P + 1,) of the surfaces, at normal incidence.
        exponent: (P + 1,) of the cosine by which it falls off: 1 for Lambert's law, 0
            for ground.
        glint: (P + 1,) Gamma^2 / (2 s^2) of the surfaces; 0 of rough ones.
        narrowness: (P + 1,) 1 / (2 s^2) likewise.
        area: (P + 1,) m^2, of the largest flat face of mirrors; 0 of others.
        volume: (P + 1,) radar cross section of a cubic metre inside, m^2/m^3.
        albedo: (P + 1,) share of what a sheet takes that comes back.
        sway: (P + 1,) rms speed at which the wind moves volumes and sheets, m/s.
        air: Cross section of a cubic metre of the air, m^2/m^3.
        ground: Which parts are level, and where they end.
    """

    gamma: Floats
    exponent: Floats
    glint: Floats
    narrowness: Floats
    area: Floats
    volume: Floats
    albedo: Floats
    sway: Floats
    air: float
    ground: Ground


_known: WeakKeyDictionary[Tracer, dict[RayClass, Scattering]] = WeakKeyDictionary()


def scene_scattering(tracer: Tracer, ray_class: RayClass) -> Scattering:
    """Return what the parts of a scene scatter of the waves of a class."""
    # Weakly: a tracer that nobody uses any more takes its entry along.
    known = _known.setdefault(tracer, {})
    if ray_class in known:
        return known[ray_class]
    materials = [part.material for part in tracer.parts]
    density, air_density = tracer.densities(ray_class)
    per_db = ray_class.power_per_db
    loss = np.where(np.isfinite(density), density, 0.0) / (per_db * NEPER_DB)
    sheet = np.array([each.sheet_loss is not None for each in materials], np.bool_)
    albedo = np.array([each.albedo for each in materials])
    rain = np.array([rain_reflectivity(ray_class.band, r) for r in tracer.rain_rate])
    volume = np.where(sheet, 0.0, albedo * loss) + rain
    air = 0.0
    if tracer.air_part >= 0:
        air = albedo[-1] * air_density / (per_db * NEPER_DB) + rain[-1]
    lobes = np.array([lobe_of(each) for each in materials]).reshape(-1, 2)
    # Of opaque surfaces at normal incidence.
    surface_db = [MIRROR_DB if m.radar_mirror else m.backscatter_db for m in materials]
    gamma = [10 ** (db / 10) for db in surface_db]
    found = known[ray_class] = Scattering(
        np.append(gamma, 10 ** (ROBOT_DB / 10)),
        np.append([0.0 if each.constant_gamma else 1.0 for each in materials], 1.0),
        np.append(lobes[:, 0], 0.0),
        np.append(lobes[:, 1], 0.0),
        np.append([_mirror_area(part) for part in tracer.parts], 0.0),
        np.append(volume, 0.0),
        np.append(albedo, 0.0),
        np.append([each.sway_m_per_s for each in materials], 0.0),
        float(air),
        find_ground(tracer, np.array(gamma)),
    )
    return found


def _mirror_area(part: Part) -> float:
    """Return the area of the largest flat face of a mirror, m^2; 0 of anything else."""
    if not part.material.radar_mirror or not part.faces.size:
        return 0.0
    a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a) / 2
    area = np.linalg.norm(normals, axis=1)
    flat = np.round(normals / np.maximum(area, 1e-12)[:, None], 4)
    _, which = np.unique(flat, axis=0, return_inverse=True)
    return float(np.bincount(which.ravel(), area).max())


@njit_inline
def gamma_at(
    cosine: float, gamma: float, exponent: float, glint: float, narrowness: float
) -> float:
    """Return the gamma of a surface at an angle of incidence.

    Args:
        cosine: Cosine of the angle, above 0.
        gamma: As in ``Scattering``.
        exponent: Likewise.
        glint: Likewise.
        narrowness: Likewise.
    """
    rough = gamma * cosine**exponent
    if glint <= 0.0:
        return float(rough)
    square = cosine * cosine
    lobe = np.exp(-narrowness * (1.0 - square) / square)
    return float(rough + glint * lobe / (square * square * cosine))


def lobe_of(material: Material) -> tuple[float, float]:
    """Return ``glint`` and ``narrowness`` of ``Scattering`` of an opaque surface."""
    reflected, slope = material.specular_db, material.slope_deg
    if material.radar_mirror and reflected is None:
        reflected, slope = -material.absorption_db, MIRROR_SLOPE_DEG
    if reflected is None:
        return 0.0, 0.0
    narrowness = 0.5 / math.radians(slope) ** 2
    return 10 ** (reflected / 10) * narrowness, narrowness
