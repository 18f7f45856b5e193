"""Builds a map file from the objects in a file of another program."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

import yaml

from radarsim.addons.imports.cli import ImportOptions
from radarsim.addons.imports.source_file import place, rounded
from radarsim.errors import ForeignFileError, MapError
from radarsim.geometry import Pose3
from radarsim.scene.map_loader import load_scene
from radarsim.scene.map_schema import MAX_NAME, MAX_OBJECTS, level_of
from radarsim.yaml_reader import parse_yaml

MAX_SHOWN: Final = 8  # number of names that a warning lists
LEVEL: Final = 1e-7  # rad; objects with smaller roll and pitch count as upright
LOW: Final = 0.05  # m; an object that begins higher above the start is no floor


class ImportedMap:
    """Collects the objects of an imported map.

    Attributes:
        options: Options of the import.
        notes: Notes on parts that are left out or changed, with file and line.
        materials: Materials of the file, by name.
        defaulted: Names of objects with the default material, in order.
        meshes: Content of the mesh files that are written with the map, by name.
        models: Number of models in the file, including models that are left out.
        others: Number of other parts that are left out, by their kind.
        has_floor: Whether an object is below the start; set by ``to_text``.
        start: x, y, z, m, and yaw, degrees, of the start.
    """

    def __init__(self, source: Path, options: ImportOptions) -> None:
        """Create an imported map that has no objects yet.

        Args:
            source: The file that is imported.
            options: Options of the import.
        """
        self.options = options
        self.notes: list[str] = []
        self.materials: dict[str, dict[str, object]] = {}
        self.defaulted: list[str] = []
        self.meshes: dict[str, bytes] = {}
        self.models = 0
        self.others: Counter[str] = Counter()
        self.has_floor = True
        self.start = (0.0, 0.0, 0.0, 0.0)
        if options.start is not None:
            yaw_deg = math.degrees(options.start.yaw)
            self.start = (options.start.x, options.start.y, 0.0, yaw_deg)
        self._source = source
        self._objects: list[dict[str, object]] = []
        self._names: dict[str, int] = {}
        self._left_out: Counter[str] = Counter()  # number of models, by reason
        self._patterns = dict(options.material)  # material names, by name pattern
        self._unused = dict.fromkeys(self._patterns)

    def note(self, path: Path, line: int, text: str) -> None:
        """Add a note about a part of the file that is left out or changed."""
        self.notes.append(place(path, line, text))

    def count_model(self, reasons: Sequence[str], added: int = 0) -> None:
        """Count a model of the file, as left out if most of its shapes are left out.

        Args:
            reasons: The reason for each shape that is left out, such as "without a
                shape", which follows a number in the summary.
            added: Number of shapes that were added.
        """
        self.models += 1
        if len(reasons) > added:
            self._left_out[Counter(reasons).most_common(1)[0][0]] += 1
        elif reasons:
            self.others["shape"] += len(reasons)

    @property
    def count(self) -> int:
        """The number of objects in the map."""
        return len(self._objects)

    @property
    def is_mostly_left_out(self) -> bool:
        """Whether more than half of the models in the file are left out."""
        return 2 * self._left_out.total() > self.models

    def summary(self) -> str:
        """Return a text that says how many models and other parts are left out."""
        text = f"{self._left_out.total()} of {self.models} models left out"
        reasons = self._left_out.most_common()
        shown = [f"{count} {reason}" for reason, count in reasons[:MAX_SHOWN]]
        if more := sum(count for _, count in reasons[MAX_SHOWN:]):
            shown.append(f"{more} for other reasons")
        text += (": " + ", ".join(shown)) * bool(shown)
        others = (f"{n} {each}{'s' * (n > 1)}" for each, n in self.others.items())
        return text + f"; also {', '.join(others)}" * bool(self.others)

    def material_of(self, name: str, known: str | None = None) -> str:
        """Return the material of the first pattern that matches the name of an object.

        Args:
            name: Name of the object.
            known: Material if no pattern fits; None for the default material.
        """
        patterns = self._patterns
        fitting = [p for p in patterns if fnmatchcase(name.casefold(), p.casefold())]
        for pattern in fitting:
            self._unused.pop(pattern, None)
        if fitting:
            return patterns[fitting[0]]
        if known is None:
            self.defaulted.append(name)
        return known or self.options.default_material

    def warnings(self) -> list[str]:
        """Return warnings of unused patterns, default materials and a missing floor."""
        lines = [f"--material {each!r} matches no object" for each in self._unused]
        names = list(dict.fromkeys(self.defaulted))
        if names:
            shown = ", ".join(map(repr, names[:MAX_SHOWN]))
            more = len(names) - MAX_SHOWN
            shown += f" and {more} more" * (more > 0)
            lines.append(f"{self.options.default_material} by default: {shown}")
        if not self.has_floor:
            text = "robots drive at z = 0, and rays that point down hit nothing"
            lines.append(f"no floor below the start: {text}")
        return lines

    def add(
        self, name: str, shape: Mapping[str, object], pose: Pose3, material: str = ""
    ) -> None:
        """Add an object to the map.

        Args:
            name: Name of the object; a number is appended if the name is taken.
            shape: The keys of a map file that describe the shape.
            pose: Pose of the object.
            material: Material of the object; if empty, it is chosen by the name.

        Raises:
            ForeignFileError: If the map has too many objects.
        """
        if len(self._objects) >= MAX_OBJECTS:
            text = f"more than {MAX_OBJECTS} objects, expected fewer"
            raise ForeignFileError(f"{self._source}: {text}")
        keys = {
            "name": self._unique(name),
            **shape,
            "position": rounded(pose.position()),
        }
        angles = rounded(map(math.degrees, (pose.roll, pose.pitch, pose.yaw)))
        # Tiny angles count as 0, since composed rotations have rounding errors.
        if max(abs(pose.roll), abs(pose.pitch)) > LEVEL:
            keys["rotation_deg"] = angles
        elif abs(pose.yaw) > LEVEL:
            keys["yaw_deg"] = angles[2]
        if "materials" not in shape:
            keys["material"] = material or self.material_of(name)
        self._objects.append(keys)

    def to_text(self, file: Path) -> str:
        """Return the text of the map file.

        Args:
            file: Path of the map file, for the check.

        Raises:
            ForeignFileError: If the map is invalid or has no objects.
        """
        if not self._objects:
            nothing = f"{self._source}: no objects for a map"
            raise ForeignFileError(f"{nothing}: {self.summary()}")
        *position, yaw = self.start
        spot = {"position": rounded(position), "yaw_deg": round(yaw, 4)}
        content: dict[str, object] = {
            "version": 1,
            "level": f"DM-{level_of(self._source.stem)}",
            **({"materials": self.materials} if self.materials else {}),
            "objects": self._objects,
            "starts": [{"name": "RobotStart1", **spot}],
        }
        # ``!a`` escapes line breaks in the name, which would end the comment.
        text: str = f"# Imported from {self._source.name!a}.\n" + yaml.dump(
            content,
            Dumper=yaml.CSafeDumper,
            default_flow_style=None,  # writes lists of numbers on one line
            sort_keys=False,
            allow_unicode=True,
        )
        # Names and sizes from other programs may be invalid in a map, so the map is
        # checked.
        try:
            scene = load_scene(parse_yaml(file, text))
        except MapError as error:
            first = error.problems[0].removeprefix(f"{file}:")
            reason = first.partition(": ")[2]
            wrong = f"{self._source}: cannot be converted to a map: {reason}"
            raise ForeignFileError(wrong) from error
        x, y, z = position
        self.has_floor = any(
            low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] < z + LOW
            for low, high in (part.bounds for part in scene.parts)
        )
        return text

    def _unique(self, name: str) -> str:
        """Return an object name that is valid in a map file and not in use yet."""
        signs = [c if c.isprintable() and c not in "{}" else "_" for c in name]
        wanted = "".join(signs).strip()[: MAX_NAME - 8] or "object"
        # ``wall_2`` may also be a name in the file, so the new name is checked again.
        count = self._names[wanted] = self._names.get(wanted, 0) + 1
        if count == 1:
            return wanted
        return self._unique(f"{wanted}_{count}")
