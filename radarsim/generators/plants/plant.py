"""Plants of wood and foliage, one shrub with foliage in three shapes, and mesh files.

The wood of the three shapes is the same: it blocks the same rays, so that only the
foliage differs, and a map has the same plants that were calibrated.

Meshes are closed tapered tubes for wood, balls, and leaves. A leaf is an open rhombus
of two triangles that share the midrib.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from radarsim.generators.plants.growth import LEAVES, WOOD, Skeleton, grow
from radarsim.generators.plants.species import SHRUB, TREE, YOUNG_TREE, PlantParameters
from radarsim.geometry import Floats
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Mesh, concatenate, sphere

MIN_SIDES: Final = 4
MAX_SIDES: Final = 10
SIDE_WIDTH: Final = 0.07  # m, of the sides of thick wood


def bark(skeleton: Skeleton) -> Mesh:
    """Return the surface of wood: a closed tube for each branch and each stem.

    A branch's tube begins inside its parent's, a stem's on the ground.
    """
    return concatenate([_mesh_branch(skeleton, path) for path in _branches(skeleton)])


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
    outward = (
        np.cos(angles)[:, None] * u[:, None] + np.sin(angles)[:, None] * v[:, None]
    )
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


def _branches(skeleton: Skeleton) -> list[list[int]]:
    """Split a skeleton into branches: the points of each, from its parent to its end.

    At a fork the thickest branch is the continuation of the parent.
    """
    count = len(skeleton.points)
    children: list[list[int]] = [[] for _ in range(count)]
    for point, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            children[parent].append(point)
    finished = []
    growing = [[point] for point in np.flatnonzero(skeleton.parents < 0).tolist()]
    while growing:
        path = growing.pop()
        while children[path[-1]]:
            fork = path[-1]
            first, *others = sorted(
                children[fork], key=lambda point: -skeleton.radii[point]
            )
            growing += [[fork, other] for other in others]
            path.append(first)
        finished.append(path)
    return finished


def _mesh_branch(skeleton: Skeleton, path: list[int]) -> Mesh:
    radii = skeleton.radii[path]
    if skeleton.parents[path[0]] >= 0:
        radii[0] = radii[1]  # the branch's own, not its parent's
    circumference = 2 * np.pi * float(radii[0])
    sides = int(np.clip(round(circumference / SIDE_WIDTH), MIN_SIDES, MAX_SIDES))
    return tube(skeleton.points[path], radii, sides)


def foliage(
    parameters: PlantParameters, skeleton: Skeleton, rng: np.random.Generator
) -> Mesh:
    """Create leaves around the ends of the twigs, equally many for each, in the crown.

    They point away from their twig's end and face in random directions.
    """
    ends = skeleton.points[skeleton.tips]
    owners = np.arange(parameters.leaves) % len(ends)
    # All corners of a leaf are in the crown, whatever direction the leaf faces.
    share = parameters.leaf_length / 2 / parameters.half_axes.min()
    half_axes = parameters.half_axes * (1 - share)
    offsets = np.zeros((len(owners), 3))
    outside = np.arange(len(owners))
    while len(outside):
        offsets[outside] = rng.normal(0, parameters.cluster, (len(outside), 3))
        centres = ends[owners[outside]] + offsets[outside]
        positions = (centres - parameters.centre) / half_axes
        outside = outside[np.linalg.norm(positions, axis=1) > 1]
    midribs = offsets / parameters.cluster + rng.standard_normal(offsets.shape)
    return rhombi(parameters, ends[owners] + offsets, midribs, rng)


def rhombi(
    parameters: PlantParameters,
    centres: Floats,
    midribs: Floats,
    rng: np.random.Generator,
) -> Mesh:
    """Create a leaf at each of some points, rotated about its midrib at random.

    Args:
        parameters: The size of leaves.
        centres: (N, 3) m.
        midribs: (N, 3) directions from base to tip, of any length but 0.
        rng: Draws the rotations.

    Returns:
        Base, right, tip and left of each leaf, (4N, 3) m; and (2N, 3) faces, of which
        two each share the edge from base to tip.
    """
    midribs = midribs / np.linalg.norm(midribs, axis=1, keepdims=True)
    others = rng.standard_normal(midribs.shape)
    blades = np.cross(midribs, others)
    blades /= np.linalg.norm(blades, axis=1, keepdims=True)
    rib, blade = (
        midribs * parameters.leaf_length / 2,
        blades * parameters.leaf_width / 2,
    )
    corners = [centres - rib, centres - blade, centres + rib, centres + blade]
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(centres))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return vertices, faces.astype(np.int32)


SHAPES: Final = ("ball", "cloud", "leaves")
TUFT_RADIUS: Final = 0.25  # m, of a ball of the cloud
SEED: Final = 5  # of the shipped mesh files
GRID: Final = 1e-4  # m, of coordinates; rounding errors of processors are far below


@dataclass(frozen=True, eq=False)
class Plant:
    """A plant at the origin.

    Attributes:
        wood: Closed tubes.
        foliage: Leaves, or closed volumes that replace them.
    """

    wood: Mesh
    foliage: Mesh

    @property
    def pieces(self) -> dict[str, Mesh]:
        """The meshes by the names of their materials in the mesh file."""
        return {WOOD: self.wood, LEAVES: self.foliage}

    @property
    def triangles(self) -> int:
        """Number of triangles of both meshes."""
        return len(self.wood[1]) + len(self.foliage[1])

    def parts(
        self,
        name: str,
        wood: Material,
        leaves: Material,
        position: Floats | None = None,
    ) -> tuple[Part, Part]:
        """Return its parts in a scene, at a position, (3,) m, or at the origin."""
        offset = np.zeros(3) if position is None else position
        return (
            Part(name, wood, self.wood[0] + offset, self.wood[1]),
            Part(name, leaves, self.foliage[0] + offset, self.foliage[1]),
        )


def make_plant(parameters: PlantParameters, seed: int, name: str) -> Plant:
    """Create a plant with leaves; the same seed and name give the same plant."""
    rng = generator_for(seed, "plants", name)
    skeleton = grow(parameters, rng)
    return Plant(bark(skeleton), foliage(parameters, skeleton, rng))


def make_shrubs(seed: int, parameters: PlantParameters = SHRUB) -> dict[str, Plant]:
    """Create one shrub with foliage in each of ``SHAPES``; wood and crown are the same.

    A ball fills the crown; a cloud has a small ball around the end of each twig;
    leaves are there, too.

    Args:
        seed: Seed of wood and leaves.
        parameters: Parameters with a spherical crown.
    """
    rng = generator_for(seed, "plants", "shrub")
    skeleton = grow(parameters, rng)
    vertices, faces = sphere(parameters.crown_radius)
    # Balls of the cloud are around the twigs' ends, moved inward to fit into the crown.
    ends = skeleton.points[skeleton.tips] - parameters.centre
    distances = np.linalg.norm(ends, axis=1, keepdims=True)
    inward = np.minimum(
        1.0,
        (parameters.crown_radius - TUFT_RADIUS) / np.maximum(distances, TUFT_RADIUS),
    )
    ends = parameters.centre + inward * ends
    shapes = {
        "ball": (vertices + parameters.centre, faces),
        "cloud": concatenate([ball(end, TUFT_RADIUS) for end in ends]),
        "leaves": foliage(parameters, skeleton, rng),
    }
    wood = bark(skeleton)
    return {shape: Plant(wood, shapes[shape]) for shape in SHAPES}


def plant_files(seed: int = SEED) -> dict[str, bytes]:
    """Return the contents of all mesh files of plants, by file name."""
    plants = {f"shrub_{name}": each for name, each in make_shrubs(seed).items()}
    plants["tree"] = make_plant(TREE, seed, "tree")
    plants["young_tree"] = make_plant(YOUNG_TREE, seed, "young tree")
    return {f"{name}.glb": encode_glb(each.pieces) for name, each in plants.items()}


def encode_glb(pieces: Mapping[str, Mesh]) -> bytes:
    """Encode meshes, by the names of their materials, as a binary glTF file.

    Args:
        pieces: Meshes with z up; in the file y is up. Coordinates are rounded to
            0.1 mm, so that all machines write the same ones.
    """
    import trimesh  # noqa: PLC0415 - slow to import

    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual
    for name, (vertices, faces) in pieces.items():
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
