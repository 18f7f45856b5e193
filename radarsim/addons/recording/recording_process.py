"""Records in a separate process, so that recording does not delay the server's ticks.

The server only packs events. A thread writes them to a pipe at intervals, as each
write may delay the server. The process at the other end converts the events and writes
the files. If the server is killed, the process reads the pipe to its end and completes
the recording.
"""

from __future__ import annotations

import json
import logging
import os
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, BinaryIO, Final

from radarsim.addons.recording.bag_folder import (
    RecordingInfo,
    create_folder,
    recorded_scene,
)
from radarsim.addons.recording.recorders import EventType, HostRecorder, RunEvent
from radarsim.errors import RecordingError, describe_os_error

if TYPE_CHECKING:
    from radarsim.addons.recording.messages import TopicMessage
    from radarsim.scene.scene import Scene
    from radarsim.server.host import Host

log = logging.getLogger("radarsim.addons.recording")

NICENESS: Final = 10  # lower priority than the server
MAX_WAITING: Final = 256 * 2**20  # bytes that may wait for the process
WRITE_INTERVAL: Final = 0.05  # s between writes to the pipe
PAUSE: Final = 0.01  # s between checks while ``add`` waits for the process
END_TIMEOUT: Final = 60.0  # s; timeout for the process to write the rest
FRAME: Final = struct.Struct("<BQQQ")  # type, tick, client, number of bytes that follow
# The child process gets the module search path of this process.
PROGRAM: Final = (
    "import sys; sys.path[:] = sys.argv[1:];"
    "from radarsim.addons.recording.recording_process import write_run; write_run()"
)


class RecordingProcess:
    """Records a run in a child process.

    Attributes:
        folder: Folder of the recording.
        has_ended: Whether the recording has ended, also by an error such as a full
            disk.
    """

    def __init__(
        self, folder: Path, info: RecordingInfo, *, is_patient: bool = False
    ) -> None:
        """Start the process.

        Args:
            folder: Folder to create.
            info: The conditions of the run.
            is_patient: Whether ``add`` waits if more than ``MAX_WAITING`` bytes wait
                for the process, instead of ending the recording.

        Raises:
            RecordingError: If the process cannot be started, a package is missing, or
                the folder exists.
        """
        create_folder(folder)
        self.folder = folder
        self._frames: deque[bytes] = deque()
        self._is_closing = threading.Event()
        self._queued = self._written = 0  # bytes; each is changed by one thread only
        self.has_ended = False
        self._recorder: HostRecorder | None = None
        self._is_patient = is_patient
        try:
            # Forking a server with threads is unsafe, and multiprocessing would import
            # the main module of the calling program in the child.
            self._process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM, *sys.path],
                stdin=subprocess.PIPE,
                start_new_session=True,  # so that Ctrl-C does not interrupt it
            )
        except OSError as error:
            text = f"cannot start recording: {describe_os_error(error)}"
            raise RecordingError(text) from error
        self._frames.append(opening_of(folder, info))
        self._thread = threading.Thread(target=self._pass_on, daemon=True)
        self._thread.start()

    def record(
        self, host: Host, *, spectra: bool = False, camera_interval: int = 0
    ) -> None:
        """Record the calls of a host from now on; see ``HostRecorder``."""
        self._recorder = HostRecorder(
            self.add, spectra=spectra, camera_interval=camera_interval
        )
        host.add_observer(self._recorder)

    def add(self, event: RunEvent) -> None:
        """Queue an event without raising; if ``is_patient``, wait for a slow child."""
        if self.has_ended:
            return
        frame = frame_of(event)
        # Appending to a deque needs no lock, so no tick waits for the thread. Each
        # thread has its own counter, because a shared counter would need a lock.
        self._frames.append(frame)
        self._queued += len(frame)
        while self._is_patient and self._is_behind() and not self.has_ended:
            time.sleep(PAUSE)
        if self._is_behind():
            self.has_ended = True
            behind = MAX_WAITING // 2**20
            log.warning(
                "recording ends: %d MB wait to be written; the server goes on", behind
            )

    def close(self) -> bool:
        """Complete the recording; return whether all events were written."""
        if self._recorder is not None:
            self._recorder.end()
        is_whole = not self.has_ended
        self._is_closing.set()
        self._thread.join(END_TIMEOUT)
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            # A disk that hangs must not block the server.
            self._process.kill()
            self._process.wait()
            log.warning("recording %s: incomplete after %g s", self.folder, END_TIMEOUT)
        return is_whole and self._process.returncode == 0

    def _is_behind(self) -> bool:
        return self._queued - self._written > MAX_WAITING

    def _pass_on(self) -> None:
        """Write frames to the pipe until the recording is closed."""
        pipe = self._process.stdin
        assert pipe is not None
        with suppress(OSError):  # the process has ended, and printed why
            while not self._is_closing.wait(WRITE_INTERVAL):
                self._write_frames(pipe)
            self._write_frames(pipe)
        self.has_ended = True
        with suppress(OSError):
            pipe.close()

    def _write_frames(self, pipe: IO[bytes]) -> None:
        # Only the frames that are queued now are written, as the server may keep adding
        # more.
        frames = [self._frames.popleft() for _ in range(len(self._frames))]
        pipe.write(b"".join(frames))
        pipe.flush()
        self._written += sum(map(len, frames))


