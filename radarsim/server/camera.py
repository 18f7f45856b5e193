"""What a robot's camera sees: pictures of a scene by the ray engine, and their bytes.

A picture depends on the scene and the view only: the same view gives the same pixels.

Surfaces are matt and are lit from where the camera is: their brightness depends on the
cosine between the ray and their normal (Lambert), and is at least ``AMBIENT``. Volumes
that let light through veil objects behind them: a ray that loses the power d in a
volume gets the share 1 - exp(-d) of the volume's colour (Beer and Lambert).
"""

from __future__ import annotations

import io
import math
from dataclasses import replace
from functools import lru_cache
from typing import Final, TypeAlias

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image

from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.plotting.palette import FAMILY_COLOURS, Family, family_of
from radarsim.protocol.images import (
    HEIGHT,
    WIDTH,
    ImageType,
    Region,
    encode_image,
    encode_raw,
)
from radarsim.raycast.rays import LASER, Outcome, RayClass, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import ROBOT
from radarsim.server.views import FOV_DEG, Tiles, View

FULL_POWER: Final = 50.0  # a ray that has lost it sees nothing: exp(-50) is 2e-22
AMBIENT: Final = 0.45  # brightness of a surface along the ray
Pixels: TypeAlias = NDArray[np.uint8]
FIELD_OF_VIEW: Final = math.radians(FOV_DEG)
VIEWING_DISTANCE: Final = 1000.0  # m
# A volume that takes a decibel of light is that much darker, whatever a laser's power.
LIGHT: Final = RayClass(LASER, power_per_db=math.log(10) / 10)
MARK_RADIUS: Final = 0.04  # m; of a disc for each mark of a trail
MOST_ANGLES: Final = 8  # fields of view whose pixels are kept
ZENITH: Final = "#8fb8de"
HORIZON: Final = "#e4eef5"
GOOD_QUALITY: Final = 75  # percent, as the original's library has it


