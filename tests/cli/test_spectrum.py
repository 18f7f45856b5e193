"""``radarsim spectrum`` and ``radarsim explain --budget``."""

import csv
import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
from commands import Run
from commands import run_in_process as radarsim
from PIL import Image

from radarsim import load_turns

START = ("--start", "RobotStart1")
# A radar small enough for quick tests.
SMALL = (
    *("--sensor", "navtech_cts350x"),
    *("--set", "fmcw.azimuths=100", "--set", "fmcw.bins=500"),
)


def record(path: Path, *options: object) -> Run:
    return radarsim("spectrum", "foliage_room", *SMALL, *START, "-o", path, *options)


def size_of(path: Path) -> tuple[int, int]:
    with Image.open(path) as image:
        return image.size


def test_archive_holds_all_numbers_of_each_turn(tmp_path: Path) -> None:
    path = tmp_path / "turns.npz"
    assert record(path, "--count", "2").code == 0
    with np.load(path) as turns:
        assert turns["power"].shape == turns["counts"].shape == (2, 100, 500)
        assert turns["counts"].dtype == np.uint8
        assert turns["ranges"][1] == pytest.approx(0.0438)
        assert turns["angles"][25] == pytest.approx(-math.pi / 2)
        # The west wall is 2.6 m behind the radar.
        peak = turns["ranges"][turns["power"][0, 50].argmax()]
        assert peak == pytest.approx(2.6, abs=0.3)
        assert (turns["power"][0] != turns["power"][1]).any()


def test_same_seed_gives_the_same_turn(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.csv" for name in "abc"]
    for path, seed in zip(paths, ("1", "1", "2"), strict=True):
        assert record(path, "--seed", seed).code == 0
    first, second, third = (path.read_bytes() for path in paths)
    assert first == second != third


@pytest.mark.parametrize("detector", ["ca", "os", "k"])
def test_detections_are_a_row_each(tmp_path: Path, detector: str) -> None:
    path = tmp_path / "targets.csv"
    assert record(path, "--detector", detector).code == 0
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    assert rows
    near = [row for row in rows if row["azimuth"] == "25"]  # the south wall, at 6.4 m
    assert any(abs(float(row["range"]) - 6.4) < 0.3 for row in near)
    assert all(-130 < float(row["dbm"]) < 20 for row in rows)


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--view", "polar", "--max-range", "20"),
        ("--view", "ascope", "--azimuth", "3", "--detector", "k"),
    ],
)
def test_pictures_are_drawn(tmp_path: Path, options: tuple[str, ...]) -> None:
    path = tmp_path / "turn.png"
    assert record(path, *options).code == 0
    assert size_of(path)[0] > 500


def test_image_of_a_data_set_has_its_size(tmp_path: Path) -> None:
    path = tmp_path / "turn.png"
    for layout, size in (("oxford", (511, 100)), ("radiate", (100, 500))):
        assert record(path, "--layout", layout).code == 0
        assert size_of(path) == size


def test_budget_adds_up() -> None:
    run = radarsim(
        *("explain", "foliage_room", "--sensor", "navtech_cts350x", *START),
        *("--beam", "200", "--budget", "--format", "json"),
    )
    printed = json.loads(run.text)
    (wall,) = printed["echoes"]
    assert wall["object_name"] == "west_wall"
    assert wall["range"] == pytest.approx(2.61, abs=0.01)
    total = sum(entry["db"] for entry in [*printed["entries"], *wall["entries"]])
    assert total == pytest.approx(wall["received"])


def test_budget_names_what_each_material_takes() -> None:
    run = radarsim(
        *("explain", "foliage_room", "--sensor", "navtech_cts350x", *START),
        *("--beam", "3", "--budget"),
    )
    assert "lost in foliage" in run.text
    assert run.text.count("signal to noise") >= 2


