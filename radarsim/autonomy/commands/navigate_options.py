"""The options of ``radarsim navigate``, and the mission that they ask for."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.addons.recording.run_recording import RecordOption
from radarsim.autonomy.navigation.algorithms import (
    ROBOT,
    Algorithm,
    GiveUp,
    PoseSource,
    Rule,
)
from radarsim.cli.options import (
    DriveUnit,
    DriveUnitOption,
    FilmOption,
    FilmSpeedOption,
    HostOption,
    JsonOption,
    PortOption,
    PoseOption,
    PowerOption,
    SafetyOption,
    ServedSeedOption,
    ServedSettingsOption,
    StartOption,
    TimeLimitOption,
    TimeoutOption,
    check_positive,
    check_robot,
    check_start,
    penetration_depth,
    read_point,
    read_pose,
)

if TYPE_CHECKING:
    from radarsim.autonomy.navigation.mission import Mission
    from radarsim.scene.scene import Trial
    from radarsim.server.host import Host


class Side(StrEnum):
    """Side of the robot on which boundaries are followed."""

    LEFT = "left"
    RIGHT = "right"


def _check_share(value: float) -> float:
    if not 0 < value <= 1:
        raise typer.BadParameter(f"{value!r}, expected above 0 and at most 1")
    return value


AlgorithmOption = Annotated[
    Algorithm, typer.Option(help="How to get around obstacles.")
]
GoalsOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="X,Y",
        help="Goal in m, map frame; repeat it for waypoints to reach in turn.",
    ),
]
RobotOption = Annotated[
    str, typer.Option(help="Class of the robot; it has to see all the way round.")
]
ScannerOption = Annotated[
    str | None, typer.Option(help="Scanner to steer by; the first by default.")
]
DensityOption = Annotated[
    float | None,
    typer.Option(
        metavar="PER_M",
        callback=check_positive,
        help="Density of the thinnest foliage that the robot may meet, for servers"
        " that send no echoes: the radar sees into it.",
    ),
]
BumpersOption = Annotated[int, typer.Option(min=4, max=36, help="Number of bumpers.")]
ShareOption = Annotated[
    float,
    typer.Option(
        callback=_check_share, help="Share of a bumper's beams that press it."
    ),
]
RuleOption = Annotated[
    Rule,
    typer.Option(
        help="A bumper is pressed if a share of its beams is near, or if all are in"
        " the band; 'thesis' also follows boundaries by bumpers alone."
    ),
]
SideOption = Annotated[
    Side, typer.Option(help="Side on which the robot keeps boundaries.")
]
GiveUpOption = Annotated[
    GiveUp, typer.Option(help="Where Bug2 decides that there is no path.")
]
PoseSourceOption = Annotated[
    PoseSource, typer.Option(help="Sensor from which the pose is read.")
]
EchoesOption = Annotated[
    bool,
    typer.Option(
        help="Ask the server for the echoes of each beam, or use ranges alone."
    ),
]
SpeedOption = Annotated[
    float,
    typer.Option(
        metavar="M_PER_S",
        callback=check_positive,
        help="Maximum speed; the robot's own limit holds as well.",
    ),
]
TraceOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write a CSV file with a row for each scan."),
]
PlotOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Draw the run into a .png, .svg or .pdf."),
]
ServeOption = Annotated[
    str | None,
    typer.Option(
        metavar="MAP",
        help="Simulate this map here, as fast as possible, instead of connecting to"
        " a server; its trial provides start, goal and safety distance where no"
        " option does.",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigateOptions:
    """The options, by their names on the command line."""

    algorithm: AlgorithmOption
    goal: GoalsOption = None
    host: HostOption = None
    port: PortOption = None
    start: StartOption = None
    pose: PoseOption = None
    robot: RobotOption = ROBOT
    scanner: ScannerOption = None
    safety_distance: SafetyOption = None
    foliage_density: DensityOption = None
    penetration_power: PowerOption = 1.0
    bumpers: BumpersOption = 8
    share: ShareOption = 0.1
    rule: RuleOption = Rule.SHARE
    side: SideOption = Side.LEFT
    give_up: GiveUpOption = GiveUp.HIT_POINT
    pose_from: PoseSourceOption = PoseSource.INS
    echoes: EchoesOption = True
    speed: SpeedOption = 0.3
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S
    timeout: TimeoutOption = 2.0
    time_limit: TimeLimitOption = 3600.0
    as_json: JsonOption = False
    trace: TraceOption = None
    plot: PlotOption = None
    serve: ServeOption = None
    seed: ServedSeedOption = None
    settings: ServedSettingsOption = None
    record: RecordOption = None
    film: FilmOption = None
    film_speed: FilmSpeedOption = 6.0

    def mission(self, served: Host | None) -> Mission:
        """Return the mission; the map's trial provides what the options leave open.

        Args:
            served: The simulation in this process; None for another server.

        Raises:
            typer.BadParameter: If robot, start or goal are wrong.
        """
        from radarsim.autonomy.navigation.control import SpeedLimits
        from radarsim.autonomy.navigation.mission import Mission

        scene = None if served is None else served.simulation.scene
        trial = None if scene is None else scene.trial
        check_robot(self.robot, served)
        check_start(self.start, self.pose, scene)
        return Mission(
            algorithm=self.algorithm,
            goals=self._goals(trial),
            robot_class=self.robot,
            start=self._start(trial),
            pose=None if self.pose is None else read_pose(self.pose, "--pose"),
            scanner=self.scanner,
            safety_distance=self._safety_distance(trial),
            penetration_depth=penetration_depth(
                self.foliage_density, self.penetration_power
            ),
            bumpers=self.bumpers,
            share=self.share,
            rule=self.rule,
            wall_on_left=self.side is Side.LEFT,
            give_up=self.give_up,
            pose_source=self.pose_from,
            echoes=self.echoes,
            speed_limits=SpeedLimits(speed=self.speed),
            time_limit=self.time_limit,
            timeout=self.timeout,
            drive_unit=self.drive_unit.value,
        )

    def _start(self, trial: Trial | None) -> str | None:
        is_given = self.start is not None or self.pose is not None
        return self.start if is_given or trial is None else trial.start

    def _safety_distance(self, trial: Trial | None) -> float | None:
        is_given = self.safety_distance is not None or self.foliage_density is not None
        return (
            self.safety_distance if is_given or trial is None else trial.safety_distance
        )

    def _goals(self, trial: Trial | None) -> tuple[tuple[float, float], ...]:
        if self.goal:
            return tuple(read_point(text, "--goal") for text in self.goal)
        if trial is not None:
            return (trial.goal,)
        text = "nowhere to go, expected X,Y, or --serve with a map that has a trial"
        if self.serve is not None:
            text = f"nowhere to go, expected X,Y: the map {self.serve!r} has no trial"
        raise typer.BadParameter(text, param_hint="--goal")
