"""What the core finds by name and never imports: commands, sensors, servers.

A door of the core is a group of entries. The core runs without them as well. Entries of
this package are in ``OWN``; other packages add theirs as entry points of the same
groups.
"""

import functools
import importlib
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, Final

from radarsim.errors import MissingPackage

# Not in pyproject.toml: that is read from the metadata of an installation, which a
# source tree may not have, and which takes 20 ms where many packages are installed.
OWN: Final[dict[str, dict[str, str]]] = {
    # Tables of commands, in the order of 'radarsim --help'.
    "radarsim.commands": {
        "core": "radarsim.cli.entries:COMMANDS",
        "autonomy": "radarsim.autonomy.cli:COMMANDS",
        "addons": "radarsim.addons.entries:COMMANDS",
        "sweep": "radarsim.sweep:COMMANDS",
    },
    # Radars, by the section of a sensor preset that describes them.
    "radarsim.sensors": {"fmcw": "radarsim.addons.fmcw.radar:FmcwRadar"},
    # Kinds of sensors, which classes of robots know by the types of items.
    "radarsim.kinds": {"core": "radarsim.sensors.sensor:kinds"},
    # Scanners of robots that are read outside of the simulation, at times of their own.
    "radarsim.items": {"fmcw": "radarsim.addons.fmcw.rotation_schedule:Antennas"},
    # What 'radarsim explain' can print instead of what a beam meets.
    "radarsim.explanations": {"budget": "radarsim.addons.fmcw.budget:print_budget"},
    # What simulations in Python can do besides.
    "radarsim.local": {
        "evaluate": "radarsim.autonomy.evaluation.own_controllers:evaluate",
        "record": "radarsim.addons.recording.recording_process:record_host",
        "spectra": "radarsim.addons.fmcw.rotation_schedule:collect_turns",
    },
    # What records runs of 'radarsim navigate' and 'radarsim map'.
    "radarsim.runs": {
        "record": "radarsim.addons.recording.run_recording:RunRecording",
    },
    # Options of 'radarsim serve', and the extensions that they start.
    "radarsim.serve": {
        "core": "radarsim.cli.server_options:SidePorts",
        "navtech": "radarsim.addons.fmcw.cli:NavtechOptions",
        "record": "radarsim.addons.recording.run_recording:RecordOptions",
        "web": "radarsim.addons.web.cli:WebOptions",
    },
}


def names(group: str) -> list[str]:
    """Return the names of the entries of a group that are there, in order."""
    own = [each for each in OWN.get(group, {}) if has(group, each)]
    return sorted({*own, *_installed(group)})


@functools.cache
def has(group: str, name: str) -> bool:
    """Return whether there is an entry of this name; nothing heavy is imported."""
    own = OWN.get(group, {}).get(name)
    if own is None:
        return name in _installed(group)
    try:
        return find_spec(own.partition(":")[0]) is not None
    except ModuleNotFoundError:  # of a folder around it
        return False


def import_part(module: str, wanted_by: str = "") -> Any:
    """Import and return a module of a part of radarsim that may have been left out.

    Args:
        module: Name of the module.
        wanted_by: Begin of the message if it is not there.

    Raises:
        MissingPackage: If it is not there; it names the part that is missing.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        # Other packages say which extra they need.
        if not (error.name or "").startswith("radarsim."):
            raise
        raise MissingPackage(f"{wanted_by}{error.name} is not installed") from error


@functools.cache
def load(group: str, name: str) -> Any:
    """Import and return what an entry stands for.

    Raises:
        MissingPackage: If it is not there; it names the part that is missing.
    """
    own = OWN.get(group, {}).get(name)
    if not has(group, name):
        part = ".".join(own.split(".")[:3]) if own else f"{name!r} of {group!r}"
        raise MissingPackage(f"{part} is not installed")
    entry = _installed(group)[name] if own is None else EntryPoint(name, own, group)
    return entry.load()


@functools.cache
def _installed(group: str) -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=group)}
