import json
import math
from pathlib import Path
from typing import Any

import pytest
from commands import run_in_process as radarsim

MAP = """\
version: 1
materials:
  wall: {density: opaque}
  leaf: {density: 0.5}
  mist: {density: 0.1, laser_density: 0.001, solid: false}
  sheet: {density: 0.0, sheet_loss: 0.25}
objects:
  - {name: room, box: [20, 20, 4], position: [0, 0, 1], material: wall}
  - {name: mist, box: [4, 4, 3], position: [0, 0, 1], material: mist}
  - {name: bush, box: [1, 4, 3], position: [4, 0, 1], material: leaf}
  - {name: paper, mesh: sheet.stl, position: [6, 0, 0], material: sheet}
starts:
  - {name: RobotStart1, position: [0, 0, 0], yaw_deg: 0}
"""
SHEET = """\
solid sheet
 facet normal 1 0 0
  outer loop
   vertex 0 -3 -1
   vertex 0 3 -1
   vertex 0 0 3
  endloop
 endfacet
endsolid sheet
"""


CENTRE_RAY = ("--set", "ray_weights=0,1,0")
AHEAD = ("--sensor", "radar", "--pose", "0,0,0", "--beam", "90", *CENTRE_RAY)


@pytest.fixture
def room(tmp_path: Path) -> str:
    path = tmp_path / "room.yaml"
    path.write_text(MAP)
    (tmp_path / "sheet.stl").write_text(SHEET)
    return str(path)


def explain(*words: object) -> Any:
    return json.loads(radarsim("explain", *words, "--format", "json").text)


def test_crossings_have_the_power_before_and_after(room: str) -> None:
    data = explain(room, *AHEAD)
    mist, bush, paper = data["crossings"]
    assert (mist["object"], mist["material"]) == ("mist", "mist")
    assert mist["starts_inside"] is True
    assert (mist["entry"], mist["exit"]) == pytest.approx((0, 2))
    assert (mist["power_before"], mist["power_after"]) == pytest.approx((1, 0.8))
    assert (bush["entry"], bush["exit"]) == pytest.approx((3.5, 4.5))
    assert (bush["power_before"], bush["power_after"]) == pytest.approx((0.8, 0.3))
    assert (paper["entry"], paper["exit"]) == pytest.approx((6, 6))
    assert (paper["power_before"], paper["power_after"]) == pytest.approx((0.3, 0.05))
    assert data["outcome"] == "hit"
    assert (data["object"], data["material"]) == ("room", "wall")
    assert data["range"] == pytest.approx(10)
    assert data["power_left"] == pytest.approx(0.05)


def test_spent_beam_has_the_object_and_distance(room: str) -> None:
    data = explain(room, *AHEAD, "--set", "penetration_power=0.6")
    assert (data["outcome"], data["object"]) == ("spent", "bush")
    assert data["range"] == pytest.approx(3.5 + 0.4 / 0.5)
    assert data["crossings"][-1]["exit"] is None


def test_sheet_that_absorbs_the_remaining_power_ends_the_beam(room: str) -> None:
    data = explain(room, *AHEAD, "--set", "penetration_power=0.9")
    assert (data["outcome"], data["object"]) == ("spent", "paper")
    assert data["crossings"][-1]["power_before"] == pytest.approx(0.2)
    assert data["crossings"][-1]["power_after"] == 0
    assert data["range"] == pytest.approx(6)


def test_spent_laser_beam_reads_zero(room: str) -> None:
    weak = ("--set", "max_range=20", "--set", "penetration_power=0.003")
    where = ("--sensor", "hokuyo", "--pose", "-5,0,0", "--beam", "113")
    data = explain(room, *where, *weak)
    assert (data["outcome"], data["range"], data["ray"]) == ("spent", 0.0, None)
    assert data["distance"] > 3


def test_text_has_a_line_for_each_crossing(room: str) -> None:
    lines = radarsim("explain", room, *AHEAD).text.splitlines()
    assert lines == [
        "radar, beam 90 at 0.00 deg, centre ray",
        "sent with power 1.0000",
        "starts inside mist (mist), leaves at 2.0000 m, power 1.0000 to 0.8000",
        "3.5000 m: enters bush (leaf), leaves at 4.5000 m, power 0.8000 to 0.3000",
        "6.0000 m: enters paper (sheet), leaves at 6.0000 m, power 0.3000 to 0.0500",
        "10.0000 m: hits room (wall), power left 0.0500",
        "reads 10.0000 m",
    ]


def test_beam_without_hits_is_out_of_range(room: str) -> None:
    run = radarsim(
        *("explain", room, "--sensor", "sick", "--pose", "8,0,0", "--beam", "90"),
        *("--set", "max_range=1"),
    )
    assert run.text.splitlines()[1:] == [
        "sent with power unlimited",
        "1.0000 m: out of range, power left unlimited",
        "reads nothing",
    ]


@pytest.mark.parametrize("beam", [60, 88, 116])
def test_drawn_ray_is_the_one_of_scan_with_the_same_seed(beam: int) -> None:
    start = ("--start", "RobotStart1", "--seed", "4")
    place = ("foliage_room", "--sensor", "radar", *start)
    scan = json.loads(radarsim("scan", *place).text)
    data = explain(*place, "--beam", beam)
    assert data["range"] == scan["ranges"][beam]
    assert data["ray"] == scan["rays"][beam]
    assert data["angle"] == pytest.approx(math.radians(beam - 90))


