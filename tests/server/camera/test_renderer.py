"""Pictures of scenes whose every pixel is known in closed form."""

import math

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.plotting.palette import FAMILY_COLOURS, Family
from radarsim.presets.robots import load_robot
from radarsim.protocol.images import HEIGHT, WIDTH
from radarsim.raycast.rays import Boxes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose
from radarsim.scene.shapes import box
from radarsim.server.camera import HORIZON, ZENITH, Renderer
from radarsim.server.views import View
from radarsim.simulation.simulation import Simulation

EYE = Pose3(0.0, 0.0, 1.0)
FOCAL = 80 / math.tan(math.radians(40))  # pixels; 80 degrees from left to right
ALONG = 0.45  # brightness of a surface along the ray
CONCRETE, GROUND = Material("concrete"), Material("ground")
SMOKE = Material("smoke", density=0.0, laser_density=0.5, solid=False)


def cuboid(
    size: tuple[float, float, float], at: tuple[float, float, float], material: Material
) -> Part:
    vertices, faces = box(*size)
    return Part(material.name, material, vertices + np.array(at), faces)


# Its face is 5 m ahead, and it is 2 m high.
WALL = cuboid((0.2, 200, 2), (5.1, 0, 1), CONCRETE)
FLOOR = cuboid((400, 400, 0.2), (0, 0, -0.1), GROUND)


def picture(
    *parts: Part, air: Material | None = None, boxes: Floats | None = None
) -> Floats:
    """Return the view from 1 m above the origin, along x."""
    scene = Scene("room", "DM-Room", parts, air=air)
    rows = np.zeros((0, 8)) if boxes is None else boxes
    pixels = Renderer(scene).render(View(EYE, Boxes(rows)))
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    assert pixels.dtype == np.uint8
    return pixels.astype(float)


def colour(family: Family) -> Floats:
    return 255 * np.array(to_rgb(FAMILY_COLOURS[family]))


def lit(cosine: float) -> float:
    return ALONG + (1 - ALONG) * cosine


def ray(row: int, column: int) -> tuple[float, float, float]:
    """Return forward, left and up of the unit vector to a pixel's middle."""
    left, up = 79.5 - column, 59.5 - row
    norm = math.hypot(FOCAL, left, up)
    return FOCAL / norm, left / norm, up / norm


def test_wall_is_between_ground_and_sky_and_each_pixel_has_its_shade() -> None:
    pixels = picture(WALL, FLOOR)
    horizon, zenith = (255 * np.array(to_rgb(text)) for text in (HORIZON, ZENITH))
    for row in range(0, HEIGHT, 7):
        for column in range(0, WIDTH, 9):
            forward, _, up = ray(row, column)
            height = 1 + 5 * up / forward  # of the ray where the wall is
            if height > 2:
                expected = horizon + up * (zenith - horizon)
            elif height > 0:
                expected = lit(forward) * colour(Family.STONE)
            else:
                expected = lit(-up) * colour(Family.GROUND)
            assert pixels[row, column] == pytest.approx(expected, abs=0.51)


def test_what_is_at_the_left_is_at_the_left_of_the_picture() -> None:
    crate = cuboid((1, 1, 1), (5, 2, 1), Material("metal"))
    pixels = picture(crate)
    seen = np.flatnonzero(pixels[59, :, 2] < 130)  # dark before the sky
    # The front, 4.5 m ahead, is from 1.5 to 2.5 m to the left; of the right side the
    # camera sees all up to the back, 5.5 m ahead.
    assert seen.min() == math.ceil(79.5 - FOCAL * 2.5 / 4.5)
    assert seen.max() == math.floor(79.5 - FOCAL * 1.5 / 5.5)


def test_picture_turns_with_the_camera() -> None:
    scene = Scene("room", "DM-Room", (cuboid((1, 1, 1), (0, 5, 1), CONCRETE),))
    left = Pose3(0.0, 0.0, 1.0, yaw=math.pi / 2)
    pixels = Renderer(scene).render(View(left, Boxes(np.zeros((0, 8)))))
    expected = lit(ray(60, 80)[0]) * colour(Family.STONE)
    assert pixels[60, 80].astype(float) == pytest.approx(expected, abs=0.51)


FOG = Material("fog", density=0.0, laser_density=0.1, solid=False)


def cloud(
    material: Material = SMOKE, *, x: float = 3.0, length: float = 2.0
) -> list[Part]:
    return [cuboid((length, 50, 50), (x, 0, 1), material)]


