"""Mirrors, absorbers, air and dB, against the geometry of mirror images."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from parts import brick

from radarsim.geometry import Floats, rotation_matrix
from radarsim.raycast.rays import (
    LASER,
    RADAR,
    Boxes,
    EventKind,
    Outcome,
    RayClass,
    Rays,
)
from radarsim.raycast.tracer import Tracer
from radarsim.scene import shapes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

WALL = Material("wall")
MIRROR = Material("metal", radar_mirror=True)
LEAF = Material("leaf", density=0.1)
POST = Material("post")


def cast(
    ray_directions: Floats,
    *,
    bounces: int = 2,
    power: float = 1.0,
    max_range: float = 80.0,
    **kind: Any,
) -> Rays:
    return Rays.uniform(
        np.zeros_like(ray_directions),
        ray_directions / np.linalg.norm(ray_directions, axis=1, keepdims=True),
        max_range=max_range,
        power=power,
        ray_classes=(
            RayClass(**{"medium": RADAR, "max_reflections": bounces, **kind}),
        ),
    )


AHEAD = np.eye(3)[:1]
# A mirror across the ray at x = 4, turned by 45 degrees: rays go on to the left.
ACROSS = brick(MIRROR, (0.2, 4, 4), (4.0, 0, 0), -45)


def mirrored(points: Floats, place: Floats, normal: Floats) -> Floats:
    """Return the images of points in a mirror."""
    apart = (points - place) @ normal
    images: Floats = points - 2 * apart[:, None] * normal
    return images


def test_two_mirrors_show_the_image_of_an_image() -> None:
    """Two mirrors at a right angle: the ray turns twice, unfolded it is straight."""
    ahead = brick(MIRROR, (1, 40, 8), (6.5, 0, 0))  # face x = 6
    left = brick(MIRROR, (40, 1, 8), (0, 5.5, 0))  # face y = 5
    vertices, faces = shapes.sphere(0.05)
    place = np.array([[1.0, -2.0, 0.3]])
    ball = Part("ball", POST, vertices + place, faces)
    once = mirrored(place, np.array([0, 5.0, 0]), np.array([0, 1.0, 0]))
    twice = mirrored(once, np.array([6.0, 0, 0]), np.array([1.0, 0, 0]))
    rays = cast(twice)
    tracer = Tracer([ahead, left, ball])
    traces = tracer.trace(rays)
    assert traces.parts.tolist() == [2]
    ghost = float(traces.ranges[0]) * rays.directions[0]
    assert np.linalg.norm(ghost - twice[0]) == pytest.approx(0.05, abs=1e-3)
    kinds = [event.kind for event in tracer.explain(rays)[0]]
    assert kinds == [EventKind.MIRRORED, EventKind.MIRRORED, EventKind.HIT]


@settings(max_examples=40)
@given(
    st.floats(-70, 70),
    st.floats(-30, 30),
    st.floats(-40, 40),
    st.floats(-20, 20),
    st.floats(2, 9),
)
def test_ray_into_a_mirror_is_the_straight_ray_into_the_mirrored_scene(
    yaw: float, pitch: float, az: float, el: float, distance: float
) -> None:
    """A ball of leaves and a room, seen in a mirror; and both mirrored, without it."""
    turn = rotation_matrix(0, math.radians(pitch), math.radians(yaw))
    normal = turn @ np.array([1.0, 0, 0])
    place = np.array([distance, 0.0, 0.0])
    plate = np.array([[0, -30, -30], [0, 30, -30], [0, 30, 30], [0, -30, 30.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    mirror = Part("mirror", MIRROR, plate @ turn.T + place, faces)
    ball, ball_faces = shapes.sphere(1.5)
    middle = place - 3.0 * normal + np.array([0.0, 0.3, 0.2])
    room, room_faces = shapes.box(200, 200, 200)
    parts = [
        Part("ball", LEAF, ball + middle, ball_faces),
        Part("room", WALL, room, room_faces),
    ]
    images = []
    for p in parts:
        vertices = mirrored(p.vertices, place, normal)
        images.append(Part(p.object_name, p.material, vertices, p.faces[:, ::-1]))
    direction = rotation_matrix(0, math.radians(-el), math.radians(az))[:, 0]
    ahead = float(direction @ normal)
    assume(abs(ahead) >= 0.05)
    hit = float(place @ normal) / ahead
    at = hit * direction
    on_plate = np.abs((at - place) @ turn)[1:].max() < 29.9
    assume(0 < hit <= 40 and on_plate)
    assume(np.linalg.norm(middle) >= 1.6 <= np.linalg.norm(at - middle))
    straight = np.linalg.norm(np.cross(middle, direction))
    # Otherwise the ball hides its own image.
    assume(straight >= 1.6 or not 0 < middle @ direction < hit)
    rays = cast(direction[None], bounces=1, max_range=500.0)
    seen = Tracer([mirror, *parts]).trace(rays)
    wanted = Tracer(images).trace(rays)
    assert seen.ranges == pytest.approx(wanted.ranges, abs=1e-6)
    assert seen.power == pytest.approx(wanted.power, abs=1e-6)
    assert seen.parts.tolist() == [wanted.parts[0] + 1]


def test_mirror_after_the_last_reflection_is_a_surface() -> None:
    one, other = (brick(MIRROR, (1, 9, 9), (x, 0, 0)) for x in (5.5, -5.5))
    tracer = Tracer([one, other])
    for bounces in range(4):
        traces = tracer.trace(cast(AHEAD, bounces=bounces))
        assert traces.ranges[0] == pytest.approx(5 + 10 * bounces)
        assert traces.parts[0] == bounces % 2
        assert traces.outcomes[0] == Outcome.HIT


def test_maximum_range_covers_all_segments() -> None:
    mirror = brick(MIRROR, (1, 9, 9), (5.5, 0, 0))
    wall = brick(WALL, (1, 9, 9), (-5.5, 0, 0))
    tracer = Tracer([mirror, wall])
    assert tracer.trace(cast(AHEAD, max_range=15.001)).ranges[0] == pytest.approx(15)
    short = tracer.trace(cast(AHEAD, max_range=14.9))
    assert (short.ranges[0], short.outcomes[0]) == (math.inf, Outcome.NOTHING)


def test_foliage_on_both_segments_costs_power() -> None:
    bush = brick(LEAF, (2, 9, 9), (2, 0, 0))  # crossed there and back: 4 m
    mirror = brick(MIRROR, (1, 9, 9), (5.5, 0, 0))
    wall = brick(WALL, (1, 9, 9), (-5.5, 0, 0))
    tracer = Tracer([bush, mirror, wall])
    traces = tracer.trace(cast(AHEAD))
    assert traces.power[0] == pytest.approx(0.6)
    spent = tracer.trace(cast(AHEAD, power=0.3))
    assert (spent.outcomes[0], spent.parts[0]) == (Outcome.SPENT, 0)
    assert spent.ranges[0] == pytest.approx(5 + 2 + 1)


def test_ray_reflected_within_foliage_stays_within_it() -> None:
    bush = brick(LEAF, (8, 9, 9), (4, 0, 0))  # from 0 to 8, the sensor at its face
    mirror = brick(MIRROR, (1, 2, 2), (5.5, 0, 0))
    wall = brick(WALL, (1, 9, 9), (-5.5, 0, 0))
    rays = cast(AHEAD)
    rays.origins[0, 0] = 1.0
    traces = Tracer([bush, mirror, wall]).trace(rays)
    assert traces.ranges[0] == pytest.approx(4 + 5 + 5)
    assert traces.power[0] == pytest.approx(1 - 0.1 * (4 + 5))


@pytest.mark.parametrize("yaw_deg", [0, 30, 60, 75])
def test_bush_at_a_mirror_is_left_once_and_one_behind_is_never_entered(
    yaw_deg: float,
) -> None:
    turn = math.radians(yaw_deg)
    there = np.array([5.0, 0, 0]), rotation_matrix(0, 0, turn)

    def slab(material: Material, near: float, far: float) -> Part:
        vertices, faces = shapes.box(far - near, 30, 30)
        moved = vertices + np.array([(near + far) / 2, 0, 0])
        return Part(material.name, material, moved @ there[1].T + there[0], faces)

    front, behind = slab(LEAF, -1, 0), slab(Material("hid", density=9.0), 0, 1)
    mirror = slab(MIRROR, 0, 0.5)
    room = Part("room", WALL, *shapes.box(100, 100, 100))
    for parts in ([front, behind, mirror, room], [mirror, behind, front, room]):
        rays = cast(AHEAD, bounces=1, power=2.0)
        events = Tracer(parts).explain(rays)[0]
        reported = [(event.kind, parts[event.part].object_name) for event in events]
        assert reported == [
            (EventKind.ENTER, "leaf"),
            (EventKind.MIRRORED, "metal"),
            (EventKind.LEAVE, "leaf"),
            (EventKind.HIT, "room"),
        ]
        lost = 2 * 0.1 / math.cos(turn)
        assert events[-1].power == pytest.approx(2.0 - lost, abs=1e-8)


def test_robot_sees_itself_in_a_mirror_and_not_otherwise() -> None:
    mirror = brick(MIRROR, (1, 9, 9), (5.5, 0, 0))
    boxes = Boxes(np.array([[0, 0, 0, -1, 1, 0.5, 0.3, 7.0]]))
    rays = cast(AHEAD)
    rays.carrier_id[:] = 7
    traces = Tracer([mirror]).trace(rays, boxes, incidence=True)
    assert (traces.ranges[0], traces.parts[0]) == (pytest.approx(9.5), 1 + 7)
    assert traces.incidence[0] == pytest.approx(1.0)


def test_events_have_positions_and_the_incidence_of_the_last_segment() -> None:
    tracer, rays = Tracer([ACROSS, brick(WALL, (40, 1, 9), (4, 6.5, 0))]), cast(AHEAD)
    (events,) = tracer.explain(rays)
    slanted = Tracer([ACROSS, brick(WALL, (20, 1, 9), (4, 6.5, 0), 30)])
    found = slanted.trace(rays, incidence=True).incidence
    assert found == pytest.approx([math.cos(math.radians(30))])
    mirror, hit = events
    assert mirror.position[1:] == pytest.approx((0, 0))
    assert mirror.position[0] == pytest.approx(mirror.t)
    assert hit.position == pytest.approx((mirror.t, 6.0, 0), abs=1e-6)
    assert hit.t == pytest.approx(mirror.t + 6.0)


def test_laser_sees_the_surface_of_a_radars_mirror() -> None:
    mirror = brick(MIRROR, (1, 9, 9), (5.5, 0, 0))
    traces = Tracer([mirror]).trace(cast(AHEAD, medium=LASER))
    assert traces.ranges[0] == pytest.approx(5.0)


# What absorbs.


@pytest.mark.parametrize(
    ("keeps", "outcome"),
    [
        pytest.param(0.0, Outcome.HIT, id="nothing"),
        pytest.param(1.6, Outcome.HIT, id="less than is left"),
        pytest.param(2.4, Outcome.ABSORBED, id="more than is left"),
        pytest.param(math.inf, Outcome.ABSORBED, id="everything"),
    ],
)
def test_hit_needs_more_power_than_the_surface_absorbs(
    keeps: float, outcome: Outcome
) -> None:
    """A surface absorbs its dB once, attenuation counts in both directions."""
    bush = brick(LEAF, (1, 9, 9), (3, 0, 0))
    black = brick(Material("black", absorption_db=keeps), (1, 9, 9), (5.5, 0, 0))
    traces = Tracer([bush, black]).trace(cast(AHEAD, power=1.1))
    assert traces.outcomes[0] == outcome
    assert traces.parts[0] == 1
    seen = outcome == Outcome.HIT
    assert traces.ranges[0] == (pytest.approx(5.0) if seen else math.inf)
    assert traces.power[0] == (pytest.approx(1.0 - keeps / 2) if seen else 0.0)


def test_laser_is_absorbed_by_its_own_absorption() -> None:
    black = brick(
        Material("velvet", laser_absorption_db=math.inf), (1, 9, 9), (5, 0, 0)
    )
    tracer = Tracer([black])
    assert np.isinf(tracer.trace(cast(AHEAD, medium=LASER)).ranges[0])
    assert np.isfinite(tracer.trace(cast(AHEAD)).ranges[0])


def test_mirror_absorbs_twice_at_each_reflection() -> None:
    dull = Material("dull", radar_mirror=True, absorption_db=0.2)
    one, other = (brick(dull, (1, 9, 9), (x, 0, 0)) for x in (5.5, -5.5))
    tracer = Tracer([one, other])
    traces = tracer.trace(cast(AHEAD, bounces=3))
    assert traces.power[0] == pytest.approx(1 - 3 * 0.2 - 0.1)
    assert tracer.trace(cast(AHEAD, bounces=8)).outcomes[0] == Outcome.ABSORBED


@given(st.floats(0.01, 20))
def test_absorption_equal_to_the_power_leaves_exactly_nothing(decibels: float) -> None:
    black = Material("black", absorption_db=decibels)
    parts = [brick(LEAF, (1, 9, 9), (3, 0, 0)), brick(black, (1, 9, 9), (5.5, 0, 0))]
    traces = Tracer(parts).trace(cast(AHEAD, power=0.1 + decibels / 2))
    assert 0.0 <= traces.power[0] < 1e-9


@pytest.mark.parametrize("power", [0.0, math.inf])
def test_perfect_absorber_absorbs_rays_of_any_power(power: float) -> None:
    black = brick(Material("black", absorption_db=math.inf), (1, 9, 9), (5, 0, 0))
    rays, tracer = cast(AHEAD, power=power, power_per_db=0.0), Tracer([black])
    assert tracer.trace(rays).outcomes.tolist() == [Outcome.ABSORBED]
    assert kinds_of(tracer, rays) == [EventKind.ABSORBED]


# dB and bands.

BANDED = Material(
    "hedge", density=0.05, laser_density=0.0, radar_db=(1, 2, 3), laser_db=5
)


@pytest.mark.parametrize(
    ("kind", "wanted"),
    [
        pytest.param({"band": 0, "power_per_db": 0.1}, 0.05 + 0.1, id="24 GHz"),
        pytest.param({"band": 1, "power_per_db": 0.1}, 0.05 + 0.2, id="77 GHz"),
        pytest.param({"band": 2, "power_per_db": 0.1}, 0.05 + 0.3, id="94 GHz"),
        pytest.param({"band": 2, "power_per_db": 0.04}, 0.05 + 0.12, id="more margin"),
        pytest.param({"medium": LASER, "power_per_db": 0.04}, 0.2, id="light"),
    ],
)
def test_attenuation_is_that_of_the_band_times_power_per_db(
    kind: dict[str, Any], wanted: float
) -> None:
    parts = [brick(BANDED, (1, 9, 9), (3, 0, 0)), brick(WALL, (1, 9, 9), (5.5, 0, 0))]
    assert Tracer(parts).trace(cast(AHEAD, **kind)).power[0] == pytest.approx(
        1 - wanted
    )


def test_rays_of_several_classes_are_traced_together() -> None:
    parts = [brick(BANDED, (1, 9, 9), (3, 0, 0)), brick(WALL, (1, 9, 9), (5.5, 0, 0))]
    tracer = Tracer(parts)
    kinds = [{"band": 0}, {"band": 2}, {"medium": LASER}, {"band": 0}]
    batches = [cast(AHEAD, power_per_db=0.1, **kind) for kind in kinds]
    together = tracer.trace(Rays.concatenate(batches)).power
    alone = [float(tracer.trace(batch).power[0]) for batch in batches]
    assert together.tolist() == alone
    assert len(Rays.concatenate(batches).ray_classes) == 3


# Air.


def test_air_costs_power_everywhere_and_adds_to_volumes() -> None:
    mist = Material("mist", density=0.02, laser_density=0.0, solid=False)
    parts = [brick(LEAF, (2, 9, 9), (3, 0, 0)), brick(WALL, (1, 9, 9), (8.5, 0, 0))]
    tracer = Tracer(parts, mist)
    traces = tracer.trace(cast(AHEAD))
    assert traces.power[0] == pytest.approx(1 - 8 * 0.02 - 2 * 0.1)
    weak = tracer.trace(cast(AHEAD, power=0.03))
    assert (weak.outcomes[0], weak.ranges[0]) == (Outcome.SPENT, pytest.approx(1.5))
    assert tracer.parts[int(weak.parts[0])].object_name == "air"
    inside = tracer.trace(cast(AHEAD, power=0.1))
    assert tracer.parts[int(inside.parts[0])].object_name == "leaf"
    assert inside.ranges[0] == pytest.approx(2 + 0.06 / 0.12)


def test_boxes_are_numbered_after_the_air() -> None:
    mist = Material("mist", density=0.001)
    boxes = Boxes(np.array([[5, 0, 0, -1, 1, 0.5, 0.5, 7.0]]))
    tracer = Tracer([brick(WALL, (1, 9, 9), (9, 0, 0))], mist)
    assert tracer.trace(cast(AHEAD), boxes).parts.tolist() == [2 + 7]


# Mirrors that face the sensor, and panes, which pass a part.

GLASS = Material(
    "glass", radar_mirror=True, absorption_db=7.3, transmission_db=(3.8, 6.5, 8.3)
)
PER_DB = 1 / 25  # power 1 is 25 dB one way


def kinds_of(tracer: Tracer, rays: Rays) -> list[EventKind]:
    return [event.kind for event in tracer.explain(rays)[0]]


@pytest.mark.parametrize(
    ("glint_deg", "angle_deg", "answers"),
    [(1, 0.0, True), (1, 0.9, True), (1, 1.1, False), (1, -0.9, True), (0, 0.0, False)],
)
def test_mirror_that_faces_the_ray_within_its_glint_is_hit(
    glint_deg: float, angle_deg: float, *, answers: bool
) -> None:
    plate = brick(MIRROR, (0.1, 2, 2), (5, 0, 0), angle_deg)
    rays = cast(AHEAD, glint=math.radians(glint_deg))
    traces = Tracer([plate, brick(WALL, (0.1, 9, 9), (-3, 0, 0))]).trace(rays)
    assert traces.outcomes.tolist() == [Outcome.HIT]
    assert traces.parts.tolist() == [0 if answers else 1]
    if answers:
        near = 5 - 0.05 / math.cos(math.radians(angle_deg))
        assert traces.ranges == pytest.approx([near])


def test_mirror_that_faces_the_ray_takes_its_decibels_once() -> None:
    plate = Material("plate", radar_mirror=True, absorption_db=7.3)
    rays = cast(AHEAD, glint=0.01, power_per_db=PER_DB)
    traces = Tracer([brick(plate, (0.1, 2, 2), (5, 0, 0))]).trace(rays)
    # 7.3 dB of what returns, of 50 dB out and back
    assert traces.power == pytest.approx([1 - 7.3 / 50])


def pane(at: float, yaw_deg: float = 30.0) -> Part:
    return brick(GLASS, (0.006, 4, 4), (at, 0, 0), yaw_deg)


@pytest.mark.parametrize(
    ("band", "passes"), [(0, True), (1, True), (2, False)], ids=["24", "77", "94"]
)
def test_ray_takes_the_stronger_way_on_from_a_pane(band: int, *, passes: bool) -> None:
    """7.3 dB one way when reflected; 3.8, 6.5 and 8.3 dB when it passes."""
    tracer = Tracer([pane(4), brick(WALL, (1, 40, 4), (9.5, 0, 0))])
    rays = cast(AHEAD, band=band, power_per_db=PER_DB)
    traces = tracer.trace(rays)
    if not passes:
        assert EventKind.MIRRORED in kinds_of(tracer, rays)
        assert traces.parts.tolist() != [1]
        return
    assert kinds_of(tracer, rays) == [EventKind.SHEET, EventKind.SHEET, EventKind.HIT]
    assert traces.ranges == pytest.approx([9.0])
    lost = (GLASS.transmission_db or (0, 0, 0))[band]
    assert traces.power == pytest.approx([1 - lost / 25])


@pytest.mark.parametrize("bounces", [0, 1, 2, 3])
def test_number_of_panes_on_a_rays_way_is_bounded(bounces: int) -> None:
    panes = [pane(at) for at in (2.0, 4.0, 6.0)]
    tracer = Tracer([*panes, brick(WALL, (1, 40, 4), (9.5, 0, 0))])
    rays = cast(AHEAD, band=0, power_per_db=PER_DB, bounces=bounces)
    traces = tracer.trace(rays)
    assert traces.outcomes.tolist() == [Outcome.HIT]
    assert traces.parts.tolist() == [bounces]


def test_what_is_between_panes_counts_as_without_them() -> None:
    behind = [brick(LEAF, (2, 4, 4), (5, 0, 0)), brick(WALL, (1, 40, 4), (9.5, 0, 0))]
    rays = cast(AHEAD, band=1, power_per_db=PER_DB)
    plain, glazed = (Tracer([*panes, *behind]).trace(rays) for panes in ([], [pane(2)]))
    assert glazed.ranges == pytest.approx(plain.ranges)
    assert glazed.power == pytest.approx(plain.power - 6.5 / 25)


def test_ray_that_starts_inside_a_pane_leaves_it() -> None:
    thick = brick(GLASS, (2, 4, 4), (0, 0, 0))
    rays = cast(AHEAD, band=1, power_per_db=PER_DB, bounces=0)
    traces = Tracer([thick, brick(WALL, (1, 40, 4), (9.5, 0, 0))]).trace(rays)
    assert traces.ranges == pytest.approx([9.0])


def test_pane_that_takes_all_that_is_left_ends_the_ray() -> None:
    tracer = Tracer([pane(4), brick(WALL, (1, 40, 4), (9.5, 0, 0))])
    rays = cast(AHEAD, band=1, power_per_db=PER_DB, power=0.1)
    assert tracer.trace(rays).outcomes.tolist() == [Outcome.ABSORBED]