@pytest.mark.parametrize(
    ("settings", "wanted"),
    [
        (["return_mode=first"], 3.5),
        # half of its power
        (["return_mode=strongest"], 3.5 - math.log10((1 + 10**-2.5) / 2) / 2.5),
        (["return_mode=all", "range_quantum=3"], 9.0),
    ],
)
def test_range_depends_on_the_return_mode(
    room: str, settings: list[str], wanted: float
) -> None:
    changes = [part for text in settings for part in ("--set", text)]
    ahead = (*AHEAD[:-2], "--set", "side_offset_uu=0")
    data = explain(room, *ahead, *changes)
    assert data["range"] == pytest.approx(wanted)
    assert (data["outcome"], data["distance"]) == ("hit", pytest.approx(10))


def test_centre_ray_of_a_laser_is_its_only_ray(room: str) -> None:
    data = explain(room, "--sensor", "laser", *AHEAD[2:])
    assert data["ray"] is None
    assert data["range"] == pytest.approx(3.5)


BLACK = """\
version: 1
materials:
  black: {density: opaque, absorption_db: all}
  dull: {density: opaque, absorption_db: 20}
  mirror: {density: opaque, mirror: radar}
  wall: {density: opaque}
objects:
  - {name: hole, box: [1, 4, 3], position: [5, 0, 1], material: black}
  - {name: screen, box: [4, 1, 3], position: [0, 5, 1], material: dull}
  - {name: glass, box: [1, 4, 3], position: [-5, 0, 1], material: mirror}
  - {name: back, box: [1, 40, 3], position: [20, 0, 1], material: wall}
starts:
  - {name: RobotStart1, position: [0, 0, 0], yaw_deg: 0}
"""


@pytest.mark.parametrize(
    ("yaw", "said", "power"),
    [
        (0, "4.5000 m: absorbed by hole (black), power left 0.0000", 0.0),
        (90, "4.5000 m: hits screen (dull), power left 0.6000", 0.6),
    ],
)
def test_absorbing_object_and_remaining_power_are_printed(
    tmp_path: Path, yaw: int, said: str, power: float
) -> None:
    (tmp_path / "black.yaml").write_text(BLACK)
    ahead = ("--sensor", "radar", "--pose", f"0,0,{yaw}", "--beam", "90")
    where = (str(tmp_path / "black.yaml"), *ahead, *CENTRE_RAY)
    assert said in radarsim("explain", *where).text
    data = explain(*where)
    assert data["power_left"] == pytest.approx(power)


def test_mirrored_echo_is_called_a_ghost(tmp_path: Path) -> None:
    (tmp_path / "black.yaml").write_text(BLACK.replace("absorption_db: all", ""))
    ahead = ("--sensor", "radar", "--pose", "0,0,179", "--beam", "90")
    run = radarsim("explain", tmp_path / "black.yaml", *ahead, *CENTRE_RAY)
    assert "4.5007 m: mirrored by glass (mirror) at (-4.50, 0.08, 0.35)" in run.text
    assert "reads 13.5021 m, a ghost: it was mirrored on its way" in run.text


def test_attenuation_of_air_is_printed(tmp_path: Path) -> None:
    (tmp_path / "fog.yaml").write_text(BLACK.replace("starts:", "air: fog\nstarts:"))
    ahead = ("--sensor", "physical", "--pose", "0,0,0", "--beam", "90")
    run = radarsim("explain", tmp_path / "fog.yaml", *ahead)
    assert "everywhere: the air takes 0.055000 of power per metre" in run.text
    assert "reads 4.5000 m, its first echo" in run.text


def test_answer_from_inside_smoke_names_it() -> None:
    words = ("smoke_room", "--sensor", "physical", "--start", "RobotStart1")
    text = radarsim("explain", *words, "--beam", "90").text
    assert text.splitlines()[-1].endswith(" m, its first echo, from inside smoke")


def test_targets_of_a_detector_are_reported() -> None:
    words = (
        *("foliage_room", "--sensor", "navtech_cts350x", "--start", "RobotStart1"),
        *("--set", "detector=ca", "--beam", "3"),
    )
    data = explain(*words)
    assert data["detector"] == "ca"
    strongest = max(data["targets"], key=lambda target: target["dbm"])
    assert data["range"] == strongest["range"]
    # The wall behind the robot.
    assert data["range"] == pytest.approx(data["distance"], abs=0.2)
    text = radarsim("explain", *words).text
    assert f"a target of {strongest['dbm']:.1f} dBm" in text
    assert "its strongest target by its detector 'ca'" in text


def test_ray_of_a_detectors_beam_loses_decibels_as_its_spectrum_does() -> None:
    words = (
        *("foliage_room", "--sensor", "navtech_cts350x", "--start", "RobotStart1"),
        *("--set", "detector=ca", "--beam", "200", "--seed", "2"),
    )
    data = explain(*words)
    (bush,) = data["crossings"]
    # 3.31 dB/m of leaves at 77 GHz, over the way through the bush.
    loss = bush["power_before"] - bush["power_after"]
    assert loss == pytest.approx(3.31 * (bush["exit"] - bush["entry"]), rel=0.01)
    assert data["object"] == "cabinet"
    ranges = [target["range"] for target in data["targets"]]
    assert any(abs(each - data["distance"]) < 0.2 for each in ranges)
    lines = radarsim("explain", *words).text.splitlines()
    assert lines[0].endswith("centre ray")  # and not one of 201
    assert lines[1] == "followed to a loss of 75.0 dB one way"
    assert lines[2].endswith(f"loss 0.0 to {loss:.1f} dB")
    assert lines[3].endswith(f"hits cabinet (wood), loss {loss:.1f} dB")