@pytest.mark.parametrize(
    ("parts", "air", "losses"),
    [
        (cloud(), None, [(1.0, "SMOKE")]),
        (
            cloud(Material("smoke", laser_density=0.0, laser_db=4.0)),
            *(None, [(0.8 * math.log(10), "SMOKE")]),
        ),
        (cloud(Material("smoke", laser_density=0.0)), None, []),
        (cloud(Material("smoke", laser_density=1e4)), None, [(2e4, "SMOKE")]),
        (cloud(x=0, length=6), None, [(1.5, "SMOKE")]),  # with the camera inside
        (
            [*cloud(Material("glass", laser_density=0.3), x=2), *cloud()],
            # From behind; they overlap.
            *(None, [(0.5, "SMOKE"), (0.8, "SMOKE"), (0.3, "GLASS")]),
        ),
        ([], FOG, [(0.5, "SMOKE")]),
    ],
)
def test_what_takes_light_veils_what_is_behind_it_by_its_density(
    parts: list[Part], air: Material | None, losses: list[tuple[float, str]]
) -> None:
    forward = ray(60, 80)[0]
    expected = lit(forward) * colour(Family.STONE)
    for loss, family in losses:
        share = 1 - math.exp(-loss / forward)
        expected = share * colour(Family[family]) + (1 - share) * expected
    pixels = picture(WALL, *parts, air=air)
    assert pixels[60, 80] == pytest.approx(expected, abs=0.51)
    if air:  # far objects are hidden
        assert pixels[0, 0] == pytest.approx(colour(Family.SMOKE), abs=0.51)


def test_surface_that_absorbs_all_light_is_dark_but_there() -> None:
    black = Material("concrete", laser_absorption_db=math.inf)
    pixels = picture(cuboid((0.2, 9, 9), (5, 0, 1), black))
    expected = ALONG * colour(Family.STONE)
    assert pixels[60, 80] == pytest.approx(expected, abs=0.51)


def test_robots_are_seen_but_not_the_one_that_carries_the_camera() -> None:
    own = [0, 0, 0, 0, 2, 0.3, 0.25, 1]
    other = [5, 0, 0, 0, 2, 0.5, 0.5, 2]
    scene = Scene("room", "DM-Room", (FLOOR,))
    view = View(EYE, Boxes(np.array([own, other], np.float64)), carrier_id=1)
    pixels = Renderer(scene).render(view).astype(float)
    expected = lit(ray(60, 80)[0]) * colour(Family.METAL)
    assert pixels[60, 80] == pytest.approx(expected, abs=0.51)
    assert pixels[60, 5] == pytest.approx(pixels[60, 154])  # nothing at the sides


def test_same_view_gives_the_same_bytes(foliage_room: Scene) -> None:
    view = View.of(Simulation(foliage_room))
    first = Renderer(foliage_room).render(view)
    assert first.tobytes() == Renderer(foliage_room).render(view).tobytes()
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 100


def test_camera_is_that_of_the_first_robot_until_it_leaves(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    model = load_robot("P3AT")
    before = View.of(simulation)
    first = simulation.spawn("R1", model, Pose2(-3.0, 2.0, math.pi / 2))
    second = simulation.spawn("R2", model, Pose2(4.0, 1.0, 0.0))
    assert first is not None
    assert second is not None
    view = View.of(simulation)
    x, y, z, _, _, yaw = view.camera.numbers()
    assert (x, y, z, yaw) == pytest.approx((-3.0, 2.1005, 0.566, math.pi / 2))
    assert view.carrier_id == first.number
    assert len(view.boxes.rows) == 2
    simulation.remove(first)
    assert View.of(simulation).camera.x == pytest.approx(4.1005)
    simulation.remove(second)
    assert View.of(simulation).camera == before.camera


def test_without_robots_the_view_is_that_from_the_first_start() -> None:
    start = StartPose("RobotStart1", Pose3(1.0, 2.0, 3.0))
    scene = Scene("room", "DM-Room", (FLOOR,), (start,))
    camera = View.of(Simulation(scene)).camera
    assert camera.numbers() == pytest.approx((1.1005, 2.0, 3.566, 0.0, 0.0, 0.0))
    scene = Scene("room", "DM-Room", (FLOOR,))
    camera = View.of(Simulation(scene)).camera
    assert camera.numbers() == pytest.approx((0.1005, 0.0, 0.566, 0.0, 0.0, 0.0))


def test_a_view_stays_while_robots_move_on(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    vehicle = simulation.spawn("R1", load_robot("P3AT"), Pose2(0.0, 0.0, 0.0))
    assert vehicle is not None
    view, renderer = View.of(simulation), Renderer(empty_room)
    before = renderer.render(view)
    vehicle.robot.drive(5.0, 5.0)
    for _ in range(100):
        simulation.step()
    assert (renderer.render(view) == before).all()
    assert (renderer.render(View.of(simulation)) != before).any()
