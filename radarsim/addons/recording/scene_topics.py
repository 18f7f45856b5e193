"""Creates the topics that show a map: surfaces, occupancy grid, camera pictures."""

import io
import math
from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image

from radarsim.addons.recording.messages import (
    MAP,
    Fields,
    TopicMessage,
    float32,
    header_of,
    occupancy_grid,
    pose_fields,
    vector,
)
from radarsim.addons.recording.recorders import EventType, RunEvent, unpack
from radarsim.addons.recording.robot_topics import FREE, OCCUPIED
from radarsim.autonomy.evaluation.map_score import Truth
from radarsim.autonomy.mapping.occupancy_grid import CellClass, GridFrame
from radarsim.geometry import Floats, Pose3
from radarsim.plotting.palette import colour_of
from radarsim.presets.robots import load_robot
from radarsim.raycast.rays import Boxes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.server.views import View

SCENE: Final = "/scene"
# Some viewers are too slow with more triangles. A message with this many triangles has
# 12 MB.
MOST_TRIANGLES: Final = 170_000
SMALL_PART: Final = 1000  # triangles; such a part is never thinned
RESOLUTION: Final = 0.05  # m; side of a cell
MOST_CELLS: Final = 4_000_000  # of the true map; a larger map gets larger cells
SEEN_THROUGH, SMOKE = 0.5, 0.3  # opacities of foliage, and of smoke
WIDTH, HEIGHT = 320, 240  # pixels of recorded pictures
QUALITY: Final = 75  # percent; JPEG quality of pictures
_TRIANGLE_LIST: Final = 11  # a type of ``visualization_msgs/msg/Marker``


def scene_topics(scene: Scene, *, with_map: bool = True) -> Iterator[TopicMessage]:
    """Yield the latched messages about a map.

    Args:
        scene: The map.
        with_map: Whether to publish the true occupancy grid, instead of a robot's map.
    """
    yield scene_markers(scene)
    if with_map and scene.parts:
        yield true_map(scene)


def scene_markers(scene: Scene) -> TopicMessage:
    """Return the surfaces of a scene as markers, a triangle list for each part."""
    every = math.ceil(scene.triangles / MOST_TRIANGLES)
    markers = [_marker(number, part, every) for number, part in enumerate(scene.parts)]
    type_, fields = "visualization_msgs/msg/MarkerArray", Fields(markers=markers)
    return TopicMessage(SCENE, type_, fields, latched=True)


def opacity_of(material: Material) -> float:
    """Return the opacity of a material, 0 to 1."""
    if not material.solid:
        return SMOKE
    return SEEN_THROUGH if material.lets_beams_in else 1.0


def _marker(number: int, part: Part, every: int) -> Fields:
    """Return a part as a marker; of a large part, show each ``every``-th triangle."""
    faces = part.faces if len(part.faces) <= SMALL_PART else part.faces[::every]
    red, green, blue = (float32(each) for each in to_rgb(colour_of(part.material)))
    corners: Floats = part.vertices[faces.ravel()]
    nothing = np.zeros(0, np.uint8)
    return Fields(
        header=header_of(0.0, MAP),
        ns=part.object_name,
        id=number,
        type=_TRIANGLE_LIST,
        action=0,  # add the marker
        pose=pose_fields(Pose3(0.0, 0.0, 0.0)),
        scale=vector(1.0, 1.0, 1.0),
        color=Fields(r=red, g=green, b=blue, a=float32(opacity_of(part.material))),
        lifetime=Fields(sec=0, nanosec=0),  # the marker is shown for ever
        frame_locked=False,
        points=[vector(*corner) for corner in corners.tolist()],
        colors=[],
        texture_resource="",
        texture=Fields(header=header_of(0.0, ""), format="", data=nothing),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=Fields(filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )


def true_map(scene: Scene) -> TopicMessage:
    """Return the true occupancy grid at the height of a P3AT's scanner.

    Foliage is occupied, as on the maps that robots make, and smoke is free. No cell is
    unknown.
    """
    low, high = scene.bounds[:, :2].tolist()
    area, size = math.prod(np.subtract(high, low).tolist()), RESOLUTION
    while area > MOST_CELLS * size**2:
        size *= 2
    # ``GridFrame`` grows in large blocks, so cells outside the scene are cut off.
    frame = GridFrame(size).extended_to((low[0], low[1]), (high[0], high[1]))
    floor = Pose3(0.0, 0.0, scene.floor_at(0.0, 0.0))
    truth = Truth(scene, frame, load_robot("P3AT").scanner_pose(floor).z)
    solid = truth.kinds[CellClass.OBSTACLE] | truth.kinds[CellClass.FOLIAGE]
    west, south = (math.floor(each / size) for each in low)
    east, north = (math.floor(each / size) + 1 for each in high)
    window = solid[
        south - frame.row : north - frame.row,
        west - frame.column : east - frame.column,
    ]
    cells = np.where(window, OCCUPIED, FREE).astype(np.int8)
    return occupancy_grid(0.0, (west * size, south * size), size, cells)


def draw_views(scene: Scene, events: Iterable[RunEvent]) -> Iterator[RunEvent]:
    """Yield the events, with each camera view replaced by a picture in JPEG format."""
    renderer = None
    for event in events:
        if event.type is not EventType.VIEW:
            yield event
            continue
        if renderer is None:  # starting the renderer takes a second
            from radarsim.server.camera import Renderer  # noqa: PLC0415

            renderer = Renderer(scene, WIDTH, HEIGHT)
        camera, carrier, rows = unpack(event.data)
        picture = renderer.render(View(Pose3(*camera), Boxes(rows), carrier))
        file = io.BytesIO()
        Image.fromarray(picture).save(file, "JPEG", quality=QUALITY)
        yield event._replace(type=EventType.PICTURE, data=file.getvalue())
