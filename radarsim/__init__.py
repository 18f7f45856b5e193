"""A USARSim server without Unreal, with a radar that sees through foliage and smoke.

>>> import radarsim
>>> scene = radarsim.load_map("empty_room")
>>> laser = radarsim.load_sensor("laser", fov_deg=2)
>>> laser.scan(scene, (0, 0, 0)).ranges.round(3).tolist()
[10.402, 10.4, 10.402]
"""

from __future__ import annotations

# ``typing`` is not imported, since the import would delay the handling of Ctrl-C.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from radarsim.addons.fmcw.image_files import load_turns
    from radarsim.addons.recording.recording import Recording, load_recording
    from radarsim.autonomy.evaluation.own_controllers import Evaluation as Evaluation
    from radarsim.autonomy.evaluation.own_controllers import evaluate
    from radarsim.errors import MapError, PresetError, RadarsimError
    from radarsim.geometry import Pose2, Pose3
    from radarsim.local import LocalRobot, LocalScan, LocalSimulation, simulate
    from radarsim.plotting.plan import plot_scene as plot_scene
    from radarsim.plotting.scans import as_svg as as_svg
    from radarsim.plotting.scans import compare
    from radarsim.plotting.scans import plot_scan as plot_scan
    from radarsim.raycast.rays import EventKind
    from radarsim.rng import generator_for
    from radarsim.scene.map_file import load_map, shipped_maps
    from radarsim.scene.material import Material
    from radarsim.scene.scene import Part, Scene, StartPose
    from radarsim.sensors.range_scanner import RangeScanner, load_sensor
    from radarsim.sensors.scan import Echoes, Scan, Target
    from radarsim.server.host import Host
    from radarsim.simulation.config import SimulationConfig

__version__ = "0.1.0"

# The modules of these names are imported on first use, so that commands start fast, and
# so that scenes and scans can call plotting functions of higher layers.
_NAMES = {
    "addons.fmcw.image_files": ("load_turns",),
    "addons.recording.recording": ("Recording", "load_recording"),
    "errors": ("MapError", "PresetError", "RadarsimError"),
    "geometry": ("Pose2", "Pose3"),
    "local": ("LocalRobot", "LocalScan", "LocalSimulation", "simulate"),
    "plotting.plan": ("plot_scene",),
    "plotting.scans": ("as_svg", "compare", "plot_scan"),
    "raycast.rays": ("EventKind",),
    "rng": ("generator_for",),
    "scene.map_file": ("load_map", "shipped_maps"),
    "scene.material": ("Material",),
    "scene.scene": ("Part", "Scene", "StartPose"),
    "sensors.range_scanner": ("RangeScanner", "load_sensor"),
    "sensors.scan": ("Echoes", "Scan", "Target"),
    "server.host": ("Host",),
    "simulation.config": ("SimulationConfig",),
}
_MODULES = {
    name: f"radarsim.{module}" for module, names in _NAMES.items() for name in names
}

# Public names from parts outside the core, with the plugin group that provides each.
_PLUGINS = {"evaluate": "radarsim.local"}

__all__ = [
    "Echoes",
    "EventKind",
    "Host",
    "LocalRobot",
    "LocalScan",
    "LocalSimulation",
    "MapError",
    "Material",
    "Part",
    "Pose2",
    "Pose3",
    "PresetError",
    "RadarsimError",
    "RangeScanner",
    "Recording",
    "Scan",
    "Scene",
    "SimulationConfig",
    "StartPose",
    "Target",
    "__version__",
    "compare",
    "evaluate",
    "generator_for",
    "load_map",
    "load_recording",
    "load_sensor",
    "load_turns",
    "shipped_maps",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES and name not in _PLUGINS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from radarsim import plugins  # noqa: PLC0415 - it imports further modules

    if name in _PLUGINS:
        return plugins.load(_PLUGINS[name], name)
    return getattr(plugins.import_part(_MODULES[name]), name)


def __dir__() -> list[str]:
    return __all__
