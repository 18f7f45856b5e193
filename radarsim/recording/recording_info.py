"""What a recording is of: everything that its run depends on besides its calls."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from radarsim.errors import RecordingError


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingInfo:
    """The conditions of a recorded run.

    Attributes:
        version: Version of radarsim.
        level: Name of the level, as the server sends it.
        map: The map, as it was named; empty if the server was another program.
        map_digest: SHA-256 of the map file, hexadecimal; empty likewise.
        seed: Seed of all random numbers.
        dialect: Name of the dialect.
        drive_unit: Unit of commands to drive.
        settings: Settings of items that were changed, by item and key.
    """

    version: str
    level: str = ""
    map: str = ""
    map_digest: str = ""
    seed: int = 0
    dialect: str = "compat"
    drive_unit: str = "rad_per_s"
    settings: dict[str, dict[str, Any]]

    def to_text(self) -> dict[str, str]:
        """Return the conditions as a record of metadata."""
        return {
            "version": self.version,
            "level": self.level,
            "map": self.map,
            "map_digest": self.map_digest,
            "seed": str(self.seed),
            "dialect": self.dialect,
            "drive_unit": self.drive_unit,
            "settings": json.dumps(self.settings),
        }

    @classmethod
    def from_text(cls, record: dict[str, str]) -> Self:
        """Read a record of metadata.

        Raises:
            RecordingError: If it lacks something, or is not readable.
        """
        try:
            settings = json.loads(record["settings"])
            return cls(**{**record, "seed": int(record["seed"]), "settings": settings})
        except (KeyError, TypeError, ValueError) as error:
            text = f"metadata {sorted(record)} of the recording"
            raise RecordingError(f"{text}, expected those of radarsim") from error


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal.

    Raises:
        OSError: If it cannot be read.
    """
    return hashlib.sha256(path.read_bytes()).hexdigest()
