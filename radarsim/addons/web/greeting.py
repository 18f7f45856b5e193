"""The first message to a page: what the server and the program have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from radarsim import __version__
from radarsim.addons.web.offers import make_offers

if TYPE_CHECKING:
    from radarsim.addons.web.scene_message import SceneMessages
    from radarsim.addons.web.server_link import ServerState
    from radarsim.addons.web.viewer import Viewer
    from radarsim.simulation.config import SimulationConfig


def make_greeting(
    viewer: Viewer,
    state: ServerState,
    config: SimulationConfig,
    scene: SceneMessages | None,
) -> dict[str, Any]:
    """Return the message ``hello``.

    Args:
        viewer: The browser that it is for.
        state: What is known of the server.
        config: How the server was started, as far as it is known.
        scene: The map; None if it is not known.
    """
    starts = [
        {"name": name, "x": pose.x, "y": pose.y, "yaw": pose.yaw}
        for name, pose in state.starts.items()
    ]
    return {
        "op": "hello",
        "viewer": viewer.name,
        "version": __version__,
        "level": state.level,
        "dialect": config.dialect.name,
        "watch": state.watches,
        "map": scene is not None,
        "starts": starts,
        "materials": [] if scene is None else scene.materials,
        **make_offers(config),
    }
