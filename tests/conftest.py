"""Scenes that many tests look at; they are read once, and nothing changes them."""

import os
import signal

import pytest
from hypothesis import HealthCheck, settings

from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.simulation.simulation import Simulation

# Machines are shared and noisy: a slow example is not a wrong one.
settings.register_profile(
    "radarsim",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=os.environ.get("CI") == "true",
)
settings.load_profile("radarsim")

# In the background of a shell script interrupts are ignored, by whom we start as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _ready(name: str) -> Scene:
    scene = load_map(name)
    Simulation(scene)  # compiles the engine, if its cache is cold
    return scene


@pytest.fixture(scope="session")
def empty_room() -> Scene:
    return _ready("empty_room")


@pytest.fixture(scope="session")
def foliage_room() -> Scene:
    return _ready("foliage_room")


@pytest.fixture(scope="session")
def smoke_room() -> Scene:
    return _ready("smoke_room")
