"""All browsers that are connected."""

from collections.abc import Iterator, Mapping
from typing import Any

from radarsim.commander.viewer import Viewer, encode_json


class Viewers(Mapping[str, Viewer]):
    """The browsers by their names, in the order in which they came."""

    def __init__(self) -> None:
        self._viewers: dict[str, Viewer] = {}
        self._joined = 0  # so far

    def __getitem__(self, name: str) -> Viewer:
        return self._viewers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._viewers)

    def __len__(self) -> int:
        return len(self._viewers)

    @property
    def looking(self) -> list[Viewer]:
        """Those whose page is on a screen."""
        return [viewer for viewer in self.values() if viewer.is_looking]

    def add(self) -> Viewer:
        """Add a browser, under a name that none has had."""
        self._joined += 1
        viewer = Viewer(f"viewer {self._joined}")
        self._viewers[viewer.name] = viewer
        return viewer

    def remove(self, viewer: Viewer) -> None:
        """Remove a browser that is gone."""
        del self._viewers[viewer.name]

    def broadcast(
        self, message: Mapping[str, Any] | str, subject: object = None
    ) -> None:
        """Send a message to all; arguments as in ``Viewer.send``."""
        text = message if isinstance(message, str) else encode_json(message)
        for viewer in self.values():
            viewer.send(text, subject)
