"""What the options of ``radarsim map`` ask for, read and completed."""

from dataclasses import dataclass
from typing import Final

import typer

from radarsim.cli.navigate_options import (
    DriveWish,
    check_start,
    read_place,
    read_pose,
)
from radarsim.exploration.exploration import ExplorationPlan
from radarsim.exploration.options import StrategyName
from radarsim.geometry import Pose3
from radarsim.mapping.slam import MotionSource
from radarsim.navigation.control import SpeedLimits
from radarsim.navigation.options import ROBOT
from radarsim.proxy.connection_state import ScannerDefaults
from radarsim.scene.scene import Scene

FINEST: Final = 0.005  # m; a room would have millions of cells


@dataclass(frozen=True, slots=True, kw_only=True)
class MapWish(DriveWish):
    """What is to be mapped, unread; see ``ExplorationPlan``.

    Attributes:
        strategy: None for the one that chooses, or a way.
        way: ``X,Y`` texts of places to drive to instead.
        through: A port at which another client finds the server, or None.
        seed: Of what is left to chance, or None.
        robot: None for the usual one.
        mount: ``X,Y,YAW_DEG`` of a scanner that is only overheard, or None.
        max_range: Of such a one, m, or None.
    """

    strategy: str | None
    way: list[str]
    through: int | None
    seed: int | None
    robot: str | None
    seed_from: MotionSource
    echoes: bool
    radius: float
    resolution: float
    mount: str | None
    max_range: float | None

    def check(self) -> None:
        """Find numbers that cannot be, and options that do not go together.

        Raises:
            typer.BadParameter: If there are any.
        """
        self.check_numbers("radius", "max_range")
        if not FINEST <= self.resolution <= 1:
            text = f"{self.resolution!r}, expected {FINEST:g} to 1"
            raise typer.BadParameter(text, param_hint="--resolution")
        if self.strategy is not None and self.way:
            raise typer.BadParameter("expected only one of --strategy and --way")
        self._check_through()

    def check_seed(self, *, served: bool) -> None:
        """Find a seed of nothing.

        Raises:
            typer.BadParameter: If there is no simulation and no chance.
        """
        by_chance = served or self.strategy == StrategyName.TURN_AWAY
        if self.seed is not None and not by_chance:
            text = "expected --serve or --strategy turn_away with it"
            raise typer.BadParameter(text, param_hint="--seed")

    def read(self, scene: Scene | None) -> ExplorationPlan:
        """Read the texts, and check the start by the map if that is known.

        Raises:
            typer.BadParameter: If something is wrong.
        """
        check_start(self.start, scene)
        return ExplorationPlan(
            strategy=StrategyName(self.strategy or "auto"),
            waypoints=tuple(read_place(text, "--way") for text in self.way),
            motion_source=self.seed_from,
            echoes=self.echoes,
            resolution=self.resolution,
            robot_class=self.robot or ROBOT,
            start=self.start,
            pose=None if self.pose is None else read_pose(self.pose),
            scanner=self.scanner,
            safety_distance=self.safety_distance,
            penetration_depth=self.penetration_depth,
            speed_limits=SpeedLimits(speed=self.speed),
            radius=self.radius,
            time_limit=self.time_limit,
            timeout=self.timeout,
            drive_unit=self.drive_unit,
        )

    def given(self) -> ScannerDefaults:
        """Give what is known of a scanner that is only overheard.

        Raises:
            typer.BadParameter: If the mount is no pose.
        """
        if self.mount is None:
            return ScannerDefaults(None, self.max_range)
        pose = read_pose(self.mount, "--mount")
        return ScannerDefaults(Pose3(pose.x, pose.y, 0.0, yaw=pose.yaw), self.max_range)

    def _check_through(self) -> None:
        if self.through is None:
            if self.mount is not None or self.max_range is not None:
                text = "expected --through with it, where another client drives"
                hint = "--max-range" if self.mount is None else "--mount"
                raise typer.BadParameter(text, param_hint=hint)
            return
        for hint, value in (
            ("--strategy", self.strategy),
            ("--way", self.way or None),
            ("--start", self.start),
            ("--pose", self.pose),
            ("--robot", self.robot),
            ("--safety-distance", self.safety_distance),
            ("--foliage-density", self.foliage_density),
        ):
            if value is not None:
                text = "expected no --through with it, where another client drives"
                raise typer.BadParameter(text, param_hint=hint)
