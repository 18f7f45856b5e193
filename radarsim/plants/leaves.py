"""Leaves: open rhombs of two triangles that share the midrib."""

import numpy as np

from radarsim.geometry import Floats
from radarsim.plants.forms import PlantForm
from radarsim.plants.growth import Skeleton
from radarsim.plants.joining import Mesh


def foliage(form: PlantForm, skeleton: Skeleton, rng: np.random.Generator) -> Mesh:
    """Hang leaves around the ends of twigs, as many around each; all in the crown.

    They point away from their twig's end, and face any way.
    """
    ends = skeleton.points[skeleton.tips]
    owners = np.arange(form.leaves) % len(ends)
    offsets = _offsets(form, ends[owners], rng)
    ribs = offsets / form.cluster + rng.standard_normal(offsets.shape)
    return rhombs(form, ends[owners] + offsets, ribs, rng)


def rhombs(
    form: PlantForm, middles: Floats, ribs: Floats, rng: np.random.Generator
) -> Mesh:
    """Make a leaf around each of some points, turned about its rib at random.

    Args:
        form: Says how large leaves are.
        middles: (N, 3) m.
        ribs: (N, 3) where they point, of any length but none.
        rng: What turns them.

    Returns:
        Of each leaf base, right, tip, left: (4N, 3) m; and (2N, 3) faces, which have
        the edge from base to tip in common.
    """
    ribs = ribs / np.linalg.norm(ribs, axis=1, keepdims=True)
    others = rng.standard_normal(ribs.shape)
    blades = np.cross(ribs, others)
    blades /= np.linalg.norm(blades, axis=1, keepdims=True)
    rib, blade = ribs * form.leaf_length / 2, blades * form.leaf_width / 2
    corners = [middles - rib, middles - blade, middles + rib, middles + blade]
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(middles))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return vertices, faces.astype(np.int32)


def _offsets(form: PlantForm, ends: Floats, rng: np.random.Generator) -> Floats:
    """Draw where leaves are, seen from their twigs' ends, until all are in the crown.

    A leaf is in it with all its corners, whichever way it faces.
    """
    share = form.leaf_length / 2 / form.half_axes.min()
    room = form.half_axes * (1 - share)
    offsets = np.zeros_like(ends)
    out = np.arange(len(ends))
    while len(out):
        offsets[out] = rng.normal(0, form.cluster, (len(out), 3))
        places = (ends[out] + offsets[out] - form.centre) / room
        out = out[np.linalg.norm(places, axis=1) > 1]
    return offsets
