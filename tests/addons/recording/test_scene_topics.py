"""What recordings show of the world: scene, true map, robot and pictures."""

import dataclasses
import io
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import recorded_runs
import shapely
from matplotlib.colors import to_rgb
from PIL import Image
from recorded_runs import messages_of
from rosbags.highlevel import AnyReader

from radarsim.addons.recording import scene_topics
from radarsim.addons.recording.bag_folder import RecordingInfo, create_folder, file_name
from radarsim.addons.recording.call_converter import CallConverter
from radarsim.addons.recording.cdr import encode, typestore
from radarsim.addons.recording.recorders import (
    EventType,
    HostRecorder,
    RunEvent,
)
from radarsim.addons.recording.recording_process import write_recording
from radarsim.addons.recording.scene_topics import (
    SMALL_PART,
    scene_markers,
    true_map,
)
from radarsim.geometry import Pose3
from radarsim.plotting.palette import FAMILY_COLOURS, Family
from radarsim.presets.robots import load_robot
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Part, Scene
from radarsim.server.camera import FIELD_OF_VIEW
from radarsim.server.host import Host
from radarsim.server.views import View

INTERVAL = 20  # ticks between pictures of the run


def write_shown(run: recorded_runs.RecordedRun, folder: Path, scene: Scene) -> None:
    create_folder(folder)
    write_recording(folder, run.info, run.events, scene)


def decoded(message: Any) -> Any:
    return typestore().deserialize_cdr(encode(message), message.type)


def test_scene_has_the_surfaces_and_colours_of_its_parts(
    bag: Path, foliage_room: Scene
) -> None:
    (shown,) = messages_of(bag, "/scene")
    assert len(shown.markers) == len(foliage_room.parts)
    for marker, part in zip(shown.markers, foliage_room.parts, strict=True):
        assert (marker.header.frame_id, marker.ns) == ("map", part.object_name)
        corners = [(point.x, point.y, point.z) for point in marker.points]
        np.testing.assert_array_equal(corners, part.vertices[part.faces.ravel()])
        opaque = not part.material.penetrable
        assert marker.color.a == (1.0 if opaque else pytest.approx(0.5))
        if "bush" in part.object_name:
            assert not opaque
            found = (marker.color.r, marker.color.g, marker.color.b)
            assert found == pytest.approx(to_rgb(FAMILY_COLOURS[Family.FOLIAGE]))
    assert len({(marker.ns, marker.id) for marker in shown.markers}) == len(
        foliage_room.parts
    )


def test_smoke_is_the_least_opaque() -> None:
    scene = load_map("smoke_room")
    shown = decoded(scene_markers(scene)).markers
    alphas: dict[bool, set[float]] = {True: set(), False: set()}  # by what stops robots
    for part, marker in zip(scene.parts, shown, strict=True):
        alphas[part.material.solid].add(marker.color.a)
    assert max(alphas[False]) < min(alphas[True])


