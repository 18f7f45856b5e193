"""Finds, creates and checks the folder of a recording.

``RecordingInfo`` has the conditions of a run: everything that the run depends on except
the calls of its host.
"""

import hashlib
import json
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from radarsim import __version__
from radarsim.errors import (
    MapError,
    RecordingError,
    describe_os_error,
    did_you_mean,
    install_command,
    list_names,
)
from radarsim.presets.fmcw_settings import RADAR_MODEL
from radarsim.presets.robots import RobotModel
from radarsim.protocol.dialect import DriveUnit, get_dialect

if TYPE_CHECKING:
    from radarsim.addons.recording.bag import BagReader
    from radarsim.scene.scene import Scene
    from radarsim.server.host import Host
    from radarsim.simulation.config import SimulationConfig


class RecordingInfo(BaseModel):
    """The conditions of a recorded run.

    Attributes:
        version: Version of radarsim.
        level: Name of the level, as the server sends it.
        map: Name or path of the map; empty if the server was another program.
        map_digest: SHA-256 of the map file, hexadecimal; empty if ``map`` is empty.
        seed: Seed of all random numbers.
        radar_model: Revision of the model of FMCW radars; 1 if none is recorded.
        dialect: Name of the dialect.
        drive_unit: Unit of wheel speeds in drive commands.
        settings: Changed settings of items, by item and key.
        robots: Robot classes in addition to the shipped classes.
        own_localization: Whether the transform from ``map`` to ``odom`` is left out.
        no_namespace: Name of the robot whose topics and frames have no name prefix.
        robots_map: Whether ``/map`` is a robot's map instead of the true map.
        drawn_map: Map that the page showed during the recording; empty if none. A run
            with such a map cannot be repeated.
    """

    model_config = ConfigDict(extra="ignore", frozen=True)

    version: str
    level: str = ""
    map: str = ""
    map_digest: str = ""
    seed: int = 0
    radar_model: int = 1
    dialect: Literal["compat", "udk"] = "compat"
    drive_unit: DriveUnit = "rad_per_s"
    settings: dict[str, dict[str, Any]] = {}  # pydantic copies the default
    robots: tuple[RobotModel, ...] = ()
    own_localization: bool = False
    no_namespace: str = ""
    robots_map: bool = False
    drawn_map: str = ""

    @classmethod
    def of_host(
        cls,
        map_: str | None,
        host: "Host",
        seed: int,
        **others: object,
    ) -> Self:
        """Create the conditions of a run from its host.

        Args:
            map_: Name or path of the map; @VARIANT may follow. None for a scene that
                was not loaded from a file.
            host: The host.
            seed: Seed of the host.
            others: Further fields.
        """
        from radarsim.scene.map_file import find_map  # noqa: PLC0415 - slow import

        name = digest = ""
        if map_ is not None:
            path, variant = find_map(map_)
            name, digest = map_.removesuffix(f"@{variant}"), digest_of(path)
            if Path(name).exists():  # the run may be repeated from another folder
                name = str(path.resolve())
            name += "" if variant is None else f"@{variant}"
        model = {"seed": seed, "radar_model": RADAR_MODEL}
        named = {"level": host.scene.level, "map": name, "map_digest": digest}
        return cls.of_config(host.config, **named, **model, **others)

    @classmethod
    def of_config(cls, config: "SimulationConfig", **others: object) -> Self:
        """Create the conditions from a configuration and the fields in ``others``."""
        known = {
            "version": __version__,
            "dialect": config.dialect.name,
            "drive_unit": config.drive_unit or config.dialect.drive_unit,
            "settings": {i: dict(keys) for i, keys in config.item_settings.items()},
            "robots": config.robots,
        }
        return cls.model_validate(known | others)

    def config(self) -> "SimulationConfig":
        """Return the configuration of the run."""
        from radarsim.simulation.config import SimulationConfig  # noqa: PLC0415

        dialect = get_dialect(self.dialect)
        return SimulationConfig(dialect, self.drive_unit, self.settings, self.robots)

    def to_text(self) -> dict[str, str]:
        """Return the conditions as texts, for a metadata record of MCAP."""
        return {
            key: value if isinstance(value, str) else json.dumps(value)
            for key, value in self.model_dump(mode="json").items()
        }

    @classmethod
    def from_text(cls, record: dict[str, str]) -> Self:
        """Read the conditions from a metadata record of MCAP.

        Raises:
            RecordingError: If a field is missing or has a wrong value.
        """
        try:
            # MCAP metadata is text; pydantic converts it to the types of the fields.
            settings = json.loads(record.get("settings", "{}"))
            robots = json.loads(record.get("robots", "[]"))
            read = {**record, "settings": settings, "robots": robots}
            return cls.model_validate(read)
        except (ValidationError, ValueError) as error:
            text = f"metadata {sorted(record)} of the recording"
            raise RecordingError(f"{text}, expected radarsim's keys") from error


