"""What a client says and what it waits for, without the waiting itself.

Theory of operation
===================
Every method is a generator: a talk. It yields bytes to be sent, or a number of seconds
to wait for bytes at most, and is sent what came (nothing after a send). Whoever runs it
throws ``TimeoutError`` or ``ConnectionError`` into it where its link raised that; what
comes out is a ``ClientError`` that says what was missing. So a client that blocks and
one that awaits are a few lines each, and say the same.
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, TypeAlias, TypeVar

from radarsim.client import session as asking
from radarsim.client.robot_info import (
    RobotInfo,
    ScannerDescriptions,
)
from radarsim.client.session import (
    RANGE_SCANNER,
    ROBOT,
    Question,
    Session,
    check_timeout,
)
from radarsim.errors import ClientError, ClientTimeout
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import (
    Greeting,
    Report,
    RobotConf,
    RobotGeo,
    StartPoses,
)

PATIENCE: Final = (
    2.0  # s for what many servers do not tell, and a client can do without
)

Value = TypeVar("Value")
AnyReport = TypeVar("AnyReport", bound=Report)
Step: TypeAlias = bytes | float
Exchange: TypeAlias = Generator[Step, bytes, Value]


@dataclass(frozen=True, slots=True)
class Wait:
    """How long to wait for something.

    Attributes:
        what: Is waited for.
        timeout: s, from when it began.
        until: The time of the link at which it ends, s.
    """

    what: str
    timeout: float
    until: float


class Requests:
    """Talks with one server.

    Attributes:
        session: What it has said.
        timeout: Longest wait where a talk is told no other, s.
        has_robot: Whether a robot was asked for.
    """

    def __init__(self, clock: Callable[[], float], *, timeout: float) -> None:
        """Begin.

        Args:
            clock: Gives the time of the link, s.
            timeout: s.

        Raises:
            ValueError: If that is not above 0.
        """
        check_timeout(timeout)
        self.session = Session()
        self.timeout = timeout
        self.has_robot = False
        self._clock = clock
        self._pending: list[Report] = []

    def greeting(self) -> Exchange[Greeting]:
        """Give the greeting, whenever it came."""
        if self.session.greeting is None:
            yield from self._ask(asking.greeting(), Greeting)
        assert self.session.greeting is not None
        return self.session.greeting

    def start_poses(self) -> Exchange[dict[str, Pose3]]:
        """Ask for the start poses of the map."""
        answer = yield from self._ask(asking.start_poses(), StartPoses)
        return dict(answer.poses)

    def spawn(
        self,
        class_name: str,
        name: str | None,
        start: str | None,
        pose: Pose2 | Pose3 | None,
    ) -> Exchange[None]:
        """Ask for a robot, and wait until it says something, which is kept."""
        question = asking.spawn(class_name, name=name, start=start, pose=pose)
        self.has_robot = True
        self._pending.clear()
        self.session.scans.clear()  # another robot's
        first = yield from self.ask(question)
        self._pending.insert(0, first)

    def ask(self, question: Question, timeout: float | None = None) -> Exchange[Report]:
        """Ask, and give the answer; readings that come before it are skipped."""
        wait = self._wait(question.what, timeout)
        if question.data:
            yield from self.send(question.data)
        return (yield from self._skip(question.accepts, wait))

    def robot_info(self, drive_unit: DriveUnit) -> Exchange[RobotInfo]:
        """Ask for all that is known of the robot and its scanners."""
        geo = yield from self._ask(asking.geometry(ROBOT), RobotGeo)
        conf = yield from self._ask(asking.configuration(ROBOT), RobotConf)
        told = ScannerDescriptions()
        yield from self._describe_scanners(told, None)
        for name in told.incomplete(self.session.scans):
            yield from self._describe_scanners(told, name)
        names = told.names(self.session.scans)
        yield from self._see(names)
        scanners = told.scanners(self.session.scans)
        return RobotInfo.from_reports(geo, conf, scanners, drive_unit)

    def send(self, data: bytes) -> Exchange[None]:
        """Say something that is not answered."""
        try:
            yield data
        except ConnectionError as error:
            said = data.decode("latin-1").strip()
            text = f"{error}, expected to send {said[:80]!r}"
            raise ClientError(f"{text}, {self._came()}") from None

    def read(self, timeout: float | None) -> Exchange[list[Report]]:
        """Give the next reports, at least one."""
        wait = self._wait("report", timeout)
        return (yield from self._more(wait))

    def wait_for(
        self, kind: type[AnyReport], name: str | None, timeout: float | None
    ) -> Exchange[AnyReport]:
        """Skip reports up to one of a kind, and of an item of that name if given."""

        def accepts(report: Report) -> bool:
            if not isinstance(report, kind):
                return False
            return name is None or getattr(report, "name", None) == name

        what = kind.__name__ if name is None else f"{kind.__name__} of {name!r}"
        return (yield from self._ask(Question(b"", what, accepts), kind, timeout))

    def _ask(
        self, question: Question, kind: type[AnyReport], timeout: float | None = None
    ) -> Exchange[AnyReport]:
        answer = yield from self.ask(question, timeout)
        assert isinstance(answer, kind)
        return answer

    def _describe_scanners(
        self, told: ScannerDescriptions, name: str | None
    ) -> Exchange[None]:
        """Ask for place and settings of one scanner or all; some servers are silent."""
        where, what = (
            asking.geometry(RANGE_SCANNER, name),
            asking.configuration(RANGE_SCANNER, name),
        )
        missing = [where, what]

        def complete(report: Report) -> bool:
            for question in missing:
                if question.accepts(report):
                    told.add(report)
                    missing.remove(question)
                    break
            return not missing

        yield from self.send(where.data + what.data)
        with suppress(ClientTimeout):
            yield from self._skip(complete, self._wait("scanners", PATIENCE))

    def _see(self, names: Sequence[str]) -> Exchange[None]:
        """Wait for a scan of each scanner, for a while: their beams can be counted."""

        def complete() -> bool:
            seen = {name.casefold() for name in self.session.scans}
            return all(name.casefold() in seen for name in names)

        if not complete():
            with suppress(ClientTimeout):
                yield from self._skip(
                    lambda _: complete(), self._wait("scans", PATIENCE)
                )

    def _skip(self, wanted: Callable[[Report], bool], wait: Wait) -> Exchange[Report]:
        """Skip reports up to one that is wanted, and keep those behind it."""
        while True:
            reports = yield from self._more(wait)
            for i, report in enumerate(reports):
                if wanted(report):
                    self._pending = reports[i + 1 :]
                    return report
            self._check(wait)

    def _more(self, wait: Wait) -> Exchange[list[Report]]:
        """Give reports that were kept, or else the next that come."""
        reports, self._pending = self._pending, []
        while not reports:
            try:
                data = yield wait.until - self._clock()
            except TimeoutError:
                raise ClientTimeout(self._late(wait)) from None
            except ConnectionError as error:
                text = f"{error}, expected {wait.what}"
                raise ClientError(f"{text}, {self._came()}") from None
            reports = self.session.receive(data)
            if not reports:
                self._check(wait)
        return reports

    def _wait(self, what: str, timeout: float | None) -> Wait:
        seconds = self.timeout if timeout is None else timeout
        return Wait(what, seconds, self._clock() + seconds)

    def _check(self, wait: Wait) -> None:
        """Raise if the time is up, whatever else keeps coming."""
        if self._clock() >= wait.until:
            raise ClientTimeout(self._late(wait))

    def _late(self, wait: Wait) -> str:
        return f"no {wait.what} within {wait.timeout:g} s, {self._came()}"

    def _came(self) -> str:
        session = self.session
        if not session.last:
            return "no whole line came"
        unread = f"; {session.unread} lines were of no known kind"
        return f"the last line was {session.last[:80]!r}{unread * bool(session.unread)}"
