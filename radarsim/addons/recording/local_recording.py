"""The recording of a simulation in the process of the program that drives it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.addons.recording.bag_folder import (
    RecordingInfo,
    check_installed,
    create_folder,
)
from radarsim.addons.recording.host_recorder import HostRecorder
from radarsim.addons.recording.recording_process import RecordingProcess
from radarsim.errors import RecordingError

if TYPE_CHECKING:
    from radarsim.server.host import Host


def record_host(
    host: Host, map_: str | None, seed: int, folder: Path, *, spectra: bool
) -> Callable[[], None]:
    """Record what is done to a host from now on.

    Args:
        host: The host; nothing has been done to it yet.
        map_: Name of its map, or path of its file; None for a scene of the program's
            own, whose run cannot be repeated from the recording.
        seed: Its seed.
        folder: Folder to create.
        spectra: Whether to record what FMCW radars receive as well.

    Returns:
        A function that completes the recording.

    Raises:
        RecordingError: If the folder exists, or a package is missing.
    """
    check_installed()
    info = RecordingInfo.of_host(map_, host, seed)
    create_folder(folder)
    process = RecordingProcess(folder, info, is_patient=True)
    recorder = HostRecorder(process.add, spectra=spectra)
    host.add_observer(recorder)

    def complete() -> None:
        recorder.end()
        if not process.close():
            raise RecordingError(f"{folder} is not complete; the log says why")

    return complete