def check_map(info: RecordingInfo, name: str) -> None:
    """Check that a map has not changed since the recording, if its digest is known.

    Raises:
        MapError: If there is no such map.
        OSError: If the map cannot be read.
        RecordingError: If the map has changed.
    """
    from radarsim.scene.map_file import find_map  # noqa: PLC0415 - slow import

    path, _ = find_map(name)
    if info.map_digest not in ("", digest_of(path)):
        raise RecordingError(f"{path} has changed, expected the recorded map")


def recorded_scene(info: RecordingInfo) -> "Scene | None":
    """Load the map of a recording; return None if it is missing or has changed."""
    from radarsim.scene.map_file import load_map  # noqa: PLC0415

    if info.map:
        with suppress(MapError, OSError, RecordingError):
            check_map(info, info.map)
            return load_map(info.map)
    return None


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal.

    Raises:
        OSError: If the file cannot be read.
    """
    return hashlib.sha256(path.read_bytes()).hexdigest()


EXTRA: Final = ("mcap", "rosbags")  # packages that the extra ``record`` installs


def check_installed() -> None:
    """Check that the packages for recordings are installed.

    Raises:
        RecordingError: If a package is missing; the message names the extra.
    """
    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        text = f"recordings need {' and '.join(missing)}"
        raise RecordingError(f"{text}, expected: {install_command('record')}")


def open_bag(folder: Path) -> "BagReader":
    """Open a recording.

    Raises:
        RecordingError: If a package is missing, or the folder has no recording of
            radarsim.
    """
    check_installed()
    from radarsim.addons.recording.bag import BagReader  # noqa: PLC0415 - needs extra

    return BagReader(folder)


def check_new(folder: Path) -> None:
    """Check that the folder of a bag does not exist yet.

    Raises:
        RecordingError: If a package is missing, or the folder exists or cannot be
            accessed.
    """
    check_installed()
    try:
        if not folder.exists():
            return
        text = f"{folder} exists, expected a new folder for the recording"
    except OSError as error:
        text = f"{folder}: {describe_os_error(error)}"
    raise RecordingError(text)


def create_folder(folder: Path) -> None:
    """Create the folder of a bag.

    Raises:
        RecordingError: If a package is missing, or the folder exists or cannot be
            created.
    """
    check_new(folder)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise RecordingError(f"{folder}: {describe_os_error(error)}") from error


def file_name(folder: Path) -> str:
    """Return the name of the file in the folder of a bag."""
    return f"{folder.resolve().name}_0.mcap"


def find_file(folder: Path) -> Path:
    """Return the file of a bag, even if its folder was renamed.

    Raises:
        RecordingError: If there is no file or several; the message names recordings
            that may be meant.
    """
    # If the folder was renamed, its file still has the old name. The file is used if it
    # is the only MCAP file in the folder.
    expected = folder / file_name(folder)
    try:
        is_there = expected.exists()
    except OSError as error:
        text = f"{folder}: {describe_os_error(error)}, expected a recording"
        raise RecordingError(text) from error
    files = list(folder.glob("*.mcap"))
    if len(files) == 1:
        return files[0]
    if is_there:
        return expected
    reason = "not a recording" if folder.is_dir() else "no such recording"
    instead = "the folder of a recording, with one file *.mcap"
    if folder.suffix == ".mcap" and folder.is_file():
        reason += f" (did you mean {str(folder.parent)!r}?)"
    elif inside := _recordings_in(folder):
        instead = f"one of its folders {list_names(inside)}"
    else:
        reason += did_you_mean(folder.name, _recordings_in(folder.parent))
    raise RecordingError(f"{folder}: {reason}, expected {instead}")


def _recordings_in(folder: Path) -> list[str]:
    """Return the names of the recordings in a folder, sorted."""
    with suppress(OSError):
        return sorted({file.parent.name for file in folder.glob("*/*.mcap")})
    return []


def lock(file: IO[bytes], *, shared: bool = False) -> bool:
    """Lock a file until it is closed or its process ends.

    Args:
        file: The file.
        shared: Whether other processes may hold shared locks at the same time.

    Returns:
        Whether the file is not locked by another process. It is always True on systems
        without file locks, such as Windows and some network drives.
    """
    try:
        import fcntl  # noqa: PLC0415 - missing on Windows

        # The system releases this lock even if the process crashes. A lock file would
        # remain.
        kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):
        return True
    return True
