"""Carry out what a client asks for, one line at a time."""

from collections.abc import Sequence
from typing import TypeAlias

from radarsim.errors import MalformedMessage, PresetError
from radarsim.geometry import Pose2
from radarsim.host.connection import Client, Diagnostic, malformed, unknown_fields
from radarsim.host.replies import configuration, geometry, matching
from radarsim.presets.robots import Item, RobotModel, load_robot, robot_names
from radarsim.protocol.commands import (
    Command,
    Drive,
    GetConf,
    GetGeo,
    GetStartPoses,
    Init,
    SetItem,
    Unsupported,
    parse_command,
    parse_pose,
    parse_switch,
)
from radarsim.protocol.reports import Report, StartPoses
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import Simulation
from radarsim.simulation.vehicle import Vehicle

RobotCommand: TypeAlias = Drive | GetGeo | GetConf | SetItem

LONGEST_NAME = 64  # characters of a robot's name; more are cut
SPAWN_TICKS = 10  # between two robots of one client: finding a free place is work
VAIN_SPAWN_TICKS = 100  # after one for which there was no place
SPAWNS_A_TICK = 4  # of all clients
OPCODES = ("SCAN", "RESET", "POSE", "ECHOES")


class CommandHandler:
    """Obeys clients.

    Attributes:
        simulation: Where their robots are.
    """

    def __init__(self, simulation: Simulation, config: SimulationConfig) -> None:
        self.simulation = simulation
        self._config = config
        self._spawns = (-1, 0)  # the last tick with any, and how many
        self._classes = {name.casefold(): name for name in robot_names()}

    def handle(self, client: Client, line: str) -> tuple[bool, Diagnostic | None]:
        """Carry out one line.

        Returns:
            False if it is too early for it and it is to be tried again; and what had
            no effect.
        """
        try:
            command = parse_command(line, self._config.dialect)
        except MalformedMessage as error:
            return True, malformed(line, error)
        if isinstance(command, Init) and self._is_too_early(client):
            return False, None
        return True, self._carry_out(client, command) or unknown_fields(line)

    def _is_too_early(self, client: Client) -> bool:
        # Sensors count from the spawn, so robots that come together would be read
        # together ever after, all in one tick of ten.
        now = self.simulation.ticks
        crowded = self._spawns == (now, SPAWNS_A_TICK)
        return crowded or now < client.next_spawn

    def dismiss(self, client: Client) -> None:
        """Take a client's robot off the floor, if it has one."""
        if client.vehicle is not None:
            self.simulation.remove(client.vehicle)
            client.vehicle = None

    def _carry_out(self, client: Client, command: Command) -> Diagnostic | None:
        match command:
            case GetStartPoses():
                starts = self.simulation.scene.starts
                poses = tuple((start.name, start.pose) for start in starts)
                client.answers.append(StartPoses(poses))
                return None
            case Init():
                return self._init(client, command)
            case Unsupported(verb):
                return Diagnostic(verb, f"{verb} does nothing here")
            case _:
                return self._order(client, command)

    def _order(self, client: Client, command: RobotCommand) -> Diagnostic | None:
        """Carry out what needs a robot that is alive."""
        vehicle = client.vehicle
        verb = type(command).__name__.removesuffix("Item").upper()
        if vehicle is None:
            text = f"{verb} without a robot, expected INIT"
            return Diagnostic(f"{verb} without robot", text)
        if not vehicle.alive:
            return Diagnostic(
                "battery", f"{verb} with an empty battery, expected nothing"
            )
        match command:
            case Drive():
                return _drive(vehicle, command)
            case GetGeo(kind, name):
                return _answer(client, kind, geometry(vehicle, kind, name))
            case GetConf(kind, name):
                found = configuration(vehicle, self._config, kind, name)
                return _answer(client, kind, found)
            case _:
                return _set(vehicle, command)

    def _init(self, client: Client, command: Init) -> Diagnostic | None:
        """Spawn a robot, in the place of the client's last one."""
        try:
            model = self._model(command.class_name)
        except PresetError as error:
            return Diagnostic("class", str(error))
        now, (last, count) = self.simulation.ticks, self._spawns
        self._spawns = (now, count + 1 if now == last else 1)
        client.next_spawn = now + SPAWN_TICKS
        wanted, doubt = self._wanted_pose(command)
        self.dismiss(client)
        name = (command.name or model.name)[:LONGEST_NAME]
        client.vehicle = self.simulation.spawn(name, model, wanted)
        place = f"({wanted.x:.2f}, {wanted.y:.2f})"
        if client.vehicle is None:
            self._spawns = (now, SPAWNS_A_TICK)
            client.next_spawn = now + VAIN_SPAWN_TICKS
            text = f"INIT at {place}, expected a free place within 1 m"
            return _joined(doubt, Diagnostic("no place", text))
        pose = client.vehicle.robot.pose
        if (pose.x, pose.y) != (wanted.x, wanted.y):
            self._spawns = (now, SPAWNS_A_TICK)  # a search is most of a tick's work
            moved = f"from {place} to ({pose.x:.2f}, {pose.y:.2f})"
            text = f"INIT moved {moved}, the nearest free place"
            return _joined(doubt, Diagnostic("moved", text))
        return doubt

    def _model(self, class_name: str) -> RobotModel:
        # by its own name: presets are remembered by the spelling that was asked for
        return load_robot(self._classes.get(class_name.casefold(), class_name))

    def _wanted_pose(self, command: Init) -> tuple[Pose2, Diagnostic | None]:
        """Find where a robot is to stand; an unknown start is the origin."""
        if command.start is not None:
            start = self.simulation.scene.start(command.start)
            if start is None:
                names = [start.name for start in self.simulation.scene.starts]
                text = f"start {command.start[:80]!r}, expected one of {names}"
                text += "; taken as the origin"
                return Pose2(0.0, 0.0), Diagnostic("start", text)
            return Pose2(start.pose.x, start.pose.y, start.pose.yaw), None
        x, y, _ = command.position or (0.0, 0.0, 0.0)
        _, _, yaw = command.rotation or (0.0, 0.0, 0.0)
        return Pose2(x, y, yaw), None


