"""The folder of a recording, and whether recordings can be written and read."""

import io
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from radarsim.errors import RecordingError
from radarsim.suggestions import did_you_mean, list_names

EXTRA: Final = ("mcap", "rosbags")  # packages of the extra ``record``


def check_installed() -> None:
    """Check that what recordings need is installed.

    Raises:
        RecordingError: If something is missing; it names the extra.
    """
    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        text = f"recordings need {' and '.join(missing)}"
        raise RecordingError(f"{text}, expected: pip install 'radarsim[record]'")


def create_folder(folder: Path) -> None:
    """Create the folder of a bag.

    Raises:
        RecordingError: If it is there already, or cannot be created.
    """
    try:
        folder.mkdir(parents=True)
    except FileExistsError as error:
        text = f"{folder} exists, expected a new folder for the recording"
        raise RecordingError(text) from error
    except OSError as error:
        raise RecordingError(f"{folder}: {error.strerror}") from error


def file_name(folder: Path) -> str:
    """Return the name of the file in the folder of a bag."""
    return f"{folder.resolve().name}_0.mcap"


def find_file(folder: Path) -> Path:
    """Return the file of a bag, also of one whose folder has been renamed.

    Raises:
        RecordingError: If there is none, or there are several; names recordings that
            may be meant.
    """
    expected = folder / file_name(folder)
    files = list(folder.glob("*.mcap"))
    if len(files) == 1:
        return files[0]
    if expected.exists():
        return expected
    reason = "no recording in it" if folder.is_dir() else "no such recording"
    raise RecordingError(f"{folder}: {reason}, expected {_expected_instead(folder)}")


def _expected_instead(folder: Path) -> str:
    """Return which folder may be meant instead of one that is no recording."""
    expected = "the folder of a recording, with one file *.mcap"
    if folder.suffix == ".mcap" and folder.is_file():
        return f"{expected}; did you mean {str(folder.parent)!r}?"
    inside = _recordings_in(folder)
    if inside:
        return f"one of those in it: {list_names(inside)}"
    return expected + did_you_mean(folder.name, _recordings_in(folder.parent))


def _recordings_in(folder: Path) -> list[str]:
    """Return the names of the recordings in a folder, sorted."""
    with suppress(OSError):
        return sorted({file.parent.name for file in folder.glob("*/*.mcap")})
    return []


def lock(file: io.FileIO) -> None:
    """Mark a file as being written, until it is closed or its process ends.

    Systems that lock no files, as Windows and some network drives, mark nothing.
    """
    try:
        import fcntl  # noqa: PLC0415 - Windows has none

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        return


def is_being_written(path: Path) -> bool:
    """Return whether a process writes to a file that it has locked."""
    try:
        import fcntl  # noqa: PLC0415 - Windows has none

        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (ImportError, OSError):
        return False
    return False
