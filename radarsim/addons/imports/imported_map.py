"""A map that is made of a file of another program."""

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

MAX_SHOWN: Final = 8  # names in a warning
LEVEL: Final = 1e-7  # rad; less is taken for upright
LOW: Final = 0.05  # m; what begins higher is no floor


class ImportedMap:
    """Collects the objects of a map.

    Attributes:
        options: What the file does not say.
        notes: Parts that are left out or changed, each with its place.
        materials: Materials of its own, by name.
        defaulted: Names of objects with the default material, in their order.
        meshes: Content of the mesh files that are written with the map, by name.
        models: Number of models in the file, those that are left out with them.
        others: What else is left out: its name, and how often.
        has_floor: Whether something is below the start, after `to_text`.
        start: x, y, z, m, and yaw, degrees, of the start.
    """

    def __init__(self, source: Path, options: ImportOptions) -> None:
        """Begin with nothing.

        Args:
            source: The file.
            options: What the file does not say.
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
        self._left_out: Counter[str] = Counter()  # models, by the reason
        self._patterns = dict(options.material)  # names of materials by patterns
        self._unused = dict.fromkeys(self._patterns)

    def note(self, path: Path, line: int, text: str) -> None:
        """Add a note on a part that is left out, or changed."""
        self.notes.append(place(path, line, text))

    def count_model(self, reasons: Sequence[str], added: int = 0) -> None:
        """Count a model, which is left out if more than half of its shapes are.

        Args:
            reasons: Why shapes of it are left out, in words that follow a number.
            added: The number of its other shapes.
        """
        self.models += 1
        if len(reasons) > added:
            self._left_out[Counter(reasons).most_common(1)[0][0]] += 1
        elif reasons:
            self.others["shape"] += len(reasons)

    @property
    def count(self) -> int:
        """The number of objects."""
        return len(self._objects)

    @property
    def is_mostly_left_out(self) -> bool:
        """Whether more than half of the models are left out."""
        return 2 * self._left_out.total() > self.models

    def summary(self) -> str:
        """Return how many models are left out, and why, and what else is."""
        text = f"{self._left_out.total()} of {self.models} models left out"
        reasons = self._left_out.most_common()
        shown = [f"{count} {reason}" for reason, count in reasons[:MAX_SHOWN]]
        if more := sum(count for _, count in reasons[MAX_SHOWN:]):
            shown.append(f"{more} for other reasons")
        text += (": " + ", ".join(shown)) * bool(shown)
        others = (f"{n} {each}{'s' * (n > 1)}" for each, n in self.others.items())
        return text + f"; also {', '.join(others)}" * bool(self.others)

    def material_of(self, name: str, known: str | None = None) -> str:
        """Choose the material of what has a name: a pattern's counts first.

        Args:
            name: The name.
            known: The material that it has without a pattern; None for the default.
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
        """Return which patterns fit nothing, and what else may be unexpected."""
        lines = [f"--material {each!r} matches no object" for each in self._unused]
        names = list(dict.fromkeys(self.defaulted))
        if names:
            shown = ", ".join(map(repr, names[:MAX_SHOWN]))
            more = len(names) - MAX_SHOWN
            shown += f" and {more} more" * (more > 0)
            lines.append(f"{self.options.default_material} by default: {shown}")
        if not self.has_floor:
            text = "robots drive at z = 0, and rays that point down meet nothing"
            lines.append(f"no floor below the start: {text}")
        return lines

    def add(
        self, name: str, shape: Mapping[str, object], pose: Pose3, material: str = ""
    ) -> None:
        """Add an object.

        Args:
            name: Its name; a number follows it if there is another one of this name.
            shape: The keys of a map file that describe it.
            pose: Its pose.
            material: Its material; that which fits its name if there is none.

        Raises:
            ForeignFileError: If there are too many.
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
        # Composed rotations leave angles of rounding errors; such an object counts as
        # upright.
        if max(abs(pose.roll), abs(pose.pitch)) > LEVEL:
            keys["rotation_deg"] = angles
        elif abs(pose.yaw) > LEVEL:
            keys["yaw_deg"] = angles[2]
        if "materials" not in shape:
            keys["material"] = material or self.material_of(name)
        self._objects.append(keys)

    def to_text(self, file: Path) -> str:
        """Return the map file.

        Args:
            file: Where it is to be written.

        Raises:
            ForeignFileError: If it would not be a map.
        """
        if not self._objects:
            nothing = f"{self._source}: it has no object for a map"
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
        # The name in ASCII, as it may hold a line break, which would end the comment.
        text: str = f"# Imported from {self._source.name!a}.\n" + yaml.dump(
            content,
            Dumper=yaml.CSafeDumper,
            default_flow_style=None,  # lists of numbers are on one line
            sort_keys=False,
            allow_unicode=True,
        )
        # Checked as a map: names and sizes of other programs may not fit.
        try:
            scene = load_scene(parse_yaml(file, text))
        except MapError as error:
            first = error.problems[0].removeprefix(f"{file}:")
            reason = first.partition(": ")[2]
            wrong = f"{self._source}: cannot become a map: {reason}"
            raise ForeignFileError(wrong) from error
        x, y, z = position
        self.has_floor = any(
            low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] < z + LOW
            for low, high in (part.bounds for part in scene.parts)
        )
        return text

    def _unique(self, name: str) -> str:
        """Return a name that a map file may have, and that no object has."""
        signs = [c if c.isprintable() and c not in "{}" else "_" for c in name]
        wanted = "".join(signs).strip()[: MAX_NAME - 8] or "object"
        # ``wall_2`` may be a name of the file itself, so that this one is tried again.
        count = self._names[wanted] = self._names.get(wanted, 0) + 1
        if count == 1:
            return wanted
        return self._unique(f"{wanted}_{count}")
