"""Whatever a survey needs compiled is so before it begins."""

import importlib
import pkgutil
from typing import Any

import radarsim.mapping
from radarsim.client import Client
from radarsim.exploration.exploration import Exploration, ExplorationPlan, warm_up
from radarsim.host import Host
from radarsim.host.lockstep import InProcessTransport
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene


def versions() -> dict[str, int]:
    """Count for how many types of arguments each function is compiled."""
    found: dict[str, int] = {}
    for module in pkgutil.iter_modules(radarsim.mapping.__path__):
        full = f"radarsim.mapping.{module.name}"
        members: dict[str, Any] = vars(importlib.import_module(full))
        for name, member in members.items():
            if hasattr(member, "nopython_signatures"):
                found[f"{full}.{name}"] = len(member.nopython_signatures)
    return found


def test_a_survey_compiles_nothing_more(foliage_room: Scene) -> None:
    warm_up()
    before = versions()
    assert before["radarsim.mapping.inverse_sensor_model.cross"] == 1
    for wish in (
        ExplorationPlan(time_limit=8.0),
        ExplorationPlan(motion_source="none", time_limit=2.0),
    ):
        with Client(InProcessTransport(Host(foliage_room))) as client:
            Exploration(wish, generator_for(0, "exploring")).run(client)
    assert versions() == before
