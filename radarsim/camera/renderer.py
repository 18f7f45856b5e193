"""Pictures of a scene, as a robot's camera sees them.

A picture depends on the scene and the view only: the same view gives the same pixels.
"""

import math
from typing import Final, TypeAlias

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from radarsim.camera.shading import AMBIENT, FULL_POWER, shade
from radarsim.camera.view import View
from radarsim.geometry import Floats
from radarsim.plotting.palette import FAMILY_COLOURS, Family, family_of
from radarsim.raycast.rays import LASER, RayClass, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene
from radarsim.sensors.echoes import ROBOT

Pixels: TypeAlias = NDArray[np.uint8]

WIDTH, HEIGHT = 160, 120  # pixels
FIELD_OF_VIEW: Final = math.radians(80.0)  # from left to right, as the original's
VIEWING_DISTANCE: Final = 1000.0  # m
# A volume that takes a decibel of light is that much darker, whatever a laser's power.
LIGHT: Final = RayClass(LASER, power_per_db=math.log(10) / 10)

ZENITH: Final = "#8fb8de"
HORIZON: Final = "#e4eef5"


class Renderer:
    """Draws pictures of one scene."""

    def __init__(self, scene: Scene) -> None:
        """Create a renderer.

        Raises:
            EngineError: If Embree cannot be used, or cannot use a part of the scene.
        """
        self._tracer = tracer_of(scene)
        materials = [*(part.material for part in self._tracer.parts), ROBOT]
        self._colours = np.array([_colour_of(material) for material in materials])
        self._directions = _pixel_directions()

    def render(self, view: View) -> Pixels:
        """Return a picture: RGB, (120, 160, 3), from the top, rows from the left."""
        directions = _rotate(self._directions, view.camera.rotation())
        n = len(directions)
        rays = Rays(
            np.tile(view.camera.position(), (n, 1)),
            directions,
            np.full(n, VIEWING_DISTANCE),
            np.full(n, FULL_POWER),
            np.zeros(n, np.uint8),
            np.full(n, view.carrier_id, np.int64),
            (LIGHT,),
        )
        traces = self._tracer.trace(rays, view.boxes, events=True, incidence=True)
        pixels = np.zeros((n, 3))
        shade(
            traces.events,
            traces.incidence,
            self._colours,
            _background(directions),
            pixels,
        )
        bytes_ = np.floor(255 * pixels + 0.5).clip(0, 255).astype(np.uint8)
        return bytes_.reshape(HEIGHT, WIDTH, 3)


def _colour_of(material: Material) -> tuple[float, float, float]:
    return to_rgb(FAMILY_COLOURS[family_of(material)])


def _pixel_directions() -> Floats:
    """Return unit vectors to the pixels' middles in the camera's frame, (N, 3)."""
    focal_length = WIDTH / 2 / math.tan(FIELD_OF_VIEW / 2)  # pixels
    left = (WIDTH - 1) / 2 - np.arange(WIDTH)
    up = (HEIGHT - 1) / 2 - np.arange(HEIGHT)
    vectors = np.full((HEIGHT, WIDTH, 3), focal_length)
    vectors[..., 1] = left
    vectors[..., 2] = up[:, None]
    vectors /= np.sqrt((vectors**2).sum(axis=2, keepdims=True))
    directions: Floats = vectors.reshape(-1, 3)
    return directions


def _rotate(vectors: Floats, rotation: Floats) -> Floats:
    """Rotate vectors, (N, 3); without BLAS, which would use further threads."""
    x, y, z = vectors.T[..., None]
    rotated: Floats = x * rotation[:, 0] + y * rotation[:, 1] + z * rotation[:, 2]
    return rotated


def _background(directions: Floats) -> Floats:
    """Return the colours of sky and ground, where there is nothing else, (N, 3)."""
    up = directions[:, 2:]
    horizon, zenith = np.array(to_rgb(HORIZON)), np.array(to_rgb(ZENITH))
    sky = horizon + np.maximum(up, 0.0) * (zenith - horizon)
    ground = np.array(to_rgb(FAMILY_COLOURS[Family.GROUND]))
    lit = AMBIENT + (1 - AMBIENT) * np.abs(up)  # a level floor far below
    colours: Floats = np.where(up > 0.0, sky, lit * ground)
    return colours
