"""The requests of a client to a server, as generators that do no I/O.

Theory of operation
===================
Every method is a generator, called an exchange, which yields bytes to send, or the
longest time to wait for bytes, s. The client that runs the exchange passes received
bytes to ``receive`` and resumes it. If the transport raises ``TimeoutError`` or
``ConnectionError``, the client throws this error into the exchange, which raises a
``ClientError`` that names the expected report. The blocking and the asynchronous client
share these methods and their docstrings, so they behave alike.

Several exchanges may wait at once. One of their threads or tasks reads, and ``receive``
gives each report to the exchanges that wait for it, or keeps it for later calls. As
servers answer in order, an answer goes only to the exchange that asked first. Readings
that arrive before an answer are dropped unless another exchange waits for readings, so
that a caller who reads after the answer gets no older readings.
"""

from collections import deque
from collections.abc import (
    Callable,
    Generator,
    Hashable,
    Iterable,
    Sequence,
)
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final, TypeAlias, TypeVar

from radarsim.client import session as questions
from radarsim.client.robot_info import RobotInfo, ScannerDescriptions, same_name
from radarsim.client.session import (
    RANGE_SCANNER,
    ROBOT,
    SETTING,
    PoseLike,
    Question,
    Session,
    check_timeout,
)
from radarsim.errors import ClientError, ClientTimeout, expected_one_of
from radarsim.geometry import Pose3
from radarsim.protocol.commands import bare_class
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import (
    ClockTick,
    CommandError,
    Greeting,
    RangeScan,
    Report,
    RobotConf,
    RobotGeo,
    SensorReport,
    StartPoses,
    Status,
    WatchedLine,
    Watching,
)

SILENCE_LIMIT: Final = 2.0  # s; many servers do not answer optional questions
SPAWN_PATIENCE: Final = 2.0  # s until the client asks whether INIT is done
BUSY_LIMIT: Final = 60.0  # s; longest wait for a busy server
MOST_PASSED: Final = 1000  # reports that are kept while a call waits for another one
REFUSED: Final = (
    "the server has no such class, or no free place for it at that start or pose; its"
    " log says which"
)
LATE: Final = "the server is busy, and has not executed INIT yet"

Value = TypeVar("Value")
AnyReport = TypeVar("AnyReport", bound=Report)
Step: TypeAlias = bytes | float
Exchange: TypeAlias = Generator[Step, None, Value]


@dataclass(slots=True, eq=False)
class Waiter:
    """The state of a request of a client that waits for a report from the server.

    Attributes:
        expected: Name of the expected report in error texts.
        wanted: Returns whether the exchange waits for a report.
        timeout: Length of the wait, s.
        until: Clock time, s, at which the wait ends.
        hint: Possible reason of a timeout, for the error text.
        asked: Whether the exchange has sent a question.
        asks_poses: Whether the data to send ends with a question for start poses.
        is_left: Whether the wait has ended, although an answer may still arrive.
        ends: Returns whether a wanted report ends the wait.
        report: The report that ended the wait; None before.
    """

    expected: str
    wanted: Callable[[Report], bool]
    timeout: float
    until: float
    hint: str = ""
    asked: bool = False
    asks_poses: bool = False
    is_left: bool = False
    ends: Callable[[Report], bool] = lambda _: True
    report: Report | None = None