def test_turns_along_a_path_are_written_as_in_a_data_set(tmp_path: Path) -> None:
    """One metre in four turns of 0.25 s, 6.4 m from the south wall."""
    path, folder = tmp_path / "way.tum", tmp_path / "sequence"
    path.write_text("# a path\n5 -8 0 0 0 0 0 1\n6 -7 0 0 0 0 0 1\n")
    options = ["--path", str(path), "-o", str(folder)]
    result = radarsim("spectrum", "foliage_room", *SMALL, *options)
    assert result.code == 0
    assert "readers of oxford assume bins of 0.0432 m; set 0.0438 m in" in result.err
    # Times of a few digits are counted from an epoch: readers sort names as text.
    epoch = 1_600_000_000
    start = 1_000_000 * epoch + 5_000_000
    names = [f"{start + 250_000 * turn}.png" for turn in range(4)]
    assert sorted(each.name for each in (folder / "radar").iterdir()) == names
    listed = (folder / "radar.timestamps").read_text().splitlines()
    assert listed == [f"{name.removesuffix('.png')} 1" for name in names]
    poses = np.loadtxt(folder / "poses.tum")
    times = poses[:, 0] - epoch
    assert times == pytest.approx([5.125, 5.375, 5.625, 5.875], abs=1e-5)
    notes = (folder / "README.md").read_text()
    assert "bins of 0.0438 m" in notes
    assert f"{epoch} s were added" in notes
    assert poses[:, 1] == pytest.approx([-7.875, -7.625, -7.375, -7.125])
    assert poses[:, 3] == pytest.approx(0.346)
    assert poses[:, 7] == pytest.approx(1)
    with Image.open(folder / "radar" / names[0]) as image:
        counts = np.asarray(image)[25, 11:]
    assert 0.0438 * counts[60:].argmax() + 2.6 == pytest.approx(6.4, abs=0.3)


def test_kit_of_radiate_finds_images_from_above(tmp_path: Path) -> None:
    """Its kit reads the times and images of Navtech_Cartesian, as words and numbers."""
    path, folder = tmp_path / "way.tum", tmp_path / "sequence"
    path.write_text("0 -8 0 0 0 0 0 1\n0.5 -8 0 0 0 0 0 1\n")
    options = ["--path", str(path), "-o", str(folder), "--layout", "radiate"]
    result = radarsim("spectrum", "foliage_room", *SMALL, *options)
    assert result.code == 0
    listed = (folder / "Navtech_Cartesian.txt").read_text().splitlines()
    frames = [line.split()[1] for line in listed]
    assert frames == ["000001", "000002"]
    assert [float(line.split()[3]) for line in listed] == [1.6e9, 1.6e9 + 0.25]
    with Image.open(folder / "Navtech_Cartesian" / "000001.png") as image:
        counts = np.asarray(image).astype(int)
    assert counts.shape == (1152, 1152)
    # The south wall is 6.4 m to the right, which is 37 pixels of 0.1736 m.
    right = counts[574:578, 576 + 15 :].mean(axis=0)
    assert right.argmax() + 15 == pytest.approx(6.4 / 0.173611, abs=2)


@pytest.mark.parametrize("layout", ["oxford", "boreas", "radiate"])
def test_folder_of_a_data_set_is_read_back(tmp_path: Path, layout: str) -> None:
    path, folder = tmp_path / "way.tum", tmp_path / "sequence"
    path.write_text("5 -8 0 0 0 0 0 1\n5.5 -8 0 0 0 0 0 1\n")
    options = ["--path", path, "-o", folder, "--layout", layout]
    assert radarsim("spectrum", "foliage_room", *SMALL, *options).code == 0
    first, second = load_turns(folder, layout)
    start = (1.65e9 if layout == "boreas" else 1.6e9) + 5
    assert first.times == pytest.approx(start + 0.0025 * np.arange(100), abs=2e-6)
    assert second.times - first.times == pytest.approx(0.25, abs=2e-6)
    assert first.angles == pytest.approx(-2 * np.pi * np.arange(100) / 100)
    assert first.ranges == pytest.approx(0.0438 * np.arange(500))
    images = folder / ("Navtech_Polar" if layout == "radiate" else "radar")
    file = sorted(images.glob("*.png"))[-1]
    with Image.open(file) as image:
        pixels = np.asarray(image)
    counts = pixels.T if layout == "radiate" else pixels[:, 11:]
    assert (second.counts == counts).all()
    # The south wall is 6.4 m to the right, at a quarter of a turn.
    assert second.ranges[60 + second.counts[25, 60:].argmax()] == pytest.approx(
        6.4, abs=0.3
    )


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        ("0 0 0 0 0 0 1\n", "line 1"),
        ("0 0 0 0 0 0 0 1\n", "1 poses, expected at least 2"),
        ("1 0 0 0 0 0 0 1\n" * 2, "expected above 1"),
        ("1 0 0 0 0 0 0 0\n", "expected time x y z"),
        ("1 nan 0 0 0 0 0 1\n", "expected time x y z"),
    ],
)
def test_errors_of_a_path_are_reported(
    tmp_path: Path, lines: str, problem: str
) -> None:
    path = tmp_path / "way.tum"
    path.write_text(lines)
    options = ["--path", str(path), "-o", str(tmp_path / "out")]
    result = radarsim("spectrum", "foliage_room", *SMALL, *options)
    assert result.code == 2
    assert problem in " ".join(result.err.split())
