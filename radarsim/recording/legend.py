"""The names of what echoes come from, by the numbers that stand for them in points."""

import json

from radarsim.recording.messages import RosMessage, string


class Legend:
    """Numbers names in the order in which they occur, from 0.

    Attributes:
        has_changed: Whether there are names that ``message`` has not told yet.
    """

    def __init__(self) -> None:
        self.has_changed = True
        self._names: dict[str, dict[str, int]] = {
            "kind": {},
            "object": {},
            "material": {},
        }

    def kind(self, name: str) -> int:
        """Return the number of a kind of echo."""
        return self._number("kind", name)

    def object(self, name: str) -> int:
        """Return the number of an object."""
        return self._number("object", name)

    def material(self, name: str) -> int:
        """Return the number of a material."""
        return self._number("material", name)

    def message(self) -> RosMessage:
        """Return all names as JSON: a list for each of the fields of points."""
        self.has_changed = False
        return string(
            json.dumps({key: list(each) for key, each in self._names.items()})
        )

    def _number(self, field: str, name: str) -> int:
        names = self._names[field]
        if name not in names:
            if len(names) > _LARGEST:
                return _LARGEST
            names[name] = len(names)
            self.has_changed = True
        return names[name]


_LARGEST = 65535  # of 16 bits; it stands for all names after the first 65535