def test_only_large_parts_of_a_large_scene_are_thinned(
    foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    most = 3 * SMALL_PART
    monkeypatch.setattr(scene_topics, "MOST_TRIANGLES", most)
    (small, *_) = foliage_room.parts
    count = 2 * most
    faces = np.zeros((count, 3), np.int32)
    faces[:] = small.faces[np.arange(count) % len(small.faces)]
    large = dataclasses.replace(small, faces=faces)
    assert len(small.faces) < SMALL_PART
    shown = scene_markers(Scene("large", "Large", (small, large))).fields.markers
    assert len(shown[0].points) == 3 * len(small.faces)
    assert len(shown[1].points) / 3 <= most


def test_true_map_is_occupied_by_what_the_section_shows() -> None:
    box = load_robot("P3AT").scanner_pose(Pose3(0, 0, 0)).z
    scene = Scene("box", "Box").with_object(
        "crate", box=[2.0, 1.0, 1.0], material="concrete", position=[3.0, 1.0, 0.5]
    )
    scene = scene.with_object(
        "low", box=[1.0, 1.0, 0.2], material="concrete", position=[-2.0, 0.0, 0.1]
    )
    assert box > 0.2  # it is below the scanner
    grid = decoded(true_map(scene))
    cells = grid.data.reshape(grid.info.height, grid.info.width)
    size, corner = grid.info.resolution, grid.info.origin.position
    rows, columns = np.indices(cells.shape)
    x, y = corner.x + size * (columns + 0.5), corner.y + size * (rows + 0.5)
    inside = shapely.contains_xy(shapely.box(2.0, 0.5, 4.0, 1.5), x, y)
    beyond = ~shapely.contains_xy(shapely.box(1.9, 0.4, 4.1, 1.6), x, y)
    assert inside.any()
    assert (cells[inside] == 100).all()
    assert (cells[beyond] == 0).all()
    assert grid.header.frame_id == "map"
    bounds = scene.bounds
    assert corner.x <= bounds[0, 0] < corner.x + size
    assert corner.x + size * grid.info.width > bounds[1, 0]


def test_map_of_a_wide_scene_has_larger_cells() -> None:
    vertices = np.array([[-400.0, -400, 0], [400, -400, 0], [400, 400, 3]])
    wide = Part("hill", load_map("empty_room").materials["concrete"], vertices, FACE)
    grid = true_map(Scene("wide", "Wide", (wide,))).fields
    assert grid.info.resolution == pytest.approx(0.4)
    assert grid.data.size < 4.1e6


FACE = np.array([[0, 1, 2]], np.int32)


def test_scene_of_nothing_has_no_map_nor_one_that_a_robot_maps(
    foliage_room: Scene,
) -> None:
    for scene, with_map in ((Scene("a", "A"), True), (foliage_room, False)):
        shown = scene_topics.scene_topics(scene, with_map=with_map)
        assert [each.topic for each in shown] == ["/scene"]


def test_links_of_the_model_are_frames(bag: Path) -> None:
    (described,) = messages_of(bag, "/R_1/robot_description")
    robot: Any = ET.fromstring(described.data)
    frames = {
        transform.child_frame_id: transform
        for message in messages_of(bag, "/tf_static")
        for transform in message.transforms
    }
    links = {link.get("name") for link in robot.iter("link")}
    assert links == {"R_1/base_link", "R_1/lms200", "R_1/Hokuyo"}
    model = load_robot("P3AT_Compare")
    for joint in robot.iter("joint"):
        parent, child, origin = (
            joint.find(tag) for tag in ("parent", "child", "origin")
        )
        frame = frames[child.get("link")]
        assert frame.header.frame_id == parent.get("link") == "R_1/base_link"
        place = frame.transform.translation
        assert [float(word) for word in origin.get("xyz").split()] == (
            pytest.approx([place.x, place.y, place.z])
        )
    base = robot.find("link")
    low, high = math.inf, -math.inf
    for visual in base.iter("visual"):
        origin, shape = visual.find("origin"), visual.find("geometry/*")
        z = float(origin.get("xyz").split()[2])
        size = shape.get("radius") or str(float(str(shape.get("size")).split()[2]) / 2)
        low, high = min(low, z - float(size)), max(high, z + float(size))
    # Its wheels stand on the floor, and it is no higher than its class.
    assert low == pytest.approx(-model.origin_height, abs=1e-3)
    assert 0.1 < high <= model.height - model.origin_height


def test_model_of_an_unknown_class_has_what_the_server_reports() -> None:
    lines = (
        "R9",
        "GEO {Type GroundVehicle} {Name Rover} {Dimensions 1,0.8,0.5} {COG 0,0,0}"
        " {WheelRadius 0.2} {WheelSeparation 0.7} {WheelBase 0.6}",
        "CONF {Type GroundVehicle} {Name Rover} {SteeringType SkidSteered} {Mass 10}"
        " {MaxSpeed 4} {MaxTorque 10} {MaxFrontSteer 0} {MaxRearSteer 0}",
    )
    event = RunEvent(EventType.ROBOT, 5, 1, "\r\n".join(lines).encode())
    converter = CallConverter(RecordingInfo(version="1"))
    described = [message for _, message in converter.convert(event)]
    (found,) = (each for each in described if each.topic == "/R9/robot_description")
    assert found.latched
    robot = ET.fromstring(found.fields.data)
    sizes = [each.get("size") for each in robot.iter("box")]
    assert [str(size).split()[:2] for size in sizes] == [["1", "0.8"]]
    radii = [each.get("radius") for each in robot.iter("cylinder")]
    assert radii == ["0.2"] * 4


def test_pictures_come_at_their_rate_with_where_the_camera_is(
    run: recorded_runs.RecordedRun, bag: Path
) -> None:
    pictures = messages_of(bag, "/R_1/camera/image/compressed")
    views = [event.client for event in run.events if event.type is EventType.VIEW]
    assert set(views) == {1, 2}  # the second robot is the first when that has left
    assert len(pictures) == views.count(1) > 3
    times = [p.header.stamp.sec + p.header.stamp.nanosec / 1e9 for p in pictures]
    np.testing.assert_allclose(np.diff(times), INTERVAL / 100)
    shown = [np.asarray(Image.open(io.BytesIO(p.data.tobytes()))) for p in pictures]
    assert {each.shape for each in shown} == {(240, 320, 3)}
    assert (shown[0] != shown[-1]).any()  # it has driven
    infos = messages_of(bag, "/R_1/camera/camera_info")
    stamps = [p.header.stamp.sec + p.header.stamp.nanosec / 1e9 for p in infos]
    assert stamps == times
    assert infos[0].header.frame_id == "R_1/camera_optical"
    focal, middle = infos[0].k[0], infos[0].k[2]
    assert math.atan((320 - 0.5 - middle) / focal) == pytest.approx(FIELD_OF_VIEW / 2)
    (mount,) = (
        transform.transform
        for transform in messages_of(bag, "/tf_static")[-1].transforms
        if transform.child_frame_id == "R_1/camera_optical"
    )
    q = mount.rotation  # its z axis looks ahead
    ahead = [
        2 * (q.x * q.z + q.y * q.w),
        2 * (q.y * q.z - q.x * q.w),
        1 - 2 * (q.x**2 + q.y**2),
    ]
    np.testing.assert_allclose(ahead, [1, 0, 0], atol=1e-12)


def test_same_run_gives_the_same_bytes(
    run: recorded_runs.RecordedRun, bag: Path, foliage_room: Scene, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    write_shown(run, folder, foliage_room)
    once, again = ((each / file_name(each)).read_bytes() for each in (bag, folder))
    assert once == again


def test_no_view_is_taken_that_nobody_wants(
    foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(View, "of", lambda _: pytest.fail("it is taken"))
    host = Host(foliage_room, observers=[HostRecorder(lambda _: None)])
    number = host.connect()
    host.receive(number, b"INIT {ClassName P3AT} {Start RobotStart1}\r\n")
    for _ in range(50):
        host.step()


def test_one_robot_can_go_without_its_name(foliage_room: Scene, tmp_path: Path) -> None:
    run = recorded_runs.run_two_clients(foliage_room, ticks=40, camera_interval=20)
    info = run.info.model_copy(update={"no_namespace": "r 1"})  # in any case
    folder = tmp_path / "run"
    write_shown(run._replace(info=info), folder, foliage_room)
    with AnyReader([folder]) as reader:
        topics = set(reader.topics)
    assert topics >= {"/odom", "/lms200/scan", "/lms200/echoes", "/Hokuyo/scan"}
    assert topics >= {"/robot_description", "/cmd_vel", "/camera/camera_info"}
    assert topics >= {"/R_1/odom", "/R_1/lms200/scan"}  # the other robot
    parents = {
        each.child_frame_id: each.header.frame_id
        for topic in ("/tf", "/tf_static")
        for message in messages_of(folder, topic)
        for each in message.transforms
    }
    assert parents["base_link"] == "odom"
    assert parents["odom"] == "map"
    assert {k for k, parent in parents.items() if parent == "base_link"} == {
        *("lms200", "Hokuyo", "camera_optical")
    }
    scans = messages_of(folder, "/lms200/scan")
    assert {scan.header.frame_id for scan in scans} == {"lms200"}
    (described,) = messages_of(folder, "/robot_description")
    assert 'link name="base_link"' in described.data