class Requests:
    """The requests that a client can send to a server.

    Attributes:
        session: State of the connection.
        timeout: Default timeout, s.
        has_robot: Whether a robot was requested.
    """

    def __init__(
        self,
        clock: Callable[[], float],
        *,
        timeout: float,
        diagnostics: list[str] | None = None,
    ) -> None:
        """Create the requests of a new connection.

        Args:
            clock: Returns the time of the transport's clock, s.
            timeout: Default timeout, s.
            diagnostics: List to which the transport may append a text for each command
                without effect; cleared before a robot is requested.

        Raises:
            ValueError: If the timeout is not above 0.
        """
        check_timeout(timeout)
        self.session = Session()
        self.timeout = timeout
        self.has_robot = False
        self._clock = clock
        self._class_name = ""  # class of the client's robot
        self._diagnostics = [] if diagnostics is None else diagnostics
        # Unanswered questions for start poses, in order; some servers never answer.
        self._poses_asked: deque[Waiter] = deque(maxlen=MOST_PASSED)
        self._starts: dict[str, Pose3] | None = None
        self._waiters: list[Waiter] = []  # in the order of their requests
        # Reports that no call has returned: first the reports that a call has skipped
        # while it waited for another one, then the reports received after them.
        self._passed: list[Report] = []
        self._pending: list[Report] = []

    def receive(self, data: bytes) -> None:
        """Decode bytes from the server, and give the reports to the waiting requests.

        All other reports are kept, except greetings, which the session stores.
        """
        for report in self.session.receive(data):
            first = self._poses_asked[0] if self._poses_asked else None
            if isinstance(report, StartPoses) and first is not None:
                self._poses_asked.popleft()
            # The answer to a request that was cancelled or timed out is dropped.
            if first is None or not (first.is_left and first.wanted(report)):
                self._give(report)
        if len(self._passed) > MOST_PASSED:
            self._passed = without_outdated(self._passed, [])[-MOST_PASSED:]

    def _give(self, report: Report) -> None:
        """Give a report to the requests that wait for it, or keep it for later."""
        waiting = [each for each in self._waiters if each.report is None]
        takers = [each for each in waiting if each.wanted(report)]
        # An answer goes only to the first of the requests that have asked for it.
        if asking := [each for each in takers if each.asked]:
            takers = asking[:1]
        for waiter in takers:
            if waiter.ends(report):
                waiter.report = report
        if takers or isinstance(report, Greeting):
            return
        if not waiting:
            self._pending.append(report)
        elif not (reading_of(report) and all(w.asked for w in self._waiters)):
            self._passed.append(report)

    def greeting(self) -> Exchange[Greeting]:
        """Return the greeting of the server, which contains the name of the map."""
        if self.session.greeting is None:
            yield from self._skip(
                self._waiter("greeting", lambda report: isinstance(report, Greeting))
            )
        assert self.session.greeting is not None
        return self.session.greeting

    def start_poses(
        self, *, timeout: float | None = None
    ) -> Exchange[dict[str, Pose3]]:
        """Request the start poses of the map, and return them by their names.

        Args:
            timeout: Timeout, s; None for the default.
        """
        question = questions.start_poses()
        waiter = self._waiter(
            question.what, question.accepts, timeout, asked=True, asks_poses=True
        )
        answer = yield from self._await(waiter, question.data)
        assert isinstance(answer, StartPoses)
        self._starts = dict(answer.poses)
        return self._starts.copy()

    def spawn(
        self,
        class_name: str,
        *,
        name: str | None = None,
        start: str | None = None,
        pose: PoseLike | None = None,
        timeout: float | None = None,
    ) -> Exchange[None]:
        """Spawn a robot, and wait for its first report, which later calls can read.

        Servers do not report a failure: if the class is unknown or the position is not
        free, no report comes. The client also sends a question after the request, and
        waits up to 60 s while a busy server has not answered this question.

        Args:
            class_name: Class of the robot, such as ``P3AT``.
            name: Name of the robot; None lets the server choose.
            start: Name of a start pose, case-insensitive.
            pose: Pose of the robot if ``start`` is None; also as numbers: ``(x, y)``,
                ``(x, y, yaw)`` or the six numbers of a ``Pose3``. Without start and
                pose, radarsim uses the first start of the map with room for the robot;
                for other servers, the client requests the first start.
            timeout: Longest time to wait, s, even for a busy server; None for the
                default, and up to 60 s for a busy server.

        Raises:
            ClientError: If no report comes, the map has no such start, or the robot
                still has the class of an earlier spawn.
            ValueError: If both ``start`` and ``pose`` are given, the pose is malformed,
                or a text cannot be written on a line.
        """
        takes_free = start is None and pose is None
        limit = self.timeout if timeout is None else timeout
        until = self._clock() + limit
        if pose is None:
            start = yield from self._choose_start(start, limit)
        question = questions.spawn(
            class_name, name=name, start=start, pose=pose, takes_free=takes_free
        )
        # The flag is set before any report, as the server may spawn the robot late, and
        # close() must then stop the robot.
        had_robot, self.has_robot = self.has_robot, True
        self._diagnostics.clear()
        yield from self.send(question.data)
        if had_robot and not self._poses_asked:
            # Servers execute commands in order, so reports before the answer to this
            # question belong to the previous robot.
            with suppress(ClientTimeout):
                yield from self.start_poses(timeout=limit)
        if had_robot:
            yield from self._check_class(class_name)
        # Reports of the previous robot must not count as the first report of this one.
        self._passed.clear()
        self._pending.clear()
        self.session.scans.clear()
        self.session.newest.clear()
        waiter = Waiter(question.what, question.accepts, limit, until)
        first = yield from self._wait_for_robot(waiter, may_be_busy=timeout is None)
        self._pending.insert(0, first)
        self._class_name = class_name

    def _check_class(self, wanted: str) -> Exchange[None]:
        """Check that the server has replaced the client's previous robot by a new one.

        A server that refuses INIT keeps the client's previous robot.

        Raises:
            ClientError: If the robot still has the class of the previous one.
        """
        before = bare_class(self._class_name)
        if not before or same_name(bare_class(wanted), before):
            return
        with suppress(ClientTimeout):
            question = questions.configuration(ROBOT)
            conf = yield from self._ask(question, RobotConf, SILENCE_LIMIT)
            if same_name(conf.name, before):
                reason = "; ".join(self._diagnostics) or REFUSED
                text = f"the robot is still a {conf.name!r}, expected {wanted!r}"
                raise ClientError(f"{text}: {reason}")

    def _choose_start(self, wanted: str | None, limit: float) -> Exchange[str | None]:
        """Return the name of the start that the client requests, or of the first start.

        None is returned if no start is requested, and the map has no starts or the
        server does not list its starts.

        Raises:
            ClientError: If the map has no such start.
        """
        if self._starts is None and not self._poses_asked:
            with suppress(ClientTimeout):
                yield from self.start_poses(timeout=min(SILENCE_LIMIT, limit / 2))
        if self._starts is None:
            return wanted
        if wanted is None:
            return next(iter(self._starts), None)
        if wanted.casefold() not in map(str.casefold, self._starts):
            raise ClientError(f"start {expected_one_of(wanted, self._starts)}")
        return wanted

    def _wait_for_robot(self, waiter: Waiter, *, may_be_busy: bool) -> Exchange[Report]:
        """Wait for the first report of the robot that INIT spawns, and return it.

        A server does not report that it has no room for a robot. But it executes
        commands in order, so it answers a question sent after INIT when INIT is done,
        which may take a while on a busy machine.

        Args:
            waiter: Waiter for the first report of the robot.
            may_be_busy: Whether to wait longer for a busy server; False if the caller
                has set a timeout.
        """
        # Half of a short timeout is reserved for a question whose answer shows that the
        # server has executed INIT.
        now = self._clock()
        patience = min(SPAWN_PATIENCE, (waiter.until - now) / 2)
        with suppress(ClientTimeout):
            early = replace(waiter, timeout=patience, until=now + patience)
            return (yield from self._skip(early))
        if self._diagnostics:
            reason = "; ".join(self._diagnostics)
            raise ClientTimeout(f"no {waiter.expected}: {reason}")

        def is_news(report: Report) -> bool:
            return waiter.wanted(report) or isinstance(report, StartPoses)

        news = replace(waiter, wanted=is_news, hint=LATE, asks_poses=True)
        # A server that has sent its greeting and all earlier answers is executing INIT.
        if may_be_busy and self.session.greeting and not self._poses_asked:
            news = replace(news, timeout=BUSY_LIMIT, until=now + BUSY_LIMIT)
        report = yield from self._await(news, questions.start_poses().data)
        if waiter.wanted(report):
            return report
        # The server has executed INIT, but sent no report of the robot yet. If the
        # robot exists, its reports come soon, so the default timeout is enough.
        last = self._waiter(waiter.expected, waiter.wanted, hint=REFUSED)
        if self._clock() < waiter.until:
            in_time = replace(waiter, hint=REFUSED)
            last = min(last, in_time, key=lambda each: each.until)
        return (yield from self._skip(last))

    def ask(self, question: Question, timeout: float | None = None) -> Exchange[Report]:
        """Send a question to the server and return the answer."""
        waiter = self._waiter(question.what, question.accepts, timeout, asked=True)
        return (yield from self._await(waiter, question.data))

    def geometry(
        self, kind: str, name: str | None = None, *, robot: str | None = None
    ) -> Exchange[Report]:
        """Request the dimensions of a robot, or the mounting poses of its items.

        Args:
            kind: ``Robot``, or a type of items such as ``RangeScanner``.
            name: Name of one item; None for all items of the type.
            robot: Name of another client's robot, which only radarsim supports; None
                for the client's own robot.

        Returns:
            A ``RobotGeo`` or an ``ItemGeo``.
        """
        return self._describe(questions.geometry(kind, name, robot))

    def configuration(
        self, kind: str, name: str | None = None, *, robot: str | None = None
    ) -> Exchange[Report]:
        """Request the settings of a robot or its items; arguments as in ``geometry``.

        Returns:
            A ``RobotConf``, a ``ScannerConf`` or another report named ``...Conf``.
        """
        return self._describe(questions.configuration(kind, name, robot))

    def _describe(self, question: Question) -> Exchange[Report]:
        """Send a question about any robot to the server, and return the answer.

        Raises:
            ClientError: If the other robot does not exist.
        """
        answer = yield from self.ask(question)
        if isinstance(answer, CommandError):
            raise ClientError(f"{answer.text}, expected {question.what}")
        if isinstance(answer, WatchedLine) and answer.report is not None:
            return answer.report
        return answer

    def robot_info(self, *, drive_unit: DriveUnit = "rad_per_s") -> Exchange[RobotInfo]:
        """Request the dimensions, the limits and the scanners of the robot.

        Properties of a scanner that the server does not report within 2 s are taken
        from its scans.

        Args:
            drive_unit: Unit of the server's wheel speeds, which no server reports.

        Raises:
            ClientError: If the geometry or the configuration of the robot is not
                received, or not plausible.
        """
        geo = yield from self._ask(questions.geometry(ROBOT), RobotGeo)
        conf = yield from self._ask(questions.configuration(ROBOT), RobotConf)
        descriptions = ScannerDescriptions()
        yield from self._describe_scanners(descriptions, None)
        # Some servers answer only questions about a single scanner.
        for name in descriptions.incomplete(self.session.scans):
            yield from self._describe_scanners(descriptions, name)
        names = {name.casefold() for name in descriptions.names(self.session.scans)}

        def have_scanned() -> bool:
            return names <= {name.casefold() for name in self.session.scans}

        def is_last_scan(report: Report) -> bool:
            return isinstance(report, RangeScan) and have_scanned()

        if not have_scanned():  # scans provide the number of beams
            with suppress(ClientTimeout):
                waiter = self._waiter("scans", is_last_scan, SILENCE_LIMIT, asked=True)
                yield from self._await(waiter)
        scanners = descriptions.scanners(self.session.scans)
        return RobotInfo.from_reports(geo, conf, scanners, drive_unit)

    def send(self, data: bytes) -> Exchange[None]:
        """Send whole lines to the server unchanged, without waiting for an answer.

        Raises:
            ClientError: If the connection is lost.
        """
        try:
            yield data
        except ConnectionError as error:
            line = data.decode("latin-1").strip()
            text = f"{error}; the client could not send {line[:80]!r}"
            raise ClientError(f"{text}, {self._describe_last_line()}") from None

    def drive(self, left: float, right: float) -> Exchange[None]:
        """Set the speeds of the robot's left and right wheels, in the server's unit.

        The speeds hold until the next call. ``RobotInfo.wheel_speeds`` computes them
        from speed and yaw rate. For a car, after a call of ``robot_info``, they are
        converted to a speed and a steering angle.
        """
        return self.send(questions.drive(left, right, self.session.car))

    def stop(self) -> Exchange[bool]:
        """Stop the wheels; return False instead of an error if sending fails."""
        try:
            yield from self.drive(0.0, 0.0)
        except ClientError:
            return False
        return True

    def echoes(self, scanner: str, on: bool = True) -> Exchange[None]:
        """Switch the reports of a scanner's echoes, ``EchoLine``, on or off."""
        return self.send(questions.echoes(scanner, on))

    def targets(self, scanner: str, on: bool = True) -> Exchange[None]:
        """Switch the reports of a radar's targets, ``RadarTargets``, on or off."""
        return self.send(questions.targets(scanner, on))

    def watch(
        self,
        robots: str | Iterable[str] | None = None,
        *,
        echoes: bool | str | Iterable[str] = False,
        clock: bool = False,
    ) -> Exchange[None]:
        """Ask radarsim for copies of the lines that it sends to the clients of robots.

        The copies come as ``WatchedLine`` reports. If all robots are watched,
        ``RobotJoined`` and ``RobotLeft`` report which robots exist. A later call
        replaces this one.

        Args:
            robots: Name or names, case-insensitive; None for all, an empty list for
                none.
            echoes: Whether the scanners of watched robots also send echo lines, or the
                names of the robots whose scanners do.
            clock: Whether the server sends a ``ClockTick`` report in every tick of
                10 ms.

        Raises:
            ClientError: If the server refuses the command or does not answer it; only
                radarsim answers.
            ValueError: If a name is empty, or contains a comma.
        """

        def accepts(report: Report) -> bool:
            return isinstance(report, Watching | CommandError)

        data = questions.watch(robots, echoes, clock=clock)
        answer = yield from self.ask(Question(data, "answer to WATCH", accepts))
        if isinstance(answer, CommandError):
            raise ClientError(answer.text)
        self._pending.insert(0, answer)

    def set_item(
        self, kind: str, name: str | None, opcode: str, params: str = ""
    ) -> Exchange[None]:
        """Send an opcode to the items of a type, such as ``RESET`` to ``Odometry``.

        For the opcode ``SETTING``, the call waits like ``change_settings``.
        """
        data = questions.set_item(kind, name, opcode, params)
        return self._change(data) if opcode.upper() == SETTING else self.send(data)

    def change_settings(
        self, scanner: str | None = None, /, **settings: Any
    ) -> Exchange[None]:
        """Change settings of a scanner of the client's robot; its next scan uses them.

        Only radarsim supports this. Earlier scans that have not been read are dropped.

        Args:
            scanner: Name of the scanner; None for all.
            **settings: Values by the names of settings, such as ``side_offset_uu``.

        Raises:
            ClientError: If there is no such scanner or setting, or a value is refused.
            ValueError: If no setting is given, or a text cannot be written on a line.
        """
        return self._change(questions.change_settings(scanner, settings))

    def _change(self, data: bytes) -> Exchange[None]:
        refusals: list[str] = []

        def accepts(report: Report) -> bool:
            return isinstance(report, CommandError | StartPoses)

        def ends(report: Report) -> bool:
            if isinstance(report, CommandError):
                refusals.append(report.text)
                return False
            return True

        # The server answers SET only with errors. As it executes commands in order, the
        # answer to a later question shows that the settings are in effect.
        waiter = self._waiter(
            "answer after SET SETTING", accepts, asked=True, asks_poses=True
        )
        waiter.ends = ends
        yield from self._await(waiter, data + questions.start_poses().data)
        if refusals:
            raise ClientError("; ".join(refusals))

    def read(self, timeout: float | None = None) -> Exchange[list[Report]]:
        """Return all reports that no call has returned yet; wait for one if necessary.

        Reports that another call has skipped come first.
        """
        first = []
        if not self._passed and not self._pending:
            waiter = self._waiter("report", lambda _: True, timeout)
            first = [(yield from self._await(waiter))]
        reports = [*first, *self._passed, *self._pending]
        self._passed, self._pending = [], []
        return reports

    def next_report(self) -> Exchange[Report]:
        """Return the next report, and keep further reports for later calls."""
        report, *others = yield from self.read()
        self._pending[:0] = others
        return report

    def wait_for(
        self,
        kind: type[AnyReport],
        *,
        name: str | None = None,
        timeout: float | None = None,
    ) -> Exchange[AnyReport]:
        """Return the first report of a class that no call has returned; wait if needed.

        Skipped reports can still be read or waited for, but of the skipped readings of
        one sensor only the newest is kept.

        Args:
            kind: Class of the report, such as ``RangeScan``.
            name: Name of the item; None accepts any.
            timeout: Timeout, s; None for the default.

        Raises:
            TypeError: If ``kind`` is not a class.
        """
        check_kind(kind)

        def accepts(report: Report) -> bool:
            if not isinstance(report, kind):
                return False
            return name is None or getattr(report, "name", None) == name

        answer = kind.__name__ if name is None else f"{kind.__name__} of {name!r}"
        report = yield from self._skip(self._waiter(answer, accepts, timeout))
        assert isinstance(report, kind)
        return report

    def _ask(
        self, question: Question, kind: type[AnyReport], timeout: float | None = None
    ) -> Exchange[AnyReport]:
        answer = yield from self.ask(question, timeout)
        assert isinstance(answer, kind)
        return answer

    def _describe_scanners(
        self, descriptions: ScannerDescriptions, name: str | None
    ) -> Exchange[None]:
        """Request mounting pose and settings of one scanner of the robot, or of all."""
        geometry = questions.geometry(RANGE_SCANNER, name)
        configuration = questions.configuration(RANGE_SCANNER, name)
        missing = [geometry, configuration]

        def accepts(report: Report) -> bool:
            return any(question.accepts(report) for question in missing)

        def complete(report: Report) -> bool:
            descriptions.add(report)
            missing.remove(next(each for each in missing if each.accepts(report)))
            return not missing

        # Both questions are sent at once, so the client waits for silent servers once.
        waiter = self._waiter(
            "scanners", accepts, SILENCE_LIMIT, asked=True, ends=complete
        )
        with suppress(ClientTimeout):
            yield from self._await(waiter, geometry.data + configuration.data)

    def _skip(self, waiter: Waiter) -> Exchange[Report]:
        """Return the first report that a request wants, and keep skipped reports."""
        passed = list(filter(waiter.wanted, self._passed))
        fresh = list(filter(waiter.wanted, self._pending))
        if current := without_outdated(passed, fresh):
            report = current[0]
            self._passed = [each for each in self._passed if each is not report]
        elif fresh:
            report = fresh[0]
            i = next(i for i, each in enumerate(self._pending) if each is report)
            self._passed += self._pending[:i]
            del self._pending[: i + 1]
        else:
            report = yield from self._await(waiter)
        # Skipped readings are dropped if the same sensor has sent the returned report.
        self._passed = [each for each in self._passed if not is_older(each, report)]
        return report

    def _await(self, waiter: Waiter, data: bytes = b"") -> Exchange[Report]:
        """Send data, if any, and wait for the report that a request wants."""
        self._passed += self._pending
        self._pending = []
        if waiter.asked and not self._waiters:
            self._passed = [each for each in self._passed if not reading_of(each)]
        self._waiters.append(waiter)
        waiter.is_left = False
        if waiter.asks_poses and data:
            self._poses_asked.append(waiter)
        try:
            if data:
                yield from self.send(data)
            is_late = False
            while waiter.report is None:
                if is_late:  # timed out, although other lines keep coming
                    raise self._timeout(waiter)
                yield waiter.until - self._clock()
                is_late = self._clock() >= waiter.until
        except TimeoutError:
            raise self._timeout(waiter) from None
        except ConnectionError as error:
            text = f"{error} while the client waited for the {waiter.expected}"
            raise ClientError(f"{text}, {self._describe_last_line()}") from None
        except GeneratorExit:
            # The call was cancelled before it could return the report that had come.
            if waiter.report is not None and not waiter.asked:
                self._passed.append(waiter.report)
            raise
        finally:
            self._waiters.remove(waiter)
            waiter.is_left = True
        return waiter.report

    def _waiter(
        self,
        expected: str,
        wanted: Callable[[Report], bool],
        timeout: float | None = None,
        **more: Any,
    ) -> Waiter:
        seconds = self.timeout if timeout is None else timeout
        return Waiter(expected, wanted, seconds, self._clock() + seconds, **more)

    def _timeout(self, waiter: Waiter) -> ClientTimeout:
        text = f"no {waiter.expected} within {waiter.timeout:g} s"
        hint = waiter.hint and f"; {waiter.hint}"
        return ClientTimeout(f"{text}, {self._describe_last_line()}{hint}")

    def _describe_last_line(self) -> str:
        session = self.session
        if not session.last:
            return "no complete line was received"
        unread = f"; {session.unread} lines could not be parsed"
        return f"the last line was {session.last[:80]!r}{unread * bool(session.unread)}"


