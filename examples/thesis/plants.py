"""Trees and shrubs of wood and foliage, by seed, and their mesh files.

Wood grows from the ground towards the ends of the twigs, and becomes closed tapered
tubes. Leaves are around the ends of the twigs: each is an open rhombus of two triangles
that share the midrib. One shrub has foliage in three shapes around the same wood, which
blocks the same rays, so that only the foliage differs. A plant is a mesh of wood and
one of leaves, by the names of their materials in mesh files.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import trimesh

from radarsim.geometry import Floats
from radarsim.rng import generator_for
from radarsim.scene.shapes import Mesh, concatenate, sphere

WOOD, LEAVES = "Wood", "Leaves"
SHAPES: Final = ("ball", "cloud", "leaves")
SEED: Final = 5  # of the shipped mesh files
GRID: Final = 1e-4  # m, of coordinates; rounding errors of processors are far below
TUFT_RADIUS: Final = 0.25  # m, of a ball of the cloud
CANDIDATES: Final = 12  # random positions for each twig's end
END_REGION: Final = 0.95  # share of the crown with twigs' ends; leaves extend further
SEGMENTS: Final = 4  # of a branch
SHARP_ANGLE_COST: Final = 3.0  # m
BEND: Final = 0.35  # share of a branch that continues in its parent's direction
WOBBLE: Final = 0.04  # deviation of a stem from its line, as a share of its length
MIN_SIDES, MAX_SIDES = 4, 10  # of wood
SIDE_WIDTH: Final = 0.07  # m, of the sides of thick wood

Plant = dict[str, Mesh]


@dataclass(frozen=True, slots=True)
class Species:
    """A kind of plant, in m unless stated otherwise; by default the shrub."""

    crown_centre: float = 0.9  # height of the ellipsoid in which twigs and leaves end
    crown_radius: float = 1.0
    crown_half_height: float = 1.0
    stems: int = 6
    stem_length: float = 0.35  # before branches grow to the twigs' ends
    stem_lean_deg: float = 25  # from the vertical, at most
    clear_height: float = 0.1  # below which nothing branches off
    stem_radius: float = 0.022  # at the ground
    tip_radius: float = 0.003  # at the ends of the twigs
    twigs: int = 90
    levels: int = 4  # of branchings from a stem to a twig, at most
    spread_deg: float = 65  # between a branch and its parent, at most, where possible
    directness: float = 0.35  # 0 uses the least wood, 1 the shortest paths to the twigs
    leaves: int = 6000
    leaf_length: float = 0.14
    leaf_width: float = 0.09
    cluster: float = 0.13  # standard deviation of leaves from their twig's end

    @property
    def centre(self) -> Floats:
        """Centre of the crown, (3,) m."""
        return np.array([0.0, 0.0, self.crown_centre])

    @property
    def half_axes(self) -> Floats:
        """Half-axes of the crown, (3,) m."""
        return np.array([self.crown_radius, self.crown_radius, self.crown_half_height])


SHRUB: Final = Species()
TREE: Final = Species(
    crown_centre=4.2,
    crown_radius=1.9,
    crown_half_height=2.4,
    stems=1,
    stem_length=5.2,
    stem_lean_deg=2,
    clear_height=1.7,
    stem_radius=0.14,
    tip_radius=0.007,
    twigs=140,
    spread_deg=75,
    directness=0.4,
    leaves=3600,
    leaf_length=0.24,
    leaf_width=0.15,
    cluster=0.22,
)
YOUNG_TREE: Final = Species(
    crown_centre=1.9,
    crown_radius=0.8,
    crown_half_height=1.4,
    stems=1,
    stem_length=2.6,
    stem_lean_deg=3,
    clear_height=0.5,
    stem_radius=0.04,
    tip_radius=0.004,
    twigs=60,
    levels=3,
    spread_deg=70,
    directness=0.3,
    leaves=1300,
    leaf_length=0.16,
)


class Skeleton:
    """The centre lines of a plant's wood, point by point, parents before children."""

    def __init__(self, species: Species, rng: np.random.Generator) -> None:
        """Grow the wood of one plant."""
        self.species = species
        self.points: list[Floats] = []  # m
        self.parents: list[int] = []  # index of the point before; -1 on the ground
        self._directions: list[Floats] = []  # unit vectors
        self._levels: list[int] = []
        self._lengths: list[float] = []  # along the wood to the ground, m
        self._grow_stems(rng)
        ends = _place_ends(species, rng)
        # Near ends first, so that branches to far ones can start from those to near
        # ones.
        order = np.argsort(np.linalg.norm(ends - self.points[0], axis=1), kind="stable")
        tips = [self._grow_branch(end) for end in ends[order]]
        self.tips = np.array(self.points)[tips]  # (T, 3) m; branches may start there
        self.radii = self._radii()  # of the wood at each point, m

    def _add(self, point: Floats, direction: Floats, parent: int, level: int) -> int:
        """Add a point; return its index."""
        length = 0.0
        if parent >= 0:
            step = float(np.linalg.norm(point - self.points[parent]))
            length = self._lengths[parent] + step
        self.points.append(point)
        self._directions.append(direction)
        self.parents.append(parent)
        self._levels.append(level)
        self._lengths.append(length)
        return len(self.points) - 1

    def _grow_stems(self, rng: np.random.Generator) -> None:
        """Grow slightly bent stems around the origin."""
        it = self.species
        first = rng.uniform(0, 2 * math.pi)
        steps = max(SEGMENTS, round(it.stem_length / 0.5))
        for number in range(it.stems):
            azimuth = first + 2 * math.pi * number / it.stems + rng.normal(0, 0.2)
            lean = math.radians(it.stem_lean_deg) * rng.uniform(0.5, 1.0)
            out = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
            direction = out * math.sin(lean) + np.array([0.0, 0.0, math.cos(lean)])
            foot = out * (2.0 * it.stem_radius if it.stems > 1 else 0.0)
            last = self._add(foot, direction, -1, 0)
            for step in range(1, steps + 1):
                offset = rng.normal(0, WOBBLE * it.stem_length / steps, 3) * [1, 1, 0]
                point = foot + direction * it.stem_length * step / steps + offset
                last = self._add(point, direction, last, 0)

    def _grow_branch(self, end: Floats) -> int:
        """Grow a branch to an end, along a Bézier curve; return its last point."""
        last = start = self._choose_start(end)
        foot, level = self.points[start], self._levels[start]
        length = float(np.linalg.norm(end - foot))
        control = foot + self._directions[start] * BEND * length
        for share in np.linspace(0, 1, SEGMENTS + 1)[1:].tolist():
            on_first = foot + share * (control - foot)
            tangent = control + share * (end - control) - on_first
            direction = tangent / max(float(np.linalg.norm(tangent)), 1e-12)
            last = self._add(on_first + share * tangent, direction, last, level + 1)
        return last

    def _choose_start(self, end: Floats) -> int:
        it, points = self.species, np.array(self.points)
        gaps = end - points
        distances = np.linalg.norm(gaps, axis=1)
        along = np.einsum("ij,ij->i", gaps, np.array(self._directions))
        along /= np.maximum(distances, 1e-9)
        too_sharp = along < math.cos(math.radians(it.spread_deg))
        costs = distances + it.directness * np.array(self._lengths)
        costs += SHARP_ANGLE_COST * too_sharp
        excluded = np.array(self._levels) >= it.levels
        excluded |= points[:, 2] < min(it.clear_height, points[:, 2].max())
        return int(np.where(excluded, np.inf, costs).argmin())

    def _radii(self) -> Floats:
        it, points, parents = self.species, np.array(self.points), self.parents
        rooted = np.array(parents) >= 0
        steps = np.zeros(len(points))
        before = points[np.array(parents)[rooted]]
        steps[rooted] = np.linalg.norm(points[rooted] - before, axis=1)
        beyond = np.zeros(len(points))
        for child in reversed(range(len(points))):
            if parents[child] >= 0:
                beyond[parents[child]] += beyond[child] + steps[child]
        shares = 1 + beyond / steps[rooted].mean()
        exponent = math.log(it.stem_radius / it.tip_radius) / math.log(shares.max())
        return np.asarray(it.tip_radius * shares**exponent)

    def bark(self) -> Mesh:
        """Return the surface of the wood: a closed tube for each branch and each stem.

        A branch's tube begins inside its parent's, a stem's on the ground. At a fork
        the thickest branch is the continuation of the parent.
        """
        children: dict[int, list[int]] = {}
        for point, parent in enumerate(self.parents):
            children.setdefault(parent, []).append(point)
        tubes = []
        growing = [[point] for point in children[-1]]
        while growing:
            path = growing.pop()
            while forks := children.get(path[-1]):
                first, *others = sorted(forks, key=lambda point: -self.radii[point])
                growing += [[path[-1], other] for other in others]
                path.append(first)
            radii = self.radii[path]
            if self.parents[path[0]] >= 0:
                radii[0] = radii[1]  # the branch's own, not its parent's
            width = 2 * np.pi * float(radii[0]) / SIDE_WIDTH
            sides = int(np.clip(round(width), MIN_SIDES, MAX_SIDES))
            tubes.append(tube(np.array(self.points)[path], radii, sides))
        return concatenate(tubes)


