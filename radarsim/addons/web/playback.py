"""Plays a recording to the commander, in place of a server.

Robots are told of as a server tells of them that is watched: that they join and leave,
and the lines that their clients were sent. Who goes back is told that all robots have
left, and then again of those that were there, with the last second before.
"""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final

from radarsim.addons.web.requests import BadRequest, Pace, Seek
from radarsim.addons.web.server_link import ServerState
from radarsim.addons.web.time_control import TimeControl
from radarsim.errors import RecordingError
from radarsim.protocol.reports import Report, RobotJoined, RobotLeft, Watching
from radarsim.protocol.watch import RobotChoice

if TYPE_CHECKING:
    from radarsim.addons.recording.recorded_lines import RecordedLines, TimedLine

INTERVAL: Final = 0.05  # s between two looks at what is due
BEFORE: Final = 1.0  # s of lines that tell how everything is at a time
KEPT: Final = 4  # seconds of lines that are remembered
FIRST_LOOK: Final = 0.2  # s after the first robot, when it has scanned


class Playback(TimeControl):
    """A link to a recording, whose time is controlled.

    Attributes:
        address: That of no server.
        state: What is known, as of a server.
    """

    refusal = ""
    address = None

    def __init__(self, recording: "RecordedLines") -> None:
        """Stand where the first robot is there.

        Args:
            recording: What is played.
        """
        super().__init__()
        level = recording.info.level or recording.info.map  # which older ones lack
        self.state = ServerState(level, watches=True, problem="")
        self.on_link: Callable[[], None] = lambda: None
        self.on_reports: Callable[[Sequence[Report]], None] = lambda _: None
        self.on_damage: Callable[[str], None] = lambda _: None  # told what is damaged
        self._recording = recording
        self.is_paused = True
        joined = [robot.joined for robot in recording.robots]
        first = min(joined, default=recording.start) + FIRST_LOOK
        self._time = recording.start
        self._wanted: float | None = min(first, recording.end)  # where to go
        self._present: set[str] = set()
        self._seconds: dict[int, list[TimedLine]] = {}
        self._changed = asyncio.Event()

    @property
    def position(self) -> float | None:
        """The time that is shown, s."""
        return self._time

    @property
    def _target(self) -> float:
        """The time that is shown soon, s, if nobody asks for another one."""
        return self._time if self._wanted is None else self._wanted

    def message(self) -> dict[str, Any]:
        """See ``TimeControl.message``; the times are those of the recorded run."""
        recording = self._recording
        times = {"t": self._target, "start": recording.start, "end": recording.end}
        return {**super().message(), **times}

    def change(self, request: Pace) -> None:
        """See ``TimeControl.change``; who goes on at the end begins anew."""
        paused = self.is_paused if request.paused is None else request.paused
        if request.step is not None:
            paused = True
            self._go(min(self._target + request.step, self._recording.end))
        elif not paused and self._time >= self._recording.end:
            self._go(self._recording.start)
        self._set(request.speed or self.speed, paused)
        self._changed.set()

    def seek(self, request: Seek) -> None:
        """See ``TimeControl.seek``."""
        start, end = self._recording.start, self._recording.end
        if not start <= request.t <= end:
            raise BadRequest(f"t {request.t}, expected {start:g} to {end:g} s")
        self._go(request.t)
        self.on_change()

    def watch(self, echoes: Iterable[str] | None) -> None:
        """Do nothing: all that is recorded is told."""

    async def run(self) -> None:
        """Play for ever; paused at the end."""
        self.on_link()
        self.on_reports([Watching(RobotChoice(None))])
        clock = asyncio.get_running_loop().time
        last = clock()
        while True:
            if self.is_paused and self._wanted is None:
                await self._changed.wait()
                last = clock()
            self._changed.clear()
            await asyncio.sleep(INTERVAL)
            last, passed = clock(), clock() - last
            wanted, self._wanted = self._wanted, None
            if wanted is not None:
                await self._show(wanted)
            elif not self.is_paused:
                await self._play(passed * self.speed)

    def _go(self, time: float) -> None:
        # Only the newest place counts, however many are asked for meanwhile.
        self._wanted = time
        self._changed.set()

    async def _play(self, duration: float) -> None:
        end = self._recording.end
        time = min(self._time + duration, end)
        await self._show(time)
        if time >= end and self._wanted is None:
            self._set(self.speed, True)

    async def _show(self, time: float) -> None:
        """Tell what was sent up to a time since the one before, or a little before."""
        since = self._time
        if time < since:
            self.on_reports([RobotLeft(name) for name in sorted(self._present)])
            self._present.clear()
        if not 0 <= time - since <= max(BEFORE, 2 * INTERVAL * self.speed):
            since = time - BEFORE  # the lines between would not be seen
        lines = await self._read(since, time)
        if self._wanted is not None:  # meanwhile somebody went elsewhere
            return
        self._time = time
        self._tell_robots(time)
        self.on_reports(
            [each.line for each in lines if each.line.robot in self._present]
        )

    def _tell_robots(self, time: float) -> None:
        """Tell which robots have joined and left up to a time."""
        robots = self._recording.robots
        there = {r.name: r for r in robots if r.joined <= time <= r.left}
        gone = sorted(self._present - there.keys())
        new = [robot for name, robot in there.items() if name not in self._present]
        self._present = {*there}
        self.on_reports([RobotLeft(name) for name in gone])
        self.on_reports([RobotJoined(each.name, each.class_name) for each in new])

    async def _read(self, since: float, time: float) -> "list[TimedLine]":
        """Return the lines after a time up to another one."""
        seconds = range(int(max(since, 0.0)), int(time) + 1)
        for second in seconds:
            lines = self._seconds.pop(second, None)
            if lines is None:
                lines = await self._read_second(second)
            self._seconds[second] = lines  # the newest is last
        for old in [*self._seconds][: -max(KEPT, len(seconds))]:
            del self._seconds[old]
        found = (line for second in seconds for line in self._seconds[second])
        return [line for line in found if since < line.time <= time]

    async def _read_second(self, second: int) -> "list[TimedLine]":
        try:
            return await asyncio.to_thread(self._recording.read, second)
        except RecordingError as error:  # what comes after it may be whole
            self.on_damage(str(error))
            return []
