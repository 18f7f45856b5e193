"""What a recording is of: everything that its run depends on besides its calls."""

import hashlib
import json
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from radarsim.errors import RecordingError
from radarsim.presets.robots import RobotModel
from radarsim.protocol.dialect import DriveUnit


class RecordingInfo(BaseModel):
    """The conditions of a recorded run.

    Attributes:
        version: Version of radarsim.
        level: Name of the level, as the server sends it.
        map: Name of the map, or path of its file; empty if the server was another
            program.
        map_digest: SHA-256 of the map file, hexadecimal; empty likewise.
        seed: Seed of all random numbers.
        dialect: Name of the dialect.
        drive_unit: Unit of commands to drive.
        settings: Settings of items that were changed, by item and key.
        robots: Robot classes besides those that are shipped.
    """

    model_config = ConfigDict(extra="ignore", frozen=True)

    version: str
    level: str = ""
    map: str = ""
    map_digest: str = ""
    seed: int = 0
    dialect: Literal["compat", "udk"] = "compat"
    drive_unit: DriveUnit = "rad_per_s"
    settings: dict[str, dict[str, Any]] = {}  # pydantic copies it
    robots: tuple[RobotModel, ...] = ()

    def to_text(self) -> dict[str, str]:
        """Return the conditions as a record of metadata."""
        return {
            key: value if isinstance(value, str) else json.dumps(value)
            for key, value in self.model_dump(mode="json").items()
        }

    @classmethod
    def from_text(cls, record: dict[str, str]) -> Self:
        """Read a record of metadata.

        Raises:
            RecordingError: If it lacks something, or is not readable.
        """
        try:
            settings = json.loads(record.get("settings", "{}"))
            robots = json.loads(record.get("robots", "[]"))
            read = {**record, "settings": settings, "robots": robots}
            return cls.model_validate(read)
        except (ValidationError, ValueError) as error:
            text = f"metadata {sorted(record)} of the recording"
            raise RecordingError(f"{text}, expected those of radarsim") from error


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal.

    Raises:
        OSError: If it cannot be read.
    """
    return hashlib.sha256(path.read_bytes()).hexdigest()
