"""Execute the commands of clients, one line at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

from radarsim.errors import MalformedMessage, list_names
from radarsim.protocol.commands import (
    Act,
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
)
from radarsim.protocol.control import CONTROLLER, Action, Control
from radarsim.protocol.reports import Report, StartPoses, WatchedLine, to_bytes
from radarsim.protocol.watch import CommandError, Watch
from radarsim.server.host.connection import Client, Diagnostic, join_diagnostics
from radarsim.server.host.control_commands import control
from radarsim.server.host.replies import (
    CAMERA,
    camera_configuration,
    configuration,
    geometry,
    items_reporting,
)
from radarsim.server.host.robot_commands import (
    SETTING,
    describe_missing,
    drive,
    move_links,
    robots_named,
    set_items,
    set_viewports,
    show_camera,
    trace,
)
from radarsim.server.host.watchers import MAX_WATCHERS, Watchers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from radarsim.server.host.spawning import Spawner
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

Question: TypeAlias = GetGeo | GetConf
# What comes of a line: whether it is done, or has to be handled again in a later tick;
# None if the command had its full effect; units of work that it took.
Handled: TypeAlias = tuple[bool, Diagnostic | None, int]

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
CACHED_REPLIES: Final = 1000  # a client can ask for types and names in any spelling


class CommandHandler:
    """Executes commands; what each type of them does is in ``COMMAND_TABLE``.

    Attributes:
        spawner: Spawns the robots of clients.
        watchers: The clients that watch robots.
        simulation: The simulation that commands act on.
    """

    def __init__(self, spawner: Spawner, watchers: Watchers) -> None:
        self.spawner, self.watchers = spawner, watchers
        self.simulation = spawner.simulation
        self._dialect = self.simulation.config.dialect
        self._replies: dict[tuple[str | None, ...], bytes] = {}

    def handle(self, client: Client, line: str) -> Handled:
        """Execute the command in a line."""
        reading = len(line) // CHARACTERS_A_UNIT
        try:
            parsed = parse_command(line, self._dialect)
        except MalformedMessage as error:
            malformed = Diagnostic.of_malformed(line, error)
            # A line in UTF-16, of a client of today that needs to be told.
            if malformed.kind == f"malformed {Watch.verb}" or line[1:4:2] == "\0\0":
                self.reply(client, CommandError(malformed.text))
            return True, malformed, LIGHT_WORK + SUGGESTION_WORK + reading
        command = parsed.command
        # The line stays where it is and all later ones of this client wait behind it:
        # GETGEO often follows INIT in the same packet.
        if isinstance(command, Init) and self.spawner.is_too_early(client):
            return False, None, LIGHT_WORK + reading
        row = COMMAND_TABLE[type(command)]
        work = row.work(self, client, command) + reading
        if isinstance(command, Init):
            is_done, diagnostic = self.spawner.spawn(client, command)
            if not is_done:
                return False, None, work
        else:
            diagnostic = row.execute(self, client, command)
        if diagnostic is not None and row.is_answered(command):
            self.reply(client, CommandError(diagnostic.text))
        if parsed.unsupported_keys:
            fields = list_names(parsed.unsupported_keys)
            unsupported = Diagnostic.of_unsupported(command.verb, f" with {fields}")
            diagnostic = join_diagnostics(unsupported, diagnostic)
        if parsed.unknown_keys:
            work += SUGGESTION_WORK
            unknown = Diagnostic.of_unknown_fields(parsed)
            diagnostic = join_diagnostics(unknown, diagnostic)
        return True, diagnostic, work

    def reply(self, client: Client, report: Report) -> None:
        """Add a reply to those that a client gets next."""
        client.replies.append(to_bytes([report.encode(self._dialect)]))

    def tell_starts(self, client: Client, question: GetStartPoses) -> None:
        """Reply with the start poses."""
        key = (question.verb,)
        if key not in self._replies:
            starts = self.simulation.scene.starts
            poses = StartPoses(tuple((start.name, start.pose) for start in starts))
            self._replies[key] = to_bytes([poses.encode(self._dialect)])
        client.replies.append(self._replies[key])

    def describe(self, client: Client, question: Question) -> Diagnostic | None:
        """Reply to a question; what is the same for all robots is encoded once."""
        if question.robot is not None:
            return self._describe_others(question.robot, client, question)
        vehicle = find_robot(client, question.verb)
        if isinstance(vehicle, Diagnostic):
            return vehicle
        key = self.reply_key(client, question)
        line = self._replies.get(key)
        if line is None:
            report = _describe(vehicle, question)
            if isinstance(report, Diagnostic):
                return report
            # Cleared as a whole: an order of use would cost more than the few replies
            # that have to be built again.
            line = to_bytes([report.encode(self._dialect)])
            if len(self._replies) >= CACHED_REPLIES:
                self._replies.clear()
            if key:
                self._replies[key] = line
        client.replies.append(line)
        return None

    def _describe_others(
        self, robot: str, client: Client, question: Question
    ) -> Diagnostic | None:
        """Reply to a question about the robots of a name, which others may drive."""
        named = robots_named(self.simulation, robot)
        if not named:
            text = f"{question.verb} of robot {robot[:80]!r}, which is not there"
            return Diagnostic("no robot", text)
        for vehicle in named:
            report = _describe(vehicle, question)
            if isinstance(report, Diagnostic):
                return report
            line = report.encode(self._dialect)
            self.watchers.tell(client, WatchedLine(vehicle.robot.name, line, report))
        return None

    def reply_key(
        self, client: Client, question: Question | GetStartPoses
    ) -> tuple[str | None, ...]:
        """Return what a reply depends on; nothing if it is not kept."""
        if isinstance(question, GetStartPoses):
            return (question.verb,)
        vehicle = client.vehicle
        # A robot may have settings of its own. Cameras are zoomed, and change their
        # places in pictures.
        if vehicle is None or vehicle.config is not self.simulation.config:
            return ()
        if isinstance(question, GetConf) and question.type.casefold() == CAMERA.lower():
            return ()
        return question.verb, vehicle.model.name, question.type, question.name

    def is_known(self, client: Client, question: Question | GetStartPoses) -> bool:
        """Return whether the reply to a question has been encoded before."""
        return self.reply_key(client, question) in self._replies

    def watch(self, client: Client, command: Watch) -> Diagnostic | None:
        """Let a client watch robots."""
        if command.robots.names != () and not self.watchers.takes(client):
            text = f"WATCH of one watcher more, expected at most {MAX_WATCHERS}"
            return Diagnostic("watchers", text)
        self.watchers.watch(client, command)
        return None

    def control(self, client: Client, command: Control) -> Diagnostic | None:
        """Create, move, remove or list crates."""
        if not client.controls:
            expected = f"expected INIT of {CONTROLLER}"
            text = f"CONTROL by a client that is no controller, {expected}"
            return Diagnostic("no controller", text)
        states, problem = control(self.simulation, command, client.number)
        if states is not None:
            self.reply(client, states)
        return problem


def _describe(vehicle: Vehicle, question: Question) -> Report | Diagnostic:
    """Return what a question asks about a robot, or why it does not have that."""
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


def find_robot(client: Client, verb: str) -> Vehicle | Diagnostic:
    """Return the robot of a client, or why it executes no commands."""
    if client.vehicle is None:
        text = f"{verb} without a robot, expected INIT"
        return Diagnostic(f"{verb} without robot", text)
    if not client.vehicle.alive:
        text = f"{verb} with an empty battery, expected nothing"
        return Diagnostic("battery", text)
    return client.vehicle


Execute: TypeAlias = "Callable[[CommandHandler, Client, Any], Diagnostic | None]"
Work: TypeAlias = "Callable[[CommandHandler, Client, Any], int]"


def _on_robot(
    act: Callable[[Simulation, Vehicle, Any], Diagnostic | None],
) -> Execute:
    """Return what executes a command that needs a robot."""

    def execute(
        handler: CommandHandler, client: Client, command: Command
    ) -> Diagnostic | None:
        vehicle = find_robot(client, command.verb)
        if isinstance(vehicle, Diagnostic):
            return vehicle
        return act(handler.simulation, vehicle, command)

    return execute


def _light(*_: object) -> int:
    return LIGHT_WORK


def _heavy(*_: object) -> int:
    return HEAVY_WORK


def _link_work(_: object, __: object, command: MovePackage | MultiDrive) -> int:
    return HEAVY_WORK + len(command.orders) // 2


def _set_work(_: object, __: object, command: SetItem) -> int:
    return SETTING_WORK if _changes_settings(command) else HEAVY_WORK


def _work_among_robots(handler: CommandHandler, *_: object) -> int:
    return HEAVY_WORK + len(handler.spawner.clients_by_robot) // ROBOTS_A_UNIT


def _control_work(handler: CommandHandler, _: object, command: Control) -> int:
    is_of_all = command.action in (Action.GET_STATE, Action.KILL_ALL)
    crates = len(handler.simulation.crates) if is_of_all else 2
    return _work_among_robots(handler) + CRATE_WORK * crates


def _question_work(
    handler: CommandHandler, client: Client, question: Question | GetStartPoses
) -> int:
    if not isinstance(question, GetStartPoses) and question.robot is not None:
        return _work_among_robots(handler)
    # Clients ask for every item at the start, many of them at once: what is known
    # already must not use up the work of a tick.
    return LIGHT_WORK if handler.is_known(client, question) else HEAVY_WORK


def _changes_settings(command: SetItem) -> bool:
    return command.opcode.upper() == SETTING


class Row(NamedTuple):
    """How a type of commands is handled.

    Attributes:
        execute: Executes a command.
        work: Returns the units of work that a command takes.
        is_answered: Returns whether a client is told why a command had no effect. Only
            clients of radarsim are: to all others an answer would be unknown.
    """

    execute: Execute
    work: Work = _light
    is_answered: Callable[[Any], bool] = lambda _: False


COMMAND_TABLE: Final[Mapping[type[Command], Row]] = {
    Init: Row(lambda *_: None, _heavy),  # by the spawner, in several ticks
    Drive: Row(_on_robot(drive)),
    MovePackage: Row(_on_robot(move_links), _link_work),
    Act: Row(_on_robot(move_links), _link_work),
    MultiDrive: Row(_on_robot(move_links), _link_work),
    Trace: Row(_on_robot(trace)),
    SetViewports: Row(_on_robot(set_viewports), _heavy),
    SetItem: Row(_on_robot(set_items), _set_work, _changes_settings),
    GetStartPoses: Row(CommandHandler.tell_starts, _question_work),
    GetGeo: Row(CommandHandler.describe, _question_work, lambda q: q.robot is not None),
    GetConf: Row(
        CommandHandler.describe, _question_work, lambda q: q.robot is not None
    ),
    ShowCamera: Row(
        lambda handler, _, command: show_camera(handler.simulation, command),
        _work_among_robots,
    ),
    Control: Row(CommandHandler.control, _control_work),
    Watch: Row(CommandHandler.watch, _work_among_robots, lambda _: True),
    Unsupported: Row(lambda _, __, command: Diagnostic.of_unsupported(command.verb)),
}
