"""Executes the commands of clients, one line at a time.

Commands to items of a robot are in ``item_commands``, and commands of world controllers
in ``control_commands``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, TypeAlias

from radarsim.errors import MalformedMessage
from radarsim.protocol.commands import (
    TRACE_COLOURS,
    Act,
    Action,
    Command,
    Control,
    Drive,
    GetConf,
    GetGeo,
    GetStartPoses,
    Init,
    MovePackage,
    MultiDrive,
    OtherCommand,
    RobotCommand,
    SetItem,
    SetViewports,
    ShowCamera,
    Trace,
    Watch,
    parse_command,
)
from radarsim.protocol.packages import LinkOrder
from radarsim.protocol.reports import Report, StartPoses, WatchedLine, to_bytes
from radarsim.protocol.watch import CommandError
from radarsim.server.host.connection import Client, Diagnostic, join_diagnostics
from radarsim.server.host.control_commands import control
from radarsim.server.host.item_commands import (
    SETTING,
    describe_missing,
    move_links,
    robots_named,
    set_items,
    set_viewports,
    show_camera,
)
from radarsim.server.host.replies import (
    CAMERA,
    camera_configuration,
    configuration,
    geometry,
    items_reporting,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from radarsim.server.host.host import Host
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

Question: TypeAlias = GetGeo | GetConf
# Result of handling a line: whether the line is done (otherwise a later tick handles it
# again), a diagnostic or None if the command had its full effect, and the units of
# work.
Handled: TypeAlias = tuple[bool, Diagnostic | None, int]

# Units of work, about 20 us each: most commands take one unit; a spawn, a requested
# scan, and a reply that has to be computed take five. Long lines and orders to many
# links take more.
LIGHT_WORK: Final = 1
HEAVY_WORK: Final = 5
CRATE_WORK: Final = 2  # to add or remove a body
SETTING_WORK: Final = 50  # to prepare the rays of a scanner again
SUGGESTION_WORK: Final = 3  # to find a similar verb or key for an unknown one
CHARACTERS_A_UNIT: Final = 300
ROBOTS_A_UNIT: Final = 8  # robots to search or report per unit of work
CACHED_REPLIES: Final = 1000  # limited, as clients can use any spelling of names
LONGEST_TRACE: Final = 3600.0  # s between two marks of a trail


def handle(host: Host, client: Client, line: str) -> Handled:
    """Execute the command in a line of a client, or postpone it to a later tick."""
    reading = len(line) // CHARACTERS_A_UNIT
    dialect = host.config.dialect
    try:
        command, unknown = parse_command(line, dialect)
    except MalformedMessage as error:
        malformed = Diagnostic.of_malformed(line, error)
        # A zero after each character means that the client sends UTF-16. Only clients
        # under development make this mistake. They get an error line, which existing
        # clients would not understand.
        if malformed.kind == f"malformed {Watch.verb}" or line[1:4:2] == "\0\0":
            client.reply(CommandError(malformed.text), dialect)
        return True, malformed, LIGHT_WORK + SUGGESTION_WORK + reading
    # A postponed line stays first, and all later lines of its client wait behind it:
    # GETGEO often follows INIT in the same packet.
    if isinstance(command, Init) and host.spawner.is_too_early(client):
        return False, None, LIGHT_WORK + reading
    work = _work_of(host, client, command) + reading
    if isinstance(command, Init):
        is_done, diagnostic = host.spawner.spawn(client, command)
        if not is_done:
            return False, None, work
    else:
        diagnostic = _execute(host, client, command)
    if diagnostic is not None and _is_answered(command):
        client.reply(CommandError(diagnostic.text), dialect)
    if unknown:
        work += SUGGESTION_WORK
        others = Diagnostic.of_unknown_field(command, unknown[0])
        diagnostic = join_diagnostics(others, diagnostic)
    return True, diagnostic, work


def _execute(
    host: Host, client: Client, command: RobotCommand | OtherCommand
) -> Diagnostic | None:
    """Execute a command other than INIT; return None if it took full effect."""
    if type(command) in _TO_HOST:
        return _TO_HOST[type(command)](host, client, command)
    vehicle = _find_robot(client, command.verb)
    if isinstance(vehicle, Diagnostic):
        return vehicle
    return _TO_ROBOT[type(command)](host.simulation, vehicle, command)


def _find_robot(client: Client, verb: str) -> Vehicle | Diagnostic:
    """Return the robot of a client, or the reason why commands have no effect."""
    if client.vehicle is None:
        text = f"{verb} without a robot, expected INIT"
        return Diagnostic(f"{verb} without robot", text)
    if not client.vehicle.alive:
        text = f"{verb} to a robot with an empty battery has no effect"
        return Diagnostic("battery", text)
    return client.vehicle


def _work_of(host: Host, client: Client, command: Command) -> int:
    """Return how many units of work a command costs."""
    work = LIGHT_WORK
    among_robots = HEAVY_WORK + len(host.spawner.clients_by_robot) // ROBOTS_A_UNIT
    match command:
        case Init() | SetViewports():
            work = HEAVY_WORK
        case MovePackage() | MultiDrive():
            work = HEAVY_WORK + len(command.orders) // 2
        case SetItem():
            work = SETTING_WORK if _changes_settings(command) else HEAVY_WORK
        case GetGeo(robot=str()) | GetConf(robot=str()) | ShowCamera() | Watch():
            work = among_robots
        case GetStartPoses() | GetGeo() | GetConf():
            # At the start, many clients ask for every item at once. A cached reply is
            # light work, so that it does not use up the limit of a tick.
            is_known = _reply_key(host, client, command) in host.known_replies
            work = LIGHT_WORK if is_known else HEAVY_WORK
        case Control():
            is_of_all = command.action in (Action.GET_STATE, Action.KILL_ALL)
            crates = len(host.simulation.crates) if is_of_all else 2
            work = among_robots + CRATE_WORK * crates
        case _:
            pass
    return work


def _is_answered(command: Command) -> bool:
    """Return whether a client gets an error line if the command has no effect.

    The reason is sent only for commands that radarsim has added to the protocol,
    because other clients do not know such answers.
    """
    match command:
        case Watch() | GetGeo(robot=str()) | GetConf(robot=str()):
            return True
        case _:
            return isinstance(command, SetItem) and _changes_settings(command)


def _changes_settings(command: SetItem) -> bool:
    return command.opcode.upper() == SETTING


def _drive(_: Simulation, vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    """Execute a drive command; each type of robot uses different fields."""
    if command.value is not None and command.joint is not None:
        order = LinkOrder(command.joint, None, command.value, command.order)
        return move_links(vehicle, command.verb, [order])
    left, right = command.left, command.right
    normalized, light = command.normalized, command.light
    vehicle.robot.drive(left, right, normalized=normalized, light=light)
    if vehicle.model.flight is not None:
        return _fly(vehicle, command)
    return _roll(vehicle, command)


def _roll(vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    """Steer a car; return a diagnostic if fields for wheeled robots are missing."""
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
    # Only angles are checked, because one client stops any robot by sending zero speeds
    # for all types of vehicles, but no angles.
    if steers:
        text = f"DRIVE with FrontSteer of {vehicle.model.name}, which is skid-steered"
        return Diagnostic("steering", f"{text}, expected Left and Right")
    return None


def _fly(vehicle: Vehicle, command: Drive) -> Diagnostic | None:
    """Set the speeds of a flying robot; return a diagnostic for a car's fields."""
    speeds = command.linear, command.lateral, command.altitude, command.rotational
    vehicle.robot.fly(*speeds, normalized=bool(command.normalized))
    others = command.speed, command.front_steer, command.rear_steer
    if speeds.count(None) == len(speeds) and others.count(None) < len(others):
        text = f"DRIVE with Speed of {vehicle.model.name}, which flies, expected"
        return Diagnostic("no speed", f"{text} AltitudeVelocity and LinearVelocity")
    return None


