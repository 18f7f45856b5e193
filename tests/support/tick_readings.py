"""The reports of robots, not rounded; a simulation has only their numbers."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import RobotModel, load_robot
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import LineReport, SensorReport
from radarsim.protocol.reports import Status
from radarsim.scene.scene import Scene
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import Simulation
from radarsim.simulation.tick_output import TickOutput
from radarsim.simulation.vehicle import Vehicle


def status_of(output: TickOutput) -> Status | None:
    """Return the status; None when it is not due."""
    return next((r for r in _group_of(output) if isinstance(r, Status)), None)


def readings_of(output: TickOutput) -> list[LineReport]:
    """Return the readings of all items but scanners, poses first."""
    group = [report for report in _group_of(output) if not isinstance(report, Status)]
    return [*group, *output.cast]


def _group_of(output: TickOutput) -> list[LineReport]:
    numbers = iter(output.numbers)
    reports = [
        _filled(sample, numbers, output.group.dialect)
        for sample in output.group.samples
    ]
    assert not list(numbers)
    return reports


def _filled(
    sample: LineReport, numbers: Iterator[float], dialect: Dialect
) -> LineReport:
    """Return a report with the numbers that follow."""
    sources = sample.sources(dialect)
    changes: dict[str, Any] = {}
    if isinstance(sample, SensorReport) and "time" not in sources:
        changes["time"] = math.nan
    for name in sources:
        match getattr(sample, name):
            case bool():
                changes[name] = next(numbers) != 0
            case int():
                changes[name] = int(next(numbers))
            case float():
                changes[name] = next(numbers)
            case Pose2():
                changes[name] = Pose2(*islice(numbers, 3))
            case Pose3():
                changes[name] = Pose3(*islice(numbers, 6))
            case ((str(), _), *_) as ticks:
                changes[name] = tuple((key, int(next(numbers))) for key, _ in ticks)
            case values:
                changes[name] = tuple(islice(numbers, len(values)))
    made: LineReport = replace(sample, **changes)  # type: ignore[type-var]
    return made


def spawn(
    scene: Scene,
    pose: Pose2,
    model: RobotModel | str = "P3AT",
    config: SimulationConfig | None = None,
) -> tuple[Simulation, Vehicle]:
    """Return a simulation and a robot in it."""
    simulation = Simulation(scene, config=config)
    model = load_robot(model) if isinstance(model, str) else model
    vehicle = simulation.spawn("R", model, pose)
    assert vehicle is not None
    return simulation, vehicle


def read(simulation: Simulation, vehicle: Vehicle, ticks: int = 10) -> list[LineReport]:
    """Let time pass, and return the readings of a robot."""
    readings: list[LineReport] = []
    for _ in range(ticks):
        simulation.step()
        output = simulation.collect_reports().get(vehicle.number)
        readings += readings_of(output) if output else ()
    return readings
