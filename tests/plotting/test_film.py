"""Films: frames by simulated time, complete files or none, little memory."""

import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence
from processes import largest_file

from radarsim.plotting.film import FRAME_RATE, HOLD, Film, Pixels, film_format

SIZE = 48, 64  # rows and columns


def counting_frames() -> Callable[[], Pixels]:
    """Return a function that draws a white bar, a pixel longer each time."""
    length = 0

    def draw() -> Pixels:
        nonlocal length
        length += 1
        pixels = np.zeros((*SIZE, 3), np.uint8)
        pixels[:, :, 2] = 255
        pixels[10:20, : length % SIZE[1]] = 255
        return pixels

    return draw


def durations(path: Path) -> list[int]:
    with Image.open(path) as image:
        return [frame.info["duration"] for frame in ImageSequence.Iterator(image)]


def bar_lengths(path: Path) -> list[int]:
    with Image.open(path) as image:
        frames = [np.array(f.convert("RGB")) for f in ImageSequence.Iterator(image)]
    return [int((frame[15, :, 0] == 255).sum()) for frame in frames]


def film_run(path: Path, seconds: float, *, speed: float = 6.0) -> Film:
    with Film(path, counting_frames(), speed=speed) as film:
        for k in range(round(seconds * 10) + 1):
            film.update(100.0 + k / 10)
    return film


def test_frames_come_at_a_fixed_rate_of_simulated_time(tmp_path: Path) -> None:
    path = tmp_path / "run.gif"
    film = film_run(path, 30.0, speed=6.0)
    assert film.error is None
    assert film.frames / FRAME_RATE == pytest.approx(30 / 6 + HOLD, abs=0.2)
    *moving, last = durations(path)
    assert {*moving} == {1000 // FRAME_RATE}
    assert last == HOLD * 1000
    assert bar_lengths(path) == [*range(1, len(moving) + 2)]


def test_scans_that_are_rarer_than_frames_leave_no_gap(tmp_path: Path) -> None:
    path = tmp_path / "run.gif"
    film = film_run(path, 2.0, speed=0.5)  # a frame each .05 s, a scan each .1 s
    assert film.frames / FRAME_RATE == pytest.approx(2 / 0.5 + HOLD, abs=0.2)
    assert sum(durations(path)) == pytest.approx(1000 * film.frames / FRAME_RATE)


def test_film_does_not_wait_for_a_clock_that_jumps(tmp_path: Path) -> None:
    with Film(tmp_path / "run.gif", counting_frames()) as film:
        for time in (0.0, 1e6, 1e6 + 0.6):
            film.update(time)
    assert film.frames / FRAME_RATE < 2 * HOLD + 1


def test_same_frames_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.gif", "b.gif"):
        film_run(tmp_path / name, 12.0)
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()


def test_film_of_a_run_that_fails_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "run.gif"
    with suppress(KeyboardInterrupt), Film(path, counting_frames()) as film:
        for time in (0.0, 1.0, 2.0):
            film.update(time)
        raise KeyboardInterrupt
    assert durations(path)[-1] == HOLD * 1000
    assert [*tmp_path.iterdir()] == [path]


def test_film_without_a_frame_is_not_written(tmp_path: Path) -> None:
    with Film(tmp_path / "run.gif", counting_frames()) as film:
        pass
    assert (film.frames, [*tmp_path.iterdir()]) == (0, [])


def test_interrupt_while_the_film_is_completed_leaves_no_file(tmp_path: Path) -> None:
    draw, interrupted = counting_frames(), False

    def draw_until_interrupted() -> Pixels:
        if interrupted:
            raise KeyboardInterrupt
        return draw()

    path = tmp_path / "run.gif"
    with suppress(KeyboardInterrupt), Film(path, draw_until_interrupted) as film:
        film.update(0.0)
        interrupted = True
    assert not [*tmp_path.iterdir()]


def test_full_disk_ends_the_film_and_not_the_run(tmp_path: Path) -> None:
    with largest_file(3000):
        film = film_run(tmp_path / "run.gif", 60.0)
    assert film.error is not None
    assert film.error.strerror == "File too large"
    assert not [*tmp_path.iterdir()]


def test_memory_does_not_grow_with_the_film(tmp_path: Path) -> None:
    path, frame = tmp_path / "run.gif", 3 * SIZE[0] * SIZE[1]
    film_run(path, 30.0)
    tracemalloc.start()
    film = film_run(path, 600.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert film.frames > 1000
    assert peak < 150 * frame


def test_many_colours_are_reduced(tmp_path: Path) -> None:
    noise = np.random.Generator(np.random.PCG64(0))
    drawn = [noise.integers(0, 256, (*SIZE, 3), np.uint8) for _ in range(2)]
    with Film(tmp_path / "run.gif", lambda: drawn[film.frames % 2]) as film:
        film.update(0.0)
    with Image.open(tmp_path / "run.gif") as image:
        shown = np.array(image.convert("RGB")).astype(float)
    assert np.abs(shown - drawn[0]).mean() < 30


# imageio-ffmpeg leaves the pipes of ffmpeg to the garbage collector
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_mp4_can_be_played(tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    film = film_run(tmp_path / "run.mp4", 30.0)
    assert film.error is None
    reader = ffmpeg.read_frames(str(tmp_path / "run.mp4"))
    about = next(reader)
    assert about["size"] == SIZE[::-1]
    assert about["duration"] == pytest.approx(film.frames / FRAME_RATE, abs=0.2)
    frames = [np.frombuffer(f, np.uint8).reshape(*SIZE, 3) for f in reader]
    assert len(frames) == film.frames
    lengths = [int((frame[15, :, 0] > 128).sum()) for frame in frames]
    assert lengths[30] == pytest.approx(31, abs=2)
    assert [*tmp_path.iterdir()] == [tmp_path / "run.mp4"]


@pytest.mark.parametrize("name", ["run.avi", "run", "gif"])
def test_unknown_format_is_an_error(name: str) -> None:
    with pytest.raises(ValueError, match=r"expected a \.gif or \.mp4 file"):
        film_format(Path(name))
    assert film_format(Path("RUN.GIF")) == "gif"


def test_missing_ffmpeg_is_an_error_with_a_hint(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(ValueError, match="MP4") as error:
        film_format(Path("out/run.mp4"))
    assert "pip install '.[film]' in the checkout" in str(error.value)
    assert "or choose out/run.gif" in str(error.value)