def _move(
    _: Simulation, vehicle: Vehicle, command: MovePackage | MultiDrive
) -> Diagnostic | None:
    return move_links(vehicle, command.verb, command.orders)


def _trace(simulation: Simulation, vehicle: Vehicle, command: Trace) -> None:
    """Begin or end the trail of a robot."""
    interval = round(100 * min(max(command.interval, 0.01), LONGEST_TRACE))
    if command.is_on:
        colour = TRACE_COLOURS[command.colour]
        simulation.trails.begin(vehicle.robot, interval, colour)
    else:
        simulation.trails.end(vehicle.robot)


def _send_starts(host: Host, client: Client, question: GetStartPoses) -> None:
    """Reply with the start poses."""
    key = _reply_key(host, client, question)
    if key not in host.known_replies:
        starts = host.scene.starts
        poses = StartPoses(tuple((start.name, start.pose) for start in starts))
        host.known_replies[key] = to_bytes([poses.encode(host.config.dialect)])
    client.replies.append(host.known_replies[key])


def _answer(host: Host, client: Client, question: Question) -> Diagnostic | None:
    """Reply to a question; equal replies for all robots of a class are cached."""
    if question.robot is not None:
        return _answer_of_others(host, client, question)
    vehicle = _find_robot(client, question.verb)
    if isinstance(vehicle, Diagnostic):
        return vehicle
    key = _reply_key(host, client, question)
    line = host.known_replies.get(key)
    if line is None:
        report = _describe(vehicle, question)
        if isinstance(report, Diagnostic):
            return report
        # The cache is cleared as a whole, because tracking the order of use would cost
        # more than building a few replies again.
        line = to_bytes([report.encode(host.config.dialect)])
        if len(host.known_replies) >= CACHED_REPLIES:
            host.known_replies.clear()
        if key:
            host.known_replies[key] = line
    client.replies.append(line)
    return None


