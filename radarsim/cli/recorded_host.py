"""The host of a command that may record: ``--record DIR`` of several commands."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim import __version__
from radarsim.cli.output import print_message

if TYPE_CHECKING:
    from radarsim.addons.recording.bag_folder import RecordingInfo
    from radarsim.scene.scene import Scene
    from radarsim.server.host import Host
    from radarsim.simulation.config import SimulationConfig

RecordOption = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Record the run in a new folder, as a bag of ROS 2 that 'radarsim replay'"
        " repeats. Needs the extra 'record'.",
    ),
]
RecordSpectraOption = Annotated[
    bool,
    typer.Option(help="Record what FMCW radars receive as well, some 180 MB a minute."),
]


@contextmanager
def open_host(
    map_: str,
    config: SimulationConfig,
    folder: Path | None,
    *,
    seed: int = 0,
    begins: bool = True,
    spectra: bool = False,
) -> Iterator[Host]:
    """Load a map, and record what is done to its host if that is wanted.

    Args:
        map_: Name of a map, or path of a map file.
        config: Dialect and settings of items.
        folder: Folder to create for the recording; None for none.
        seed: Seed of the simulation.
        begins: Whether the simulation begins at once.
        spectra: Whether what FMCW radars receive is recorded as well.

    Raises:
        MapError: If the map is wrong.
        RecordingError: If recording is not possible.
        typer.BadParameter: If a setting of an item does not fit.
    """
    from radarsim.cli.serve import load_host

    if folder is None and spectra:
        hint = "--record-spectra"
        raise typer.BadParameter("expected --record with it", param_hint=hint)
    if folder is None:
        yield load_host(map_, config, seed=seed, begins=begins)
        return
    from radarsim.addons.recording.bag_folder import check_installed, create_folder
    from radarsim.addons.recording.recording_process import RecordingProcess
    from radarsim.scene.map_file import load_map
    from radarsim.server.host.recorded_host import RecordedHost

    check_installed()
    create_folder(folder)
    try:
        scene = load_map(map_)
        process = RecordingProcess(folder, describe(map_, scene, config, seed))
    except BaseException:
        with suppress(OSError):
            folder.rmdir()
        raise
    host = RecordedHost(
        process.add, scene, spectra=spectra, config=config, seed=seed, begins=begins
    )
    try:
        yield host
    finally:
        host.end_recording()
        if process.close():
            print_message(f"recorded in {folder}")


def describe(
    map_: str, scene: Scene, config: SimulationConfig, seed: int
) -> RecordingInfo:
    """Return the conditions of a run."""
    from radarsim.addons.recording.bag_folder import RecordingInfo, digest_of
    from radarsim.scene.map_file import find_map

    path, variant = find_map(map_)
    is_file = Path(map_.removesuffix(f"@{variant}")).exists()
    name = str(path.resolve()) if is_file else map_.removesuffix(f"@{variant}")
    return RecordingInfo.model_validate(
        {
            "version": __version__,
            "level": scene.level,
            "map": name if variant is None else f"{name}@{variant}",
            "map_digest": digest_of(path),
            "seed": seed,
            "dialect": config.dialect.name,
            "drive_unit": config.drive_unit or config.dialect.drive_unit,
            "settings": {
                item: dict(keys) for item, keys in config.item_settings.items()
            },
            "robots": config.robots,
        }
    )
