"""Renders images of a robot's camera with the ray engine, and encodes them as bytes.

An image depends on the scene and the view only: the same view gives the same pixels.

Surfaces are matt and lit from the camera's position: their brightness depends on the
cosine between the ray and the normal (Lambert), and is at least ``AMBIENT``. A
translucent volume covers the objects behind it: in a volume with optical depth d, a ray
takes the fraction 1 - exp(-d) of the volume's colour (Beer and Lambert).
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

FULL_POWER: Final = 50.0  # optical depth at which a ray ends; exp(-50) is 2e-22
AMBIENT: Final = 0.45  # brightness of a surface that is parallel to the ray
Pixels: TypeAlias = NDArray[np.uint8]
FIELD_OF_VIEW: Final = math.radians(FOV_DEG)
VIEWING_DISTANCE: Final = 1000.0  # m
# Cameras use the attenuation of lasers, converted from dB to optical depth.
LIGHT: Final = RayClass(LASER, power_per_db=math.log(10) / 10)
MARK_RADIUS: Final = 0.04  # m; radius of the disc that marks a point of a trail
MOST_ANGLES: Final = 8  # fields of view whose pixel directions are cached
ZENITH: Final = "#8fb8de"
HORIZON: Final = "#e4eef5"
GOOD_QUALITY: Final = 75  # percent, as in the library of the original server


class Renderer:
    """Renders images of one scene."""

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
            field_of_view: Horizontal field of view, rad; None to use that of each view.

        Raises:
            EngineError: If Embree cannot be used, or cannot use a part of the scene.
            ValueError: If the number of pixels is not positive, or the angle is not
                between 0 and pi.
        """
        are_whole = all(isinstance(each, int) for each in (width, height))
        angle = FIELD_OF_VIEW if field_of_view is None else field_of_view
        if not (are_whole and min(width, height) > 0 and 0 < angle < math.pi):
            came = f"{width} x {height} pixels, {math.degrees(angle):g} degrees"
            expected = "whole numbers of pixels and an angle below 180 degrees"
            raise ValueError(f"picture of {came}, expected {expected}")
        self._tracer = tracer_of(scene)
        materials = [*(part.material for part in self._tracer.parts), ROBOT]
        self._colours = np.array([_colour_of(material) for material in materials])
        self._shape = height, width, 3
        self._field_of_view = field_of_view

    def render_tiles(self, tiles: Tiles) -> Pixels:
        """Return an image of one view, (H, W, 3), or of four views, (2H, 2W, 3).

        Four views fill the quarters of the image row by row; None gives a black
        quarter.
        """
        black = np.zeros(self._shape, np.uint8)
        pictures = [black if view is None else self.render(view) for view in tiles]
        if len(pictures) == 1:
            return pictures[0]
        return np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])])

    def render(self, view: View) -> Pixels:
        """Return an RGB image, (H, W, 3), with rows from the top."""
        height, width, _ = self._shape
        angle = self._field_of_view or view.fov
        pixels_ahead = _pixel_directions(width, height, angle)
        directions = _rotate(pixels_ahead, view.camera.rotation())
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
        """Draw the marks of trails as discs over an image, (H, W, 3).

        A ray from the camera to the centre of each mark determines its visibility: the
        mark fades in translucent volumes, and vanishes behind opaque objects.
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
            # Only pixels near the disc are tested, as there may be thousands of marks.
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
    """Return unit vectors to the centres of the pixels in the camera frame, (N, 3)."""
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
    """Rotate vectors, (N, 3), without BLAS, which would start threads."""
    x, y, z = vectors.T[..., None]
    rotated: Floats = x * rotation[:, 0] + y * rotation[:, 1] + z * rotation[:, 2]
    return rotated


def _background(directions: Floats) -> Floats:
    """Return the colours of sky and ground for rays that hit nothing, (N, 3)."""
    up = directions[:, 2:]
    horizon, zenith = np.array(to_rgb(HORIZON)), np.array(to_rgb(ZENITH))
    sky = horizon + np.maximum(up, 0.0) * (zenith - horizon)
    ground = np.array(to_rgb(FAMILY_COLOURS[Family.GROUND]))
    lit = AMBIENT + (1 - AMBIENT) * np.abs(up)  # brightness of level ground far below
    colours: Floats = np.where(up > 0.0, sky, lit * ground)
    return colours


def encode(pixels: Pixels, region: Region, image_type: ImageType) -> bytes:
    """Encode a part of an image for the wire, with its header.

    Args:
        pixels: RGB image, (H, W, 3).
        region: The part; it is clipped to the image.
        image_type: Type of the image on the wire.
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
