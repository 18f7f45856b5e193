"""The items of a robot that give readings without casting rays.

What they read is computed for all robots together: an item has instructions for that,
and numbers in the row of its robot. Scanners, sonars and GPS are not among them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.geometry import Pose3
from radarsim.presets.robots import Item
from radarsim.protocol.periodic_reports import ReportForm
from radarsim.protocol.reports import (
    Encoder,
    GroundTruth,
    Ins,
    Odometry,
    Tachometer,
    Touch,
)
from radarsim.robots.robot import Robot
from radarsim.sensors.motion_readings import (
    ANGLE_ZERO,
    DRAWN,
    INS_DRAWS,
    INS_USED,
    TICK_ZERO,
    USED,
    InsNoise,
    draw_drift,
    draw_errors,
    encoded_wheels,
    new_encoder,
    new_ins,
    new_tachometer,
    overwrite_ins,
)
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.reading_kernel import (
    BODY_POSE,
    DRIFT,
    INS_POSE,
    IS_TOUCHED,
    MEASURE,
    TICKS,
    TIME,
    WHEEL_ANGLE,
    WHEEL_POSE,
    WHEEL_SPEED,
)
from radarsim.simulation.reading_table import (
    Instruction,
    NumberRow,
    instruction,
)


@dataclass(frozen=True, slots=True)
class Mounting:
    """What a sensor item is created from.

    Attributes:
        item: The item of the robot's class.
        robot: The robot that carries it.
        numbers: The numbers of the robot.
        rng: The item's own random numbers.
        config: Configuration of the simulation.
        time: Time of the spawn, s.
    """

    item: Item
    robot: Robot
    numbers: NumberRow
    rng: np.random.Generator
    config: SimulationConfig
    time: float


class SensorItem:
    """An item whose readings follow from the numbers of its robot.

    Attributes:
        name: Name of the item.
        robot: The robot that carries it.
        form: Its report without numbers.
        instructions: What writes the numbers of its report after the time.
    """

    form: ReportForm
    instructions: Sequence[Instruction]

    def __init__(self, mounting: Mounting) -> None:
        self.name = mounting.item.name
        self.robot = mounting.robot
        self._numbers = mounting.numbers
        self._rng = mounting.rng

    def reset(self) -> None:
        """Start counting again, if it counts."""

    def draw(self) -> None:
        """Draw random numbers, if it needs some and they are used up."""


class GroundTruthItem(SensorItem):
    """Reads the true pose of the robot's body."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self.form = ReportForm(GroundTruth, self.name)
        self.instructions = [instruction(BODY_POSE)]


class TouchItem(SensorItem):
    """Reads whether something touches the robot."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self.form = ReportForm(Touch, self.name)
        self.instructions = [instruction(IS_TOUCHED)]


class InsItem(SensorItem):
    """Reads the drifting pose of an inertial navigation system.

    Attributes:
        drifting: The instruction that lets it drift; due every ``INS_DRIFT_INTERVAL``.
    """

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        body = self.robot.body
        sensor = body.compose(mounting.item.mount)
        noise = InsNoise.from_settings(mounting.config.settings(mounting.item))
        self._places = self._numbers.add(new_ins(sensor, body, noise, self._rng))
        self.form = ReportForm(Ins, self.name)
        self.instructions = [instruction(INS_POSE, self._places.start)]
        self.drifting = instruction(DRIFT, self._places.start)

    def draw(self) -> None:
        """Draw random numbers for the drift, if they are used up."""
        ins = self._numbers[self._places]
        if ins[INS_USED] >= len(ins) - INS_DRAWS:
            draw_drift(ins, self._rng)

    def overwrite(self, pose: Pose3) -> None:
        """Replace the estimated pose."""
        overwrite_ins(self._numbers[self._places], pose, self.robot.body)


class OdometryItem(SensorItem):
    """Reads the pose that follows from the turns of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._odometry = self.robot.fleet.add_odometry(self.robot)
        places = self._numbers.add([self._odometry.row])
        self.form = ReportForm(Odometry, self.name)
        self.instructions = [instruction(WHEEL_POSE, places.start)]

    def reset(self) -> None:
        """Start again from a pose of zeros."""
        self._odometry.reset()


class TachometerItem(SensorItem):
    """Reads speeds and angles of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        start = new_tachometer(mounting.time, *self.robot.side_angles)
        self._places = self._numbers.add(start)
        place = self._places.start
        sides = [int(side == "right") for side in self.robot.model.wheels]
        self.form = ReportForm(Tachometer, (self.name, len(sides), len(sides)))
        self.instructions = [
            instruction(MEASURE, place),
            *[instruction(WHEEL_SPEED, place, side) for side in sides],
            *[instruction(WHEEL_ANGLE, place, side) for side in sides],
        ]

    def reset(self) -> None:
        """Count angles from zero again."""
        zero = slice(ANGLE_ZERO, ANGLE_ZERO + 2)
        self._numbers[self._places][zero] = self.robot.side_angles


class EncoderItem(SensorItem):
    """Reads ticks of the wheels that are in the item's name."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        model = self.robot.model
        wheels = encoded_wheels(self.name, model.wheels)
        start = new_encoder(len(wheels), *self.robot.side_angles, self._rng)
        self._places = self._numbers.add(start)
        names = tuple(wheel.name for wheel in wheels)
        self.form = ReportForm(Encoder, names)
        self.instructions = []
        for wheel in wheels:
            side = int(model.wheels[wheel.index] == "right")
            self.instructions.append(
                instruction(TICKS, self._places.start, side, wheel.sign)
            )

    def reset(self) -> None:
        """Count ticks from zero again."""
        zero = slice(TICK_ZERO, TICK_ZERO + 2)
        self._numbers[self._places][zero] = self.robot.side_angles

    def draw(self) -> None:
        """Draw random numbers for the errors, if they are used up."""
        encoder = self._numbers[self._places]
        if encoder[USED] >= encoder[DRAWN]:
            draw_errors(encoder, self._rng)


def join_reports(
    items: Sequence[SensorItem], *, joins_encoders: bool
) -> tuple[list[ReportForm], list[Instruction]]:
    """Return the reports of items without their numbers, and what writes the numbers.

    Args:
        items: Items that are due, in the order of readings.
        joins_encoders: Whether there is one report of all encoders.
    """
    forms: list[ReportForm] = []
    instructions: list[Instruction] = []
    for item in items:
        form, before = item.form, forms[-1] if forms else None
        if joins_encoders and before and before.report is form.report is Encoder:
            forms[-1] = form._replace(fixed=(*before.fixed, *form.fixed))
        else:
            forms.append(form)
            instructions.append(instruction(TIME))
        instructions += item.instructions
    return forms, instructions


# By item type, in the order of readings within a tick: clients expect a pose before the
# scan that belongs to it.
SENSOR_ITEMS: dict[str, Callable[[Mounting], SensorItem]] = {
    "GroundTruth": GroundTruthItem,
    "INS": InsItem,
    "Odometry": OdometryItem,
    "Tachometer": TachometerItem,
    "Encoder": EncoderItem,
    "Touch": TouchItem,
}