def record_host(
    host: Host, map_: str | None, seed: int, folder: Path, *, spectra: bool
) -> Callable[[], None]:
    """Record the calls of a host from now on.

    Args:
        host: The host, before its first call.
        map_: Name or path of the map; None for a scene that was not loaded from a
            file. Its run cannot be repeated from the recording.
        seed: Seed of the host.
        folder: Folder to create.
        spectra: Whether to record the received power of FMCW radars as well.

    Returns:
        A function that completes the recording.

    Raises:
        RecordingError: If the folder exists, or a package is missing.
    """
    info = RecordingInfo.of_host(map_, host, seed)
    process = RecordingProcess(folder, info, is_patient=True)
    process.record(host, spectra=spectra)

    def complete() -> None:
        if not process.close():
            raise RecordingError(f"{folder} is incomplete; the log has the reason")

    return complete


def opening_of(folder: Path, info: RecordingInfo) -> bytes:
    """Return the line of JSON that the process reads first: folder and conditions."""
    opening = str(folder.resolve()), info.model_dump(mode="json")
    return json.dumps(opening).encode() + b"\n"


def frame_of(event: RunEvent) -> bytes:
    """Return an event as bytes: a header as in ``FRAME``, then the data."""
    return FRAME.pack(*event[:3], len(event.data)) + event.data


def _read_events(pipe: BinaryIO) -> Iterator[RunEvent]:
    """Yield events up to the end of the pipe, or up to a truncated event."""
    while len(head := pipe.read(FRAME.size)) == FRAME.size:
        type_, tick, client, size = FRAME.unpack(head)
        data = pipe.read(size)
        # A truncated event means that the server was killed while it wrote.
        if len(data) < size:
            return
        yield RunEvent(EventType(type_), tick, client, data)


def write_recording(
    folder: Path,
    info: RecordingInfo,
    events: Iterable[RunEvent],
    scene: Scene | None = None,
) -> None:
    """Write the bag of a run.

    Args:
        folder: Folder of the recording, which exists; see ``create_folder``.
        info: The conditions of the run.
        events: The events, in order.
        scene: The map, for topics that show it; None for none.

    Raises:
        OSError: If a file cannot be written.
    """
    # Only the process that writes needs these slow imports.
    from radarsim.addons.recording.bag import BagMessage, BagWriter  # noqa: PLC0415
    from radarsim.addons.recording.call_converter import CallConverter  # noqa: PLC0415
    from radarsim.addons.recording.cdr import encode  # noqa: PLC0415

    converter = CallConverter(info)
    writer = BagWriter(folder, info.to_text())

    def write(time_: int, message: TopicMessage) -> None:
        topic, type_, _, latched = message
        writer.write(BagMessage(topic, type_, encode(message), time_, latched))

    if scene is not None:
        from radarsim.addons.recording.scene_topics import (  # noqa: PLC0415
            draw_views,
            scene_topics,
        )

        events = draw_views(scene, events)
        for shown in scene_topics(scene, with_map=not info.robots_map):
            write(0, shown)
    for event in events:
        for time_, message in converter.convert(event):
            write(time_, message)
    writer.close()


def write_run() -> None:
    """Record the events from standard input; the child process runs this function."""
    if sys.platform != "win32":  # Windows has no ``nice``
        os.nice(NICENESS)
    pipe = sys.stdin.buffer
    opening = pipe.readline()
    if not opening.endswith(b"\n"):  # the server was killed
        return
    folder, conditions = json.loads(opening)
    info = RecordingInfo.model_validate(conditions)
    try:
        write_recording(Path(folder), info, _read_events(pipe), recorded_scene(info))
    except OSError as error:
        text = f"recording to {folder} ends: {describe_os_error(error)}"
        sys.stderr.write(f"radarsim: {text}; the server goes on\n")
        sys.exit(1)
