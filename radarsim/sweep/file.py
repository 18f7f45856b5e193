"""Sweep files: YAML with lists of parameter values; errors name the line."""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self, TypeAlias

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from radarsim.autonomy.plans import Algorithm, StrategyName
from radarsim.errors import (
    PresetError,
    SweepError,
    describe_os_error,
    did_you_mean,
    expected_one_of,
)
from radarsim.presets.sensors import load_settings, sensor_presets
from radarsim.scene.map_file import shipped_maps
from radarsim.yaml_reader import YamlFile, read_yaml

MAX_TASKS: Final = 1_000_000
MAX_STEPS: Final = 100_000
_RANGE: Final = {"from", "to", "steps"}

Parameters: TypeAlias = dict[str, Any]


def _values(given: Any) -> Any:
    """Return a list of values from a list, from a range, or from a single value."""
    if isinstance(given, dict) and given.keys() & _RANGE:
        steps, ends = given.get("steps"), (given.get("from"), given.get("to"))
        is_number = all(type(end) in (int, float) for end in ends)
        if given.keys() != _RANGE or not is_number or type(steps) is not int:
            raise ValueError(
                f"{given}, expected {{from: NUMBER, to: NUMBER, steps: N}}"
            )
        if not 2 <= steps <= MAX_STEPS:
            raise ValueError(f"steps {steps}, expected 2 to {MAX_STEPS}")
        # Rounding makes the table contain 0.3 instead of 0.30000000000000004.
        return [
            round(float(each), 9)
            for each in np.linspace(given["from"], given["to"], steps)
        ]
    return given if isinstance(given, list) else [given]


_Listed = BeforeValidator(_values)
_AtLeastOne = Field(min_length=1)
Texts = Annotated[list[str], _Listed, _AtLeastOne]
Numbers = Annotated[
    list[Annotated[float, Field(allow_inf_nan=False)]], _Listed, _AtLeastOne
]
Seeds = Annotated[list[Annotated[int, Field(ge=0)]], _Listed, _AtLeastOne]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PoseGrid(_Model):
    """Poses of the sensor: all combinations of x and y, in m, and yaw, in degrees."""

    x: Numbers
    y: Numbers
    yaw_deg: Numbers = Field(default=[0.0])


class SweepFile(_Model):
    """The contents of a sweep file.

    Attributes:
        kind: Kind of the tasks: ``count`` scans, a trial of a navigator, or a map.
        map: Names or files of maps; files in the folder of the sweep file come first.
        sensor: Lists of values for ``name``, a sensor preset, and for its settings.
        pose: Poses of the sensor, for scans.
        count: Number of scans in a task.
        seed: Seeds of the tasks.
        algorithm: Algorithms of navigators, for trials.
        strategy: Exploration strategies, for maps.
        time_limit: Maximum duration of a trial or exploration, s of simulated time.
    """

    version: Literal[1]
    kind: Literal["scan", "trial", "map"]
    map: Texts
    sensor: dict[str, Annotated[list[Any], _Listed, _AtLeastOne]]
    pose: PoseGrid | None = None
    count: Annotated[int, Field(ge=1, le=100_000)] = 1
    seed: Seeds = Field(default=[0])
    algorithm: Annotated[list[Algorithm], _Listed, _AtLeastOne] | None = None
    strategy: Annotated[list[StrategyName], _Listed, _AtLeastOne] | None = None
    time_limit: Annotated[float, Field(gt=0, le=1e5)] = 3600.0

    @model_validator(mode="after")
    def _check_kind(self) -> Self:
        """Check that all keys belong to this kind of task, and that none is missing."""
        own = {"scan": "pose", "trial": "algorithm", "map": "strategy"}
        for kind, key in own.items():
            if kind != self.kind and getattr(self, key) is not None:
                raise ValueError(f"'{key}' is only for kind {kind}, not {self.kind}")
        if self.kind == "scan" and self.pose is None:
            raise ValueError("no 'pose', which kind scan needs")
        if self.kind != "scan" and self.count != 1:
            raise ValueError("'count' is only for kind scan")
        return self

    def tasks(self) -> Iterator[Parameters]:
        """Yield the parameters of each task as plain data, in the order of the file."""
        for map_, sensor, where, seed in product(
            self.map, self._sensors(), self._ways(), self.seed
        ):
            task = {"kind": self.kind, "map": map_, "sensor": sensor, "seed": seed}
            limit = {} if self.kind == "scan" else {"time_limit": self.time_limit}
            yield {**task, **where, **limit}

    def _sensors(self) -> list[Parameters]:
        return [
            dict(zip(self.sensor, values, strict=True))
            for values in product(*self.sensor.values())
        ]

    def _ways(self) -> list[Parameters]:
        """Return the poses, algorithms or strategies over which the sweep runs."""
        if self.pose is not None:
            places = product(self.pose.x, self.pose.y, self.pose.yaw_deg)
            return [{"x": x, "y": y, "yaw_deg": yaw} for x, y, yaw in places]
        if self.kind == "trial":
            chosen = self.algorithm or [Algorithm.BUG2]
            return [{"algorithm": each.value} for each in chosen]
        return [
            {"strategy": each.value} for each in self.strategy or [StrategyName.AUTO]
        ]


