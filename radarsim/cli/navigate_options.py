"""What the options of ``radarsim navigate`` ask for, read and completed."""

import math
from dataclasses import dataclass
from typing import Final

import typer

from radarsim.cli.options import read_item_settings
from radarsim.cli.signals import exit_immediately_on_signals
from radarsim.client import DriveUnit
from radarsim.errors import PresetError
from radarsim.geometry import Pose2
from radarsim.host import Host
from radarsim.navigation.bug import Point
from radarsim.navigation.control import SpeedLimits
from radarsim.navigation.mission import Mission
from radarsim.navigation.options import Algorithm, GiveUp, PoseSource, Rule
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene, Trial
from radarsim.simulation.config import SimulationConfig

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
        settings = read_item_settings(self.settings)
        config = SimulationConfig(drive_unit=self.drive_unit, item_settings=settings)
        try:
            config.check()
        except PresetError as error:
            raise typer.BadParameter(str(error), param_hint="--set") from None
        with exit_immediately_on_signals():
            scene = load_map(self.map_)
            return Host(scene, config=config, seed=self.seed or 0)


POSITIVE: Final = (
    "safety_distance",
    "foliage_density",
    "penetration_power",
    "speed",
    "timeout",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveWish:
    """What robots that drive by themselves are told, unread.

    Attributes:
        start: Name of a start, or None.
        pose: ``X,Y,YAW_DEG``, or None.
        scanner: To steer by; None for the first.
        safety_distance: m, or None.
        foliage_density: Power per metre that the thinnest foliage takes, or None.
        penetration_power: Of the radar.
        speed: m/s at most.
        drive_unit: Of the server.
        timeout: s without a scan after which it gives up.
        time_limit: s of the server.
    """

    start: str | None
    pose: str | None
    scanner: str | None
    safety_distance: float | None
    foliage_density: float | None
    penetration_power: float
    speed: float
    drive_unit: DriveUnit
    timeout: float
    time_limit: float

    def check_numbers(self, *more: str) -> None:
        """Find numbers that cannot be, and two places to start from.

        Args:
            more: More attributes that are to be above 0.

        Raises:
            typer.BadParameter: If there are any.
        """
        for name in (*POSITIVE, *more):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                text = f"{value!r}, expected above 0 and finite"
                hint = "--" + name.replace("_", "-")
                raise typer.BadParameter(text, param_hint=hint)
        if not self.time_limit > 0:
            text = f"{self.time_limit!r}, expected above 0"
            raise typer.BadParameter(text, param_hint="--time-limit")
        if self.start is not None and self.pose is not None:
            raise typer.BadParameter("expected only one of --start and --pose")

    @property
    def penetration_depth(self) -> float:
        """How far a radar sees into the thinnest foliage, m; 0 if none is told of."""
        if self.foliage_density is None:
            return 0.0
        return self.penetration_power / self.foliage_density


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionWish(DriveWish):
    """What the robot is to do, unread; see ``Mission``.

    Attributes:
        goals: ``X,Y`` texts.
        robot: Its class.
        bumpers: How many; share, rule, side and give_up are texts of options as well.
    """

    algorithm: str
    goals: list[str]
    robot: str
    bumpers: int
    share: float
    rule: str
    side: str
    give_up: str
    pose_from: str

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
            penetration_depth=self.penetration_depth,
            bumpers=self.bumpers,
            share=self.share,
            rule=Rule(self.rule),
            wall_on_left=self.side == "left",
            give_up=GiveUp(self.give_up),
            pose_source=PoseSource(self.pose_from),
            speed_limits=SpeedLimits(speed=self.speed),
            time_limit=self.time_limit,
            timeout=self.timeout,
            drive_unit=self.drive_unit,
        )

    def _check(self) -> None:
        self.check_numbers()
        if not 0 < self.share <= 1:
            text = f"{self.share!r}, expected above 0 and at most 1"
            raise typer.BadParameter(text, param_hint="--share")

    def _goals(self, trial: Trial | None) -> tuple[Point, ...]:
        if self.goals:
            return tuple(read_place(text, "--goal") for text in self.goals)
        if trial is None:
            text = "nowhere to go, expected X,Y, or --serve with a map that has a trial"
            raise typer.BadParameter(text, param_hint="--goal")
        return (trial.goal,)

    def _start(self, scene: Scene | None) -> str | None:
        if scene is None or self.pose is not None:
            return self.start
        if self.start is None:
            return scene.trial.start if scene.trial else None
        check_start(self.start, scene)
        return self.start

    def _safety_distance(self, trial: Trial | None) -> float | None:
        if self.safety_distance is None and self.foliage_density is None and trial:
            return trial.safety_distance
        return self.safety_distance


def check_start(wanted: str | None, scene: Scene | None) -> None:
    """Find a start that the map, if it is known, does not have.

    Raises:
        typer.BadParameter: If it is one.
    """
    if scene is None or wanted is None or scene.start(wanted) is not None:
        return
    names = [start.name for start in scene.starts]
    text = f"{wanted[:80]!r}, expected one of {names}"
    raise typer.BadParameter(text, param_hint="--start")


def read_place(text: str, hint: str) -> Point:
    """Read ``X,Y``.

    Args:
        text: To be read.
        hint: The option that it is of.

    Raises:
        typer.BadParameter: If these are not two numbers.
    """
    x, y = _numbers(text, "X,Y", hint)
    return x, y


def read_pose(text: str, hint: str = "--pose") -> Pose2:
    """Read ``X,Y,YAW_DEG``.

    Args:
        text: To be read.
        hint: The option that it is of.

    Raises:
        typer.BadParameter: If these are not three numbers.
    """
    x, y, yaw_deg = _numbers(text, "X,Y,YAW_DEG", hint)
    return Pose2(x, y, math.radians(yaw_deg))


def _numbers(text: str, form: str, hint: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != form.count(",") + 1 or not all(map(math.isfinite, numbers)):
        raise typer.BadParameter(f"{text[:80]!r}, expected {form}", param_hint=hint)
    return numbers
