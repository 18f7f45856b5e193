"""Compile the engine when the package is built or installed."""

import runpy
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompileHook(BuildHookInterface):
    """Adds the engine to wheels, which then are for one platform."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the engine in the source tree."""
        build = Path(self.root, "radarsim", "engine", "build.py")
        runpy.run_path(str(build))["compile_engine"]()
        build_data["artifacts"].append("radarsim/engine/libradarsim.so")
        build_data["pure_python"] = False
        build_data["tag"] = "py3-none-manylinux_2_17_x86_64"