def flat_parameters(task: Parameters) -> Parameters:
    """Return a task's parameters by the names of columns, such as ``sensor.name``."""
    sensor = {f"sensor.{key}": value for key, value in task["sensor"].items()}
    left_out = ("sensor", "kind", "scene", "count")
    others = {key: value for key, value in task.items() if key not in left_out}
    return {"map": others.pop("map"), **sensor, **others}


def shipped_sweeps() -> dict[str, Path]:
    """Return the paths of the sweeps that come with radarsim, by name."""
    folder = Path(__file__).parent / "shipped"
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def read_sweep(path_or_name: str) -> tuple[Path, SweepFile]:
    """Read a sweep file, and check the sensors that it names.

    Args:
        path_or_name: A file, or the name of a shipped sweep.

    Raises:
        SweepError: If the file is wrong, with the file and line of each problem.
    """
    path = Path(path_or_name)
    known = sorted(shipped_sweeps())
    expected = f"expected a sweep file, whose 'map' names maps, or one of {known}"
    try:
        if not path.is_file():
            path = shipped_sweeps().get(path_or_name, path)
        if not path.is_file() and path_or_name.partition("@")[0] in shipped_maps():
            raise SweepError(f"{path}: is a map, {expected}")
        file = read_yaml(path)
    except OSError as error:
        reason = describe_os_error(error) + did_you_mean(path_or_name, known)
        raise SweepError(f"{path}: {reason}, {expected}") from error
    if isinstance(file.data, dict) and "objects" in file.data:
        raise SweepError(f"{path}: is a map, {expected}")
    problems = list(file.problems)
    sweep = None
    if not problems:
        try:
            sweep = SweepFile.model_validate(file.data)
        except ValidationError as error:
            known = sorted(SweepFile.model_fields)
            problems = file.validation_problems(error, known=known, most=20)
    if sweep is not None:
        problems = [*_sensor_problems(file, sweep), *_size_problems(file, sweep)]
    if sweep is None or problems:
        raise SweepError("\n".join(problems))
    return path, sweep


def _sensor_problems(file: YamlFile, sweep: SweepFile) -> Iterator[str]:
    """Yield errors in the name and in the settings of the file's sensor."""
    if "name" not in sweep.sensor:
        yield file.problem(("sensor",), "no 'name', expected a sensor preset")
        return
    known = sorted(sensor_presets())
    for name in sweep.sensor["name"]:
        if name not in known:
            text = expected_one_of(str(name), known)
            yield file.problem(("sensor", "name"), text)
            return
    # All combinations are checked, since limits of some settings depend on other
    # settings. Only the first error is reported, since a wrong value is part of many
    # combinations.
    for settings in sweep._sensors():
        try:
            load_settings(settings.pop("name"), **settings)
        except PresetError as error:
            keys = [key for key in settings if f"{key}:" in str(error)]
            yield file.problem(("sensor", *keys[:1]), str(error).splitlines()[0])
            return


def _size_problems(file: YamlFile, sweep: SweepFile) -> Iterator[str]:
    lists: list[list[Any]] = [sweep.map, sweep.seed, sweep._ways()]
    count = int(np.prod([len(each) for each in [*lists, *sweep.sensor.values()]]))
    if count > MAX_TASKS:
        yield file.problem((), f"{count} tasks, expected at most {MAX_TASKS}")
