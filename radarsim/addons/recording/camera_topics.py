"""Pictures of a robot's camera as topics, and the drawing of what is recorded of it."""

import io
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Final

import numpy as np
from PIL import Image

from radarsim.addons.recording.host_recorder import (
    EventType,
    RunEvent,
    view_from_bytes,
)
from radarsim.addons.recording.messages import Fields, RosMessage, header_of
from radarsim.geometry import Pose3
from radarsim.scene.scene import Scene
from radarsim.server.views import MOUNT

WIDTH, HEIGHT = 320, 240  # pixels of recorded pictures
QUALITY: Final = 75  # percent, of JPEG
OPTICAL_FRAME: Final = "camera_optical"
# Its z axis looks ahead, x to the right and y down (REP-103).
OPTICAL_MOUNT: Final = MOUNT.compose(Pose3(0, 0, 0, -math.pi / 2, 0, -math.pi / 2))


def compressed_image(time: float, frame: str, jpeg: bytes) -> RosMessage:
    """Return a picture that is a file of JPEG."""
    data = np.frombuffer(jpeg, np.uint8)
    fields = Fields(header=header_of(time, frame), format="jpeg", data=data)
    return RosMessage("sensor_msgs/msg/CompressedImage", fields)


def camera_info(time: float, frame: str, width: int, height: int) -> RosMessage:
    """Return the intrinsics of the camera: a pinhole without distortion."""
    from radarsim.server.camera import FIELD_OF_VIEW  # noqa: PLC0415 - imports much

    focal = width / 2 / math.tan(FIELD_OF_VIEW / 2)
    x, y = width / 2 - 0.5, height / 2 - 0.5  # pixels have their middles at integers
    k = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])
    region = Fields(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    fields = Fields(
        header=header_of(time, frame),
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([k, np.zeros(3)]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=region,
    )
    return RosMessage("sensor_msgs/msg/CameraInfo", fields)


def size_of(jpeg: bytes) -> tuple[int, int]:
    """Return width and height of a picture, pixels.

    Raises:
        OSError: If it is no picture.
    """
    with Image.open(io.BytesIO(jpeg), formats=["JPEG"]) as image:
        return image.size


def draw_views(scene: Scene, events: Iterable[RunEvent]) -> Iterator[RunEvent]:
    """Yield events, each view replaced by its picture."""
    draw = None
    for event in events:
        if event.type is not EventType.VIEW:
            yield event
            continue
        draw = draw or _painter(scene)  # the engine takes a second to start
        yield event._replace(type=EventType.PICTURE, data=draw(event.data))


def _painter(scene: Scene) -> Callable[[bytes], bytes]:
    from radarsim.server.camera import Renderer  # noqa: PLC0415 - imports much

    renderer = Renderer(scene, WIDTH, HEIGHT)

    def draw(view: bytes) -> bytes:
        file = io.BytesIO()
        picture = Image.fromarray(renderer.render(view_from_bytes(view)))
        picture.save(file, "JPEG", quality=QUALITY)
        return file.getvalue()

    return draw
