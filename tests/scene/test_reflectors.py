"""Point reflectors: their cross sections against textbook values, and in maps."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import radarsim
from radarsim import MapError, Scene
from radarsim.presets.sensor_settings import BANDS_GHZ
from radarsim.raycast.rays import LASER, RADAR, Outcome, RayClass, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.scene import POINT_EDGE, Reflector

LIGHT = 299_792_458.0  # m/s


def dbsm(rcs: float) -> float:
    return 10 * math.log10(rcs)


def load(tmp_path: Path, objects: str) -> Scene:
    path = tmp_path / "yard.yaml"
    path.write_text(f"version: 1\nobjects:\n{objects}\n")
    return radarsim.load_map(path)


# 4 pi a^4 / (3 lambda^2), tabulated to 0.01 dB
@pytest.mark.parametrize(
    ("f_ghz", "expected"), [(24.0, 4.29), (77.0, 14.41), (94.0, 16.15)]
)
def test_cross_section_of_10_cm_has_its_textbook_value(
    f_ghz: float, expected: float
) -> None:
    corner = Reflector("corner", (0, 0, 0), trihedral=0.1)
    found = dbsm(corner.rcs(LIGHT / (f_ghz * 1e9)))
    assert found == pytest.approx(expected, abs=0.1)


@given(st.floats(0.02, 2), st.sampled_from(BANDS_GHZ))
def test_trihedral_twice_as_large_returns_12_db_more(edge: float, band: int) -> None:
    wavelength = LIGHT / (band * 1e9)
    small, large = (
        Reflector("corner", (0, 0, 0), trihedral=a).rcs(wavelength)
        for a in (edge, 2 * edge)
    )
    assert dbsm(large) - dbsm(small) == pytest.approx(40 * math.log10(2))


@given(st.floats(-60, 60), st.floats(1e-3, 1e-1))
def test_given_cross_section_holds_at_every_wavelength(
    level: float, wavelength: float
) -> None:
    rcs = Reflector("target", (0, 0, 0), rcs_dbsm=level).rcs(wavelength)
    assert dbsm(rcs) == pytest.approx(level)


def test_reflectors_of_a_map_are_part_of_the_scene(tmp_path: Path) -> None:
    scene = load(
        tmp_path,
        "  - {name: corner, reflector: {trihedral: 0.1}, position: [8, 1, 0.4],\n"
        "     repeat: {count: 2, step: [0, -2, 0]}}\n"
        "  - {name: target, reflector: {rcs_dbsm: 10}, position: [9, 0, 1]}\n",
    )
    assert scene.reflectors == (
        Reflector("corner_1", (8.0, 1.0, 0.4), trihedral=0.1),
        Reflector("corner_2", (8.0, -1.0, 0.4), trihedral=0.1),
        Reflector("target", (9.0, 0.0, 1.0), rcs_dbsm=10.0),
    )
    assert [part.object_name for part in scene.parts] == [
        reflector.name for reflector in scene.reflectors
    ]
    for part, reflector in zip(scene.parts, scene.reflectors, strict=True):
        edge = reflector.trihedral or POINT_EDGE
        assert np.ptp(part.bounds, axis=0) == pytest.approx([2 * edge] * 3)
        assert part.bounds.mean(axis=0) == pytest.approx(reflector.position)


def test_scattered_trihedrals_scale_with_their_copies(tmp_path: Path) -> None:
    scene = load(
        tmp_path,
        "  - {name: corner, reflector: {trihedral: 0.1}, scatter: {count: 9, seed: 1,\n"
        "     area: [[0, 0], [9, 9]], scale: [1, 3]}}\n",
    )
    edges = [reflector.trihedral or 0.0 for reflector in scene.reflectors]
    spans = [np.ptp(part.bounds[:, 2]) for part in scene.parts]
    assert spans == pytest.approx([2 * edge for edge in edges])
    assert 0.1 <= min(edges) < max(edges) <= 0.3


@pytest.mark.parametrize(
    ("keys", "place", "message"),
    [
        ("reflector: {}", "reflector", "one of 'trihedral'"),
        ("reflector: {trihedral: 0.1, rcs_dbsm: 3}", "reflector", "exactly"),
        ("reflector: {trihedral: 0}", "trihedral", "more than 0"),
        ("reflector: {rcs_dbsm: 0}, material: wood", "material", "not allowed"),
        ("reflector: {rcs_dbsm: 0}, yaw_deg: 3", "yaw_deg", "not allowed"),
        ("reflector: {rcs_dbsm: 0}, sphere: 1", "objects", "one of"),
    ],
)
def test_problem_of_a_reflector_has_place_and_expectation(
    tmp_path: Path, keys: str, place: str, message: str
) -> None:
    with pytest.raises(MapError) as caught:
        load(tmp_path, f"  - {{name: corner, {keys}}}")
    (problem,) = caught.value.problems
    assert place in problem
    assert message in problem


def yard(tmp_path: Path) -> Scene:
    return load(
        tmp_path,
        "  - {name: corner, reflector: {trihedral: 0.2}, position: [5, 0, 0.3]}\n"
        "  - {name: wall, box: [1, 9, 3], position: [8.5, 0, 0], material: concrete}\n"
        "  - {name: board, box: [1, 2, 3], position: [3, 4, 0], material: concrete}\n"
        "  - {name: hidden, reflector: {rcs_dbsm: 30}, position: [5, 6.6667, 0.3]}\n",
    )


@pytest.mark.parametrize("sensor", ["radar", "laser"])
def test_scanner_hits_the_hull_of_a_reflector_unless_something_hides_it(
    tmp_path: Path, sensor: str
) -> None:
    scanner = radarsim.load_sensor(sensor)
    if sensor == "radar":
        scanner = radarsim.load_sensor("radar", side_offset_uu=0)
    scan = scanner.scan(yard(tmp_path), (0, 0, 0.3, 0, 0, 0), radarsim.generator_for(1))
    assert scan.ranges[90] == pytest.approx(4.8, abs=1e-9)  # 0.2 m before its middle
    echo = scan.to_dict()["echoes"][90][-1]
    assert (echo["object"], echo["kind"], echo["density"]) == ("corner", "hit", None)
    seen = {each["object"] for beam in scan.to_dict()["echoes"] for each in beam}
    assert "hidden" not in seen


@pytest.mark.parametrize(("medium", "passes"), [(RADAR, True), (LASER, False)])
def test_ray_of_a_radar_that_counts_decibels_goes_on_behind_a_hull(
    tmp_path: Path, medium: int, *, passes: bool
) -> None:
    rays = Rays.uniform(
        np.array([[0.0, 0.0, 0.3]]), np.eye(3)[:1], max_range=20.0, power=75.0
    )
    counting = (RayClass(medium, in_decibels=medium == RADAR),)
    traces = tracer_of(yard(tmp_path)).trace(replace(rays, ray_classes=counting))
    assert traces.outcomes.tolist() == [Outcome.HIT]
    assert traces.ranges[0] == pytest.approx(8.0 if passes else 4.8)


def test_robots_bump_into_reflectors(tmp_path: Path) -> None:
    assert all(part.material.solid for part in yard(tmp_path).parts)
