"""Execute the commands of clients, one line at a time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from radarsim.errors import MalformedMessage, PresetError, expected_one_of, list_names
from radarsim.geometry import Pose2
from radarsim.presets.sensors import parse_settings
from radarsim.protocol.commands import (
    TRACE_COLOURS,
    UNSUPPORTED_TYPES,
    Command,
    Drive,
    GetConf,
    GetGeo,
    GetStartPoses,
    Init,
    MovePackage,
    MultiDrive,
    SetItem,
    SetViewports,
    ShowCamera,
    Trace,
    Unsupported,
    parse_command,
    parse_pose,
    parse_switch,
)
from radarsim.protocol.control import CONTROLLER, Action, Control
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import LARGEST_COMMANDED, parse_number
from radarsim.protocol.packages import LinkOrder
from radarsim.protocol.reports import Report, StartPoses, WatchedLine, to_bytes
from radarsim.protocol.watch import CommandError, Watch
from radarsim.scene.scene import Scene
from radarsim.server.host.camera_commands import set_viewports, show_camera
from radarsim.server.host.connection import Client, Diagnostic, join_diagnostics
from radarsim.server.host.control_commands import control
from radarsim.server.host.replies import (
    CAMERA,
    camera_configuration,
    configuration,
    find_items,
    geometry,
    items_reporting,
)
from radarsim.server.host.watchers import MAX_WATCHERS, Watchers
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence

    from radarsim.presets.robots import Item, RobotModel
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

RobotCommand: TypeAlias = (
    Drive | MovePackage | MultiDrive | GetGeo | GetConf | SetItem | SetViewports | Trace
)
# All but INIT, which may need several ticks.
ImmediateCommand: TypeAlias = (
    RobotCommand | GetStartPoses | Watch | ShowCamera | Control | Unsupported
)
Question: TypeAlias = GetStartPoses | GetGeo | GetConf
ReplyKey: TypeAlias = tuple[str | None, ...] | None

MAX_NAME_LENGTH = 64  # characters of a robot's name; longer ones are cut
SPAWN_COOLDOWN = 10  # ticks between two robots of one client: a free place costs work
FAILED_SPAWN_COOLDOWN = 100  # ticks after a spawn for which there was no free place
SPAWNS_PER_TICK = 4  # of all clients
# Ticks without a spawn, for all clients, after a search for a free place.
SEARCH_COOLDOWN = 3  # the requested place was occupied
FAILED_SEARCH_COOLDOWN = 10  # and no other was free

# Units of work, about 20 us each: most commands take one; a spawn, a scan that is asked
# for, and a reply that has to be computed take five. Reading a long line takes more,
# and so do orders to many links.
LIGHT_WORK: Final = 1
HEAVY_WORK: Final = 5
CRATE_WORK: Final = 2  # a body comes or goes
SETTING_WORK: Final = 50  # the rays of a scanner have to be prepared anew
SUGGESTION_WORK: Final = 3  # for a verb or a key that is not known
CHARACTERS_A_UNIT: Final = 300
ROBOTS_A_UNIT: Final = 8  # that a watcher may have to be told of
SETTING: Final = "SETTING"
SCANNER_OPCODES: Final = ("ECHOES", "TARGETS", SETTING)
CAMERA_OPCODES: Final = ("ZOOM", "FOV")
OPCODES: Final = ("SCAN", "RESET", "POSE", *SCANNER_OPCODES, *CAMERA_OPCODES)
# Of all searches for a free place in a tick: 2 ms by ``Obstacles.search_free_pose``.
SEARCH_WORK: Final = 400_000
START_WORK: Final = 60_000  # to find out whether a start is free
LONGEST_TRACE: Final = 3600.0  # s between two marks of a trail
MAX_PROBLEMS: Final = 800  # characters; a client can have many settings wrong
CACHED_REPLIES: Final = 1000  # a client can ask for types and names in any spelling


class Handled(NamedTuple):
    """Result of handling one line.

    Attributes:
        done: False if the line has to be handled again in a later tick.
        diagnostic: None if the command had its full effect.
        work: Units of work that it took.
    """

    done: bool
    diagnostic: Diagnostic | None = None
    work: int = LIGHT_WORK


class CommandHandler:
    """Executes commands.

    Attributes:
        has_begun: Whether there is a simulation to act on. Before, INIT waits for it.
        clients_by_robot: The client of each robot, by the robot's number.
        spawn_queue: Numbers of the clients whose INIT waits for its turn, the first
            come first; the first one keeps its turn while its place is looked for.
    """

    def __init__(
        self, scene: Scene, config: SimulationConfig, watchers: Watchers
    ) -> None:
        self.has_begun = False
        self._scene = scene
        self._simulation: Simulation | None = None
        self.clients_by_robot: dict[int, Client] = {}
        self._config = config
        self._watchers = watchers
        self._last_spawn = -1  # the last tick with a spawn
        self._spawn_count = 0  # of that tick
        self._next_spawn = 0  # the first tick that may have one
        self._search_work = SEARCH_WORK  # that is left in this tick
        self.spawn_queue: dict[int, None] = {}
        self._classes = {name.casefold(): name for name in config.robot_names()}
        self._reply_lines: dict[ReplyKey, bytes] = {}

    @property
    def simulation(self) -> Simulation:
        """The simulation that the commands act on, once it has begun."""
        assert self._simulation is not None
        return self._simulation

    def begin(self, simulation: Simulation) -> None:
        """Let robots be spawned in a simulation."""
        self._simulation = simulation
        self.has_begun = True

    def begin_tick(self) -> None:
        """Let searches for a free place go on; what they exceeded counts."""
        self._search_work = min(self._search_work, 0) + SEARCH_WORK

    def handle(self, client: Client, line: str) -> Handled:
        """Execute the command in a line."""
        reading = len(line) // CHARACTERS_A_UNIT
        try:
            parsed = parse_command(line, self._config.dialect)
        except MalformedMessage as error:
            malformed = Diagnostic.of_malformed(line, error)
            # A line in UTF-16, of a client of today that needs to be told.
            if malformed.kind == f"malformed {Watch.verb}" or line[1:4:2] == "\0\0":
                self._answer_error(client, malformed)
            return Handled(True, malformed, LIGHT_WORK + SUGGESTION_WORK + reading)
        command = parsed.command
        # The line stays where it is and all later ones of this client wait behind it:
        # GETGEO often follows INIT in the same packet.
        if isinstance(command, Init) and self._is_too_early(client):
            return Handled(False, work=LIGHT_WORK + reading)
        work = self._work_of(client, command) + reading
        if isinstance(command, Init):
            is_done, diagnostic = self._go_on_spawning(client, command)
            if not is_done:
                return Handled(False, work=work)
        else:
            diagnostic = self._execute(client, command)
        match command:
            # No old client sends these; to all others an answer would be unknown.
            case Watch() | GetGeo(robot=str()) | GetConf(robot=str()):
                is_answered = True
            case SetItem():
                is_answered = command.opcode.upper() == SETTING
            case _:
                is_answered = False
        if diagnostic is not None and is_answered:
            self._answer_error(client, diagnostic)
        if parsed.unsupported_keys:
            fields = list_names(parsed.unsupported_keys)
            unsupported = Diagnostic.of_unsupported(command.verb, f" with {fields}")
            diagnostic = join_diagnostics(unsupported, diagnostic)
        if parsed.unknown_keys:
            work += SUGGESTION_WORK
            unknown = Diagnostic.of_unknown_fields(parsed)
            diagnostic = join_diagnostics(unknown, diagnostic)
        return Handled(True, diagnostic, work)

    def remove(self, client: Client) -> None:
        """Remove a client, and its robot if it has one."""
        self.spawn_queue.pop(client.number, None)
        client.spawning = None
        self._despawn(client)

    def _despawn(self, client: Client) -> None:
        if client.controls:
            self.simulation.crates.remove_owned(client.number)
            client.controls = False
        if client.vehicle is not None:
            self.simulation.remove(client.vehicle)
            self._watchers.remove_robot(client.vehicle)
            del self.clients_by_robot[client.vehicle.number]
            client.vehicle = None

    def _work_of(self, client: Client, command: Command) -> int:
        match command:
            case SetItem() if command.opcode.upper() == SETTING:
                return SETTING_WORK
            case Init() | SetItem() | SetViewports():
                return HEAVY_WORK
            case MovePackage(orders=orders) | MultiDrive(orders=orders):
                return HEAVY_WORK + len(orders) // 2
            case (
                Watch()
                | ShowCamera()
                | Control()
                | GetGeo(robot=str())
                | GetConf(robot=str())
            ):
                return self._work_among_robots(command)
            # Clients ask for every item at the start, many of them at once: what is
            # known already must not use up the work of a tick.
            case GetGeo() | GetConf() | GetStartPoses():
                known = self._reply_key(client.vehicle, command) in self._reply_lines
                return LIGHT_WORK if known else HEAVY_WORK
            case _:
                return LIGHT_WORK

    def _work_among_robots(self, command: Command) -> int:
        work = HEAVY_WORK + len(self.clients_by_robot) // ROBOTS_A_UNIT
        if not isinstance(command, Control) or self._simulation is None:
            return work
        is_of_all = command.action in (Action.GET_STATE, Action.KILL_ALL)
        return work + CRATE_WORK * (len(self._simulation.crates) if is_of_all else 2)

    def _is_too_early(self, client: Client) -> bool:
        # The intervals of sensors start at the spawn: robots of one tick would be due
        # together for ever, and all their scans would fall into the same ticks.
        if not self.has_begun:
            return True
        if client.spawning is not None:
            return False
        now = self.simulation.ticks
        if now < client.next_spawn:
            return True
        # Nobody goes first who comes later: a flood would leave no tick to the others.
        self.spawn_queue.setdefault(client.number)
        is_first = next(iter(self.spawn_queue)) == client.number
        full = self._last_spawn == now and self._spawn_count >= SPAWNS_PER_TICK
        return full or now < self._next_spawn or not is_first

    def _go_on_spawning(
        self, client: Client, command: Init
    ) -> tuple[bool, Diagnostic | None]:
        """Spawn a robot; return whether that is done, and its diagnostic."""
        if client.spawning is None:
            client.spawning = self._init(client, command)
        elif self._search_work <= 0:
            return False, None
        try:
            while True:
                self._search_work -= next(client.spawning)
                if self._search_work <= 0:
                    return False, None
        except StopIteration as end:
            client.spawning = None
            del self.spawn_queue[client.number]
            diagnostic: Diagnostic | None = end.value
            return True, diagnostic

    def _execute(self, client: Client, command: ImmediateCommand) -> Diagnostic | None:
        match command:
            case GetStartPoses():
                return self._reply(client, command)
            case Watch() | ShowCamera() | Control():
                return self._execute_without_robot(client, command)
            case GetGeo(robot=str(robot)) | GetConf(robot=str(robot)):
                return self._reply_about(robot, client, command)
            case Unsupported(verb):
                return Diagnostic.of_unsupported(verb)
            case _:
                return self._execute_on_robot(client, command)

    def _execute_on_robot(
        self, client: Client, command: RobotCommand
    ) -> Diagnostic | None:
        verb, vehicle = command.verb, client.vehicle
        if vehicle is None:
            text = f"{verb} without a robot, expected INIT"
            return Diagnostic(f"{verb} without robot", text)
        if not vehicle.alive:
            text = f"{verb} with an empty battery, expected nothing"
            return Diagnostic("battery", text)
        match command:
            case Drive():
                return _drive(vehicle, command)
            case MovePackage() | MultiDrive():
                return _move_links(vehicle, command.verb, command.orders)
            case SetItem() | SetViewports() | Trace():
                return self._set(vehicle, command)
            case _:
                return self._reply(client, command)

    def _trace(self, vehicle: Vehicle, command: Trace) -> None:
        interval = round(100 * min(max(command.interval, 0.01), LONGEST_TRACE))
        colour = TRACE_COLOURS[command.colour]
        if command.is_on:
            self.simulation.trails.begin(vehicle.robot, interval, colour)
        else:
            self.simulation.trails.end(vehicle.robot)

    def _control(self, client: Client, command: Control) -> Diagnostic | None:
        if not client.controls:
            expected = f"expected INIT of {CONTROLLER}"
            text = f"CONTROL by a client that is no controller, {expected}"
            return Diagnostic("no controller", text)
        states, problem = control(self.simulation, command, client.number)
        if states is not None:
            client.replies.append(to_bytes([states.encode(self._config.dialect)]))
        return problem

    def _set(
        self, vehicle: Vehicle, command: SetItem | SetViewports | Trace
    ) -> Diagnostic | None:
        if isinstance(command, Trace):
            self._trace(vehicle, command)
            return None
        if isinstance(command, SetViewports):
            return set_viewports(vehicle, command)
        if command.type == "Joint":  # as the original, in this case only
            return _set_joint(vehicle, command)
        return self._set_items(vehicle, command)

    def _set_items(self, vehicle: Vehicle, command: SetItem) -> Diagnostic | None:
        """Apply an opcode to items, which have the same type."""
        items = find_items(vehicle.model, command.type, command.name)
        if not items:
            of_type = vehicle.model.items_of(command.type)
            return _describe_missing(vehicle.model, command, of_type)
        opcode, params = command.opcode.upper(), command.params
        if opcode not in OPCODES:
            text = f"opcode {expected_one_of(command.opcode, OPCODES)}"
            return Diagnostic("opcode", text)
        kinds = (SCANNER_OPCODES, "RangeScanner"), (CAMERA_OPCODES, CAMERA)
        for opcodes, kind in kinds:
            if opcode in opcodes and items[0].type != kind:
                text = f"SET {opcode} of type {items[0].type!r}, expected {kind}"
                return Diagnostic("opcode", text)
        try:
            if opcode == SETTING:
                others = [each.vehicle for each in self.clients_by_robot.values()]
                settings = parse_settings(params)
                vehicle.change_settings(items, settings, filter(None, others))
            else:
                _apply_opcode(vehicle, items, opcode, params)
        except (MalformedMessage, PresetError) as error:
            problems = "; ".join(str(error).splitlines())[:MAX_PROBLEMS]
            return Diagnostic(f"malformed {opcode}", f"SET {opcode}: {problems}")
        return None

    def _execute_without_robot(
        self, client: Client, command: Watch | ShowCamera | Control
    ) -> Diagnostic | None:
        """Watch robots, show a camera to viewers of pictures, or move crates."""
        if isinstance(command, Control):
            return self._control(client, command)
        if isinstance(command, ShowCamera):
            robots = [c.vehicle for c in self.clients_by_robot.values() if c.vehicle]
            return show_camera(self._simulation, robots, command)
        if command.robots.names != () and not self._watchers.takes(client):
            text = f"WATCH of one watcher more, expected at most {MAX_WATCHERS}"
            return Diagnostic("watchers", text)
        self._watchers.watch(client, command)
        return None

    def _reply_about(
        self, robot: str, client: Client, question: GetGeo | GetConf
    ) -> Diagnostic | None:
        """Reply to a question about the robots of a name, of which others may drive."""
        name = printable_name(robot).casefold()
        vehicles = [c.vehicle for c in self.clients_by_robot.values() if c.vehicle]
        named = [v for v in vehicles if printable_name(v.robot.name).casefold() == name]
        if not named:
            text = f"{question.verb} of robot {robot[:80]!r}, which is not there"
            return Diagnostic("no robot", text)
        # Robots whose names differ only in characters that no line can have all
        # answer.
        for vehicle in named:
            report = self._report(vehicle, question)
            if report is None:
                of_type = items_reporting(vehicle.model, question.type)
                return _describe_missing(vehicle.model, question, of_type)
            line = report.encode(self._config.dialect)
            copy = WatchedLine(vehicle.robot.name, line, report)
            self._watchers.tell(client, copy)
        return None

    def _answer_error(self, client: Client, diagnostic: Diagnostic) -> None:
        """Tell a client that a command had no effect; no old client sends such ones."""
        report = CommandError(diagnostic.text)
        client.replies.append(to_bytes([report.encode(self._config.dialect)]))

    def _reply(self, client: Client, question: Question) -> Diagnostic | None:
        """Reply to a question; what is the same for all robots is encoded once."""
        key = self._reply_key(client.vehicle, question)
        line = self._reply_lines.get(key)
        if line is None:
            report = self._report(client.vehicle, question)
            if report is None:
                assert client.vehicle is not None
                assert not isinstance(question, GetStartPoses)
                model = client.vehicle.model
                of_type = items_reporting(model, question.type)
                return _describe_missing(model, question, of_type)
            # Cleared as a whole: an order of use would cost more than the few replies
            # that have to be built again.
            line = to_bytes([report.encode(self._config.dialect)])
            if len(self._reply_lines) >= CACHED_REPLIES:
                self._reply_lines.clear()
            if key is not None:
                self._reply_lines[key] = line
        client.replies.append(line)
        return None

    def _reply_key(self, vehicle: Vehicle | None, question: Question) -> ReplyKey:
        """Return what a reply depends on; None if the robot has settings of its own."""
        if vehicle is not None and vehicle.config is not self._config:
            return None
        # Cameras are zoomed, and change their places in pictures.
        if isinstance(question, GetConf) and question.type.casefold() == CAMERA.lower():
            return None
        if vehicle is None or isinstance(question, GetStartPoses):
            return (question.verb,)
        return question.verb, vehicle.model.name, question.type, question.name

    def _report(self, vehicle: Vehicle | None, question: Question) -> Report | None:
        if vehicle is None or isinstance(question, GetStartPoses):
            starts = self._scene.starts
            return StartPoses(tuple((start.name, start.pose) for start in starts))
        item_type, name = question.type, question.name
        if isinstance(question, GetGeo):
            return geometry(vehicle.model, item_type, name)
        if item_type.casefold() == CAMERA.lower():
            return camera_configuration(vehicle, item_type, name)
        return configuration(vehicle.model, vehicle.config, item_type, name)

    def _init(
        self, client: Client, command: Init
    ) -> Generator[int, None, Diagnostic | None]:
        """Spawn a robot, which replaces the client's previous one.

        Yields:
            The work of the next step of the search for a free place.
        """
        if command.class_name.casefold() == CONTROLLER.casefold():
            self._despawn(client)
            client.controls = True
            return None
        # Presets are cached by the requested spelling, of which clients have many.
        class_name = self._classes.get(command.class_name.casefold())
        try:
            model = self._config.robot(class_name or command.class_name)
            self._config.check_scanners(model)
        except PresetError as error:
            return Diagnostic("class", str(error))
        now = self.simulation.ticks
        self._spawn_count = self._spawn_count + 1 if self._last_spawn == now else 1
        self._last_spawn = now
        client.next_spawn = now + SPAWN_COOLDOWN
        # First, so that the old robot does not occupy the place of the new one.
        self._despawn(client)
        requested, diagnostic = yield from self._requested_pose(command, model)
        z = -math.inf if command.position is None else command.position[2]
        name = (command.name or model.name)[:MAX_NAME_LENGTH]
        vehicle = client.vehicle = yield from self.simulation.spawn_stepwise(
            name, model, requested, z
        )
        now = self.simulation.ticks
        place = f"({requested.x:.2f}, {requested.y:.2f})"
        if vehicle is None:
            client.next_spawn = now + FAILED_SPAWN_COOLDOWN
            self._next_spawn = now + FAILED_SEARCH_COOLDOWN
            in_way = self.simulation.hindrances(model, requested)
            where = f"{place} in {list_names(in_way)}" if in_way else place
            text = f"INIT at {where}, expected a free place within 1 m"
            text += ", or another start"
            return join_diagnostics(diagnostic, Diagnostic("no place", text))
        vehicle.address = client.address
        self.clients_by_robot[vehicle.number] = client
        self._watchers.add_robot(vehicle)
        pose = vehicle.robot.pose
        if (pose.x, pose.y) != (requested.x, requested.y):
            moved = f"from {place} to ({pose.x:.2f}, {pose.y:.2f})"
            text = f"INIT moved {moved}, the nearest free place"
            self._next_spawn = now + SEARCH_COOLDOWN
            return join_diagnostics(diagnostic, Diagnostic("moved", text))
        (x_min, y_min), (x_max, y_max) = self._scene.bounds[:, :2].tolist()
        is_inside = x_min <= pose.x <= x_max and y_min <= pose.y <= y_max
        if is_inside or not self._scene.triangles:
            return diagnostic
        text = f"INIT at {place}, which is outside the map:"
        text += f" x from {x_min:.2f} to {x_max:.2f} m, y from {y_min:.2f} to"
        outside = Diagnostic("outside", f"{text} {y_max:.2f} m")
        return join_diagnostics(diagnostic, outside)

    def _requested_pose(
        self, command: Init, model: RobotModel
    ) -> Generator[int, None, tuple[Pose2, Diagnostic | None]]:
        """Return the requested pose; the origin for an unknown start.

        Yields:
            The work of looking at the next start.
        """
        if command.takes_free:
            for each in self._scene.starts:
                pose = Pose2(each.pose.x, each.pose.y, each.pose.yaw)
                if not self.simulation.hindrances(model, pose):
                    return pose, None
                yield START_WORK
        if command.start is None:
            x, y, _ = command.position or (0.0, 0.0, 0.0)
            _, _, yaw = command.rotation or (0.0, 0.0, 0.0)
            return Pose2(x, y, yaw), None
        start = self._scene.start(command.start)
        if start is not None:
            return Pose2(start.pose.x, start.pose.y, start.pose.yaw), None
        names = [start.name for start in self._scene.starts]
        text = f"start {expected_one_of(command.start, names)}; taken as the origin"
        return Pose2(0.0, 0.0), Diagnostic("start", text)


def _describe_missing(
    model: RobotModel, command: GetGeo | GetConf | SetItem, of_type: Sequence[Item]
) -> Diagnostic:
    """Describe why a robot does not have what a command is about.

    Args:
        model: The class of the robot.
        command: The command.
        of_type: The items of the command's type.
    """
    item_type, name = command.type, command.name
    for unsupported in UNSUPPORTED_TYPES:
        if unsupported.casefold() == item_type.casefold():
            return Diagnostic.of_unsupported(unsupported)
    if name is not None and of_type:
        expected = expected_one_of(name, [item.name for item in of_type])
        text = f"{command.verb} of {of_type[0].type} {expected}"
        return Diagnostic("item name", text)
    types: list[str] = [*dict.fromkeys(item.type for item in model.items)]
    if not isinstance(command, SetItem):
        types = ["Robot", *types, "Echoes", "RadarTargets"]
    text = f"{command.verb} of type {expected_one_of(item_type, types)}"
    return Diagnostic("item type", text)


def _move_links(
    vehicle: Vehicle, verb: str, orders: Sequence[LinkOrder]
) -> Diagnostic | None:
    """Move those links that the robot has."""
    missing = [
        order.name if order.link is None else f"{order.name} {order.link}"
        for order in orders
        if not vehicle.move_link(order)
    ]
    if not missing:
        return None
    model = vehicle.model
    packages = model.items_of("MisPkg")
    if not packages:
        return Diagnostic.of_unsupported(verb)
    known = [f"{item.name} 1 to {len(item.links)}" for item in packages]
    known += [link.name for item in packages for link in item.links if link.name]
    text = f"{verb} of {list_names(missing)[:80]}, which {model.name} does not have"
    return Diagnostic("link", f"{text}, expected one of {known}")


def _set_joint(vehicle: Vehicle, command: SetItem) -> Diagnostic | None:
    """Turn a link to an angle."""
    if command.opcode not in ("Angle", "Target"):
        text = f"opcode {expected_one_of(command.opcode, ['Angle', 'Target'])}"
        return Diagnostic("opcode", text)
    try:
        angle = parse_number(command.params, largest=LARGEST_COMMANDED)
    except MalformedMessage as error:
        return Diagnostic("malformed Angle", f"SET {command.opcode}: {error}")
    order = LinkOrder(command.name or "", None, angle)
    return _move_links(vehicle, SetItem.verb, [order])


def _drive(vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    """Drive a robot, as far as the command has what its drive needs."""
    if command.value is not None and command.joint is not None:
        order = LinkOrder(command.joint, None, command.value, command.order)
        return _move_links(vehicle, command.verb, [order])
    left, right = command.left, command.right
    normalized, light = command.normalized, command.light
    vehicle.robot.drive(left, right, normalized=normalized, light=light)
    if vehicle.model.flight is not None:
        return _fly(vehicle, command)
    return _roll(vehicle, command)


def _roll(vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    """Steer a car, or tell what a robot on wheels misses in a command."""
    robot, is_car = vehicle.robot, vehicle.robot.bicycle is not None
    left, right = command.left, command.right
    if is_car and command.speed is not None:
        robot.steer(command.speed, command.front_steer, command.rear_steer)
        return None
    steers = (command.front_steer, command.rear_steer) != (None, None)
    sides = (left is not None) + (right is not None)
    if is_car and (steers or sides):
        text = f"DRIVE of {vehicle.model.name} without Speed, expected Speed"
        return Diagnostic("no speed", f"{text}, FrontSteer and RearSteer")
    if sides == 1:
        missing = "Left" if left is None else "Right"
        text = f"DRIVE without {missing}, expected Left and Right"
        return Diagnostic("one side", f"{text}, or none of them")
    # A client stops any robot with all speeds of all vehicles, but without angles.
    if steers:
        text = f"DRIVE with FrontSteer of {vehicle.model.name}, which is skid-steered"
        return Diagnostic("steering", f"{text}, expected Left and Right")
    return None


def _fly(vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    """Fly a robot, which also takes the speeds of two sides, as if it had wheels."""
    speeds = command.linear, command.lateral, command.altitude, command.rotational
    vehicle.robot.fly(*speeds, normalized=bool(command.normalized))
    others = command.speed, command.front_steer, command.rear_steer
    if speeds.count(None) == len(speeds) and others.count(None) < len(others):
        text = f"DRIVE with Speed of {vehicle.model.name}, which flies, expected"
        return Diagnostic("no speed", f"{text} AltitudeVelocity and LinearVelocity")
    return None


def _apply_opcode(
    vehicle: Vehicle, items: Sequence[Item], opcode: str, params: str
) -> None:
    """Apply an opcode other than ``SETTING`` to items.

    Raises:
        MalformedMessage: If the parameters are not those of the opcode.
    """
    if opcode == "POSE":
        pose = parse_pose(params)
        for item in items:
            vehicle.set_ins(item, pose)
    elif opcode in CAMERA_OPCODES:
        angle = parse_number(params, largest=LARGEST_COMMANDED) if params else 0.0
        for item in items:  # whole degrees, as the original has them
            vehicle.zoom(item, math.trunc(math.degrees(angle)))
    elif opcode in SCANNER_OPCODES:
        enabled = parse_switch(params)
        for scanner in vehicle.scanners:
            if scanner.item in items and opcode == "ECHOES":
                scanner.sends_echoes = enabled
            elif scanner.item in items:
                scanner.sends_targets = enabled
    else:
        act = vehicle.request_scan if opcode == "SCAN" else vehicle.reset
        for item in items:
            act(item)