def _joined(first: Diagnostic | None, second: Diagnostic) -> Diagnostic:
    """Say two things at once, the cause before what came of it."""
    if first is None:
        return second
    return Diagnostic(f"{first.kind}, {second.kind}", f"{first.text}; {second.text}")


def _drive(vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    vehicle.robot.drive(
        command.left,
        command.right,
        normalized=command.normalized,
        light=command.light,
    )
    if (command.left is None) != (command.right is None):
        text = f"DRIVE of one side, expected Left and Right: {command}"
        return Diagnostic("one side", text)
    return None


def _answer(client: Client, kind: str, found: Report | None) -> Diagnostic | None:
    if found is None:
        return Diagnostic("no item", f"no item of type {kind[:80]!r} on this robot")
    client.answers.append(found)
    return None


def _set(vehicle: Vehicle, command: SetItem) -> Diagnostic | None:
    items = matching(vehicle, command.type, command.name)
    if not items:
        named = (
            command.type if command.name is None else f"{command.type} {command.name}"
        )
        return Diagnostic("no item", f"SET of {named[:80]!r}, which is not there")
    opcode = command.opcode.upper()
    if opcode not in OPCODES:
        text = f"opcode {command.opcode[:80]!r}, expected one of {list(OPCODES)}"
        return Diagnostic("opcode", text)
    try:
        return _order_items(vehicle, items, opcode, command.params)
    except MalformedMessage as error:
        return Diagnostic(f"malformed {opcode}", f"SET {opcode}: {error}")


def _order_items(
    vehicle: Vehicle, items: Sequence[Item], opcode: str, params: str
) -> Diagnostic | None:
    """Order items of one type.

    Raises:
        MalformedMessage: If the parameters are not those of the opcode.
    """
    match opcode:
        case "POSE":
            pose = parse_pose(params)
            for item in items:
                vehicle.set_ins(item, pose)
        case "ECHOES":
            if items[0].type != "RangeScanner":
                text = f"SET ECHOES of {items[0].type}, expected of RangeScanner"
                return Diagnostic("opcode", text)
            on = parse_switch(params)
            for item in items:
                vehicle.listen(item, on)
        case _:
            for item in items:
                vehicle.order(item, opcode)
    return None