def _place_ends(species: Species, rng: np.random.Generator) -> Floats:
    """Spread the ends of the twigs over the crown, (T, 3) m."""
    ends = np.full((species.twigs, 3), np.inf)
    for number in range(species.twigs):
        # Uniform in the unit ball. The best of some random candidates keeps ends apart,
        # where plain random ones would bunch.
        places = rng.standard_normal((CANDIDATES, 3))
        places /= np.linalg.norm(places, axis=1, keepdims=True)
        places = places * rng.random((CANDIDATES, 1)) ** (1 / 3)
        places = species.centre + END_REGION * species.half_axes * places
        distances = np.linalg.norm(places[:, None] - ends[None, :number], axis=2)
        ends[number] = places[distances.min(axis=1, initial=np.inf).argmax()]
    return ends


def tube(centre_line: Floats, radii: Floats, sides: int) -> Mesh:
    """Create a closed tube with a flat beginning and a pointed end.

    Args:
        centre_line: (N, 3) m; at least two points.
        radii: (N,) m; the last one is ignored.
        sides: Number of sides, at least 3.
    """
    rings = len(centre_line) - 1
    tangents = np.gradient(centre_line, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    least = np.abs(tangents).mean(axis=0).argmin()  # an axis that it is never along
    # normal to the line, and counter-clockwise of each other as seen from its end
    u = np.cross(np.eye(3)[least], tangents)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(tangents, u)
    angles = 2 * np.pi * np.arange(sides) / sides
    cosines, sines = np.cos(angles)[:, None], np.sin(angles)[:, None]
    outward = cosines * u[:, None] + sines * v[:, None]
    walls = centre_line[:-1, None] + radii[:-1, None, None] * outward[:-1]
    vertices = np.vstack([walls.reshape(-1, 3), centre_line[0], centre_line[-1]])
    here = np.arange(sides)
    following = (here + 1) % sides
    foot, tip = np.full(sides, rings * sides), np.full(sides, rings * sides + 1)
    last = (rings - 1) * sides
    triangles = [(foot, following, here), (tip, last + here, last + following)]
    for ring in range(rings - 1):
        low, high = ring * sides, (ring + 1) * sides
        triangles.append((low + here, low + following, high + following))
        triangles.append((low + here, high + following, high + here))
    faces = np.vstack([np.column_stack(corners) for corners in triangles])
    return vertices, faces.astype(np.int32)


def ball(centre: Floats, radius: float, sides: int = 8, rings: int = 5) -> Mesh:
    """Create a closed sphere of few faces; all its vertices are on the true sphere."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings + 2)[1:-1]
    axis = np.zeros((rings + 1, 3))
    axis[:-1, 2], axis[-1, 2] = radius * np.sin(angles), radius
    vertices, faces = tube(axis, np.append(radius * np.cos(angles), 0.0), sides)
    vertices[-2] = [0.0, 0.0, -radius]  # the flat beginning becomes a pole, too
    return vertices + centre, faces


def foliage(skeleton: Skeleton, rng: np.random.Generator) -> Mesh:
    """Create leaves around the ends of the twigs, equally many for each, in the crown.

    They point away from their twig's end and face in random directions.
    """
    it, ends = skeleton.species, skeleton.tips
    owners = np.arange(it.leaves) % len(ends)
    # All corners of a leaf are in the crown, in any direction of the leaf.
    share = it.leaf_length / 2 / it.half_axes.min()
    half_axes = it.half_axes * (1 - share)
    offsets = np.zeros((len(owners), 3))
    outside = np.arange(len(owners))
    while len(outside):
        offsets[outside] = rng.normal(0, it.cluster, (len(outside), 3))
        centres = ends[owners[outside]] + offsets[outside]
        positions = (centres - it.centre) / half_axes
        outside = outside[np.linalg.norm(positions, axis=1) > 1]
    midribs = offsets / it.cluster + rng.standard_normal(offsets.shape)
    return rhombi(it, ends[owners] + offsets, midribs, rng)


def rhombi(
    species: Species, centres: Floats, midribs: Floats, rng: np.random.Generator
) -> Mesh:
    """Create a leaf at each of some points, rotated about its midrib at random.

    Args:
        species: The size of leaves.
        centres: (N, 3) m.
        midribs: (N, 3) directions from base to tip, of any length but 0.
        rng: Draws the rotations.

    Returns:
        Base, right, tip and left of each leaf, (4N, 3) m; and (2N, 3) faces, of which
        two each share the edge from base to tip.
    """
    midribs = midribs / np.linalg.norm(midribs, axis=1, keepdims=True)
    blades = np.cross(midribs, rng.standard_normal(midribs.shape))
    blades /= np.linalg.norm(blades, axis=1, keepdims=True)
    rib, blade = midribs * species.leaf_length / 2, blades * species.leaf_width / 2
    corners = [centres - rib, centres - blade, centres + rib, centres + blade]
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(centres))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return vertices, faces.astype(np.int32)


def make_plant(species: Species, seed: int, name: str) -> Plant:
    """Create a plant with leaves; the same seed and name give the same plant."""
    rng = generator_for(seed, "plants", name)
    skeleton = Skeleton(species, rng)
    return {WOOD: skeleton.bark(), LEAVES: foliage(skeleton, rng)}


def make_shrubs(seed: int, species: Species = SHRUB) -> dict[str, Plant]:
    """Create one shrub with foliage in each of ``SHAPES``; wood and crown are the same.

    A ball fills the crown, which is spherical; a cloud has a small ball around the end
    of each twig; leaves are there, too.
    """
    rng = generator_for(seed, "plants", "shrub")
    skeleton = Skeleton(species, rng)
    vertices, faces = sphere(species.crown_radius)
    # Balls of the cloud are around the twigs' ends, moved inward to fit into the crown.
    ends = skeleton.tips - species.centre
    distances = np.linalg.norm(ends, axis=1, keepdims=True)
    room = (species.crown_radius - TUFT_RADIUS) / np.maximum(distances, TUFT_RADIUS)
    ends = species.centre + np.minimum(1.0, room) * ends
    shapes = (
        (vertices + species.centre, faces),
        concatenate([ball(end, TUFT_RADIUS) for end in ends]),
        foliage(skeleton, rng),
    )
    wood = skeleton.bark()
    return {
        name: {WOOD: wood, LEAVES: shape}
        for name, shape in zip(SHAPES, shapes, strict=True)
    }


def plant_files(seed: int = SEED) -> dict[str, bytes]:
    """Return the contents of all mesh files of plants, by file name."""
    plants = {f"shrub_{name}": each for name, each in make_shrubs(seed).items()}
    plants["tree"] = make_plant(TREE, seed, "tree")
    plants["young_tree"] = make_plant(YOUNG_TREE, seed, "young tree")
    return {f"{name}.glb": encode_glb(each) for name, each in plants.items()}


def encode_glb(plant: Plant) -> bytes:
    """Encode a plant as a binary glTF file, in which y is up.

    Coordinates are rounded to 0.1 mm, so that all machines write the same ones.
    """
    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual
    for name, (vertices, faces) in plant.items():
        x, y, z = (np.round(vertices / GRID) * GRID).T
        material = visual.material.PBRMaterial(name=name, doubleSided=True)
        mesh = trimesh.Trimesh(
            np.column_stack([x, z, -y]) + 0.0,  # no negative zeros
            faces,
            process=False,
            visual=visual.TextureVisuals(material=material),
        )
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    content: bytes = scene.export(file_type="glb")
    return content