class Renderer:
    """Draws pictures of one scene."""

    def __init__(
        self,
        scene: Scene,
        width: int = WIDTH,
        height: int = HEIGHT,
        field_of_view: float | None = None,
    ) -> None:
        """Create a renderer.

        Args:
            scene: The scene.
            width: Pixels from left to right.
            height: Pixels from top to bottom.
            field_of_view: Angle from left to right, rad; None for that of each view.

        Raises:
            EngineError: If Embree cannot be used, or cannot use a part of the scene.
            ValueError: If there are no pixels, or the angle is not below pi.
        """
        are_whole = all(isinstance(each, int) for each in (width, height))
        angle = FIELD_OF_VIEW if field_of_view is None else field_of_view
        if not (are_whole and min(width, height) > 0 and 0 < angle < math.pi):
            came = f"{width} x {height} pixels, {math.degrees(angle):g} degrees"
            expected = "whole numbers of pixels, and less than 180 degrees"
            raise ValueError(f"picture of {came}, expected {expected}")
        self._tracer = tracer_of(scene)
        materials = [*(part.material for part in self._tracer.parts), ROBOT]
        self._colours = np.array([_colour_of(material) for material in materials])
        self._shape = height, width, 3
        self._field_of_view = field_of_view

    def render_tiles(self, tiles: Tiles) -> Pixels:
        """Return a picture of one view, or of four as its quarters, row by row."""
        black = np.zeros(self._shape, np.uint8)
        pictures = [black if view is None else self.render(view) for view in tiles]
        if len(pictures) == 1:
            return pictures[0]
        return np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])])

    def render(self, view: View) -> Pixels:
        """Return a picture: RGB, (H, W, 3), from the top, rows from the left."""
        height, width, _ = self._shape
        angle = self._field_of_view or view.fov
        pixels_ahead = _pixel_directions(width, height, angle)
        directions = _rotate(pixels_ahead, view.camera.rotation())
        n = len(directions)
        # Picture by picture only the camera moves: the directions are turned, not
        # computed again.
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
        engine.shade(
            traces.events,
            traces.incidence,
            self._colours,
            _background(directions),
            pixels,
            FULL_POWER,
            AMBIENT,
        )
        if view.marks is not None and len(view.marks):
            self._draw_marks(view, view.marks, pixels.reshape(self._shape))
        bytes_ = np.floor(255 * pixels + 0.5).clip(0, 255).astype(np.uint8)
        return bytes_.reshape(self._shape)

    def _draw_marks(self, view: View, marks: Floats, pixels: Floats) -> None:
        """Draw the marks of trails as discs over a picture, (H, W, 3).

        Each is veiled as one ray to it is, and hidden with what that ray does not
        reach.
        """
        height, width, _ = self._shape
        angle = self._field_of_view or view.fov
        focal_length = width / 2 / math.tan(angle / 2)  # pixels
        offsets = marks[:, :3] - view.camera.position()
        local = _rotate(offsets, view.camera.rotation().T)
        near = np.flatnonzero(local[:, 0] > MARK_RADIUS)
        order = near[np.argsort(-local[near, 0], kind="stable")]
        lengths = np.sqrt((offsets[order] ** 2).sum(axis=1))
        rays = replace(
            Rays.uniform(
                np.tile(view.camera.position(), (len(order), 1)),
                offsets[order] / lengths[:, None],
                max_range=0.0,
                power=FULL_POWER,
                carrier_id=view.carrier_id,
                medium=0,
            ),
            max_range=lengths,
            ray_classes=(LIGHT,),
        )
        traces = self._tracer.trace(rays, view.boxes)
        seen = np.exp(traces.power - FULL_POWER)
        seen[traces.outcomes != Outcome.NOTHING] = 0.0
        for k, share in zip(order.tolist(), seen.tolist(), strict=True):
            ahead, left, up = local[k]
            column = (width - 1) / 2 - focal_length * left / ahead
            row = (height - 1) / 2 - focal_length * up / ahead
            radius = max(focal_length * MARK_RADIUS / ahead, 0.5)
            # Pixels around it alone, as there may be thousands of marks.
            rows, columns = np.ogrid[
                max(0, int(row - radius)) : min(height, int(row + radius) + 2),
                max(0, int(column - radius)) : min(width, int(column + radius) + 2),
            ]
            disc = np.hypot(columns - column, rows - row) <= radius
            before = pixels[rows, columns]
            pixels[rows, columns] += share * disc[..., None] * (marks[k, 3:] - before)


def _colour_of(material: Material) -> tuple[float, float, float]:
    return to_rgb(FAMILY_COLOURS[family_of(material)])


@lru_cache(MOST_ANGLES)
def _pixel_directions(width: int, height: int, field_of_view: float) -> Floats:
    """Return unit vectors to the pixels' middles in the camera's frame, (N, 3)."""
    focal_length = width / 2 / math.tan(field_of_view / 2)  # pixels
    left = (width - 1) / 2 - np.arange(width)
    up = (height - 1) / 2 - np.arange(height)
    vectors = np.full((height, width, 3), focal_length)
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


def encode(pixels: Pixels, region: Region, image_type: ImageType) -> bytes:
    """Return a part of a picture as it is sent to a viewer.

    Args:
        pixels: RGB, (H, W, 3).
        region: The part; as much of it as is in the picture is sent.
        image_type: Type of the picture on the wire.
    """
    height, width = pixels.shape[:2]
    x, y, width, height = region.clip(width, height)
    part = np.ascontiguousarray(pixels[y : y + height, x : x + width])
    if image_type is ImageType.RAW:
        data = encode_raw(width, height, [row[:, ::-1].tobytes() for row in part])
    else:
        file = io.BytesIO()
        Image.fromarray(part).save(file, "JPEG", quality=GOOD_QUALITY)
        data = file.getvalue()
    return encode_image(image_type, data)