def check_kind(kind: object) -> None:
    """Check that the reports to wait for are given as a class.

    Raises:
        TypeError: If ``kind`` is not a class.
    """
    if not isinstance(kind, type):
        text = f"kind {kind!r}, expected a class of reports such as RangeScan"
        raise TypeError(text)


def reading_of(report: Report) -> tuple[Hashable, float] | None:
    """Return the sensor and the time of a reading; None if a report is no reading."""
    reading = report.report if isinstance(report, WatchedLine) else report
    if not isinstance(reading, SensorReport | Status | ClockTick):
        return None
    # Echo and target lines count as readings of the scanner whose name they have.
    item = getattr(reading, "name", type(reading))
    return (getattr(report, "robot", None), item), reading.time


def is_older(report: Report, other: Report) -> bool:
    """Return whether both reports are readings of one sensor and ``other`` is newer."""
    # A client may compare a thousand reports in one call, and this fast check of the
    # names decides most of the comparisons.
    if getattr(report, "name", None) != getattr(other, "name", None):
        return False
    one, two = reading_of(report), reading_of(other)
    if one is None or two is None:
        return False
    return one[0] == two[0] and one[1] < two[1]


def without_outdated(
    reports: Sequence[Report], later: Sequence[Report]
) -> list[Report]:
    """Return reports without the readings for which their sensor has sent a newer one.

    Args:
        reports: Reports to filter.
        later: Reports received later, which are not returned.
    """
    newest: dict[Hashable, float] = {}
    for sensor, time in filter(None, map(reading_of, (*reports, *later))):
        newest[sensor] = max(time, newest.get(sensor, time))
    readings = map(reading_of, reports)
    return [
        report
        for report, reading in zip(reports, readings, strict=True)
        if reading is None or not reading[1] < newest[reading[0]]
    ]