def _answer_of_others(
    host: Host, client: Client, question: Question
) -> Diagnostic | None:
    """Reply to a question about the robots of all clients that have a given name."""
    name = question.robot or ""
    named = robots_named(host.simulation, name)
    if not named:
        text = f"{question.verb} of robot {name[:80]!r}, which is not there"
        return Diagnostic("no robot", text)
    for vehicle in named:
        report = _describe(vehicle, question)
        if isinstance(report, Diagnostic):
            return report
        line = report.encode(host.config.dialect)
        host.watchers.tell(client, WatchedLine(vehicle.robot.name, line, report))
    return None


def _reply_key(
    host: Host, client: Client, question: Question | GetStartPoses
) -> tuple[str | None, ...]:
    """Return the cache key of a reply; empty if the reply must not be cached."""
    if isinstance(question, GetStartPoses):
        return (question.verb,)
    vehicle = client.vehicle
    # Replies are not cached for robots with changed settings, nor for cameras, because
    # the zoom of a camera and its region in pictures can change.
    if vehicle is None or vehicle.config is not host.simulation.config:
        return ()
    if isinstance(question, GetConf) and question.type.casefold() == CAMERA.lower():
        return ()
    return question.verb, vehicle.model.name, question.type, question.name


def _describe(vehicle: Vehicle, question: Question) -> Report | Diagnostic:
    """Return the report that a question requests, or the reason if there is none."""
    item_type, name = question.type, question.name
    if isinstance(question, GetGeo):
        report = geometry(vehicle.model, item_type, name)
    elif item_type.casefold() == CAMERA.lower():
        report = camera_configuration(vehicle, item_type, name)
    else:
        report = configuration(vehicle.model, vehicle.config, item_type, name)
    if report is not None:
        return report
    of_type = items_reporting(vehicle.model, item_type)
    return describe_missing(vehicle, question, of_type)


# Functions that execute commands to the host, and commands to a robot. They return a
# diagnostic, or None if the command had its full effect.
_TO_HOST: Final[dict[type, Callable[[Host, Client, Any], Diagnostic | None]]] = {
    GetStartPoses: _send_starts,
    GetGeo: _answer,
    GetConf: _answer,
    Watch: lambda host, client, command: host.watchers.watch(client, command),
    Control: lambda host, client, command: control(host.simulation, client, command),
    ShowCamera: lambda host, _, command: show_camera(host.simulation, command),
}
_TO_ROBOT: Final[
    dict[type, Callable[[Simulation, Vehicle, Any], Diagnostic | None]]
] = {
    Drive: _drive,
    **dict.fromkeys((MovePackage, Act, MultiDrive), _move),
    Trace: _trace,
    SetViewports: lambda _, vehicle, command: set_viewports(vehicle, command),
    SetItem: set_items,
}
