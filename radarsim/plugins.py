"""Plugins: commands, sensors and servers that the core loads by name.

Each extension point of the core is a group of entries, and the core also runs without
them. Entries of this package are in ``OWN``; other packages add entry points with the
same group names.
"""

import functools
import importlib
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, Final

from radarsim.errors import MissingPackage

# These plugins are not entry points in pyproject.toml, since a source tree may have no
# installed metadata, and reading metadata can take 20 ms.
OWN: Final[dict[str, dict[str, str]]] = {
    # Tables of the commands that 'radarsim --help' lists, in the same order.
    "radarsim.commands": {
        "core": "radarsim.cli.entries:COMMANDS",
        "autonomy": "radarsim.autonomy.cli:COMMANDS",
        "addons": "radarsim.addons.entries:COMMANDS",
        "sweep": "radarsim.sweep:COMMANDS",
    },
    # Radar classes, by the section of sensor presets with the settings of the radar.
    "radarsim.sensors": {"fmcw": "radarsim.addons.fmcw.radar:FmcwRadar"},
    # Sensor classes by item type, which the files of robot classes refer to.
    "radarsim.kinds": {"core": "radarsim.sensors.sensor:kinds"},
    # Add-ons that read scanners of robots, such as FMCW radars, on their own schedule.
    "radarsim.items": {"fmcw": "radarsim.addons.fmcw.rotation_schedule:Antennas"},
    # Alternative outputs of 'radarsim explain'.
    "radarsim.explanations": {"budget": "radarsim.addons.fmcw.budget:print_budget"},
    # Additional functions of simulations in Python.
    "radarsim.local": {
        "evaluate": "radarsim.autonomy.evaluation.own_controllers:evaluate",
        "record": "radarsim.addons.recording.recording_process:record_host",
        "spectra": "radarsim.addons.fmcw.rotation_schedule:collect_turns",
    },
    # Recorders for runs of 'radarsim navigate' and 'radarsim map'.
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
    """Return the names of the available plugins of a group, sorted."""
    own = [each for each in OWN.get(group, {}) if has(group, each)]
    return sorted({*own, *_installed(group)})


@functools.cache
def has(group: str, name: str) -> bool:
    """Return whether a plugin is available, without importing its module."""
    own = OWN.get(group, {}).get(name)
    if own is None:
        return name in _installed(group)
    try:
        return find_spec(own.partition(":")[0]) is not None
    except ModuleNotFoundError:  # A parent package is missing.
        return False


def import_part(module: str, wanted_by: str = "") -> Any:
    """Import and return a module of radarsim that may not be installed.

    Args:
        module: Name of the module.
        wanted_by: Prefix of the error message.

    Raises:
        MissingPackage: If the part is missing; the message names it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        # Errors about missing other packages are not converted: modules that import
        # optional packages raise errors that name the extra.
        if not (error.name or "").startswith("radarsim."):
            raise
        raise MissingPackage(f"{wanted_by}{error.name} is not installed") from error


@functools.cache
def load(group: str, name: str) -> Any:
    """Import a plugin's module, and return the plugin: a class, function or table.

    Raises:
        MissingPackage: If the entry is not available; the message names its part.
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
