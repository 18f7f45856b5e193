"""What the options of ``radarsim navigate`` ask for, read and completed."""

import math
from dataclasses import dataclass

import typer

from radarsim.cli.serving import item_settings
from radarsim.client import DriveUnit
from radarsim.errors import PresetError
from radarsim.geometry import Pose2
from radarsim.host import Host
from radarsim.navigation.bug import Point
from radarsim.navigation.choices import Algorithm, GiveUp, PoseSource, Rule
from radarsim.navigation.mission import Mission
from radarsim.navigation.motion import Pace
from radarsim.scene.mapfile import load_map
from radarsim.scene.scene import Scene, Trial
from radarsim.simulation.conditions import Conditions

HOST, PORT = "127.0.0.1", 3000


@dataclass(frozen=True, slots=True)
class ServerWish:
    """Which server to drive at: one that listens, or one in this process.

    Attributes:
        host: Of one that listens; None for this machine.
        port: None for USARSim's.
        map_: Of one in this process; None for one that listens.
        seed: Of one in this process.
        settings: ``ITEM.KEY=VALUE`` texts, of one in this process.
        drive_unit: Of one in this process.
    """

    host: str | None
    port: int | None
    map_: str | None
    seed: int | None
    settings: list[str]
    drive_unit: DriveUnit

    def check(self) -> None:
        """Find options that do not go together.

        Raises:
            typer.BadParameter: If there are any.
        """
        ours: dict[str, object] = {"--seed": self.seed, "--set": self.settings or None}
        theirs: dict[str, object] = {"--host": self.host, "--port": self.port}
        others, text = (
            (ours, "expected --serve with it")
            if self.map_ is None
            else (theirs, "expected no --serve with it")
        )
        for name, value in others.items():
            if value is not None:
                raise typer.BadParameter(text, param_hint=name)

    @property
    def address(self) -> tuple[str, int]:
        """Where the server listens."""
        return self.host or HOST, self.port or PORT

    def open(self) -> Host | None:
        """Make the server that is to be in this process, if one is to be.

        Raises:
            MapError: If the map is wrong.
            typer.BadParameter: If a setting is.
        """
        if self.map_ is None:
            return None
        settings = item_settings(self.settings)
        conditions = Conditions(drive_unit=self.drive_unit, item_settings=settings)
        try:
            conditions.check()
        except PresetError as error:
            raise typer.BadParameter(str(error), param_hint="--set") from None
        return Host(load_map(self.map_), conditions=conditions, seed=self.seed or 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionWish:
    """What the robot is to do, unread; see ``Mission``.

    Attributes:
        goals: ``X,Y`` texts.
        pose: ``X,Y,YAW_DEG``, or None.
        foliage_density: Power per metre that the thinnest foliage takes, or None.
        penetration_power: Of the radar.
    """

    algorithm: str
    goals: list[str]
    start: str | None
    pose: str | None
    robot: str
    scanner: str | None
    safety_distance: float | None
    foliage_density: float | None
    penetration_power: float
    bumpers: int
    share: float
    rule: str
    side: str
    give_up: str
    pose_from: str
    speed: float
    drive_unit: DriveUnit
    timeout: float
    time_limit: float

    def read(self, scene: Scene | None) -> Mission:
        """Read the texts, check the numbers, and take from a map's trial what is left.

        Raises:
            typer.BadParameter: If something is wrong or missing.
        """
        self._check()
        trial = None if scene is None else scene.trial
        return Mission(
            algorithm=Algorithm(self.algorithm),
            goals=self._goals(trial),
            robot_class=self.robot,
            start=self._start(scene),
            pose=None if self.pose is None else read_pose(self.pose),
            scanner=self.scanner,
            safety_distance=self._safety_distance(trial),
            depth=self._depth(),
            bumpers=self.bumpers,
            share=self.share,
            rule=Rule(self.rule),
            on_left=self.side == "left",
            give_up=GiveUp(self.give_up),
            source=PoseSource(self.pose_from),
            pace=Pace(speed=self.speed),
            time_limit=self.time_limit,
            timeout=self.timeout,
            drive_unit=self.drive_unit,
        )

    def _check(self) -> None:
        for hint, value in (
            ("--safety-distance", self.safety_distance),
            ("--foliage-density", self.foliage_density),
            ("--penetration-power", self.penetration_power),
            ("--speed", self.speed),
            ("--timeout", self.timeout),
        ):
            if value is not None and not 0 < value < math.inf:
                text = f"{value!r}, expected above 0 and finite"
                raise typer.BadParameter(text, param_hint=hint)
        if not self.time_limit > 0:
            text = f"{self.time_limit!r}, expected above 0"
            raise typer.BadParameter(text, param_hint="--time-limit")
        if not 0 < self.share <= 1:
            text = f"{self.share!r}, expected above 0 and at most 1"
            raise typer.BadParameter(text, param_hint="--share")
        if self.start is not None and self.pose is not None:
            raise typer.BadParameter("expected only one of --start and --pose")

    def _goals(self, trial: Trial | None) -> tuple[Point, ...]:
        if self.goals:
            return tuple(read_goal(text) for text in self.goals)
        if trial is None:
            text = "nowhere to go, expected X,Y, or --serve with a map that has a trial"
            raise typer.BadParameter(text, param_hint="--goal")
        return (trial.goal,)

    def _start(self, scene: Scene | None) -> str | None:
        if scene is None or self.pose is not None:
            return self.start
        if self.start is None:
            return scene.trial.start if scene.trial else None
        if scene.start(self.start) is None:
            names = [start.name for start in scene.starts]
            text = f"{self.start[:80]!r}, expected one of {names}"
            raise typer.BadParameter(text, param_hint="--start")
        return self.start

    def _safety_distance(self, trial: Trial | None) -> float | None:
        if self.safety_distance is None and self.foliage_density is None and trial:
            return trial.safety_distance
        return self.safety_distance

    def _depth(self) -> float:
        if self.foliage_density is None:
            return 0.0
        return self.penetration_power / self.foliage_density


def read_goal(text: str) -> Point:
    """Read ``X,Y``.

    Raises:
        typer.BadParameter: If these are not two numbers.
    """
    x, y = _numbers(text, "X,Y", "--goal")
    return x, y


def read_pose(text: str) -> Pose2:
    """Read ``X,Y,YAW_DEG``.

    Raises:
        typer.BadParameter: If these are not three numbers.
    """
    x, y, yaw_deg = _numbers(text, "X,Y,YAW_DEG", "--pose")
    return Pose2(x, y, math.radians(yaw_deg))


def _numbers(text: str, form: str, hint: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != form.count(",") + 1 or not all(map(math.isfinite, numbers)):
        raise typer.BadParameter(f"{text[:80]!r}, expected {form}", param_hint=hint)
    return numbers
