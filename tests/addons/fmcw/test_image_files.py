"""Images of turns, read by the rules of the data sets' own readers."""

import io
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import radarsim
from radarsim.addons.fmcw.image_files import (
    assumed_bin,
    epoch_of,
    file_name,
    image_of,
    load_turns,
)
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.scene.scene import Scene

TIME = 1_547_131_046_353_776  # us


@pytest.fixture(scope="module")
def turn(foliage_room: Scene) -> Spectrum:
    radar = radarsim.load_sensor("navtech_cts350x")
    turn: Spectrum = radar.spectrum(foliage_room, (-8, 0, 0), radarsim.generator_for(0))
    return turn


def pixels(data: bytes) -> "np.ndarray[tuple[int, int], np.dtype[np.uint8]]":
    with Image.open(io.BytesIO(data)) as image:
        assert image.mode == "L"
        return np.asarray(image)


@pytest.mark.parametrize("layout", ["oxford", "boreas"])
def test_kit_of_the_data_set_reads_times_angles_and_counts(
    turn: Spectrum, layout: str
) -> None:
    raw = pixels(image_of(turn, layout, time_us=TIME))
    assert raw.shape == (400, 3779)
    times = raw[:, :8].copy().view(np.int64).ravel()
    angles = raw[:, 8:10].copy().view(np.uint16).ravel() / 5600 * 2 * np.pi
    assert times[0] == TIME
    assert set(np.diff(times)) == {625}
    assert angles == pytest.approx(-turn.angles)
    assert (raw[:, 10] == 255).all()
    assert (raw[:, 11:] == turn.counts).all()


def test_image_of_radiate_has_a_column_for_each_direction(turn: Spectrum) -> None:
    off = pixels(image_of(turn, "radiate")) - turn.counts.T.astype(np.float64)
    assert np.sqrt((off**2).mean()) < 8
    with pytest.raises(ValueError, match="expected one of"):
        image_of(turn, "kitti")


def test_image_of_radiate_has_been_through_jpeg(turn: Spectrum) -> None:
    """Second differences jump at the edges of blocks of 8 bins, as in real ones."""
    image = pixels(image_of(turn, "radiate"))[64:].astype(np.float64)
    jumps = np.abs(np.diff(image, 2, axis=0)).mean(axis=1)
    in_block = jumps[: len(jumps) // 8 * 8].reshape(-1, 8).mean(axis=0)
    assert in_block[6:].min() > 1.5 * in_block[:6].max()


@pytest.mark.parametrize(
    ("layout", "name"),
    [
        ("oxford", f"{TIME}.png"),
        ("boreas", f"{TIME + 199 * 625}.png"),
        ("radiate", "000007.png"),
    ],
)
def test_files_have_the_names_of_the_data_set(
    turn: Spectrum, layout: str, name: str
) -> None:
    assert file_name(turn, layout, time_us=TIME, number=7) == name


@pytest.mark.parametrize(
    ("layout", "bin_size", "start", "epoch", "assumed"),
    [
        pytest.param("oxford", 0.0438, 0, 1.6e15, 0.0432, id="oxford"),
        pytest.param("oxford", 0.0432, TIME, 0, 0.0432, id="times of today"),
        pytest.param("boreas", 0.0596, 7, 1.6e15, 0.0596, id="boreas"),
        pytest.param("boreas", 0.0438, 7, 1.65e15, 0.04381, id="boreas, fine bins"),
        pytest.param("boreas", 0.0438, TIME, 0, 0.0596, id="boreas, an early time"),
        pytest.param("radiate", 0.1736, 0, 1.6e15, 0.173611, id="radiate"),
    ],
)
def test_epoch_is_one_for_which_readers_assume_the_bins_if_they_can(
    layout: str, bin_size: float, start: int, epoch: float, assumed: float
) -> None:
    """By pyboreas bins are finer for names above 1632182400 s."""
    assert epoch_of(layout, bin_size, start) == epoch
    assert assumed_bin(layout, start + int(epoch)) == assumed
    assert len(str(start + int(epoch))) == 16


def test_images_without_notes_have_the_bins_of_their_readers(tmp_path: Path) -> None:
    """Files in the layouts that the data sets have published."""
    row = struct.pack("<qHB", TIME, 2803, 255) + bytes(range(5))
    png = Image.fromarray(np.frombuffer(row, np.uint8)[None])
    for layout, size in (("oxford", 0.0432), ("boreas", 0.0596)):
        (tmp_path / layout / "radar").mkdir(parents=True)
        png.save(tmp_path / layout / "radar" / f"{TIME}.png")
        (read,) = load_turns(str(tmp_path / layout), layout)
        assert read.times == pytest.approx([TIME / 1e6], abs=1e-6)
        assert read.angles == pytest.approx([-2803 / 5600 * 2 * np.pi])
        assert read.counts.tolist() == [list(range(5))]
        assert read.ranges == pytest.approx(size * np.arange(5))
    (read,) = load_turns(tmp_path / "oxford", "oxford", bin_size=0.04)
    assert read.ranges[1] == pytest.approx(0.04)
    (tmp_path / "Navtech_Polar").mkdir()
    times = "Frame: 000001 Time: 1574859771.744660272\n"
    (tmp_path / "Navtech_Polar.txt").write_text(times)
    for name in ("000001.png", "000002.png"):
        Image.fromarray(np.eye(576, 400, dtype=np.uint8)).save(
            tmp_path / "Navtech_Polar" / name
        )
    with pytest.raises(ValueError, match=r"no line for the image 000002\.png"):
        next(load_turns(tmp_path, "radiate"))
    (tmp_path / "Navtech_Polar" / "000002.png").unlink()
    (read,) = load_turns(tmp_path, "radiate")
    assert (read.counts == np.eye(400, 576)).all()
    assert read.times[[0, 100]] == pytest.approx([1574859771.744660, 1574859771.80716])
    assert read.ranges[-1] == pytest.approx(575 * 0.173611)


@pytest.mark.parametrize(
    ("layout", "problem"), [("kitti", "expected one of"), ("boreas", "no .png files")]
)
def test_other_folders_than_a_data_set_are_reported(
    tmp_path: Path, layout: str, problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        next(load_turns(tmp_path, layout))
